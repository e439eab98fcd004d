"""`mapcli transform` as a user runs it."""

from __future__ import annotations

import io
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import run

from mapcli import GridMap, Pose2D, load_map, move
from mapcli.algorithms.maps.transform import bake_yaw
from mapcli.cli import main
from mapcli.formats.documents.load_trajectory import load_trajectory
from mapcli.formats.maps.save import dump_map

CELLS = np.array([[1, np.nan, 0, 0], [1, 0, 0, np.nan], [1, 1, 1, np.nan]], dtype=np.float32)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, data in dump_map(GridMap(CELLS, 0.5, Pose2D(-1, 2)), "m.yaml").items():
        Path(name).write_bytes(data)
    return tmp_path


def transform(*arguments: str) -> int:
    return run("transform", *arguments)


def trace() -> None:
    poses = [
        {"stamp_ns": 1, "x": 0.0, "y": 2.5, "theta": 0.0,
         "odom": {"x": 0.0, "y": 0.5, "theta": 0.1}, "score": None, "status": "first"},
        {"stamp_ns": 2, "x": 0.5, "y": 2.5, "theta": 1.0,
         "odom": None, "score": 0.5, "status": "matched"},
    ]  # fmt: skip
    loops = [{"from": 0, "to": 1, "dx": 0.5, "dy": 0.25, "dtheta": 1.0, "score": 0.9}]
    content = {"format": "mapcli.pose-trace", "version": 1, "parameters": {"a": 1},
               "summary": {"scans": 2}, "loops": loops, "poses": poses}  # fmt: skip
    Path("t.json").write_text(json.dumps(content))


def test_operations_run_in_the_order_given(capsys: pytest.CaptureFixture[str]) -> None:
    assert transform("m.yaml", "a.txt", "--shift", "1,0", "--rotate", "90", "-q") == 0
    assert transform("m.yaml", "b.txt", "--rotate", "90", "--shift", "1,0", "-q") == 0
    shift_twice = ("--shift", "0.25,0", "--rotate", "90", "--shift", "1,0", "--shift", "0,-0.25")
    assert transform("m.yaml", "c.txt", *shift_twice, "-q") == 0
    assert load_map("a.txt").grid.origin == Pose2D(-3.5, 0)  # the far corner 0, 3.5 turned
    assert load_map("b.txt").grid.origin == Pose2D(-2.5, -1)
    assert load_map("c.txt").grid.origin == Pose2D(-2.5, -1)
    for name in ("a.txt", "b.txt", "c.txt"):
        assert np.array_equal(load_map(name).grid.cells, np.rot90(CELLS), equal_nan=True)
    assert capsys.readouterr() == ("", "")


def test_report(capsys: pytest.CaptureFixture[str]) -> None:
    assert transform("m.yaml", "a.yaml", "--crop", "-1,2,0.2,3", "--flip", "left-right") == 0
    assert capsys.readouterr() == (
        "       map  2 rows, 3 columns of 0.5 m; origin x -0.5 m, y 2 m, yaw 0 deg\n"
        "     world  mirrored (y turned around), then turned by -180 deg, moved by x 0 m, y 0 m\n"
        "   written  a.pgm, a.yaml\n",
        "",
    )
    assert transform("m.yaml", "a.yaml", "--crop", "known") == 0
    assert "     world  stays where it was\n" in capsys.readouterr().out


def test_a_trace_moves_along() -> None:
    trace()
    assert transform("m.yaml", "a.yaml", "--rotate", "90", "--trace", "t.json", "n.json") == 0
    poses = load_trajectory("n.json").trajectory.poses
    assert poses == pytest.approx(
        np.array([[-2.5, 0, math.pi / 2], [-2.5, 0.5, 1 + math.pi / 2]]), abs=1e-6
    )
    content = json.loads(Path("n.json").read_text())
    assert content["parameters"] == {
        "a": 1,
        "moved_by": {"x": 0.0, "y": 0.0, "theta": 1.570796, "mirrored": False},
    }
    assert content["summary"] == {"scans": 2}
    assert content["poses"][0]["odom"] == {"x": 0.0, "y": 0.5, "theta": 0.1}
    assert content["loops"][0]["dy"] == 0.25


def test_a_mirrored_trace_steps_to_the_other_side() -> None:
    trace()
    assert transform("m.yaml", "a.yaml", "--flip", "up-down", "--trace", "t.json", "n.json") == 0
    assert load_trajectory("n.json").trajectory.poses.tolist() == [[0, -2.5, 0], [0.5, -2.5, -1]]
    content = json.loads(Path("n.json").read_text())
    assert content["poses"][0]["odom"] == {"x": 0.0, "y": -0.5, "theta": -0.1}
    assert (content["loops"][0]["dy"], content["loops"][0]["dtheta"]) == (-0.25, -1)


def test_bake_yaw_and_set_origin() -> None:
    assert transform("m.yaml", "a.yaml", "--origin", "1,1,90", "-q") == 0
    assert load_map("a.yaml").grid.origin == Pose2D(1, 1, math.pi / 2)
    assert transform("a.yaml", "b.yaml", "--bake-yaw", "-q") == 0
    grid = load_map("b.yaml").grid
    assert grid.origin == Pose2D(-0.5, 1, 0)
    assert np.array_equal(grid.cells, np.rot90(CELLS), equal_nan=True)


