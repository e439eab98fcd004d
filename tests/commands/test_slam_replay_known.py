"""`mapcli slam-replay` in a known map, and without closing loops, as a user runs it."""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from conftest import SHARED
from support.replaying import APARTMENT, CORRIDOR, FIXTURES, Trace, files, replay, traced

from mapcli import Pose2D, load_map
from mapcli.model.pose import wrap_angle

CELL = 0.05

DATASETS = SHARED / "datasets"


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the map of the corridor, and the trace of the run that made it."""
    folder = tmp_path_factory.mktemp("mapped")
    assert replay("-q", CORRIDOR, "-o", str(folder)) == 0
    return folder


@pytest.fixture(autouse=True)
def folder(mapped: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The current folder, with the map in it."""
    monkeypatch.chdir(tmp_path)
    for name in ("map.yaml", "map.pgm"):
        shutil.copy(mapped / name, name)


@pytest.fixture
def usual(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Trace:
    """The trace of the run that made the map, without closing loops: its poses are the map's."""
    return traced(CORRIDOR)


def complaint(capsys: pytest.CaptureFixture[str]) -> str:
    heard = capsys.readouterr()
    assert heard.out == ""
    (line,) = heard.err.splitlines()
    return line


def assert_near(found: Trace, expected: Trace, first: int = 0) -> None:
    """All poses are within a cell and half a degree, from a first one on."""
    assert len(found["poses"]) == len(expected["poses"])
    pairs = list(zip(found["poses"], expected["poses"], strict=True))[first:]
    for k, (one, other) in enumerate(pairs):
        away = math.hypot(one["x"] - other["x"], one["y"] - other["y"])
        assert away < CELL, f"pose {k}: {away:.3f} m away"
        assert abs(wrap_angle(one["theta"] - other["theta"])) < math.radians(0.5), f"pose {k}"


# Localising


def test_localize_finds_the_poses_and_leaves_the_map(usual: Trace) -> None:
    found = traced(CORRIDOR, "--known", "map.yaml", "--localize", "--map", "after.yaml")
    assert_near(found, usual)
    assert Path("after.pgm").read_bytes() == Path("map.pgm").read_bytes()
    before, after = (yaml.safe_load(Path(name).read_text()) for name in ("map.yaml", "after.yaml"))
    assert {**after, "image": "map.pgm"} == before
    assert found["summary"]["loops"] == 0
    assert found["poses"][0]["score"] > 0.5  # it was found, not taken for granted


def test_localize_with_an_initial_pose(usual: Trace) -> None:
    where = ("--known", "map.yaml", "--localize", "--initial-pose")
    assert_near(traced(CORRIDOR, *where, "0,0,0"), usual)
    # The pose that a user reads off a map is a little wrong; that is put right at once.
    assert_near(traced(CORRIDOR, *where, "0.1,-0.08,4"), usual, first=1)


def test_the_first_pose_is_found_in_a_map_that_was_shifted(usual: Trace) -> None:
    meta = yaml.safe_load(Path("map.yaml").read_text())
    x, y, yaw = meta["origin"]
    Path("map.yaml").write_text(yaml.safe_dump({**meta, "origin": [x + 100.02, y - 7.01, yaw]}))
    found = traced(CORRIDOR, "--known", "map.yaml", "--localize")
    for pose in found["poses"]:
        pose["x"], pose["y"] = pose["x"] - 100.02, pose["y"] + 7.01
    assert_near(found, usual)


def test_a_later_part_of_the_log_is_found_where_it_was(usual: Trace) -> None:
    found = traced(CORRIDOR, "--known", "map.yaml", "--localize", "--start", "5")
    later = [p for p in usual["poses"] if p["stamp_ns"] >= found["poses"][0]["stamp_ns"]]
    assert 20 < len(later) < 30
    assert_near(found, {"poses": later})


def test_two_runs_give_the_same_bytes() -> None:
    known = ("--known", "map.yaml", "-q", CORRIDOR)
    assert replay(*known, "-o", "one") == 0
    assert replay(*known, "-o", "other") == 0
    for name in ("trace.json", "map.pgm", "map.yaml", "map.png"):
        assert Path("one", name).read_bytes() == Path("other", name).read_bytes()


# Going on


def test_a_known_map_goes_on(usual: Trace) -> None:
    # The map ends where the first half of the log did; the second half adds what it sees.
    assert replay("-q", CORRIDOR, "--end", "5", "--map", "half.yaml") == 0
    found = traced(CORRIDOR, "--known", "half.yaml", "--start", "4", "--map", "on.yaml")
    later = [p for p in usual["poses"] if p["stamp_ns"] >= found["poses"][0]["stamp_ns"]]
    assert_near(found, {"poses": later})
    half, on, whole = (load_map(name).grid for name in ("half.yaml", "on.yaml", "map.yaml"))
    assert half.known.sum() < on.known.sum()
    assert on.known.sum() == pytest.approx(whole.known.sum(), rel=0.05)
    # What was known is still there: walls, and open floor.
    for old, new in zip(*cells_of_both(half, on), strict=True):
        assert (new[old] | ~old[old]).mean() > 0.9


def cells_of_both(one, other) -> tuple[list[np.ndarray], list[np.ndarray]]:  # type: ignore
    """Walls and open floor of one map, and of the other at the same places."""
    rows, columns = (axis.ravel() for axis in np.indices(one.cells.shape))
    places = one.world_of_cells(rows, columns)
    there = other.cells_of_world(places)
    a, b = one.cells[rows, columns], other.cells[there[:, 0], there[:, 1]]
    return [a > 0.65, a < 0.25], [b > 0.65, b < 0.25]


def test_no_loops_are_closed_in_a_known_map() -> None:
    found = traced(APARTMENT, "--known", "map.yaml", "--initial-pose", "0,0,0", "--every", "10")
    assert found["summary"]["loops"] == 0
    assert found["parameters"]["loops"] is None


def test_the_trace_tells_where_it_began_and_in_which_map() -> None:
    told = traced(CORRIDOR, "--known", "map.yaml", "--initial-pose", "0.1,0,0")["parameters"]
    assert told["initial_pose"] == {"x": 0.1, "y": 0.0, "theta": 0.0}
    assert told["known"] == [
        {"file": name, "sha256": hashlib.sha256(Path(name).read_bytes()).hexdigest()}
        for name in ("map.yaml", "map.pgm")
    ]
    alone = traced(CORRIDOR)["parameters"]
    assert (alone["initial_pose"], alone["known"]) == (None, [])


def test_no_loop_closing() -> None:
    found = traced(APARTMENT, "--no-loop-closing", "--every", "3")
    assert found["summary"]["loops"] == 0
    assert found["loops"] == []
    assert found["parameters"]["loops"] is None
    closing = traced(APARTMENT, "--every", "3")
    assert closing["parameters"]["loops"] is not None


@pytest.mark.parametrize(
    ("options", "forgets", "detects"),
    [
        ((), True, True),
        (("--no-loop-closing",), False, True),
        (("--known", "map.yaml", "--initial-pose", "0.1,0,0"), False, True),
        (("--search", "book"), False, False),
        (("--search", "none"), False, False),
    ],
)
def test_failing_odometry_is_detected_where_poses_are_searched_for(
    options: tuple[str, ...], forgets: bool, detects: bool
) -> None:
    told = traced(CORRIDOR, *options)["parameters"]
    assert told["detect_odometry_faults"] is detects
    assert (told["local_map"]["max_length_m"] is not None) == forgets


# What cannot be


def test_localize_needs_a_map(capsys: pytest.CaptureFixture[str]) -> None:
    before = files()
    assert replay(CORRIDOR, "--localize") == 2
    assert "--localize needs --known" in capsys.readouterr().err
    assert files() == before


@pytest.mark.parametrize("pose", ["1,2", "1,2,x", "nan,0,0", "1,2,3,4"])
def test_an_initial_pose_that_is_none(pose: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert replay(CORRIDOR, "--known", "map.yaml", "--initial-pose", pose) == 2
    assert "--initial-pose" in capsys.readouterr().err


def test_a_map_without_walls(capsys: pytest.CaptureFixture[str]) -> None:
    Path("bare.txt").write_text("0 0 0\n0 ? 0\n")
    before = files()
    assert replay("-q", CORRIDOR, "--known", "bare.txt") == 1
    assert complaint(capsys) == "Error: bare.txt: no occupied cell; expected a map with walls"
    assert files() == before


def test_a_map_that_is_turned(capsys: pytest.CaptureFixture[str]) -> None:
    meta = yaml.safe_load(Path("map.yaml").read_text())
    x, y, _ = meta["origin"]
    Path("map.yaml").write_text(yaml.safe_dump({**meta, "origin": [x, y, math.pi / 2]}))
    before = files()
    assert replay("-q", CORRIDOR, "--known", "map.yaml", "--localize") == 1
    assert complaint(capsys).startswith("Error: map.yaml: the origin's yaw is 90 deg; expected 0")
    assert files() == before


@pytest.mark.parametrize(
    ("name", "content"), [("none.yaml", None), ("broken.yaml", "image: [\n"), ("m.jpg", "")]
)
def test_a_map_that_cannot_be_read(
    name: str, content: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    if content is not None:
        Path(name).write_text(content)
    before = files()
    assert replay("-q", CORRIDOR, "--known", name) == 1
    assert complaint(capsys).startswith(f"Error: {name}: ")
    assert files() == before


def test_a_robot_that_is_not_in_the_map(capsys: pytest.CaptureFixture[str]) -> None:
    # A closet of half a metre, as a map of 5 cm cells; the corridor does not fit into it.
    rows = ["1 " * 12, *["1 " + "0 " * 10 + "1"] * 10, "1 " * 12]
    Path("closet.txt").write_text("\n".join(["resolution: 0.05", *rows]))
    before = files()
    assert replay("-q", CORRIDOR, "--known", "closet.txt", "--localize") == 1
    line = complaint(capsys)
    assert "10 scans are found nowhere in the known map; expected a start pose" in line
    assert files() == before


@pytest.mark.parametrize("pose", ["0,0,0", "2,0.5,90", "100,0,0"])
def test_another_building(pose: str, capsys: pytest.CaptureFixture[str]) -> None:
    before = files()
    where = ("--known", "map.yaml", "--localize", "--initial-pose", pose)
    assert replay("-q", APARTMENT, *where) == 1
    line = complaint(capsys)
    assert "apartment.mcap: is not of the place in the known map: only " in line
    assert "; expected a start pose in it (--initial-pose), or another map" in line
    assert files() == before


@pytest.mark.parametrize(
    ("pose", "text"),
    [
        ("0,0,0", "only "),
        ("2,0.5,90", "only "),
        ("100,0,0", "the scans see nothing of the known map: it is of another place, or the start"),
    ],
)
def test_a_map_of_another_building_that_is_gone_on_from(
    pose: str, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    where = ("--known", "map.yaml", "--initial-pose", pose)
    assert replay(APARTMENT, *where, "--json", "trace.json") == 0
    summary = json.loads(Path("trace.json").read_text())["summary"]
    assert summary["verdict"] == "bad"
    reason = summary["reasons"][0]
    assert (reason["kind"], reason["try"]) == ("known_map", "--initial-pose X,Y,THETA_DEG")
    assert reason["text"].startswith(text)
    assert "verdict  bad\n" in capsys.readouterr().err
    assert replay("-q", APARTMENT, *where, "--json", "t.json", "--fail-if", "verdict!=good") == 3


def test_a_map_of_the_building_that_is_gone_on_from() -> None:
    assert replay("-q", CORRIDOR, "--known", "map.yaml", "--json", "trace.json") == 0
    assert json.loads(Path("trace.json").read_text())["summary"]["verdict"] == "good"


def test_a_sensor_of_one_beam_is_found_nowhere(capsys: pytest.CaptureFixture[str]) -> None:
    before = files()
    for more in ((), ("--localize",)):
        assert replay("-q", str(FIXTURES / "lateral.mcap"), "--known", "map.yaml", *more) == 1
        assert complaint(capsys) == (
            "Error: lateral.mcap: is found nowhere in the known map; expected a start pose in it "
            "(--initial-pose), or another map"
        )
    assert files() == before


@pytest.mark.slow
@pytest.mark.skipif(not DATASETS.is_dir(), reason="needs the shared datasets")
@pytest.mark.parametrize(
    ("log", "known", "options", "is_there"),
    [
        ("freiburg-101", "intel", (), False),
        ("freiburg-101", "intel", ("--initial-pose", "0,0,0"), False),
        ("intel", "csail", (), False),  # whose first scans fit somewhere
        ("csail", "csail", (), True),
        ("mit-csail", "csail", ("--initial-pose", "0,0,0"), True),  # another log of the building
    ],
)
def test_real_buildings(log: str, known: str, options: tuple[str, ...], is_there: bool) -> None:
    paths = [str(DATASETS / f"{name}.log.gz") for name in (log, known)]
    assert replay("-q", paths[1], "--map", "known.yaml") == 0
    before = files()
    status = replay("-q", paths[0], "--known", "known.yaml", "--localize", *options, "-o", "there")
    assert status == (0 if is_there else 1)
    assert (files() == before) != is_there


def test_the_known_map_is_never_replaced(capsys: pytest.CaptureFixture[str]) -> None:
    before = Path("map.pgm").read_bytes()
    assert replay("-q", CORRIDOR, "--known", "map.yaml", "--map", "./map.yaml") == 1
    assert complaint(capsys).startswith("Error: ./map.yaml: is one of ")
    assert Path("map.pgm").read_bytes() == before


def test_the_initial_pose_is_in_the_maps_frame(usual: Trace) -> None:
    first = usual["poses"][0]
    found = traced(CORRIDOR, "--initial-pose", "3,4,90")
    start = Pose2D(3, 4, math.pi / 2)
    begin, end = found["poses"][0], usual["poses"][-1]
    assert (begin["x"], begin["y"]) == (3, 4)
    expected = start.compose(
        Pose2D(first["x"], first["y"], first["theta"]).between(
            Pose2D(end["x"], end["y"], end["theta"])
        )
    )
    last = found["poses"][-1]
    assert math.hypot(last["x"] - expected.x, last["y"] - expected.y) < CELL
