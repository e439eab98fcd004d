"""`mapcli frontier` as a user runs it."""

from __future__ import annotations

import csv
import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import FIXTURES, run
from PIL import Image

from mapcli import GridMap, Pose2D, load_map
from mapcli.formats.maps.save import dump_map
from mapcli.pictures.drawing import RED

WORLD, KNOWN, SMALL = (str(FIXTURES / f"{name}.txt") for name in ("fig9_9", "fig9_4", "fig9_10"))
BOOK = (WORLD, "--known", KNOWN, "--robot", "5,9")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def frontier(*arguments: str) -> int:
    return run("frontier", *arguments)


def frames(name: str) -> int:
    with Image.open(name) as image:
        return int(getattr(image, "n_frames", 1))


def colours(name: str) -> set[Any]:
    with Image.open(name) as image:
        return {colour for _, colour in image.convert("RGB").getcolors(1 << 24) or []}


def test_the_summary(capsys: pytest.CaptureFixture[str]) -> None:
    assert frontier(*BOOK) == 0
    assert capsys.readouterr().out == (
        "    strategy  nearest\n"
        "       steps  28 steps, 47 time steps\n"
        "      driven  47 cells, 47 m\n"
        "       known  124 cells, coverage 100.0%\n"
        "       ended  no frontier is left\n"
        "  never seen  2 cells: 9,0 9,11 "
        "(touch open cells at corners only, so no frontier is beside them)\n"
    )


def test_the_steps_as_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    """Figs. 9.5 to 9.8: two cells up, one more, then round the obstacle."""
    assert frontier(*BOOK, "--steps", "--max-steps", "3") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:4] == [
        "step  robot  from   to  cells  frontier     p  sensed",
        "   1      1   5,9  3,9      2        13   0.5       3",
        "   2      1   3,9  2,9      1        12     1       3",
        "   3      1   2,9  2,7      4        10  0.25       2",
    ]
    assert lines[4:6] == ["", "    strategy  nearest"]


def test_the_plan_of_figure_9_10(capsys: pytest.CaptureFixture[str]) -> None:
    plan = (SMALL, "--known", SMALL, "--robot", "3,3", "--plan")
    assert frontier(*plan, "--strategy", "priority") == 0
    assert capsys.readouterr().out == (
        "strategy: priority\n"
        "frontier: 3 cells\n"
        "        cell  unknown  distance  priority\n"
        "         1,3        3         2       1.5\n"
        "         2,2        2         2         1\n"
        "         3,2        1         1         1\n"
        "robot 1 goes to 1,3: 2 cells, priority 1.5\n"
    )
    assert frontier(*plan) == 0
    assert "robot 1 goes to 3,2: 1 cell, priority 1\n" in capsys.readouterr().out


def test_the_trace() -> None:
    assert frontier(*BOOK, "-q", "--json", "trace.json") == 0
    trace = json.loads(Path("trace.json").read_text())
    assert list(trace)[:2] == ["format", "version"]
    assert (trace["format"], trace["version"]) == ("mapcli.exploration-trace", 1)
    assert [file["file"] for file in trace["input"]] == ["fig9_9.txt", "fig9_4.txt"]
    assert trace["parameters"]["strategy"] == "nearest"
    assert trace["robots"] == [[5, 9]]
    assert trace["steps"][0] == {
        "robot": 0, "kind": "frontier", "time": 2, "from": [5, 9], "goal": [3, 9],
        "path": [[4, 9], [3, 9]], "sensed": [[2, 8, 1.0], [2, 9, 0.1], [2, 10, 0.1]],
        "frontier_size": 13, "priority": 0.5,
    }  # fmt: skip
    assert trace["unreachable"] == []
    assert trace["summary"]["reason"] == "complete"


@pytest.mark.slow
def test_all_outputs_and_that_they_are_the_same_again() -> None:
    names = {"--json": "t.json", "--png": "p.png", "--gif": "g.gif", "--map": "m.yaml",
             "--curve": "c.png"}  # fmt: skip
    outputs = [word for pair in names.items() for word in pair]
    written = []
    for _ in range(2):
        assert frontier(*BOOK, *outputs) == 0
        written.append({path.name: path.read_bytes() for path in Path().iterdir()})
    assert written[0] == written[1]
    assert set(written[0]) == {*names.values(), "m.png"}
    assert frames("g.gif") == 29
    assert RED not in colours("p.png")  # no frontier is left
    explored = load_map("m.yaml").grid.cells
    np.testing.assert_allclose(explored[2, 8:11], [1, 0.1, 0.1], atol=0.006)


def test_the_frontier_is_red() -> None:
    assert frontier(*BOOK, "--max-steps", "3", "--png", "p.png") == 0
    assert RED in colours("p.png")


@pytest.mark.slow
def test_long_animations_are_thinned() -> None:
    Path("hall.txt").write_text("0 " * 401 + "\n")
    assert frontier("hall.txt", "--robot", "0,0", "--gif", "g.gif") == 0
    assert 250 <= frames("g.gif") <= 300


