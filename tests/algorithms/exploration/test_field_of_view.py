"""What a robot sees: hand-worked, and against rays followed one at a time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.exploring import grid_of, worlds
from support.literal_frontier import look_by_rays

from mapcli.algorithms.exploration.exploration_parameters import ExplorationParameters
from mapcli.algorithms.exploration.exploration_state import OPEN, UNKNOWN
from mapcli.algorithms.exploration.field_of_view import (
    THROUGH_OPEN,
    THROUGH_UNKNOWN,
    cells_in_range,
    expected_gain,
    make_field_of_view,
    visible_cells,
)
from mapcli.algorithms.exploration.goal_selection import make_chooser
from mapcli.algorithms.exploration.initialisation import register_known_map
from mapcli.algorithms.exploration.loop_arrays import cells_of, make_state
from mapcli.algorithms.exploration.visibility import shows_unknown
from mapcli.model.grid import GridMap

Cell = tuple[int, int]


def seen_from(world: GridMap, cell: Cell, sensor_range: int, passed: int) -> list[Cell]:
    state = make_state(world, world, ExplorationParameters(sensor_range=sensor_range))
    fov = make_field_of_view(state, sensor_range)
    index = (cell[0] + 1) * state.stride + cell[1] + 1
    kinds = state.world if passed == THROUGH_OPEN else state.known
    count = visible_cells(state, fov, kinds, passed, index)
    cells = cells_of(state, np.array([fov.seen[k] for k in range(count)])).tolist()
    return [(row, column) for row, column in cells]


def picture(world: GridMap, cell: Cell, sensor_range: int) -> list[str]:
    """The world with blanks where the robot sees nothing."""
    seen = seen_from(world, cell, sensor_range, THROUGH_OPEN)
    letters = np.where(np.isnan(world.cells), "?", np.where(world.cells < 0.5, ".", "#"))
    for place in np.ndindex(letters.shape):
        if place not in seen:
            letters[place] = " "
    letters[cell] = "R"
    return ["".join(row) for row in letters]


def test_the_eight_neighbours_whatever_is_in_between() -> None:
    world = grid_of("....", "#?..", ".#..", "....")
    assert picture(world, (2, 0), 1) == ["    ", "#?  ", "R#  ", "..  "]


def test_nothing_is_seen_through_obstacles() -> None:
    world = grid_of(".......", ".......", "..###..", ".......", ".......")
    assert picture(world, (4, 3), 9) == [
        "       ",
        ".     .",
        "..###..",
        ".......",
        "...R...",
    ]


def test_an_unknown_cell_of_the_world_hides_what_is_behind_it() -> None:
    assert picture(grid_of("..?.."), (0, 0), 9) == ["R.?  "]


def test_nothing_is_seen_between_obstacles_that_touch_at_a_corner() -> None:
    world = grid_of("....", "..#.", ".#..", "....")
    assert picture(world, (3, 3), 9) == ["  ..", "  #.", ".#..", "...R"]


def test_the_range_is_a_disc() -> None:
    hall = GridMap(np.full((7, 7), 0.1, dtype=np.float32))
    assert picture(hall, (3, 3), 3) == [
        "   .   ",
        " ..... ",
        " ..... ",
        "...R...",
        " ..... ",
        " ..... ",
        "   .   ",
    ]


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(world=worlds(largest=9), sensor_range=st.integers(2, 12), data=st.data())
def test_every_cell_that_a_ray_gets_to(
    world: np.ndarray, sensor_range: int, data: st.DataObject
) -> None:
    cell = data.draw(st.sampled_from(list(np.ndindex(world.shape))))
    for passed, codes in ((THROUGH_OPEN, {OPEN}), (THROUGH_UNKNOWN, {OPEN, UNKNOWN})):

        def passes(c: Cell, codes: set[int] = codes) -> bool:
            unknown = bool(np.isnan(world[c]))
            return (UNKNOWN if unknown else OPEN) in codes and (unknown or world[c] < 0.5)

        seen = seen_from(GridMap(world), cell, sensor_range, passed)
        assert len(seen) == len(set(seen))
        assert set(seen) == look_by_rays(cell, sensor_range, world.shape, passes)


@pytest.mark.parametrize(("sensor_range", "cells"), [(1, 8), (2, 12), (3, 28), (5, 80)])
def test_most_that_can_be_expected(sensor_range: int, cells: int) -> None:
    """A goal is worth no more than the range allows: this stops the search for a better one."""
    hall = GridMap(np.full((13, 13), np.nan, dtype=np.float32))
    hall.cells[6, 6] = 0.1
    state = make_state(hall, hall, ExplorationParameters(sensor_range=sensor_range))
    fov = make_field_of_view(state, sensor_range)
    assert cells_in_range(fov) == cells
    assert expected_gain(state, fov, 7 * state.stride + 7) == cells
    assert make_chooser("gain", state, fov).max_utility == cells


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(world=worlds(largest=9), sensor_range=st.integers(1, 12))
def test_a_glimpse_shows_what_a_look_shows(world: np.ndarray, sensor_range: int) -> None:
    state = make_state(GridMap(world), GridMap(world), ExplorationParameters())
    register_known_map(state)
    fov = make_field_of_view(state, sensor_range)
    for row, column in np.argwhere(world < np.float32(0.5)).tolist():
        cell = (row + 1) * state.stride + column + 1
        glimpsed = shows_unknown(state, fov, cell)
        count = visible_cells(state, fov, state.known, THROUGH_OPEN, cell)
        assert glimpsed == any(state.known[fov.seen[k]] == UNKNOWN for k in range(count))
