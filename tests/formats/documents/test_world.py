"""Worlds and paths: records, files, and what is said about bad ones."""

from __future__ import annotations

import io
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapcli.errors import DataError, FormatError
from mapcli.formats.documents.waypoints import load_waypoints, read_waypoints
from mapcli.formats.documents.world import load_world, read_world, write_world
from mapcli.model.grid import GridMap
from mapcli.model.waypoint import Waypoint
from mapcli.model.world import World

TRIANGLE = [[6, 3], [3, 7], [6, 7]]
"""The object of Fig. 9.1."""


def test_first_vertex_repeated_at_the_end_is_dropped() -> None:
    assert World.of([[*TRIANGLE, TRIANGLE[0]]]).polygons[0].tolist() == TRIANGLE
    assert World.of([[*TRIANGLE, *[TRIANGLE[0]] * 3]]).polygons[0].tolist() == TRIANGLE


def test_bounds() -> None:
    assert World.of([TRIANGLE], [[0, 8]]).bounds() == (0, 3, 6, 8)
    with pytest.raises(DataError, match="empty world has no extent"):
        World().bounds()


@pytest.mark.parametrize(
    ("polygons", "points", "message"),
    [
        ([[[0, 0], [1, 1]]], [], "polygon 0: 2 vertices; expected 3 or more"),
        ([TRIANGLE, [[0, 0], [1, 1], [0, 0]]], [], "polygon 1: 2 vertices"),
        ([[[0, 0], [1, 1], [0, math.nan]]], [], "polygon 0: a coordinate is not finite"),
        ([[[0, 0, 0], [1, 1, 1], [0, 1, 0]]], [], "polygon 0: shape (3, 3)"),
        ([], [[0, math.inf]], "points: a coordinate is not finite"),
        ([], [1, 2], "points: shape (2,)"),
    ],
)
def test_records_that_are_no_world(polygons: list, points: list, message: str) -> None:
    with pytest.raises(DataError) as error:
        World.of(polygons, points)
    assert message in str(error.value)


WORLD_TEXT = b"""\
# the object of Fig. 9.1
polygons:
  - [[6, 3], [3, 7], [6, 7]]
  -
    - [0, 0]
    - [1.5, 0]
    - [1.5, 1e-1]
    - [0, 0]
points: [[2, 2], [2, -2]]
frame: map
"""


def test_yaml_by_the_letter() -> None:
    world = read_world(WORLD_TEXT, "w.yaml")
    assert [polygon.tolist() for polygon in world.polygons] == [
        TRIANGLE,
        [[0, 0], [1.5, 0], [1.5, 0.1]],
    ]
    assert world.points.tolist() == [[2, 2], [2, -2]]


def test_written_by_the_letter() -> None:
    assert write_world(World.of([TRIANGLE], [[0.1, -2]])) == (
        b"polygons:\n  - [[6, 3], [3, 7], [6, 7]]\npoints:\n  - [0.1, -2]\n"
    )


numbers = st.floats(-1e9, 1e9)
vertices = st.tuples(numbers, numbers)
polygons = st.lists(vertices, min_size=3, max_size=5, unique=True)


@given(st.lists(polygons, max_size=3), st.lists(vertices, max_size=3))
def test_round_trip(shapes: list, points: list) -> None:
    world = World.of(shapes, points)
    again = read_world(write_world(world), "w.yaml")
    assert [p.tolist() for p in again.polygons] == [p.tolist() for p in world.polygons]
    assert again.points.tolist() == world.points.tolist()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("polygons: [}", "w.yaml: line 1: broken YAML"),
        ("[1, 2]", "w.yaml: not a YAML mapping"),
        ("polygon: []", "w.yaml: line 1: polygons: key is missing; expected a list of polygons"),
        ("polygons: 3", "w.yaml: line 1: polygons: not a list"),
        ("polygons:\n  - 3", "w.yaml: line 2: polygons[0]: not a list; expected a list of vert"),
        ("polygons:\n- [[0,0],[1,0],[1,1]]\n- [[0,0],[1,1]]", "line 3: polygons[1]: 2 vertices"),
        ("polygons:\n- - [0, 0]\n  - [1, 0]\n  - 7", "line 4: polygons[0][2]: not a list"),
        ("polygons:\n- - [0, 0]\n  - [1, a]\n  - [7, 8]", "line 3: polygons[0][1]: [1, a] is no"),
        ("points: [[1, 2], [1, 2, 3]]", "line 1: points[1]: [1, 2, 3] is no point; expected x "),
        ("points: [[1, [2]]]", "points[0]: [1, a list] is no point"),
        ("points: [[1, nan]]", "points[0]: [1, nan] is not finite"),
        ("points: [[1]]\npoints: []", "line 2: points: given twice"),
    ],
)
def test_malformed_worlds(text: str, message: str) -> None:
    with pytest.raises(FormatError) as error:
        read_world(text.encode(), "w.yaml")
    assert message in str(error.value)