def test_strategies_side_by_side(capsys: pytest.CaptureFixture[str]) -> None:
    both = ("--strategy", "nearest", "--strategy", "priority")
    assert frontier(*BOOK, *both, "--curve", "c.csv", "--json", "t.json") == 0
    assert capsys.readouterr().out.endswith(
        "strategy  steps  time steps  cells driven  m driven  coverage\n"
        "nearest      28          47            47        47    100.0%\n"
        "priority     26          45            45        45    100.0%\n"
        "\nnearest and priority part at step 4, from 2,7, to 5,5 and 6,5\n"
        "     nearest  5,5: distance 5, 1 unknown; as good as 2 others, "
        "taken for its smaller row\n"
        "    priority  6,5: distance 6, 2 unknown, priority 0.3333\n"
    )
    rows = list(csv.DictReader(Path("c.csv").read_text().splitlines()))
    assert [row["strategy"] for row in rows] == ["nearest"] * 29 + ["priority"] * 27
    assert rows[28]["distance_m"] == "47"
    for strategy in ("nearest", "priority"):
        trace = json.loads(Path(f"t-{strategy}.json").read_text())
        assert trace["parameters"]["strategy"] == strategy


def test_a_pipeline(monkeypatch: pytest.MonkeyPatch, capsysbinary: Any) -> None:
    data = io.TextIOWrapper(io.BytesIO(Path(WORLD).read_bytes()))
    monkeypatch.setattr(sys, "stdin", data)
    assert frontier("-", "--robot", "5,9", "--json", "-") == 0
    said = capsysbinary.readouterr()
    assert json.loads(said.out)["input"][0]["file"] == "-"
    assert b"no frontier is left" in said.err


def test_a_place_in_metres_on_a_map_that_is_turned() -> None:
    grid = GridMap(np.zeros((2, 4), dtype=np.float32), 0.5, Pose2D(1, 2, np.pi / 2))
    for name, data in dump_map(grid, "world.yaml").items():
        Path(name).write_bytes(data)
    # Up in the map is left in the world: 0.7 m up and 1.6 m along.
    assert frontier("world.yaml", "--robot-xy", "0.3,3.6", "--json", "t.json") == 0
    assert json.loads(Path("t.json").read_text())["robots"] == [[0, 3]]


def test_several_robots_and_the_way_home(capsys: pytest.CaptureFixture[str]) -> None:
    two = ("--robot", "5,9", "--robot", "7,2", "--return-home", "--json", "t.json")
    assert frontier(WORLD, *two) == 0
    assert " of 2 robots" in capsys.readouterr().out
    steps = json.loads(Path("t.json").read_text())["steps"]
    home = {step["robot"]: step["goal"] for step in steps if step["kind"] == "home"}
    assert home == {0: [5, 9], 1: [7, 2]}


def test_a_known_map_that_is_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    Path("world.txt").write_text("0 0 1 0\n0 0 0 0\n")
    Path("known.txt").write_text("0 0 0 ?\n0 0 0 ?\n")
    assert frontier("world.txt", "--known", "known.txt", "--robot", "0,0") == 0
    said = capsys.readouterr()
    assert said.err == (
        "Warning: known.txt: 1 cell at odds with world.txt (open against obstacle); where they "
        "are sensed, the latter wins\n"
    )
    assert "corrected  1 cell of the known map\n" in said.out


