"""The local map: when it is written to, and what it forgets."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.local_map import LocalMap, LocalMapParameters
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.model.pose import Pose2D

CELL = 0.25
MAP = MapParameters(resolution=CELL)


def seen(count: int = 8) -> Perception:
    """A short wall, half a metre to the left."""
    hits = np.column_stack([np.linspace(-0.2, 0.2, count), np.full(count, 0.6)])
    return Perception(hits, np.empty((0, 2)), np.zeros(2))


def new(**parameters: object) -> LocalMap:
    return LocalMap(OccupancyGrid(MAP), LocalMapParameters(**parameters))  # type: ignore


def remembered(local_map: LocalMap, now: float) -> float:
    """Metres behind a robot that drives along x of which the map knows something."""
    grid = local_map.grid.to_grid_map()
    columns = np.flatnonzero(grid.known.any(axis=0))
    return now - (grid.origin.x + columns[0] * CELL)


FORGETFUL = {"update_m": 1.0, "max_length_m": 10.0, "min_length_m": 3.0, "min_updates": 2}
REACH = 0.2 + CELL
"""Metres that one scan shows behind the robot, and a cell."""


def test_it_forgets_but_never_too_much() -> None:
    local_map = new(**FORGETFUL)
    memory = []
    for metres in range(40):
        assert local_map.update(Pose2D(metres), seen())
        memory.append(remembered(local_map, metres))
    assert max(memory) <= 10 + REACH
    assert memory[:10] == pytest.approx(range(10), abs=REACH)  # nothing is forgotten before
    assert min(memory[3:]) >= 3
    # Each time it has 10 m it goes back to the last 3: at 10, 17, 24, 31 and 38 m.
    drops = [k for k in range(1, 40) if memory[k] < memory[k - 1]]
    assert drops == [10, 17, 24, 31, 38]


def test_it_has_some_updates_at_least() -> None:
    local_map = new(**{**FORGETFUL, "min_length_m": 1.0, "min_updates": 5})
    for metres in range(40):
        local_map.update(Pose2D(metres), seen())
        # Of five updates in a row the first is four metres back.
        assert metres < 4 or remembered(local_map, metres) >= 4


def test_turning_on_the_spot_forgets_nothing() -> None:
    local_map = new(**FORGETFUL)
    for metres in range(9):
        local_map.update(Pose2D(metres), seen())
    for quarter in range(1, 50):
        assert local_map.update(Pose2D(8, 0, quarter * math.pi / 2), seen())
    assert remembered(local_map, 8) >= 8


def test_none_never_forgets() -> None:
    local_map = new(update_m=1.0, max_length_m=None)
    for metres in range(60):
        local_map.update(Pose2D(metres), seen())
    assert remembered(local_map, 59) == pytest.approx(59, abs=REACH)


def test_what_is_forgotten_leaves_the_rest_as_if_it_had_begun_there() -> None:
    local_map, late = new(**FORGETFUL), OccupancyGrid(MAP)
    for metres in range(13):
        local_map.update(Pose2D(metres), seen())
        if metres >= 7:
            late.integrate(Pose2D(metres), seen())
    found, expected = local_map.grid.to_grid_map(), late.to_grid_map()
    assert found.origin == expected.origin
    assert np.array_equal(found.cells, expected.cells, equal_nan=True)


def test_frozen_never_changes() -> None:
    grid = OccupancyGrid(MAP)
    grid.integrate(Pose2D(), seen())
    before = grid.log_odds.copy()
    local_map = LocalMap(grid, LocalMapParameters(frozen=True))
    for metres in range(40):
        assert not local_map.update(Pose2D(metres), seen())
    assert local_map.grid is grid
    assert np.array_equal(grid.log_odds, before)


@pytest.mark.parametrize(
    ("moved", "updated"),
    [
        (Pose2D(), False),
        (Pose2D(0.29), False),
        (Pose2D(-0.31), True),
        (Pose2D(0.2, 0.2), False),
        (Pose2D(0.22, -0.22), True),
        (Pose2D(0, 0, math.radians(16)), False),
        (Pose2D(0, 0, math.radians(18)), True),
        (Pose2D(0, 0, math.radians(-18)), True),
    ],
)
def test_update_distances(moved: Pose2D, updated: bool) -> None:
    local_map = new(update_m=0.3, update_deg=17.0)
    start = Pose2D(3, 4, 3.1)  # turning left from here goes past pi
    assert local_map.update(start, seen())
    before = local_map.grid.log_odds.copy()
    assert local_map.update(start.compose(moved), seen()) == updated
    assert np.array_equal(local_map.grid.log_odds, before) != updated


def test_small_steps_add_up() -> None:
    local_map = new(update_m=0.3)
    updates = [local_map.update(Pose2D(0.1001 * k), seen()) for k in range(10)]
    assert updates == [True, False, False] * 3 + [True]


def test_a_scan_of_few_points_does_not_begin_a_map() -> None:
    local_map = new(update_m=0.3)
    assert not local_map.update(Pose2D(), seen(4))
    assert not local_map.update(Pose2D(), seen(0))
    assert local_map.update(Pose2D(0.1), seen(5))  # without driving 0.3 m
    assert not local_map.update(Pose2D(0.2), seen())


def test_the_next_map_has_room_for_as_much_as_the_one_before() -> None:
    local_map = new(**FORGETFUL)
    far = np.array([[-40.0, 1.0], [38.0, 1.0], [0.0, 20.0]])
    local_map.grid.integrate(Pose2D(), Perception(far, np.empty((0, 2)), np.zeros(2)))
    assert local_map.grid.reach == pytest.approx(39.0, abs=0.2)
    local_map.begin_anew(Pose2D(100.0, -50.0))
    shape = local_map.grid.log_odds.shape
    local_map.grid.integrate(
        Pose2D(100.0, -50.0), Perception(0.9 * far, np.empty((0, 2)), np.zeros(2))
    )
    assert local_map.grid.log_odds.shape == shape
