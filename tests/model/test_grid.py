"""The axes of a grid map: every formula at the head of `model/grid.py`, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.errors import DataError
from mapcli.model.grid import UNKNOWN, GridMap, crop_to_known
from mapcli.model.pose import Pose2D

FEW = settings(max_examples=40)
SLOPE = math.atan2(3, 4)
"""An angle whose cosine is 0.8 and whose sine is 0.6."""


def grid_of(rows: int, columns: int, resolution: float = 0.5, origin: Pose2D | None = None):
    return GridMap(np.zeros((rows, columns), np.float32), resolution, origin or Pose2D(10, 20, 0))


grids = st.builds(
    grid_of,
    st.integers(1, 9),
    st.integers(1, 9),
    st.floats(0.01, 10),
    st.builds(Pose2D, st.floats(-50, 50), st.floats(-50, 50), st.floats(-4, 4)),
)


# --- where cells are


def test_cell_centres_by_hand() -> None:
    grid = grid_of(3, 4)
    # The bottom left cell is row 2, column 0: half a cell (0.25 m) from the origin.
    centres = grid.world_of_cells([2, 0, 0, 2], [0, 0, 3, 3])
    assert centres.tolist() == [[10.25, 20.25], [10.25, 21.25], [11.75, 21.25], [11.75, 20.25]]


def test_cell_centres_of_a_map_turned_by_a_quarter() -> None:
    # Columns now run along +y, rows upward run along -x.
    grid = grid_of(3, 4, origin=Pose2D(10, 20, math.pi / 2))
    centres = grid.world_of_cells([2, 0, 2], [0, 0, 3])
    assert centres == pytest.approx(np.array([[9.75, 20.25], [8.75, 20.25], [9.75, 21.75]]))


def test_cell_centres_of_a_map_turned_aslant() -> None:
    # Cell (0, 0) lies at (0.25, 1.25) before turning: (0.2 - 0.75, 0.15 + 1.0) after.
    grid = grid_of(3, 4, origin=Pose2D(10, 20, SLOPE))
    assert grid.world_of_cells([0], [0]) == pytest.approx(np.array([[9.45, 21.15]]))


def test_fractional_cells_are_edges() -> None:
    grid = grid_of(3, 4)
    assert grid.world_of_cells([-0.5, 2.5], [-0.5, 3.5]).tolist() == [[10, 21.5], [12, 20]]
    cells = grid.fractional_cells_of_world([[10, 21.5], [12, 20], [10.25, 21.25]])
    assert cells.tolist() == [[-0.5, -0.5], [2.5, 3.5], [0, 0]]


def test_cells_of_points_by_hand() -> None:
    grid = grid_of(3, 4)
    points = [
        [10.0, 20.0],  # the origin's corner belongs to the bottom left cell
        [10.49, 20.49],  # so does all up to its far corner
        [10.5, 20.0],  # an edge belongs to the cell right of it
        [10.0, 20.5],  # or above it
        [9.99, 19.99],  # outside, left and below
        [12.0, 21.5],  # outside, right and above
    ]
    cells = grid.cells_of_world(points)
    assert cells.tolist() == [[2, 0], [2, 0], [2, 1], [1, 0], [3, -1], [-1, 4]]
    assert cells.dtype == np.int64


def test_cells_of_points_of_a_map_turned_aslant() -> None:
    grid = grid_of(3, 4, origin=Pose2D(10, 20, SLOPE))
    assert grid.cells_of_world([[9.45, 21.15]]).tolist() == [[0, 0]]
    # 1.75 m along the turned x axis: column 3 of the bottom row, a little above its lower edge.
    along = [10 + 1.75 * 0.8 - 0.1 * 0.6, 20 + 1.75 * 0.6 + 0.1 * 0.8]
    assert grid.cells_of_world([along]).tolist() == [[2, 3]]


def test_no_points_no_cells() -> None:
    assert grid_of(3, 4).world_of_cells([], []).shape == (0, 2)
    assert grid_of(3, 4).cells_of_world([]).shape == (0, 2)
    assert grid_of(3, 4).fractional_cells_of_world([]).shape == (0, 2)


@FEW
@given(grids)
def test_every_cell_finds_itself_again(grid: GridMap) -> None:
    rows, columns = np.indices(grid.cells.shape).reshape(2, -1)
    there = grid.world_of_cells(rows, columns)
    back = grid.cells_of_world(there)
    assert (back == np.column_stack([rows, columns])).all()
    assert grid.fractional_cells_of_world(there) == pytest.approx(back, abs=1e-6)


@FEW
@given(grids)
def test_the_formula_at_the_head_of_the_module(grid: GridMap) -> None:
    n, s = grid.rows, grid.resolution
    cos, sin = math.cos(grid.origin.theta), math.sin(grid.origin.theta)
    for row in range(n):
        for column in range(grid.columns):
            u, v = s * (column + 0.5), s * (n - row - 0.5)
            x, y = cos * u - sin * v + grid.origin.x, sin * u + cos * v + grid.origin.y
            assert grid.world_of_cells([row], [column])[0] == pytest.approx([x, y])


def test_from_bottom_up() -> None:
    # [v, u]: the first row is the lowest.
    cells = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]], np.float32)
    grid = GridMap.from_bottom_up(cells, 2.0, (-4.0, 6.0))
    assert grid.cells.tolist() == [cells[1].tolist(), cells[0].tolist()]
    assert grid.origin == Pose2D(-4, 6, 0)
    for v in range(2):
        for u in range(3):
            row, column = grid.cells_of_world([[-4 + 2 * (u + 0.5), 6 + 2 * (v + 0.5)]])[0]
            assert grid.cells[row, column] == cells[v, u]


# --- cropping


def with_known(rows: int, columns: int, known: dict[tuple[int, int], float], yaw: float = 0.0):
    cells = np.full((rows, columns), UNKNOWN)
    for cell, value in known.items():
        cells[cell] = value
    return GridMap(cells, 0.5, Pose2D(10, 20, yaw))


def test_crop_by_hand() -> None:
    grid = with_known(6, 8, {(1, 2): 0.25, (3, 5): 0.75})
    cropped = crop_to_known(grid)
    assert cropped.cells.shape == (3, 4)
    assert (cropped.cells[0, 0], cropped.cells[2, 3]) == (0.25, 0.75)
    assert np.isnan(cropped.cells).sum() == 10
    # Two columns go on the left, and rows 4 and 5 below.
    assert cropped.origin == Pose2D(11, 21, 0)


def test_crop_leaves_a_margin_where_there_is_room() -> None:
    cropped = crop_to_known(with_known(6, 8, {(1, 2): 0.25, (3, 5): 0.75}), margin=2)
    assert cropped.cells.shape == (6, 8)  # rows 0 to 5: one less above than asked for
    assert cropped.origin == Pose2D(10, 20, 0)
    cropped = crop_to_known(with_known(9, 9, {(4, 4): 0.5}), margin=1)
    assert cropped.cells.shape == (3, 3)
    assert cropped.origin == Pose2D(11.5, 21.5, 0)


def test_crop_of_a_turned_map_by_hand() -> None:
    grid = with_known(6, 8, {(1, 2): 0.25, (3, 5): 0.75}, yaw=SLOPE)
    # 1 m along and 1 m across the turned axes: (0.8 - 0.6, 0.6 + 0.8).
    cropped = crop_to_known(grid)
    assert (cropped.origin.x, cropped.origin.y) == pytest.approx((10.2, 21.4))
    assert cropped.origin.theta == SLOPE


@FEW
@given(st.integers(0, 2**32 - 1), st.integers(0, 3), st.floats(-math.pi, math.pi))
def test_crop_keeps_every_cell_where_it_is(seed: int, margin: int, yaw: float) -> None:
    rng = np.random.default_rng(seed)
    places = [tuple(rng.integers(0, (7, 9))) for _ in range(rng.integers(1, 5))]
    grid = with_known(7, 9, {place: rng.random() for place in places}, yaw)
    cropped = crop_to_known(grid, margin)
    assert cropped.known.sum() == grid.known.sum()
    rows, columns = np.nonzero(grid.known)
    moved = cropped.cells_of_world(grid.world_of_cells(rows, columns))
    assert (cropped.cells[tuple(moved.T)] == grid.cells[rows, columns]).all()


def test_a_map_without_known_cells_stays() -> None:
    grid = with_known(3, 4, {})
    assert crop_to_known(grid, 1) is grid


# --- records


def test_what_is_known() -> None:
    grid = with_known(2, 3, {(0, 1): 0.0, (1, 2): 1.0})
    assert grid.known.tolist() == [[False, True, False], [False, False, True]]
    assert (grid.rows, grid.columns) == (2, 3)
    assert grid.contains(1, 2)
    assert not any(grid.contains(*cell) for cell in [(-1, 0), (0, -1), (2, 0), (0, 3)])


def test_replaced_cells_stay_in_place() -> None:
    grid = with_known(2, 3, {}, yaw=1.0)
    other = grid.replaced(np.ones((2, 3), np.float32))
    assert (other.resolution, other.origin) == (0.5, Pose2D(10, 20, 1.0))
    assert other.cells.tolist() == [[1, 1, 1], [1, 1, 1]]
    assert not grid.known.any()


@pytest.mark.parametrize(
    ("cells", "resolution", "origin", "message"),
    [
        ([0.5, 0.5], 1.0, Pose2D(), r"shape \(2,\)"),
        (np.zeros((0, 3)), 1.0, Pose2D(), r"shape \(0, 3\)"),
        ([[0.5, 1.5]], 1.0, Pose2D(), "holds 1.5"),
        ([[-0.25, math.nan]], 1.0, Pose2D(), "holds -0.25"),
        ([[0.5]], 0.0, Pose2D(), "resolution 0"),
        ([[0.5]], math.nan, Pose2D(), "resolution nan"),
        ([[0.5]], math.inf, Pose2D(), "resolution inf"),
        ([[0.5]], 1.0, Pose2D(0, math.inf, 0), "origin"),
    ],
)
def test_malformed_maps(cells, resolution: float, origin: Pose2D, message: str) -> None:
    with pytest.raises(DataError, match=message):
        GridMap(np.array(cells, np.float32), resolution, origin)
