"""A map ends where the robot has really seen, not where single beams got to."""

from __future__ import annotations

import numpy as np
import pytest

from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D
from mapcli.model.seen_part import MARGIN, seen_part

ROOM = np.s_[200:260, 300:380]
"""3 m by 4 m of a map of 20 m by 30 m."""


def a_room(resolution: float = 0.05) -> GridMap:
    cells = np.full((400, 600), np.nan, np.float32)
    cells[ROOM] = 0.1
    cells[230, 380:590] = 0.1  # a ray through a window
    cells[230, 590] = 0.9
    cells[260:400:7, 340] = 0.1
    return GridMap(cells, resolution, Pose2D(-15.0, -10.0, 0.0))


def test_rays_beyond_the_room_are_left_out() -> None:
    grid = a_room()
    seen = seen_part(grid, np.zeros((0, 2)))
    assert (seen.rows, seen.columns) == pytest.approx((60 + 2 * MARGIN, 80 + 2 * MARGIN), abs=10)
    room = grid.part(200, 300, 260, 380)
    there = seen.cells[
        round((seen.rows * 0.05 + seen.origin.y - (room.rows * 0.05 + room.origin.y)) / 0.05) :,
        round((room.origin.x - seen.origin.x) / 0.05) :,
    ][:60, :80]
    np.testing.assert_array_equal(there, room.cells)


def test_the_path_is_in_the_map_as_far_as_it_was() -> None:
    grid = a_room()
    far, beyond = (12.0, 1.5), (100.0, 0.0)
    seen = seen_part(grid, np.array([far, beyond]))
    row, column = seen.fractional_cells_of_world(np.array([far]))[0]
    assert seen.contains(round(row), round(column))
    assert seen.columns < grid.columns


def test_where_all_is_sparse_all_is_kept() -> None:
    cells = np.full((100, 100), np.nan, np.float32)
    cells[10:90:10, 10:90:10] = 0.9
    seen = seen_part(GridMap(cells, 0.05), np.zeros((0, 2)))
    assert np.count_nonzero(seen.known) == 64


def test_nothing_known_is_left_as_it_is() -> None:
    grid = GridMap(np.full((3, 4), np.nan, np.float32), 0.05)
    assert seen_part(grid, np.zeros((1, 2))) is grid
