"""Tours: a robot finds its own way through a grid map."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from mapcli import GridMap, MotionLimits, plan_drive, plan_tour
from mapcli.algorithms.simulation.simulate import check_clearance
from mapcli.errors import DataError

RIGHT_ANGLED = MotionLimits(corner_cut=0.0)


def drawn(*rows: str, resolution: float = 1.0) -> GridMap:
    """`#` solid, `?` unknown, `.` open."""
    values = {"#": 1.0, "?": np.nan, ".": 0.0}
    cells = np.array([[values[mark] for mark in row] for row in rows], dtype=np.float32)
    return GridMap(cells, resolution)


def scaled(grid: GridMap, factor: int) -> GridMap:
    """The same world in finer cells."""
    return GridMap(np.kron(grid.cells, np.ones((factor, factor))), grid.resolution / factor)


ROOMS = scaled(
    drawn(
        "##########",
        "#...#....#",
        "#...#....#",
        "#.......##",
        "#...#..###",
        "#####.####",
        "#????....#",
        "##########",
    ),
    20,
)  # 10 m x 8 m in cells of 5 cm


def test_coarse_cells_leave_room() -> None:
    """A corridor of one cell, a metre wide, has room for a robot of 0.8 m, none for one of 1 m."""
    corridor = drawn("######", "#....#", "######")
    ways = plan_tour(corridor, 1, 0.4, RIGHT_ANGLED)
    assert ways[0] == ways[-1]
    assert len(ways) == 3
    check_clearance(corridor, plan_drive(ways, RIGHT_ANGLED), 0.4)
    assert [way.y for way in ways] == pytest.approx([1.5, 1.5, 1.5], abs=0.1)
    with pytest.raises(DataError, match="has no three cells"):
        plan_tour(corridor, 1, 0.5, RIGHT_ANGLED)


@pytest.mark.parametrize("seed", range(12))
def test_tours_keep_their_distance(seed: int) -> None:
    """The simulator itself checks every pose, on the arcs that round the corners too."""
    limits = MotionLimits(corner_cut=0.2)
    ways = plan_tour(ROOMS, 6, 0.15, limits, seed)
    solid = ROOMS.replaced(np.nan_to_num(ROOMS.cells, nan=1.0))
    check_clearance(solid, plan_drive(ways, limits), 0.15)
    assert ways[0] == ways[-1]
    assert len(ways) >= 8
    assert ways == plan_tour(ROOMS, 6, 0.15, limits, seed)
    assert ways != plan_tour(ROOMS, 6, 0.15, limits, seed + 1)


def test_ways_are_straight_where_they_can_be() -> None:
    """In an empty hall every waypoint is a place of the tour, and every way straight."""
    hall = GridMap(np.zeros((60, 80), dtype=np.float32), 0.1)
    assert len(plan_tour(hall, 9, 0.3, seed=3)) == 11


def test_the_shortest_way_is_taken() -> None:
    """From one room into the other the robot bends round both corners of the door, no more."""
    lengths = []
    for seed in range(8):
        ways = plan_tour(ROOMS, 1, 0.15, RIGHT_ANGLED, seed)
        length = sum(math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(ways))
        direct = math.dist((ways[0].x, ways[0].y), (ways[len(ways) // 2].x, ways[len(ways) // 2].y))
        lengths.append((length / 2, direct))
        assert length / 2 >= direct - 1e-9
    assert max(length for length, _ in lengths) < 12  # the way through both doors is 10 m long


@pytest.mark.parametrize(
    ("grid", "places", "message"),
    [
        (ROOMS, 0, "a tour of 0 places; expected 1 or more"),
        (
            drawn("###", "#.#", "###", resolution=0.6),
            3,
            "has no three cells from which everything is 0.34 m away",
        ),
        (drawn("???", "???"), 3, "has no three cells"),
    ],
)
def test_no_tour(grid: GridMap, places: int, message: str) -> None:
    with pytest.raises(DataError, match=message):
        plan_tour(grid, places, 0.15)
