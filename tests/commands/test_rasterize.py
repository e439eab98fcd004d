"""Polygons to cells and back (Sect. 9.1): the book's triangle, exact shares, what both take."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from conftest import FIXTURES, run
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli import GridMap, Pose2D, World, load_map, load_world, rasterize, vectorize
from mapcli.algorithms.maps.polygons import polygons_at, solid_area, world_of_area
from mapcli.algorithms.maps.rasterize import box_around, covered_shares, empty_map
from mapcli.errors import DataError
from mapcli.formats.documents.world import read_world, write_world

FIGURE = FIXTURES / "fig9_1.yaml"
TRIANGLE = World.of([[[6, 3], [3, 7], [6, 7]]])
BOOK_CELLS = {(5, 3), (5, 4), (5, 5), (4, 5), (5, 6), (4, 6), (3, 6)}
"""x, y of the cells of Fig. 9.1a, y down."""


def solid_cells(grid: GridMap) -> set[tuple[int, int]]:
    """x, y of the solid cells, y down, counted from the upper left corner."""
    return {(int(column), int(row)) for row, column in np.argwhere(grid.cells >= 0.5)}


def test_fig_9_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.txt"
    arguments = ["rasterize", str(FIGURE), str(out), "--box", "0,0,8,8", "--min-cover"]
    assert run(*arguments, "0.3") == 0
    assert capsys.readouterr().out == (
        "    discrete  7 cells of 64 covered: 56 bytes as a list of pairs, 8 as one bit a cell\n"
        "  continuous  1 polygon, 3 vertices: 24 bytes as a list of pairs\n"
        "  cells x, y  (5,3) (5,4) (4,5) (5,5) (3,6) (4,6) (5,6)\n"
        f"     written  {out.name}\n"
    )
    assert solid_cells(load_map(out).grid) == BOOK_CELLS
    assert run(*arguments, "0.5") == 0  # the majority rule
    assert solid_cells(load_map(out).grid) == BOOK_CELLS - {(5, 3)}


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


# --- back


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


def test_commands_and_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, world = tmp_path / "m.txt", tmp_path / "w.yaml"
    run("rasterize", str(FIGURE), str(text), "--box", "8,8,0,0", "--min-cover", "0.3", "-q")
    run("vectorize", str(text), str(world), "--tolerance", "1", "--y-down")
    assert "1 polygon, 4 vertices: 32 bytes" in capsys.readouterr().out
    assert world.read_text() == "y: down\npolygons:\n  - [[5, 3], [5, 5], [3, 7], [6, 7]]\n"
    report = tmp_path / "r.json"
    run("rasterize", str(world), "-", "--shares", "--json", str(report))
    rows = capsys.readouterr().out.splitlines()[1:]
    cells = [[float(cell) for cell in row.split()] for row in rows]
    assert cells == [[0, 0, 0.125], [0, 0, 0.375], [0, 0.5, 0.625], [0.5, 1, 0.875]]
    content = json.loads(report.read_text())
    assert content["format"] == "mapcli.rasterize"
    assert content["memory"]["continuous"] == {"polygons": 1, "vertices": 4, "list_bytes": 32}


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("polygons: [[[0, 0], [1, 1]]]", [], "line 1: polygons[0]: 2 vertices; expected 3 or more"),
        ("polygons: [[[0, 0], [1, x], [2, 0]]]", [], "polygons[0][1]: [1, x] is no point"),
        ("polygons: []", [], "an empty world has no extent"),
        ("y: left\npoints: [[1, 1]]", [], "line 1: y: 'left'; expected up or down"),
        ("cells: [[1]]", [], "is a grid map; expected `polygons:` in YAML"),
        ("points: [[1, 1]]", ["--box", "0,0,0,1"], "the box 0,0 to 0,1 is empty"),
    ],
)
def test_bad_polygons(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, options: list[str], message: str
) -> None:
    path = tmp_path / "p.yaml"
    path.write_text(text)
    assert run("rasterize", str(path), str(tmp_path / "o.txt"), *options) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"Error: {path}: ")
    assert message in error
    assert not (tmp_path / "o.txt").exists()


def test_bad_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("rasterize", str(FIGURE), str(tmp_path / "o.jpg")) == 2
    assert run("rasterize", str(FIGURE), "-", "--min-cover", "0") == 2
    assert run("vectorize", str(FIGURE), "-", "--tolerance", "0") == 2
    assert run("vectorize", str(FIGURE), "-") == 1
    assert "`mapcli rasterize` turns polygons into one" in capsys.readouterr().err


def test_a_map_without_obstacles(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "m.txt").write_text("0 0 ?\n")
    assert run("vectorize", str(tmp_path / "m.txt"), "-") == 0
    printed = capsys.readouterr()
    assert printed.out == "polygons: []\n"
    assert "no cell is an obstacle from 0.5 on" in printed.err


def test_what_lies_at_a_point(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("info", str(FIGURE), "--at", "5.5,6", "--at", "3,3") == 0
    printed = capsys.readouterr().out
    assert "continuous map, y down" in printed
    assert "5.5,6: in polygons[0]" in printed
    assert "3,3: in no object" in printed
    (tmp_path / "m.txt").write_text("0.2 ?\n")
    run("info", str(tmp_path / "m.txt"), "--at", "0.5,0.5", "--at", "1.5,0", "--at", "-1,0")
    printed = capsys.readouterr().out
    assert "0.5,0.5: cell 0,0, obstacle probability 0.2" in printed
    assert "1.5,0: cell 0,1, unknown" in printed
    assert "-1,0: outside the map" in printed
