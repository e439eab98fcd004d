"""Polygons to cells and back (Sect. 9.1): exact shares of cells, frames, areas of polygons."""

from __future__ import annotations

import time

import numpy as np
import pytest
import shapely
from conftest import FIXTURES
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli import GridMap, Pose2D, World, load_world, rasterize, vectorize
from mapcli.algorithms.maps.polygons import polygons_at, solid_area, world_of_area
from mapcli.algorithms.maps.rasterize import box_around, covered_shares, empty_map, frame_of
from mapcli.errors import DataError
from mapcli.formats.documents.world import read_world, write_world

FIGURE = FIXTURES / "fig9_1.yaml"


TRIANGLE = World.of([[[6, 3], [3, 7], [6, 7]]])


BOOK_CELLS = {(5, 3), (5, 4), (5, 5), (4, 5), (5, 6), (4, 6), (3, 6)}
"""x, y of the cells of Fig. 9.1a, y down."""


def solid_cells(grid: GridMap) -> set[tuple[int, int]]:
    """x, y of the solid cells, y down, counted from the upper left corner."""
    return {(int(column), int(row)) for row, column in np.argwhere(grid.cells >= 0.5)}


def test_the_same_triangle_with_y_up() -> None:
    grid = rasterize(TRIANGLE, empty_map((0, 0, 8, 8), 1), 0.3)
    assert {(x, 7 - y) for x, y in solid_cells(grid)} == BOOK_CELLS


def test_shares_are_exact() -> None:
    shares = covered_shares(solid_area(TRIANGLE), empty_map((0, 0, 8, 8), 1))[::-1]  # row is y
    assert shares[3, 5] == pytest.approx(0.375, abs=1e-12)
    assert shares[4, 5] == pytest.approx(23 / 24, abs=1e-12)
    assert shares[4, 4] == pytest.approx(1 / 6, abs=1e-12)
    assert shares.sum() == pytest.approx(6, abs=1e-12)
    assert shares[6, 5] == 1


@settings(deadline=None, max_examples=30)
@given(
    st.lists(st.tuples(st.floats(-3, 9), st.floats(-3, 9)), min_size=3, max_size=12),
    st.floats(-3, 3),
)
def test_shares_equal_those_of_single_cells(points: list[tuple[float, float]], yaw: float) -> None:
    area = shapely.MultiPoint(points).convex_hull
    frame = GridMap(np.zeros((5, 7)), 0.9, Pose2D(0.3, -0.2, yaw))
    shares = covered_shares(area, frame)
    for row, column in np.ndindex(5, 7):
        corners = frame.world_of_cells(
            row + np.array([-0.5, -0.5, 0.5, 0.5]), column + np.array([-0.5, 0.5, 0.5, -0.5])
        )
        share = area.intersection(shapely.Polygon(corners)).area / 0.81
        assert shares[row, column] == pytest.approx(share, abs=1e-7)


def test_no_polygons_cover_nothing() -> None:
    world = World.of([], [[2, 2], [2, -2]])
    assert covered_shares(solid_area(world), frame_of(world, 1)).tolist() == [[0.0]] * 4


def test_a_long_thin_polygon() -> None:
    """131,080 cells of outline: a second, not ten; and each row has its share."""
    world = World.of([[[0, 0], [3, 0], [3, 65_536]]])
    start = time.process_time()
    shares = covered_shares(solid_area(world), empty_map((0, 0, 3, 65_536), 1))[::-1]
    assert time.process_time() - start < 5
    rows = np.arange(65_536)
    assert np.allclose(shares.sum(axis=1), 3 - 3 * (rows + 0.5) / 65_536, rtol=0, atol=1e-9)
    assert shares[0].tolist() == pytest.approx([1 - 0.5 * 3 / 65_536, 1, 1], abs=1e-11)


def test_overlapping_polygons_count_once() -> None:
    world = World.of([[[0, 0], [0.3, 0], [0.3, 1], [0, 1]]] * 2)
    assert rasterize(world, empty_map((0, 0, 1, 1), 1), 0.5).cells.tolist() == [[0]]