def test_maps_of_one_cell_and_of_one_open_cell(capsys: pytest.CaptureFixture[str]) -> None:
    Path("one.txt").write_text("0\n")
    Path("closed.txt").write_text("1 1 1\n1 0 1\n1 1 1\n")
    outputs = ("--png", "p.png", "--gif", "g.gif", "--curve", "c.png", "--map", "m.txt")
    for world, robot in (("one.txt", "0,0"), ("closed.txt", "1,1")):
        assert frontier(world, "--robot", robot, *outputs) == 0
        assert "coverage 100.0%" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--robot", "99,9"], "robot 1 at 99,9 is outside the world; expected a row from 0 to 10, "
                              "a column from 0 to 15"),
        (["--robot", "0,0"], "robot 1 at 0,0 stands on an unknown cell of the world; expected an "
                             "open cell, below 0.5"),
        (["--robot", "1,5"], "robot 1 at 1,5 stands on an obstacle (1) of the world; expected an "
                             "open cell, below 0.5"),
        (["--robot", "5,9", "--robot-xy", "9.5,5.5"], "robots 1 and 2 both stand on 5,9; expected "
                                                      "a cell for each robot"),
        (["--robot-xy", "100,1e9"], "--robot-xy 100,1e+09 is outside the world; expected a "
                                      "place on its 16 x 11 m, whose bottom left corner is at "
                                      "0,0"),
        (["--robot", "5,9", "--robot-radius", "50"], "robot 1 at 5,9 with a radius of 50 m fits "
                                                     "nowhere that it could get to; expected a "
                                                     "smaller radius, or another start"),
    ],
)  # fmt: skip
def test_data_that_cannot_be(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert frontier(WORLD, *arguments) == 1
    assert capsys.readouterr().err == f"Error: {WORLD}: {message}\n"


@pytest.mark.parametrize(
    ("known", "message"),
    [
        ("0 0\n0 0\n", "the known map has 2 rows and 2 columns; expected 1 and 2 as in the world"),
        ("? 0\n", "robot 1 at 0,0 stands on an unknown cell of the known map; expected an open "
                  "cell, below 0.5"),
        ("0 x\n", "line 1, column 1: cell 'x'; expected a probability from 0 to 1, or ?"),
    ],
)  # fmt: skip
def test_errors_of_the_known_map_name_it(
    known: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("world.txt").write_text("0 0\n")
    Path("known.txt").write_text(known)
    assert frontier("world.txt", "--known", "known.txt", "--robot", "0,0") == 1
    assert capsys.readouterr().err == f"Error: known.txt: {message}\n"


def test_a_world_that_is_all_unknown(capsys: pytest.CaptureFixture[str]) -> None:
    Path("world.txt").write_text("? ?\n? ?\n")
    assert frontier("world.txt", "--robot", "0,0") == 1
    message = "the world is all unknown; expected a map with known cells"
    assert capsys.readouterr().err == f"Error: world.txt: {message}\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "Where does the robot stand? Add --robot ROW,COL or --robot-xy X,Y."),
        (["--robot", "5"], "'5' is not of the form ROW,COL."),
        (["--robot", "5,9", "--low", "0"], "0.0 is not in the range 0<x<=1."),
        (["--robot", "5,9", "--low", "1.2"], "1.2 is not in the range 0<x<=1."),
        (["--robot", "5,9", "--low", "nan"], "'nan' is not a finite number."),
        (["--robot", "5,9", "--png", "x.jpg"], "--png x.jpg: does not end in .png."),
        (["--robot", "5,9", "--plan", "--gif", "x.gif"], "with --plan nobody moves."),
        (["--robot", "5,9", "--json", "-", "--map", "-"], "Two results cannot both be written"),
        (["--robot", "5,9", "--strategy", "far"], "'far' is not one of"),
    ],
)
def test_wrong_usage(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert frontier(WORLD, *arguments) == 2
    assert message in " ".join(capsys.readouterr().err.split())


def test_nothing_is_replaced_that_must_not_be(capsys: pytest.CaptureFixture[str]) -> None:
    Path("world.txt").write_text("0 0\n")
    for arguments in (["--map", "world.txt"], ["--json", "t.json", "--no-clobber"]):
        Path("t.json").write_text("precious")
        assert frontier("world.txt", "--robot", "0,0", *arguments) == 1
        assert capsys.readouterr().err.startswith("Error: ")
        assert Path("world.txt").read_text() == "0 0\n"
        assert Path("t.json").read_text() == "precious"


MEASURED = """
import os, subprocess, sys
process = subprocess.Popen([sys.executable, "-m", "mapcli", *sys.argv[1:]])
_, status, used = os.wait4(process.pid, 0)
print(os.waitstatus_to_exitcode(status), 1024 * used.ru_maxrss)
"""


def peak_bytes(*arguments: str) -> int:
    """Of a command in a process of its own, which a small one starts: the memory of who starts a
    process counts as its child's."""
    command = [sys.executable, "-c", MEASURED, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    status, size = map(int, done.stdout.split())
    assert status == 0
    return size


@pytest.mark.slow
def test_a_large_map_takes_eight_bytes_a_cell(tmp_path: Path) -> None:
    # 1 km x 1 km at 5 cm, 400 million cells, is to be explored within 3 GB.
    peaks = []
    for side in (400, 5000):
        cells = np.full((side, side), 254, np.uint8)
        cells[::100, 50:] = 0
        (tmp_path / f"{side}.pgm").write_bytes(b"P5 %d %d 255\n" % (side, side) + cells.tobytes())
        options = (
            "-q",
            "--sensor-range",
            "300",
            "--max-steps",
            "5",
            "--png",
            str(tmp_path / "f.png"),
        )
        peaks.append(
            peak_bytes("frontier", str(tmp_path / f"{side}.pgm"), "--robot", "20,20", *options)
        )
    assert peaks[1] - peaks[0] < 8 * 5000**2


def test_limits(capsys: pytest.CaptureFixture[str]) -> None:
    """The run of Fig. 9.9 is complete after 28 steps."""
    kept = ("--fail-if", "steps>28", "--fail-if", "reason!=complete", "--fail-if", "coverage<1")
    assert frontier(*BOOK, "-q", *kept) == 0
    assert frontier(*BOOK, "-q", "--max-steps", "3", "--json", "t.json", *kept[2:]) == 3
    expected = f"{WORLD}: reason is max-steps; expected not reason!=complete (--fail-if)"
    assert capsys.readouterr().err == f"Error: {expected}\n"
    assert Path("t.json").exists()
    two = ("--strategy", "nearest", "--strategy", "priority", "--fail-if", "steps<29")
    assert frontier(*BOOK, "-q", *two) == 3
    assert f"{WORLD} (nearest): steps is 28" in capsys.readouterr().err
    assert frontier(*BOOK, "--fail-if", "reason==done") == 2
    assert "one of complete, unreachable, max-steps" in capsys.readouterr().err