def test_merge_by_origin_by_motion_and_to_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert transform("m.yaml", "a.yaml", "--merge", "m.yaml@2,0,0", "--json", "a.json") == 0
    assert "m.yaml: turned by 0 deg, moved by x 2 m, y 0 m; score" in capsys.readouterr().out
    both = load_map("a.yaml").grid
    assert np.array_equal(both.cells, np.hstack([CELLS, CELLS]), equal_nan=True)
    content = json.loads(Path("a.json").read_text())
    assert content["format"] == "mapcli.map-transform"
    assert content["parameters"]["operations"] == [
        {"merge": "m.yaml", "motion": {"x": 2.0, "y": 0.0, "theta": 0.0}}
    ]
    assert content["columns"] == 8
    assert transform("m.yaml", "b.yaml", "--merge", "a.yaml", "-q") == 0
    assert np.array_equal(load_map("b.yaml").grid.cells, both.cells, equal_nan=True)


@pytest.mark.slow
def test_align_and_merge_by_search(capsys: pytest.CaptureFixture[str]) -> None:
    cells = np.zeros((90, 120), dtype=np.uint8)
    cells[[0, -1]], cells[:, [0, -1]], cells[30, :70], cells[50:, 80] = 100, 100, 100, 100
    grid = GridMap(cells, 0.1)
    turned = bake_yaw(move(grid, Pose2D(2, 1, 0.3))[0])
    for name, made in (("straight.yaml", grid), ("turned.yaml", turned)):
        for file, data in dump_map(made, name).items():
            Path(file).write_bytes(data)
    trace()
    aligned = ("--align", "--crop", "known", "--trace", "t.json", "n.json", "--json", "a.json")
    assert transform("turned.yaml", "a.yaml", *aligned) == 0
    assert capsys.readouterr().out.startswith("     align  walls at 17.")
    world = json.loads(Path("a.json").read_text())["world"]
    assert world["theta"] == pytest.approx(-0.3, abs=0.003)
    turned = load_trajectory("n.json").trajectory.poses[0, 2]
    assert turned == pytest.approx(world["theta"], abs=1e-6)
    assert transform("straight.yaml", "m.yaml", "--merge", "turned.yaml@search", "-q") == 0
    both = load_map("m.yaml").grid
    assert abs(both.rows - 90) <= 4
    assert abs(both.columns - 120) <= 4


def test_graded_images_stay_graded() -> None:
    cells = np.array([[0.25, 0.5, np.nan]], dtype=np.float32)
    for name, data in dump_map(GridMap(cells), "g.txt").items():
        Path(name).write_bytes(data)
    with pytest.raises(SystemExit):
        main(["convert", "g.txt", "g.yaml", "--mode", "scale"])
    assert transform("g.yaml", "h.yaml", "--flip", "left-right") == 0
    assert np.array_equal(load_map("h.yaml").grid.cells, cells[:, ::-1], equal_nan=True)


def test_pipeline(
    capsysbinary: pytest.CaptureFixture[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert transform("m.yaml", "-", "--flip", "up-down") == 0
    first = capsysbinary.readouterr().out
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(first)))
    assert transform("-", "-", "--flip", "up-down", "-q") == 0
    out, err = capsysbinary.readouterr()
    assert out.startswith(b"resolution: 0.5\norigin: -1.0, 2.0, 0.0\n1 ? 0 0\n")
    assert err == b""


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["m.yaml", "a.yaml"], 2, "No operation given"),
        (["m.yaml", "a.yaml", "--crop", "1,2,3"], 2, "not of the form LEFT,BOTTOM,RIGHT,TOP"),
        (["m.yaml", "a.yaml", "--rotate", "nan"], 2, "--rotate"),
        (["m.yaml", "a.yaml", "--merge", "m.yaml@1,2"], 2, "not of the form X,Y,YAW_DEG"),
        (
            ["m.yaml", "a.yaml", "--crop", "8,8,9,9"],
            1,
            "Error: m.yaml, m.pgm: the box to crop to lies outside",
        ),
        (["m.yaml", "a.yaml", "--merge", "no.yaml"], 1, "Error: no.yaml: no such file"),
        (["m.yaml", "a.yaml", "--resample", "1e-9"], 1, "the result would have"),
        (["m.yaml", "m.pgm", "--crop", "known"], 1, "Error: m.pgm: is part of IN and would change"),
        (["m.yaml", "a.yaml", "--shift", "1,1", "--trace", "no.json", "b.json"], 1, "no.json: no"),
    ],
)
def test_errors(
    arguments: list[str], code: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert transform(*arguments) == code
    assert message in capsys.readouterr().err
    assert not Path("a.yaml").exists()


def test_cells_are_set(capsys: pytest.CaptureFixture[str]) -> None:
    changes = "--set", "0,1=0.25", "--set", "2,3:1,2=1", "--set", "0,0=?"
    assert transform("m.yaml", "set.txt", *changes, "--json", "set.json") == 0
    wanted = CELLS.copy()
    wanted[0, 0], wanted[0, 1], wanted[1:, 2:] = np.nan, 0.25, 1
    made = load_map("set.txt").grid
    np.testing.assert_array_equal(made.cells, wanted)
    assert (made.resolution, made.origin) == (0.5, Pose2D(-1, 2))
    assert "2,3:1,2=1: 3 cells changed" in capsys.readouterr().out  # (2, 2) was 1 before
    done = json.loads(Path("set.json").read_text())
    assert done["parameters"]["operations"][0] == {"set": "0,1=0.25"}


@pytest.mark.parametrize("wrong", ["0,1", "0,1=2", "0,1=-0.5", "-1,0=1", "0,1:2=1", "0.5,1=1"])
def test_what_is_no_set_is_wrong_usage(wrong: str) -> None:
    assert transform("m.yaml", "set.txt", "--set", wrong) == 2


def test_a_cell_outside_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert transform("m.yaml", "set.txt", "--set", "0,0:3,0=1") == 1
    problem = "Error: m.yaml, m.pgm: cell 3,0 is outside the map; expected a cell of its"
    assert capsys.readouterr().err.startswith(problem)
    assert not Path("set.txt").exists()
