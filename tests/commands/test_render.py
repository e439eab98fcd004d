"""`mapcli render` as a user runs it."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import FIXTURES, run
from PIL import Image

from mapcli import GridMap, Pose2D
from mapcli.formats.maps.save import dump_map
from mapcli.pictures.book_figure import OBSTACLE, book_image
from mapcli.pictures.continuous_map import MARGIN
from mapcli.pictures.drawing import BLUE, RED, WHITE


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("book.txt").write_text("? 0.1 1\n? 0.1 1\n1 1 1\n")
    cells = np.full((100, 120), np.nan, dtype=np.float32)
    cells[20:80, 20:100] = 0
    cells[20:80, [20, 99]] = 1
    grid = GridMap(cells, 0.05, Pose2D(-3, -2))
    for name, data in dump_map(grid, "plan.yaml").items():
        Path(name).write_bytes(data)
    write_trace()
    return tmp_path


def write_trace(**changes: Any) -> None:
    pose = {"odom": {"x": 0, "y": 0, "theta": 0}, "score": 0.9, "status": "matched"}
    poses = [
        {"stamp_ns": 10**18 + k * 10**9, "x": -1 + k / 50, "y": 0.5, "theta": 0.0, **pose}
        for k in range(100)
    ]
    document = {"format": "mapcli.pose-trace", "version": 1, "poses": poses, "summary": {}}
    Path("trace.json").write_text(json.dumps(document | changes))


def render(*arguments: str) -> int:
    return run("render", *arguments)


def size(name: str) -> tuple[int, int]:
    with Image.open(name) as image:
        return image.size


def colours(name: str) -> set[tuple[int, int, int]]:
    with Image.open(name) as image:
        return {colour for _, colour in image.getcolors(1 << 24) or []}  # type: ignore[misc]


def test_small_maps_get_the_look_of_the_book(capsys: pytest.CaptureFixture[str]) -> None:
    assert render("book.txt", "--png", "b.png", "--labels", "--scale", "40") == 0
    assert size("b.png") == (3 * 40 + 2 * 13, 3 * 40 + 2 * 13)
    assert capsys.readouterr() == ("", "")
    assert RED not in colours("b.png")
    arguments = ["--labels", "--scale", "40", "--frontier", "--robot", "0,1"]
    assert render("book.txt", "--png", "f.png", *arguments) == 0
    assert RED in colours("f.png")


def test_large_maps_become_a_floor_plan_with_the_path() -> None:
    assert render("plan.yaml", "--png", "empty.png") == 0
    assert render("plan.yaml", "--png", "path.png", "--trace", "trace.json") == 0
    assert size("path.png") == size("empty.png")
    assert max(size("path.png")) > 1500
    assert len(colours("path.png") - colours("empty.png")) > 50


def test_robot_and_frontier_on_a_floor_plan() -> None:
    arguments = ["--robot", "50,50", "--frontier", "--title", "A room", "--scale", "3"]
    assert render("plan.yaml", "--png", "p.png", *arguments) == 0
    assert RED in colours("p.png")


def test_trace_on_a_small_map() -> None:
    assert render("book.txt", "--png", "without.png") == 0
    poses = [{"stamp_ns": k, "x": 1.5, "y": 0.5 + k, "theta": 0} for k in range(3)]
    write_trace(poses=poses)
    assert render("book.txt", "--png", "with.png", "--trace", "trace.json") == 0
    assert Path("with.png").read_bytes() != Path("without.png").read_bytes()


def test_standard_output(capsysbinary: pytest.CaptureFixture[bytes]) -> None:
    assert render("book.txt", "--png", "-", "-v") == 0
    with Image.open(io.BytesIO(capsysbinary.readouterr().out)) as image:
        assert image.format == "PNG"


def test_same_input_same_bytes() -> None:
    for name in ("a.png", "b.png"):
        assert render("plan.yaml", "--png", name, "--trace", "trace.json") == 0
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()


def test_trace_without_poses_is_a_plan_without_path() -> None:
    write_trace(poses=[])
    assert render("plan.yaml", "--png", "a.png", "--trace", "trace.json") == 0
    assert render("plan.yaml", "--png", "b.png") == 0
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no.txt"], "no.txt: no such file"),
        (["book.txt", "--robot", "3,0"], "book.txt: robot at 3,0; expected a cell of 3 rows"),
        (
            ["book.txt", "--scale", "9999"],
            "book.txt: 3 rows, 3 columns at 9999 pixels per cell; expected",
        ),
        (["book.txt", "--trace", "no.json"], "no.json: no such file"),
        (["book.txt", "--trace", "book.txt"], "book.txt: is a text map; "),
        (["large.txt", "--labels"], "large.txt: 1 rows, 251 columns; expected at most 250 a side"),
    ],
)
def test_data_errors(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("large.txt").write_text("." * 251)
    assert render(*arguments, "--png", "x.png") == 1
    assert capsys.readouterr().err.startswith(f"Error: {message}")
    assert not Path("x.png").exists()


POSE = {"stamp_ns": 1, "x": 0, "y": 0, "theta": 0}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "mapcli.map-info"}, "is a mapcli.map-info document; see what"),
        ({"version": 2}, "has version 2 of mapcli.pose-trace; expected version 1"),
        ({"poses": None}, "has no list of poses"),
        ({"poses": [POSE, {"x": 1}]}, "pose 1: has no 'stamp_ns'; expected stamp_ns, x, y and"),
        ({"poses": [POSE | {"x": "far"}]}, "pose 0: has a bad number"),
        ({"poses": [POSE | {"x": 1e300}]}, "pose 0: has a bad number"),
        ({"poses": [POSE | {"x": float("nan")}]}, "pose 0: has a bad number"),
        ({"poses": [POSE | {"stamp_ns": 2**63}]}, "pose 0: has a bad number"),
        ({"poses": [POSE | {"stamp_ns": None}]}, "pose 0: has a bad number"),
        ({"poses": [7]}, "pose 0: has a bad number"),
    ],
)
def test_malformed_traces(
    changes: dict[str, Any], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write_trace(**changes)
    assert render("plan.yaml", "--png", "x.png", "--trace", "trace.json") == 1
    assert capsys.readouterr().err.startswith(f"Error: trace.json: {message}")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["book.txt"], "Missing option '--png'"),
        (["book.txt", "--png", "x.png", "--robot", "1"], "'1' is not of the form ROW,COL"),
        (["book.txt", "--png", "x.png", "--scale", "0"], "0 is not in the range x>=1"),
        (["-", "--png", "x.png", "--trace", "-"], "cannot both be standard input"),
    ],
)
def test_usage_errors(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert render(*arguments) == 2
    assert message in capsys.readouterr().err


def test_no_clobber(capsys: pytest.CaptureFixture[str]) -> None:
    Path("x.png").write_text("mine")
    assert render("book.txt", "--png", "x.png", "--no-clobber") == 1
    assert Path("x.png").read_text() == "mine"


def test_fig_9_1b_is_drawn_from_its_polygon() -> None:
    assert render(str(FIXTURES / "fig9_1.yaml"), "--png", "b.png", "--box", "0,0,8,8") == 0
    with Image.open("b.png") as image:
        side = (image.width - 2 * MARGIN) / 8

        def at(x: float, y: float) -> tuple[int, ...]:
            """The colour at a point of the figure, y down."""
            pixel = image.getpixel((round(MARGIN + x * side), round(MARGIN + y * side)))
            assert isinstance(pixel, tuple)
            return pixel

        assert image.width == image.height
        # Between (6, 3) and (3, 7) the edge passes (4.5, 5).
        assert at(4.7, 5.2) == at(5.9, 3.5) == at(3.3, 6.9) == OBSTACLE
        assert at(4.3, 4.8) == at(2.5, 6.5) == at(6.3, 5.5) == WHITE


def test_points_and_whole_worlds_are_drawn() -> None:
    assert render(str(FIXTURES / "landmarks-map.yaml"), "--png", "points.png") == 0
    assert BLUE in colours("points.png")
    assert render(str(FIXTURES / "apartment.yaml"), "--png", "plan.png") == 0
    assert OBSTACLE in colours("plan.png")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--labels"], "--labels is for maps of cells"),
        (["--robot", "0,0"], "--robot is for maps of cells"),
        (["--box", "1,1,1,2"], "--box has no area"),
    ],
)
def test_what_polygons_do_not_have(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert render(str(FIXTURES / "fig9_1.yaml"), "--png", "x.png", *arguments) == 2
    assert message in capsys.readouterr().err


def test_a_box_is_for_polygons(capsys: pytest.CaptureFixture[str]) -> None:
    assert render("book.txt", "--png", "x.png", "--box", "0,0,1,1") == 2
    assert "--box is for polygons" in capsys.readouterr().err


def test_the_start_is_in_a_ring_and_numbers_are_not_struck_through() -> None:
    grid = GridMap(np.full((3, 4), 0.1, np.float32))
    plain = np.asarray(book_image(grid, scale=60))
    drawn = np.asarray(book_image(grid, path=[(0, 0), (0, 1), (1, 1), (1, 2)], scale=60))
    for row, column in [(0, 0), (0, 1), (1, 1), (1, 2)]:
        left, top = 20 + 60 * column, 20 + 60 * row
        number = slice(top + 20, top + 40), slice(left + 15, left + 45)
        assert (plain[number] == drawn[number]).all()
    ring = 20 + 30, 20 + 30 - 24  # x, y above the middle of the first cell
    assert tuple(drawn[ring[1], ring[0]]) == BLUE
