"""Map algebra: what every operation does to cells, to the world, and to a trace."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mapcli.algorithms.maps.compare import compare
from mapcli.algorithms.maps.registration import merge_maps, register
from mapcli.algorithms.maps.transform import (
    CellFrame,
    align_walls,
    bake_yaw,
    crop_to_box,
    flip,
    joint_frame,
    merge,
    move,
    resample,
    rotate,
    sampled,
    set_origin,
    shift,
)
from mapcli.algorithms.maps.wall_direction import wall_direction
from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.isometry import Isometry
from mapcli.model.pose import Pose2D

Q = np.nan
L_SHAPE = np.array([[1, Q, 0.5], [1, 0, 0.25]], dtype=np.float32)
"""Two rows, three columns; no turn or mirror of it looks like another."""

PERCENTS = hnp.arrays(
    np.uint8, hnp.array_shapes(min_dims=2, max_dims=2, max_side=7),
    elements=st.sampled_from([0, 1, 50, 100, 255]),
)  # fmt: skip
PLACES = st.builds(Pose2D, st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3))
MAPS = st.builds(
    lambda cells, real, *place: GridMap(GridMap(cells).cells if real else cells, *place),
    PERCENTS, st.booleans(), st.sampled_from([0.05, 0.1, 1.0]), PLACES,
)  # fmt: skip
QUARTERS = st.sampled_from([-270, -180, -90, 0, 90, 180, 270, 360])


def test_align_walls_says_by_how_much_they_were_turned() -> None:
    turned, _ = rotate(room(), math.radians(20))
    aligned = align_walls(turned)
    assert math.degrees(aligned.walls) == pytest.approx(20, abs=0.2)
    assert aligned.grid.origin.theta == 0
    assert wall_direction(aligned.grid) == pytest.approx(0, abs=math.radians(0.2))
    assert aligned.motion.pose.theta == -aligned.walls


@pytest.mark.slow
def test_merging_by_a_given_motion_and_by_a_search() -> None:
    grid = room()
    motion = Pose2D(0.5, -0.25)
    other, _ = move(grid, motion.inverse())
    given = merge_maps(grid, other, motion)
    assert given.registration.score == 1
    assert given.registration.is_reliable
    found = merge_maps(grid, other)
    assert found.registration.motion.distance(motion) < 0.02
    assert found.grid.cells.shape == given.grid.cells.shape
    assert not merge_maps(grid, other, Pose2D(1, 1, 0.7)).registration.is_reliable


def centres(grid: GridMap) -> np.ndarray:
    rows, columns = np.indices((grid.rows, grid.columns)).reshape(2, -1)
    return grid.world_of_cells(rows, columns)


def looked_up(grid: GridMap, points: np.ndarray) -> np.ndarray:
    """The cells at world points; those outside are -1."""
    rows, columns = grid.cells_of_world(points).T
    inside = (rows >= 0) & (columns >= 0) & (rows < grid.rows) & (columns < grid.columns)
    found = np.full(len(points), -1, dtype=np.float32)
    found[inside] = grid.cells[rows[inside], columns[inside]]
    return found


def assert_moved(before: GridMap, after: GridMap, motion: Isometry) -> None:
    """Every cell of the one is where the motion takes it in the other, and there are no more."""
    found = looked_up(after, motion.apply(centres(before)))
    assert np.array_equal(found, before.cells.ravel(), equal_nan=True)
    assert after.stored.size == before.stored.size
    assert after.stored.dtype == before.stored.dtype


def test_quarter_turn_literally() -> None:
    """The bottom row 1, 0, 0.25 stands upright, left of the world's y axis."""
    turned, motion = rotate(GridMap(L_SHAPE, 0.5, Pose2D(1, 0, 0)), math.pi / 2)
    assert np.array_equal(turned.cells, [[0.5, 0.25], [Q, 0], [1, 1]], equal_nan=True)
    assert turned.origin == Pose2D(-1, 1, 0)
    assert motion.apply(np.array([[1.0, 0.0]])) == pytest.approx(np.array([[0, 1]]))


def test_flips_literally() -> None:
    grid = GridMap(L_SHAPE, 0.5, Pose2D(1, 0, 0))
    mirrored, motion = flip(grid, "left-right")
    assert np.array_equal(mirrored.cells, L_SHAPE[:, ::-1], equal_nan=True)
    assert mirrored.origin == Pose2D(-2.5, 0, 0)
    assert motion.apply_pose(Pose2D(1, 2, 0.3)).theta == pytest.approx(math.pi - 0.3)
    mirrored, motion = flip(grid, "up-down")
    assert np.array_equal(mirrored.cells, L_SHAPE[::-1], equal_nan=True)
    assert mirrored.origin == Pose2D(1, -1, 0)
    assert motion.apply_pose(Pose2D(1, 2, 0.3)) == Pose2D(1, -2, pytest.approx(-0.3))


