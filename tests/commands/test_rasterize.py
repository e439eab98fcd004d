"""Polygons to cells and back (Sect. 9.1): the book's triangle, exact shares, what both take."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import FIXTURES, run

from mapcli import GridMap, load_map
from mapcli.algorithms.maps.rasterize import covered_cells_listed
from mapcli.algorithms.maps.threshold import binary_map

FIGURE = FIXTURES / "fig9_1.yaml"


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


def test_fig_9_2_has_the_object_of_fig_9_1a() -> None:
    grid = load_map(FIXTURES / "fig9_2.txt").grid
    assert solid_cells(binary_map(grid, 0.7)) == BOOK_CELLS
    assert solid_cells(binary_map(grid, 0.5)) > BOOK_CELLS


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


def test_cells_that_nobody_asks_for_are_not_listed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A list of 33 million took 25 of 28 seconds."""
    listed = []

    def listing(grid: GridMap, **options: bool) -> list[tuple[int, int]]:
        listed.append(grid)
        return covered_cells_listed(grid, **options)

    monkeypatch.setattr("mapcli.algorithms.maps.rasterize.covered_cells_listed", listing)
    path = tmp_path / "p.yaml"
    path.write_text("polygons: [[[0, 0], [11, 0], [11, 3], [0, 3]]]\n")  # 33 cells
    assert run("rasterize", path, tmp_path / "o.txt") == 0
    assert not listed
    assert "cells x, y" not in capsys.readouterr().out
    assert run("rasterize", path, tmp_path / "o.txt", "-v") == 0
    assert "(10,2)" in capsys.readouterr().out
    assert run("rasterize", path, tmp_path / "o.txt", "-q", "--json", tmp_path / "o.json") == 0
    assert len(json.loads((tmp_path / "o.json").read_text())["cells"]) == 33


def test_bad_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("rasterize", str(FIGURE), str(tmp_path / "o.jpg")) == 2
    assert run("rasterize", str(FIGURE), "-", "--min-cover", "0") == 2
    assert run("vectorize", str(FIGURE), "-", "--tolerance", "0") == 2
    assert run("vectorize", str(FIGURE), "-") == 1
    assert (
        "is a continuous map; make a grid map of it with mapcli rasterize"
        in capsys.readouterr().err
    )


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


@pytest.mark.slow
def test_the_largest_map_takes_less_than_a_gigabyte(tmp_path: Path) -> None:
    """A hundred million cells, all of them covered."""
    path = tmp_path / "p.yaml"
    path.write_text("polygons: [[[0, 0], [1e4, 0], [1e4, 1e4], [0, 1e4]]]\n")
    code = (
        "import os, subprocess, sys\n"
        "process = subprocess.Popen([sys.executable, '-m', 'mapcli', 'rasterize', *sys.argv[1:]])\n"
        "_, status, used = os.wait4(process.pid, 0)\n"
        "print(status, used.ru_maxrss)"
    )
    command = [sys.executable, "-c", code, str(path), str(tmp_path / "o.png"), "-q"]
    out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    status, kilobytes = map(int, out.split())
    assert status == 0
    assert kilobytes < 1_000_000
