"""`mapcli slam-replay` as a user runs it: what it writes, says and accepts."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import math
import os
import signal
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from PIL import Image
from support.replaying import APARTMENT, CORRIDOR, Trace, files, replay, traced, write_log

from mapcli import Pose2D, __version__, load_map, open_log
from mapcli.algorithms.slam.slam import Slam
from mapcli.cli import main
from mapcli.commands._replay_outputs import default_folder
from mapcli.formats.logs.ros import messages as ros
from mapcli.model.scan import Mount, Odometry, RangeScan, Record
from mapcli.model.trace import TracedPose

USUAL = ["map.pgm", "map.png", "map.yaml", "trace.json"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that a replay of the corridor without options writes."""
    folder = tmp_path_factory.mktemp("usual") / "corridor-slam"
    assert replay("-q", CORRIDOR, "-o", str(folder)) == 0
    return folder


@pytest.fixture(scope="module")
def corridor(usual: Path) -> Trace:
    return dict(json.loads((usual / "trace.json").read_text()))


@pytest.fixture(scope="module")
def records() -> list[Record]:
    return list(open_log([CORRIDOR]).records())


def in_own_process(*arguments: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-m", "mapcli", "slam-replay", *arguments],
        capture_output=True,
        check=False,
        env={**os.environ, **environment},
    )


# What is written


def test_without_options_the_usual_files_in_a_folder_named_after_the_log(usual: Path) -> None:
    assert replay("-q", CORRIDOR) == 0
    assert files() == [f"corridor-slam/{name}" for name in USUAL]
    for name in USUAL:
        assert Path("corridor-slam", name).read_bytes() == (usual / name).read_bytes()


@pytest.mark.parametrize(
    ("log", "folder"),
    [("a/robot.log.gz", "robot-slam"), ("r.mcap", "r-slam"), ("-", "stdin-slam"),
     ("bag/", "bag-slam"), ("x.y.CLF", "x.y-slam"), ("plain", "plain-slam")],
)  # fmt: skip
def test_names_of_folders(log: str, folder: str) -> None:
    assert default_folder(log) == folder


def test_a_folder_and_one_more_file(usual: Path) -> None:
    assert replay("-q", CORRIDOR, "-o", "out/deep", "--trace", "p.tum", "--png", "my.png") == 0
    assert files() == ["my.png", *(f"out/deep/{n}" for n in USUAL if n != "map.png"), "p.tum"]
    assert Path("my.png").read_bytes() == (usual / "map.png").read_bytes()