def test_the_frame() -> None:
    world = World.of([[[0.12, -0.3], [0.98, -0.3], [0.98, 0.2]]])
    assert box_around(world, 0.25) == (0, -0.5, 1, 0.25)
    frame = empty_map((0, 0, 1, 1.1), 0.25, from_top=True)
    assert (frame.rows, frame.columns, frame.origin.y) == (5, 4, pytest.approx(-0.15))
    with pytest.raises(DataError, match="1,000,000,000 x 10 cells"):
        empty_map((0, 0, 1e9, 10), 1)
    assert empty_map((0, 0, 1e4, 1e4), 1).stored.strides == (0, 0)  # a hundred million, one kept


def test_the_frame_of_a_world() -> None:
    around = frame_of(TRIANGLE, 0.5)
    assert (around.rows, around.columns, around.origin) == (8, 6, Pose2D(3, 3))
    down = frame_of(TRIANGLE, 1.0, (8, 8, 0, 0), y_down=True)  # any two opposite corners
    assert (down.rows, down.columns, down.origin) == (8, 8, Pose2D(0, -8))


def test_points_in_objects() -> None:
    world = World.of([[[0, 0], [2, 0], [2, 2], [0, 2]], [[1, 1], [3, 1], [3, 3], [1, 3]]])
    assert polygons_at(world, 1.5, 1.5) == [0, 1]
    assert polygons_at(world, 2, 0.5) == [0]  # on the boundary
    assert polygons_at(world, 5, 5) == []


@pytest.mark.parametrize(
    ("polygon", "message"),
    [
        ([[0, 0], [2, 2], [2, 0], [0, 2]], "polygons[0]: is no simple outline: self-intersection"),
        ([[0, 0], [1, 1], [2, 2]], "polygons[0]: has no area"),
    ],
)
def test_outlines_that_are_none(polygon: list[list[float]], message: str) -> None:
    with pytest.raises(DataError) as error:
        solid_area(World.of([polygon]))
    assert message in str(error.value)


def test_y_down_in_files() -> None:
    data = b"y: down\npolygons:\n  - [[6, 3], [3, 7], [6, 7]]\n"
    world = read_world(data, "w.yaml")
    assert world.polygons[0].tolist() == [[6, -3], [3, -7], [6, -7]]
    assert write_world(world, y_down=True) == data
    assert load_world(FIGURE).y_down


def test_vectorize_and_back_is_the_same_map() -> None:
    rng = np.random.default_rng(4)
    cells = (rng.random((20, 30)) < 0.3).astype(np.float32)
    cells[3:9, 4:12] = 1
    cells[5:7, 6:9] = 0  # a hole
    grid = GridMap(cells, 0.05, Pose2D(-1, 2, 0.3))
    world = vectorize(grid, 1e-6)
    assert (rasterize(world, grid).cells == cells).all()
    whole = sum(shapely.Polygon(polygon).area for polygon in world.polygons)
    assert whole == pytest.approx(cells.sum() * 0.05**2)


def test_half_a_cell_keeps_thin_walls_and_lone_cells() -> None:
    cells = np.zeros((9, 9), dtype=np.float32)
    cells[1, 1:8] = cells[4, 4] = 1
    grid = GridMap(cells, 0.1)
    assert (rasterize(vectorize(grid, 0.05), grid).cells == cells).all()


def test_a_staircase_becomes_a_line() -> None:
    grid = GridMap(np.tri(20, dtype=np.float32))
    (outline,) = vectorize(grid, 1.0).polygons
    assert len(outline) <= 5
    assert len(vectorize(grid, 0.1).polygons[0]) == 42  # two a step, and two


def test_holes_are_cut_open() -> None:
    ring = shapely.Point(0, 0).buffer(3).difference(shapely.Point(0.5, 0).buffer(1))
    ring = ring.difference(shapely.Point(-1.8, 0).buffer(0.5))
    world = world_of_area(ring)
    assert solid_area(world).symmetric_difference(ring).area == pytest.approx(0, abs=1e-9)
