"""`mapcli convert` of traces: every format into every other, and what is lost on the way."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import FIXTURES, run

from mapcli.formats.documents.json_document import json_bytes
from mapcli.formats.documents.load_trace import load_trace
from mapcli.formats.documents.load_trajectory import load_trajectory
from mapcli.formats.documents.pose_trace import trace_document
from mapcli.model.pose import Pose2D
from mapcli.model.trace import Loop, PoseTrace, TracedPose

Capture = pytest.CaptureFixture[str]

TRACE = PoseTrace(
    (
        TracedPose(1_600_000_000_000_000_001, Pose2D(0.5, 0, 0.25), None, None, "first"),
        TracedPose(1_600_000_000_200_000_000, Pose2D(1, -2.5, 1.5), Pose2D(1.1, -2, 1.5), 0.9123,
                   "matched"),
        TracedPose(1_600_000_001_000_000_000, Pose2D(1, -1.5, -3), Pose2D(1, -1, 3), None,
                   "odometry"),
    ),
    (Loop(2, 0, Pose2D(1, -1.5, 3), 0.8),),
)  # fmt: skip
SUMMARY = {"verdict": "good"}


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    content = trace_document(TRACE, {}, {"every": 1}, SUMMARY)
    Path("trace.json").write_bytes(json_bytes(content))


LOST = {
    ".csv": "loops and summary",
    ".tum": "odometry, scores, statuses, loops and summary",
    ".kitti": "times, odometry, scores, statuses, loops and summary",
    ".g2o": "times, odometry, scores, statuses and summary",
}


@pytest.mark.parametrize("suffix", LOST)
def test_there_and_back(suffix: str, capsys: Capture) -> None:
    assert run("convert", "trace.json", f"x{suffix}") == 0
    assert capsys.readouterr().err == f"Note: x{suffix}: {LOST[suffix]} of IN are lost\n"
    assert run("convert", f"x{suffix}", "back.json") == 0
    told = capsys.readouterr().err
    assert ("no times" in told) == ("times" in LOST[suffix])
    back = load_trace("back.json")
    np.testing.assert_allclose(back.trajectory().poses, TRACE.trajectory().poses, rtol=0, atol=2e-6)
    stamps = [pose.stamp_ns for pose in back.trace.poses]
    assert stamps == (
        [0, 10**9, 2 * 10**9] if "times" in LOST[suffix] else [p.stamp_ns for p in TRACE.poses]
    )
    kept = suffix == ".csv"
    assert [p.odom for p in back.trace.poses] == [p.odom if kept else None for p in TRACE.poses]
    assert [p.score for p in back.trace.poses] == [p.score if kept else None for p in TRACE.poses]
    assert [p.status for p in back.trace.poses] == [p.status if kept else None for p in TRACE.poses]
    motions = [(loop.from_, loop.to, loop.pose) for loop in back.trace.loops]
    assert motions == ([(2, 0, TRACE.loops[0].pose)] if suffix == ".g2o" else [])
    assert json.loads(Path("back.json").read_text())["summary"]["converted_from"]


def test_json_stays_what_it_is(capsys: Capture) -> None:
    assert run("convert", "trace.json", "again.json") == 0
    assert capsys.readouterr().err == ""
    before, after = (json.loads(Path(f).read_text()) for f in ("trace.json", "again.json"))
    assert [one["file"] for one in after.pop("input")] == ["trace.json"]
    del before["input"]
    assert after == before


@pytest.mark.parametrize("suffix", [".tum", ".kitti", ".csv", ".g2o"])
def test_a_format_into_itself_is_the_same(suffix: str) -> None:
    assert run("convert", "trace.json", f"a{suffix}", "-q") == 0
    assert run("convert", f"a{suffix}", f"b{suffix}", "-q") == 0
    first, second = (Path(name + suffix).read_text().splitlines() for name in "ab")
    assert len(first) == len(second)
    if suffix == ".csv":
        assert first == second


def test_the_information_of_a_loop_stays() -> None:
    edge = "EDGE_SE2 1 0 0.5 0.25 0 900 1 2 800 3 700"
    Path("a.g2o").write_text(f"VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n{edge}\n")
    assert run("convert", "a.g2o", "b.g2o", "-q") == 0
    last = Path("b.g2o").read_text().splitlines()[-1]
    assert last == "EDGE_SE2 1 0 0.500000 0.250000 0.000000 900 1 2 800 3 700"


def test_the_poses_of_an_mcap_file(capsys: Capture) -> None:
    log = FIXTURES / "corridor.mcap"
    assert run("convert", log, "truth.tum", "-v") == 0
    assert capsys.readouterr().err == "truth.tum: 101 poses\n"
    assert run("convert", log, "wheels.tum", "--topic", "/odom", "-q") == 0
    assert Path("truth.tum").read_bytes() != Path("wheels.tum").read_bytes()
    truth, want = (load_trajectory(str(file)).trajectory for file in ("truth.tum", log))
    np.testing.assert_allclose(truth.poses, want.poses, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(truth.stamps_ns, want.stamps_ns)


def test_standard_output(capsys: Capture) -> None:
    assert run("convert", "trace.json", "-", "-q") == 0
    assert capsys.readouterr().out.startswith("stamp_ns,x,y,theta,")
    assert run("convert", "trace.json", "-", "--to", "tum", "-q") == 0
    assert capsys.readouterr().out.startswith("1600000000.000000001 0.500000 ")


@pytest.mark.parametrize(
    ("arguments", "status", "error"),
    [
        (("trace.json", "x.tum", "--mode", "scale"), 2, "--mode is for maps, and OUT is a trace."),
        (("trace.json", "x.yaml", "--topic", "/a"), 2, "--topic is for traces, and OUT is a map."),
        (("trace.json", "x.tum", "--topic", "/a"), 1, "trace.json: has no topic /a; expected a"),
        (("trace.json", "x.yaml"), 1, "trace.json: is a pose trace; draw it with mapcli render"),
        (("bad.g2o", "x.tum"), 1, "bad.g2o: line 2: there is no vertex 7"),
        (("bad.json", "x.tum"), 1, "bad.json: loops: has a value of another kind; expected a list"),
        (("map.txt", "x.tum"), 1, "map.txt: is a text map; draw it with mapcli render"),
    ],
)
def test_what_does_not_go(
    arguments: tuple[str, ...], status: int, error: str, capsys: Capture
) -> None:
    Path("bad.g2o").write_text("VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 7 0 0 0 1 0 0 1 0 1\n")
    content = trace_document(TRACE, {}, {}, {}) | {"loops": [{"from": 0, "to": 9}]}
    Path("bad.json").write_bytes(json_bytes(content))
    Path("map.txt").write_text("0 0 1\n? 0 1\n")
    assert run("convert", *arguments) == status
    assert f"Error: {error}" in capsys.readouterr().err
    assert not Path("x.tum").exists()


SUFFIXES = [".json", *LOST]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_whatever_reads_a_trace_reads_every_format(suffix: str, capsys: Capture) -> None:
    room = FIXTURES / "corner.txt"
    Path("drive.csv").write_text(
        "stamp_ns,x,y,theta\n" + "".join(f"{k * 10**9},{x},{y},{theta}\n" for k, (x, y, theta)
        in enumerate([(2, 2, 0), (4, 2, 0), (6, 2, 0), (6, 4, 1.57), (6, 6, 1.57)])))  # fmt: skip
    if suffix != ".csv":
        assert run("convert", "drive.csv", f"drive{suffix}", "-q") == 0
    drive = f"drive{suffix}"
    assert run("render", room, "--png", "a.png", "--trace", drive) == 0
    assert run("rectify", drive, "straight.tum", "--shortest-wall", "1", "-q") == 0
    assert run("transform", room, "m.txt", "--shift", "1,0", "--trace", drive, "t.csv", "-q") == 0
    assert load_trajectory("t.csv").trajectory.poses[1, :2].tolist() == [5, 2]
    assert run("evaluate", drive, "drive.csv", "-q") == 0
    Path("world.yaml").write_text("polygons: [[[9, 9], [10, 9], [10, 10]]]\n")
    assert run("simulate", "world.yaml", "--path", drive, "o.mcap", "--beams", 4) == 0
    assert "7.9 m in" in capsys.readouterr().err