def test_a_grid_map_is_a_world(tmp_path: Path) -> None:
    file = tmp_path / "map.txt"
    file.write_text("0 1\n? 0\n")
    loaded = load_world(file)
    assert isinstance(loaded.world, GridMap)
    assert np.array_equal(loaded.world.cells, [[0, 1], [np.nan, 0]], equal_nan=True)


def test_a_world_from_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    for text, kind in ((WORLD_TEXT, World), (b"0 1\n1 0\n", GridMap)):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text)))
        assert isinstance(load_world("-").world, kind)


def test_a_missing_world() -> None:
    with pytest.raises(FormatError, match=r"nowhere\.yaml: no such file"):
        load_world("nowhere.yaml")


PATH = [
    Waypoint(0.5, 0.5),
    Waypoint(3, 0.5, speed=0.3, pause=2),
    Waypoint(-1, 0.5, back=True),
]


@pytest.mark.parametrize(
    "text",
    [
        "# start\n0.5 0.5\n\n3.0,0.5 speed=0.3 pause=2 # slowly\n-1\t.5 back\n",
        "0.5, 0.5\r\n3, 0.5, pause=2, speed=0.3\r\n-1, 0.5, back\r\n",
        "waypoints: [[0.5, 0.5], [3, 0.5, speed=0.3, pause=2], [-1, 0.5, back]]\n",
        "# a\nwaypoints:\n- [0.5, 0.5]\n- [3, 0.5, pause=2, speed=0.3]\n- [-1, .5, back]\n",
    ],
)
def test_paths_by_the_letter(text: str) -> None:
    assert read_waypoints(text.encode(), "p.txt") == PATH


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 0\n1\n", "p.txt: line 2: '1'; expected `X Y [back] [speed=M/S] [pause=S]`"),
        ("0 0\n\n1 2 3\n", "p.txt: line 3: '1 2 3'"),
        ("0 zero", "p.txt: line 1: '0 zero'"),
        ("0 0 back back", "'0 0 back back'"),
        ("0 0 speed=1 speed=2", "'0 0 speed=1 speed=2'"),
        ("0 0 speed", "'0 0 speed'"),
        ("0 0 speed=-1", "line 1: speed -1; expected metres per second, more than 0"),
        ("0 0 pause=nan", "line 1: pause nan; expected seconds, 0 or more"),
        ("0 inf", "line 1: x 0, y inf; expected finite numbers"),
        ("a:\nwaypoints:x: [[0, 0]]", "p.txt: line 1: waypoints: key is missing"),
        ("waypoints: 3", "p.txt: line 1: waypoints: not a list"),
        ("waypoints:\n- [0, 0]\n- 7", "p.txt: line 3: waypoints[1]: not a list"),
        ("waypoints:\n- [0, 0]\n- [1]", "p.txt: line 3: '1'"),
        ("waypoints: [[0, [1]]]", "p.txt: line 1: '0 a list'; expected `X Y"),
        ("\x00\xff", "p.txt: line 1: "),
    ],
)
def test_malformed_paths(text: str, message: str) -> None:
    with pytest.raises(FormatError) as error:
        read_waypoints(text.encode("latin-1"), "p.txt")
    assert message in str(error.value)


def test_an_empty_path(tmp_path: Path) -> None:
    file = tmp_path / "p.txt"
    file.write_text("# nothing\n")
    with pytest.raises(FormatError, match="has no waypoints; expected lines of"):
        load_waypoints(file)