@given(grid=MAPS, degrees=QUARTERS, side=st.sampled_from(["left-right", "up-down"]))
@settings(max_examples=60)
def test_motions_take_every_cell_along(grid: GridMap, degrees: float, side: Any) -> None:
    assert_moved(grid, *rotate(grid, math.radians(degrees)))
    assert_moved(grid, *flip(grid, side))
    assert_moved(grid, *shift(grid, 1.25, -3.5))
    moved, motion = set_origin(grid, Pose2D(1, 2, 0.7))
    assert moved.origin == Pose2D(1, 2, 0.7)
    assert_moved(grid, moved, motion)
    twice, second = flip(moved, side)
    assert_moved(grid, twice, second.after(motion))


@given(grid=MAPS, quarters=st.integers(-2, 2))
def test_baking_quarter_turns_is_exact(grid: GridMap, quarters: int) -> None:
    origin = Pose2D(grid.origin.x, grid.origin.y, quarters * math.pi / 2)
    upright = bake_yaw(GridMap(grid.stored, grid.resolution, origin))
    assert upright.origin.theta == 0
    assert_moved(GridMap(grid.stored, grid.resolution, origin), upright, Isometry())


@given(grid=MAPS)
def test_baking_any_yaw_looks_cells_up_at_their_centres(grid: GridMap) -> None:
    upright = bake_yaw(grid)
    assert upright.origin.theta == 0
    found = looked_up(grid, centres(upright) + 1e-12)
    outside = found == -1
    cells = upright.cells.ravel()
    near_edge = np.abs(grid.fractional_cells_of_world(centres(upright)) % 1 - 0.5) < 1e-6
    safe = ~near_edge.any(axis=1)
    assert np.array_equal(cells[safe & ~outside], found[safe & ~outside], equal_nan=True)
    assert np.isnan(cells[safe & outside]).all()
    box = centres(upright).min(axis=0), centres(upright).max(axis=0)
    assert (centres(grid) >= box[0] - grid.resolution).all()
    assert (centres(grid) <= box[1] + grid.resolution).all()


@given(grid=MAPS, data=st.data())
def test_crop_keeps_what_the_box_touches(grid: GridMap, data: st.DataObject) -> None:
    first, second = (data.draw(st.integers(0, grid.stored.size - 1)) for _ in range(2))
    ends = centres(grid)[[first, second]]
    cropped = crop_to_box(grid, *ends.min(axis=0), *ends.max(axis=0))
    assert not (looked_up(cropped, ends) == -1).any()
    found = looked_up(grid, centres(cropped))
    assert np.array_equal(found, cropped.cells.ravel(), equal_nan=True)


def test_crop_snaps_outwards_but_not_over_a_grid_line() -> None:
    grid = GridMap(np.zeros((10, 10)), 0.1, Pose2D(-0.3, 0.7))
    cropped = crop_to_box(grid, 0, 1, 0.3, 1.25)
    assert (cropped.rows, cropped.columns, cropped.origin) == (3, 3, Pose2D(0, 1))
    assert crop_to_box(grid, -9, -9, 9, 9).origin == grid.origin
    with pytest.raises(DataError, match=r"outside the map; expected a box in x -0\.3 to 0\.7 m"):
        crop_to_box(grid, 1, 1, 2, 2)


def test_resampling_keeps_walls_and_the_corner() -> None:
    cells = np.array([[Q, 0, 0, 0, 1], [Q, 0, 0.5, 0, 0], [Q, Q, 0, 0, 0]], dtype=np.float32)
    grid = GridMap(cells, 0.5, Pose2D(1, 2, 0.3))
    large = resample(grid, 1.0)
    assert np.array_equal(large.cells, [[0, 0, 1], [0, 0.5, 0]], equal_nan=True)
    assert (large.resolution, large.origin) == (1, grid.origin)
    small = resample(grid, 0.25)
    assert np.array_equal(small.cells, cells.repeat(2, axis=0).repeat(2, axis=1), equal_nan=True)
    with pytest.raises(DataError, match=r"the result would have .* rows"):
        resample(grid, 1e-6)


@given(grid=MAPS, ratio=st.floats(1.01, 6))
def test_larger_cells_hold_the_highest_known_centre_in_them(grid: GridMap, ratio: float) -> None:
    large = resample(grid, grid.resolution * ratio)
    at = large.cells_of_world(centres(grid))
    share = large.fractional_cells_of_world(centres(grid)) % 1
    if (np.abs(share - 0.5) < 1e-6).any():
        return  # a centre on a new grid line belongs to either side
    expected = np.full(large.stored.shape, np.nan, dtype=np.float32)
    for (row, column), cell in zip(at, grid.cells.ravel(), strict=True):
        expected[row, column] = np.fmax(expected[row, column], cell)
    assert np.array_equal(large.cells, expected, equal_nan=True)