@pytest.mark.parametrize(
    ("option", "name", "written"),
    [("--png", "m.png", ["m.png"]), ("--map", "m.yaml", ["m.pgm", "m.yaml"]),
     ("--map", "m.pgm", ["m.pgm"]), ("--map", "m.png", ["m.png"]), ("--map", "m.txt", ["m.txt"]),
     ("--json", "new/t.json", ["new/t.json"]), ("--trace", "t.tum", ["t.tum"]),
     ("--trace", "t.kitti", ["t.kitti"]), ("--trace", "t.g2o", ["t.g2o"]),
     ("--trace", "t.csv", ["t.csv"]), ("--mcap", "r.mcap", ["r.mcap"])],
)  # fmt: skip
def test_single_outputs_are_all_that_is_written(
    option: str, name: str, written: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert replay(CORRIDOR, option, name) == 0
    assert files() == written
    heard = capsys.readouterr()
    assert heard.out == ""
    last, verdict = (line.split(maxsplit=1) for line in heard.err.splitlines()[-2:])
    assert verdict == ["verdict", "good"]
    assert last[0] == "written"
    assert all(Path(file).name in last[1] for file in written)


@pytest.mark.slow
def test_two_runs_give_the_same_bytes_whatever_the_number_of_threads(usual: Path) -> None:
    for threads in ("1", "2"):
        done = in_own_process("-q", CORRIDOR, "-o", threads, NUMBA_NUM_THREADS=threads)
        assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")
        for name in USUAL:
            assert Path(threads, name).read_bytes() == (usual / name).read_bytes(), name


# The trace


def test_the_trace_document(corridor: Trace) -> None:
    assert list(corridor) == [
        "format", "version", "mapcli", "input", "parameters", "summary", "files", "loops", "poses",
    ]  # fmt: skip
    assert corridor["format"] == "mapcli.pose-trace"
    assert corridor["version"] == 1
    assert corridor["mapcli"] == __version__
    digest = hashlib.sha256(Path(CORRIDOR).read_bytes()).hexdigest()
    assert corridor["input"] == [{"file": "corridor.mcap", "sha256": digest}]
    assert corridor["parameters"]["every"] == 1
    assert corridor["parameters"]["map"]["resolution"] == 0.05
    assert corridor["parameters"]["match"]["search"] == "window"
    assert isinstance(corridor["loops"], list)


def test_every_scan_has_a_pose(corridor: Trace, records: list[Record]) -> None:
    stamps = [record.stamp_ns for record in records if isinstance(record, RangeScan)]
    assert [pose["stamp_ns"] for pose in corridor["poses"]] == stamps
    for pose in corridor["poses"]:
        assert list(pose) == ["stamp_ns", "x", "y", "theta", "odom", "score", "status"]
        assert list(pose["odom"]) == ["x", "y", "theta"]
    first, *others = corridor["poses"]
    assert (first["status"], first["score"]) == ("first", None)
    assert (first["x"], first["y"], first["theta"]) == (0, 0, 0)
    assert {pose["status"] for pose in others} == {"matched"}
    assert all(0 < pose["score"] <= 1 for pose in others)


def test_the_summary(corridor: Trace) -> None:
    summary = corridor["summary"]
    assert list(summary) == [
        "scans", "used", "used_share", "lost_share", "matched", "odometry", "skipped",
        "distance_m", "duration_s", "loops", "unjoined", "mean_score", "odometry_jumps",
        "odometry_faults", "odometry_catch_ups", "damage", "interrupted", "verdict", "reasons",
    ]  # fmt: skip
    assert (summary["scans"], summary["used"], summary["used_share"]) == (50, 50, 1)
    assert summary["lost_share"] == 0
    assert (summary["matched"], summary["odometry"]) == (49, 0)
    assert (summary["skipped"], summary["damage"], summary["interrupted"]) == ({}, {}, False)
    assert summary["duration_s"] == 9.8
    assert summary["loops"] == len(corridor["loops"])
    scores = [pose["score"] for pose in corridor["poses"][1:]]
    assert summary["mean_score"] == pytest.approx(np.mean(scores), abs=1e-4)
    places = np.array([(pose["x"], pose["y"]) for pose in corridor["poses"]])
    driven = np.hypot(*np.diff(places, axis=0).T).sum()
    assert summary["distance_m"] == pytest.approx(driven, abs=1e-3)


def test_poses_for_other_tools_are_those_of_the_trace(corridor: Trace) -> None:
    assert replay("-q", CORRIDOR, "--trace", "t.tum") == 0
    tum = np.loadtxt("t.tum")
    poses = corridor["poses"]
    assert tum[:, 1:3].tolist() == [[pose["x"], pose["y"]] for pose in poses]
    assert tum[:, 6] == pytest.approx([math.sin(pose["theta"] / 2) for pose in poses], abs=1e-6)
    lines = Path("t.tum").read_text().splitlines()
    assert [line.split()[0].replace(".", "") for line in lines] == [
        str(pose["stamp_ns"]) for pose in poses
    ]


def truth_of(log: str) -> tuple[np.ndarray, np.ndarray]:
    """Stamps, shape (n,), and true poses, shape (n, 3), of a simulated log."""
    stamps, poses = [], []
    with Path(log).open("rb") as file:
        for schema, _, message in make_reader(file).iter_messages(topics=["/ground_truth"]):
            pose = ros.typestore().deserialize_cdr(message.data, schema.name).pose  # type: ignore
            stamps.append(message.log_time)
            turn = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
            poses.append((pose.position.x, pose.position.y, turn))
    return np.array(stamps), np.array(poses)


def seen_from_the_first(rows: np.ndarray) -> np.ndarray:
    first = Pose2D(*rows[0])
    return np.array([(p.x, p.y, p.theta) for p in (first.between(Pose2D(*row)) for row in rows)])


def test_poses_are_right_to_a_few_centimetres_where_odometry_is_a_metre_off() -> None:
    poses = traced(APARTMENT)["poses"]
    stamps, truth = truth_of(APARTMENT)
    row_of = {stamp: row for row, stamp in enumerate(stamps)}
    true = seen_from_the_first(truth[[row_of[pose["stamp_ns"]] for pose in poses]])

    def errors(found: list[dict[str, float]]) -> tuple[float, float]:
        rows = seen_from_the_first(np.array([(p["x"], p["y"], p["theta"]) for p in found]))
        metres = np.hypot(*(rows - true)[:, :2].T).max()
        turns = np.abs((rows - true)[:, 2] + np.pi) % (2 * np.pi) - np.pi
        return float(metres), math.degrees(np.abs(turns).max())

    metres, degrees = errors(poses)
    assert metres < 0.08
    assert degrees < 1
    odometry_metres, odometry_degrees = errors([pose["odom"] for pose in poses])
    assert odometry_metres > 0.5
    assert odometry_degrees > 10


# The map


@pytest.mark.parametrize("inclusive", [True, False], ids=["nav2 since 2024", "nav2 before, ROS 1"])
def test_map_servers_read_the_map_as_it_is_meant(usual: Path, inclusive: bool) -> None:
    assert replay("-q", CORRIDOR, "--map", "m.txt") == 0
    cells = load_map("m.txt").grid.cells
    meta = yaml.safe_load((usual / "map.yaml").read_text())
    grey = np.asarray(Image.open(usual / meta["image"]))
    occupancy = (255 - grey.astype(float)) / 255
    occupied, free = meta["occupied_thresh"], meta["free_thresh"]
    served = np.full(grey.shape, -1)
    served[occupancy >= occupied if inclusive else occupancy > occupied] = 100
    served[occupancy <= free if inclusive else occupancy < free] = 0
    unknown, between = np.isnan(cells), (cells > 0.25) & (cells < 0.65)
    assert (served[unknown] == -1).all()
    assert (served[between] == -1).all()
    assert (served[cells <= 0.25] == 0).all()
    assert (served[cells >= 0.65] == 100).all()
    assert min((served == value).sum() for value in (-1, 0, 100)) > 100
    assert (meta["resolution"], meta["mode"], meta["negate"]) == (0.05, "trinary", 0)


def test_the_map_lies_where_the_poses_are(usual: Path, corridor: Trace) -> None:
    grid = load_map(usual / "map.yaml").grid
    for pose in corridor["poses"]:
        column = (pose["x"] - grid.origin.x) / grid.resolution
        row = grid.rows - (pose["y"] - grid.origin.y) / grid.resolution
        assert grid.cells[int(row), int(column)] == 0  # where the robot drove, it is open


def test_the_picture_is_a_picture(usual: Path) -> None:
    with Image.open(usual / "map.png") as picture:
        picture.load()
        assert picture.width > 500


# The result as MCAP


def test_result_mcap(corridor: Trace) -> None:
    assert replay("-q", CORRIDOR, "--mcap", "r.mcap", "--map", "m.txt") == 0
    found: dict[str, list[Any]] = {}
    with Path("r.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            content = ros.typestore().deserialize_cdr(message.data, schema.name)
            found.setdefault(channel.topic, []).append((message.log_time, content))
    assert {topic: len(messages) for topic, messages in found.items()} == {
        "/tf": 50, "/pose": 50, "/path": 1, "/map": 1,
    }  # fmt: skip
    poses = corridor["poses"]
    for pose, (stamp, message), (_, tf) in zip(poses, found["/pose"], found["/tf"], strict=True):
        assert stamp == pose["stamp_ns"]
        assert message.header.frame_id == tf.transforms[0].header.frame_id == "map"
        assert message.pose.position.x == pytest.approx(pose["x"], abs=1e-6)
        turn = tf.transforms[0].transform.rotation
        assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(pose["theta"], abs=1e-6)
    assert len(found["/path"][0][1].poses) == 50
    grid, served = load_map("m.txt").grid, found["/map"][0][1]
    assert (served.info.width, served.info.height) == (grid.columns, grid.rows)
    assert served.info.origin.position.x == grid.origin.x
    cells = np.flipud(served.data.reshape(grid.rows, grid.columns))
    assert np.array_equal(cells == -1, np.isnan(grid.cells))
    assert np.nanmax(np.abs(cells / 100 - grid.cells)) <= 0.0051


def test_others_read_the_result(tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    assert replay("-q", CORRIDOR, "--mcap", "r.mcap") == 0
    with AnyReader([tmp_path / "r.mcap"]) as reader:
        types = {connection.topic: connection.msgtype for connection in reader.connections}
        (map_,) = (c for c in reader.connections if c.topic == "/map")
        (grid,) = (reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages([map_]))
    assert types == {
        "/tf": "tf2_msgs/msg/TFMessage",
        "/pose": "geometry_msgs/msg/PoseStamped",
        "/path": "nav_msgs/msg/Path",
        "/map": "nav_msgs/msg/OccupancyGrid",
    }
    assert set(np.unique(grid.data)) <= set(range(-1, 101))  # type: ignore[attr-defined]


# Pipelines and what is said


def test_json_on_standard_output_is_alone_there(
    usual: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    assert replay(CORRIDOR, "--json", "-") == 0
    heard = capfdbinary.readouterr()
    alone, beside = json.loads(heard.out), json.loads((usual / "trace.json").read_bytes())
    assert alone.pop("files") == []
    assert [one["file"] for one in beside.pop("files")] == ["map.pgm", "map.yaml", "map.png"]
    assert alone == beside
    assert heard.err.splitlines()[-2] == b"      written  standard output"
    assert files() == []


@pytest.mark.parametrize(
    ("option", "start"),
    [("--trace", b"stamp_ns,x,y,theta"), ("--png", b"\x89PNG"), ("--mcap", b"\x89MCAP0\r\n")],
)
def test_other_results_on_standard_output(
    option: str, start: bytes, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    assert replay("-q", CORRIDOR, option, "-") == 0
    heard = capfdbinary.readouterr()
    assert heard.out.startswith(start)
    assert heard.err == b""
    assert files() == []


def test_the_map_on_standard_output_is_text(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    assert replay("-q", CORRIDOR, "--map", "-") == 0
    Path("piped.txt").write_bytes(capfdbinary.readouterr().out)
    assert replay("-q", CORRIDOR, "--map", "m.txt") == 0
    assert Path("piped.txt").read_bytes() == Path("m.txt").read_bytes()


def test_standard_input(usual: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Stdin:
        buffer = io.BytesIO(Path(CORRIDOR).read_bytes())

    monkeypatch.setattr("sys.stdin", Stdin())
    assert replay("-q", "-") == 0
    assert files() == [f"stdin-slam/{name}" for name in USUAL]
    for name in USUAL[:3]:
        assert Path("stdin-slam", name).read_bytes() == (usual / name).read_bytes()
    trace = json.loads(Path("stdin-slam/trace.json").read_text())
    assert trace["input"][0]["file"] == "-"


def test_the_end_report(capsys: pytest.CaptureFixture[str], corridor: Trace) -> None:
    assert replay(CORRIDOR) == 0
    lines = [line.split(maxsplit=1) for line in capsys.readouterr().err.splitlines()]
    said = {label: text for label, text in lines if label not in ("mean", "loops")}
    assert said["scans"] == "50 of 50 used (100.0 %)"
    assert said["skipped"] == "none"
    assert said["matched"] == "49; by odometry alone 0"
    assert said["driven"] == f"{corridor['summary']['distance_m']:.1f} m in 9.8 s"
    assert said["took"].endswith(" times real time")
    assert said["written"] == "corridor-slam: map.png, map.yaml, map.pgm, trace.json"


def test_quiet_and_verbose(capsys: pytest.CaptureFixture[str]) -> None:
    assert replay("-q", CORRIDOR) == 0
    assert capsys.readouterr() == ("", "")
    assert replay("-v", CORRIDOR) == 0
    assert capsys.readouterr().err.startswith("Scans from /scan, odometry from /odom.\n")


# Limits


def test_a_limit_that_holds_is_exit_3_with_one_line_and_all_outputs(
    capsys: pytest.CaptureFixture[str],
) -> None:
    limits = ("--fail-if", "used_share<0.95", "--fail-if", "matched>10", "--fail-if", "used>1")
    assert replay("-q", CORRIDOR, *limits) == 3
    assert capsys.readouterr().err == (
        "Error: corridor.mcap: matched is 49; expected not matched>10 (--fail-if)\n"
    )
    assert files() == [f"corridor-slam/{name}" for name in USUAL]
    assert replay("-q", CORRIDOR, "--fail-if", "used_share<0.95") == 0


@pytest.mark.parametrize(
    ("limit", "problem"),
    [("used_share", "expected a limit such as 'verdict!=good'"),
     ("badness>1", "no 'badness' in the summary; expected one of scans, used, used_share")],
)  # fmt: skip
def test_wrong_limits_are_found_before_the_work(
    limit: str, problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert replay("no-such.mcap", "--fail-if", limit) == 2
    assert problem in capsys.readouterr().err


# Options of the input and of the model


def poses_of(trace: Trace) -> list[Any]:
    return list(trace["poses"])


def carmen_lines(records: list[Record]) -> list[str]:
    """The corridor's log as a CARMEN text with the half of the beams that look ahead."""
    lines = []
    for record in records:
        t = f"{record.stamp_ns / 1e9:.6f}"
        if isinstance(record, Odometry):
            last = f"{record.pose.x} {record.pose.y} {record.pose.theta}"
            lines.append(f"ODOM {last} 0 0 0 {t} host {t}")
        elif isinstance(record, RangeScan):
            ahead = record.ranges[45:135]
            ranges = " ".join(f"{r:.3f}" for r in ahead)
            lines.append(f"FLASER {len(ahead)} {ranges} {last} {last} {t} host {t}")
    return lines


def test_a_carmen_log_and_its_import_give_the_same(records: list[Record]) -> None:
    text = "\n".join(carmen_lines(records)).encode()
    Path("robot.log").write_bytes(text)
    Path("robot.log.gz").write_bytes(gzip.compress(text))
    with pytest.raises(SystemExit):
        main(["import", "-q", "robot.log", "robot.mcap"])
    from_text, from_mcap = traced("robot.log"), traced("robot.mcap")
    assert len(from_text["poses"]) == 50
    assert from_text["summary"]["matched"] == 49
    assert poses_of(from_text) == poses_of(from_mcap) == poses_of(traced("robot.log.gz"))
    assert from_text["summary"] == from_mcap["summary"]


def test_parts_of_a_recording_give_the_same_as_the_whole(
    records: list[Record], corridor: Trace
) -> None:
    half = len(records) // 2
    one, two = write_log("1.mcap", records[:half]), write_log("2.mcap", records[half:])
    for parts in ((one, two), (two, one)):
        trace = traced(*parts)
        assert poses_of(trace) == poses_of(corridor)
        assert [entry["file"] for entry in trace["input"]] == list(parts)
    Path("bag").mkdir()
    Path("bag/metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    for part in (one, two):
        Path(part).rename(f"bag/{part}")
    assert poses_of(traced("bag")) == poses_of(corridor)


def test_part_of_the_time(corridor: Trace) -> None:
    trace = traced(CORRIDOR, "--start", "2", "--end", "6", "--every", "4")
    origin = corridor["poses"][0]["stamp_ns"]
    seconds = [(pose["stamp_ns"] - origin) / 1e9 for pose in trace["poses"]]
    assert seconds == pytest.approx([2 + 0.8 * k for k in range(6)])
    chosen = trace["parameters"]
    assert (chosen["start_s"], chosen["end_s"], chosen["every"]) == (2, 6, 4)
    assert trace["summary"]["scans"] == trace["summary"]["used"] == 6
    whole = {pose["stamp_ns"]: pose["odom"] for pose in corridor["poses"]}
    assert [pose["odom"] for pose in trace["poses"]] == [
        whole[p["stamp_ns"]] for p in poses_of(trace)
    ]


def test_no_scan_in_the_part_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert replay(CORRIDOR, "--start", "60") == 1
    assert capsys.readouterr().err == "Error: corridor.mcap: no scan in the part asked for\n"
    assert files() == []


def test_without_search_the_poses_are_the_odometry() -> None:
    trace = traced(CORRIDOR, "--search", "none")
    first = Pose2D(**trace["poses"][0]["odom"])
    for pose in trace["poses"]:
        relative = first.between(Pose2D(**pose["odom"]))
        found = pose["x"], pose["y"], pose["theta"]
        assert found == pytest.approx((relative.x, relative.y, relative.theta), abs=3e-6)
    assert trace["summary"]["matched"] == 0
    assert trace["summary"]["odometry"] == 49
    assert trace["summary"]["mean_score"] is None
    assert trace["parameters"]["match"]["search"] == "none"


def test_the_books_search_stays_within_a_cell_and_fifteen_degrees_of_the_odometry() -> None:
    poses = traced(CORRIDOR, "--search", "book")["poses"]
    assert sum(pose["status"] == "matched" for pose in poses[1:]) > 0.9 * len(poses)
    seen = set()
    for before, after in pairwise(poses):
        motion = Pose2D(**before["odom"]).between(Pose2D(**after["odom"]))
        predicted = Pose2D(before["x"], before["y"], before["theta"]).compose(motion)
        dx, dy = (after["x"] - predicted.x) / 0.05, (after["y"] - predicted.y) / 0.05
        turn = math.degrees(predicted.between(Pose2D(0, 0, after["theta"])).theta)
        step = round(dx), round(dy), round(turn)
        assert (dx, dy, turn) == pytest.approx(step, abs=1e-3)
        seen.add(step)
    near = {(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)}
    assert seen <= {(*place, turn) for place in near for turn in (-15, 0, 15)}


def test_beams_without_return_clear_when_asked(records: list[Record]) -> None:
    blind = [
        replace(record, ranges=np.where(np.arange(len(record.ranges)) % 9, record.ranges, np.inf))
        if isinstance(record, RangeScan)
        else record
        for record in records
    ]
    log = write_log("blind.mcap", blind)
    for policy in ("ignore", "clear"):
        options = ("--no-return", policy, "--search", "none", "--range-max", "3")
        assert replay("-q", log, *options, "--map", f"{policy}.txt") == 0
    ignored, cleared = (load_map(f"{name}.txt").grid for name in ("ignore", "clear"))
    assert (cleared.cells < 0.25).sum() > (ignored.cells < 0.25).sum()
    assert replay("-q", log, "--search", "none", "--range-max", "3", "--map", "usual.txt") == 0
    assert Path("usual.txt").read_bytes() == Path("ignore.txt").read_bytes()


def test_laser_pose_on_the_command_line_is_as_good_as_in_the_log(records: list[Record]) -> None:
    mount = Mount(Pose2D(0.1, -0.05, math.radians(20)), flipped=True)
    mounted = [
        replace(record, mount=mount) if isinstance(record, RangeScan) else record
        for record in records
    ]
    log = write_log("mounted.mcap", mounted)
    told = traced(CORRIDOR, "--laser-pose", "0.1,-0.05,20,flip")
    assert poses_of(told) == poses_of(traced(log))
    assert poses_of(told) != poses_of(traced(CORRIDOR))
    assert told["parameters"]["laser_pose"]["flipped"] is True


def test_resolution_ranges_and_topics() -> None:
    trace = traced(CORRIDOR, "--resolution", "0.1", "--range-max", "2", "--map", "m.txt")
    assert trace["parameters"]["perception"]["range_max"] == 2
    grid = load_map("m.txt").grid
    assert grid.resolution == 0.1
    assert grid.columns < 85
    usual = traced(CORRIDOR)
    by_tf = traced(CORRIDOR, "--odom-topic", "/tf", "--scan-topic", "/scan")
    for one, other in zip(usual["poses"], by_tf["poses"], strict=True):
        assert one["x"] == pytest.approx(other["x"], abs=1e-4)


def test_no_loop_closing_is_accepted(corridor: Trace) -> None:
    assert traced(CORRIDOR, "--no-loop-closing")["loops"] == []


# Stopping, and files that must stay


def stop_after(scans: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Press Ctrl-C in the middle of the scan after so many (of a log of which all is told: none is
    tracked beforehand to find out when its beams were taken)."""
    step = Slam.step
    done: list[RangeScan] = []

    def stepping(slam: Slam, scan: RangeScan, odom: Pose2D | None) -> TracedPose:
        if len(done) == scans:
            os.kill(os.getpid(), signal.SIGINT)
        done.append(scan)
        return step(slam, scan, odom)

    monkeypatch.setattr(Slam, "step", stepping)


def test_ctrl_c_without_loop_closing_leaves_the_start_of_the_trace(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = "-q", CORRIDOR, "--turn-time", "0", "--no-loop-closing"
    assert replay(*told, "--json", "whole.json") == 0
    stop_after(20, monkeypatch)
    assert replay(*told, "--json", "part.json") == 130
    part, whole = (json.loads(Path(f"{name}.json").read_text()) for name in ("part", "whole"))
    assert part["poses"] == whole["poses"][:20]


def test_ctrl_c_keeps_what_is_known(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], corridor: Trace
) -> None:
    tracked = [one.pose for one in Slam().replay(open_log(CORRIDOR).records())]
    stop_after(20, monkeypatch)
    assert replay(CORRIDOR, "--turn-time", "0", "--fail-if", "used>0") == 130
    assert files() == [f"corridor-slam/{name}" for name in USUAL]
    trace = json.loads(Path("corridor-slam/trace.json").read_text())
    # As tracked: loop closure and refinement would keep the user waiting.
    found = [(one["x"], one["y"], one["theta"]) for one in trace["poses"]]
    expected = [(pose.x, pose.y, pose.theta) for pose in tracked[:20]]
    assert found == [pytest.approx(pose, abs=1e-6) for pose in expected]
    known = load_map("corridor-slam/map.yaml").grid.known
    assert known.sum() > 0
    summary = trace["summary"]
    assert summary["interrupted"] is True
    assert summary["used"] == 20
    assert summary["scans"] == 20
    assert summary["skipped"] == {}  # no scan is held back where nothing is searched for in them
    assert capsys.readouterr().err.endswith("Interrupted.\n")


def test_ctrl_c_before_the_first_scan_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stop_after(0, monkeypatch)
    assert replay(CORRIDOR) == 130
    assert capsys.readouterr().err == "\nInterrupted.\n"
    assert files() == []


def test_no_clobber_refuses_before_the_work(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("m.pgm").write_text("mine")
    monkeypatch.setattr(Slam, "step", None)
    assert replay("--no-clobber", CORRIDOR, "--map", "m.yaml") == 1
    assert capsys.readouterr().err == ("Error: m.pgm: exists already, and --no-clobber is set\n")
    assert Path("m.pgm").read_text() == "mine"
    assert files() == ["m.pgm"]


def test_older_results_are_replaced(usual: Path) -> None:
    Path("m.pgm").write_text("old")
    assert replay("-q", CORRIDOR, "--map", "m.yaml") == 0
    assert Path("m.pgm").read_bytes() == (usual / "map.pgm").read_bytes()
    assert files() == ["m.pgm", "m.yaml"]  # and nothing temporary