@given(grid=MAPS, up=st.integers(-9, 9), right=st.integers(-9, 9), real=st.booleans())
def test_merging_on_the_same_cells(grid: GridMap, up: int, right: int, real: bool) -> None:
    """Higher of what is known, where the maps overlap; either where they do not."""
    offset = Pose2D(right * grid.resolution, up * grid.resolution)
    stored = grid.stored[:, ::-1] if grid.stored.dtype == np.uint8 else grid.stored[::-1]
    other = GridMap(stored, grid.resolution, grid.origin.compose(offset))
    other = other.replaced(other.cells) if real else other
    both = merge(grid, other)
    points = centres(both)
    mine, yours = looked_up(grid, points), looked_up(other, points)
    expected = np.fmax(np.where(mine == -1, np.nan, mine), np.where(yours == -1, np.nan, yours))
    assert np.array_equal(both.cells.ravel(), expected, equal_nan=True)
    assert not (looked_up(both, centres(grid)) == -1).any()
    assert not (looked_up(both, centres(other))[other.known.ravel()] == -1).any()


def room() -> GridMap:
    """A room of no symmetry, 12 by 9 m, walls two cells thick."""
    cells = np.full((180, 240), 0, dtype=np.uint8)
    for part in (np.s_[:2], np.s_[-2:], np.s_[:, :2], np.s_[:, -2:], np.s_[60:62, :100],
                 np.s_[60:, 150:152], np.s_[100:120, 40:70], np.s_[20:30, 180:220]):  # fmt: skip
        cells[part] = 100
    cells[140:, :60] = 255
    return GridMap(cells, 0.05, Pose2D(-3, -2))


@pytest.mark.parametrize("degrees", [-44.0, -20.0, -3.3, 0.0, 7.25, 30.0])
def test_direction_of_walls(degrees: float) -> None:
    turned, _ = rotate(room(), math.radians(degrees))
    assert math.degrees(wall_direction(turned)) == pytest.approx(degrees, abs=0.1)


def test_no_walls_no_direction() -> None:
    with pytest.raises(DataError, match="0 occupied cells; expected walls"):
        wall_direction(GridMap(np.zeros((3, 3))))


@pytest.mark.slow
@pytest.mark.parametrize(
    "motion", [Pose2D(0, 0, 0), Pose2D(7.3, -12.1, 2.4), Pose2D(-40, 3, -0.4)], ids=str
)
def test_a_part_is_found_wherever_it_is(motion: Pose2D) -> None:
    part = crop_to_box(room(), -1, -2, 7.5, 5)
    found = register(room(), bake_yaw(move(part, motion.inverse())[0]))
    error = motion.between(found.motion)
    assert math.hypot(error.x, error.y) < 0.03
    assert abs(error.theta) < 0.005
    assert found.score > 0.98
    assert found.overlap_m2 == pytest.approx(8.5 * 7 - 0.5 * 40 * 0.05, rel=0.05)


def test_nothing_to_register() -> None:
    with pytest.raises(DataError, match="without occupied cells"):
        register(room(), GridMap(np.zeros((5, 5))))


@pytest.mark.slow
def test_maps_that_do_not_fit() -> None:
    dots = np.zeros((180, 240), dtype=np.uint8)
    dots[::7, ::7] = 100
    with pytest.raises(DataError, match="no place was found where one map fits the other"):
        register(room(), GridMap(dots, 0.05))


def test_sampling_elsewhere_is_unknown() -> None:
    assert not sampled(room(), CellFrame(Pose2D(100, 100), 1.0, 2, 2)).known.any()


def test_maps_that_lie_far_apart() -> None:
    """A few cells 2 km apart would be 900 million together; 400 m apart, they may be joined."""
    here = GridMap(np.array([[0, 1]], dtype=np.float32), 0.05)
    there = GridMap(here.cells, 0.05, Pose2D(1500, 1500))
    for work in (merge, compare):
        with pytest.raises(DataError, match="apart: together they would have 30,001 rows and 30,"):
            work(here, there)
    joined = merge(here, GridMap(here.cells, 0.05, Pose2D(100, 400)))
    assert joined.cells.shape == (8001, 2002)
    assert np.nansum(joined.cells) == 2
    large = GridMap(np.zeros((4000, 4000), dtype=np.float32), 0.05)
    frame = joint_frame(large, GridMap(large.cells, 0.05, Pose2D(500, 500)))
    assert (frame.rows, frame.columns) == (14_000, 14_000)  # 2.5 times their diagonal away
