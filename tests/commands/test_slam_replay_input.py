"""`mapcli slam-replay` with logs and wishes as they should not be: a sentence, an exit code."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support.mcap_making import mcap_file, odom, scan
from support.replaying import CORRIDOR, FIXTURES, files, replay, traced, write_log

from mapcli import Pose2D, open_log
from mapcli.algorithms.slam.slam import Slam
from mapcli.model.scan import Mount, Odometry, RangeScan, Record

CORRIDOR_BYTES = Path(CORRIDOR).read_bytes()
RECORDS = list(open_log([CORRIDOR]).records())


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail if a scan is worked on."""

    def step(*arguments: object) -> None:
        pytest.fail("worked before it complained")

    monkeypatch.setattr(Slam, "step", step)


def complaint(capsys: pytest.CaptureFixture[str]) -> str:
    """The only line said."""
    heard = capsys.readouterr()
    assert heard.out == ""
    (line,) = heard.err.splitlines()
    return line


def with_scans(change: dict[int, dict[str, Any]]) -> list[Record]:
    """The corridor's records with fields of some scans, by number, changed."""
    records: list[Record] = []
    number = 0
    for record in RECORDS:
        if isinstance(record, RangeScan):
            record = replace(record, **change.get(number, {}))
            number += 1
        records.append(record)
    return records


# Logs that cannot be read at all

SMALL_FILES = {
    "empty.mcap": (
        b"",
        "empty.mcap: is empty; expected an MCAP file, a ROS bag, a CARMEN log or a robot's CSV",
    ),
    "text.mcap": (
        b"this is no log\n",
        "text.mcap: is no log that mapcli knows; expected an MCAP file, a ROS bag, a CARMEN log or "
        "a robot's CSV",
    ),
    "picture.mcap": (
        b"\x89PNG\r\n\x1a\n" + bytes(100),
        "picture.mcap: is a PNG image; draw it with mapcli render, or go on with it with mapcli "
        "slam-replay LOG --known; expected an MCAP file, a ROS bag, a CARMEN log or a robot's CSV",
    ),
    "ros1.bag": (
        b"#ROSBAG V2.0\n" + bytes(100),
        "ros1.bag: 1 gap of unreadable bytes, skipped (byte 13): no range scans; expected a topic "
        "of sensor_msgs/msg/LaserScan",
    ),
    "start.mcap": (
        CORRIDOR_BYTES[:8],
        "start.mcap: 1 file cut short (byte 8): no range scans; expected a topic of ",
    ),
}


@pytest.mark.parametrize("name", SMALL_FILES)
def test_files_that_are_no_log(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    content, problem = SMALL_FILES[name]
    Path(name).write_bytes(content)
    assert replay(name) == 1
    assert complaint(capsys).startswith(f"Error: {problem}")
    assert files() == [name]


def test_a_missing_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert replay("none.mcap") == 1
    assert complaint(capsys) == "Error: none.mcap: no such file"
    assert files() == []


def test_a_folder_that_is_no_bag(capsys: pytest.CaptureFixture[str]) -> None:
    Path("stuff").mkdir()
    assert replay("stuff") == 1
    assert complaint(capsys) == (
        "Error: stuff: is a folder without a bag's files; expected an MCAP file, a ROS bag, a "
        "CARMEN log or a robot's CSV"
    )


def test_no_log_at_all(capsys: pytest.CaptureFixture[str]) -> None:
    assert replay() == 2
    assert "Missing argument 'LOG...'" in capsys.readouterr().err


# Damaged logs


def test_a_truncated_log_is_used_as_far_as_it_goes(capsys: pytest.CaptureFixture[str]) -> None:
    end = len(CORRIDOR_BYTES) * 2 // 3
    Path("cut.mcap").write_bytes(CORRIDOR_BYTES[:end])
    assert replay("cut.mcap", "--json", "t.json") == 0
    heard = capsys.readouterr().err
    assert f"Warning: cut.mcap: 1 file cut short (byte {end})\n" in heard
    cut, whole = (traced(log, "--no-loop-closing") for log in ("cut.mcap", CORRIDOR))
    read = len(cut["poses"])
    assert 10 < read < 50
    assert cut["poses"][:-1] == whole["poses"][: read - 1]
    assert cut["summary"]["damage"] == {"files cut short": 1}
    assert replay("-q", "cut.mcap", "--fail-if", "damage>0") == 3


def test_strict_refuses_a_truncated_log(capsys: pytest.CaptureFixture[str]) -> None:
    Path("cut.mcap").write_bytes(CORRIDOR_BYTES[:20_000])
    assert replay("--strict", "cut.mcap") == 1
    assert complaint(capsys) == (
        "Error: cut.mcap: byte 20000: 1 file cut short; expected an undamaged log (--strict)"
    )
    assert files() == ["cut.mcap"]
    assert replay("-q", "--strict", CORRIDOR) == 0


def test_an_unknown_compression(capsys: pytest.CaptureFixture[str]) -> None:
    assert CORRIDOR_BYTES.count(b"\x04\0\0\0zstd") > 1
    data = CORRIDOR_BYTES.replace(b"\x04\0\0\0zstd", b"\x04\0\0\0gzip")
    data = data.replace(b"\x28\xb5\x2f\xfd", b"\x1f\x8b\x08\x00")
    Path("odd.mcap").write_bytes(data[:-12] + bytes(4) + data[-8:])  # no checksum of the index
    assert replay("odd.mcap") == 1
    line = complaint(capsys)
    assert line.startswith("Error: odd.mcap: not one scan can be read (")
    assert "unknown compression 'gzip'" in line


def test_scans_that_cannot_be_used_are_accounted_for(capsys: pytest.CaptureFixture[str]) -> None:
    good = [scan(t, [2.0] * 40, increment=0.05) for t in (1.0, 2.0, 3.0, 4.0)]
    unreadable = replace(scan(2.5), data=b"\x00\x01\x00\x00abc")
    log = mcap_file(Path(), *good, scan(2.2, []), unreadable, odom(1.0), odom(5.0))
    assert replay(log, "--json", "t.json") == 0
    summary = traced(log)["summary"]
    assert (summary["scans"], summary["used"], summary["used_share"]) == (6, 4, 0.666667)
    assert summary["skipped"] == {
        "scans without beams, skipped": 1,
        "messages on /scan without readable content": 1,
    }
    assert summary["lost_share"] == 0.166667  # a scan without beams was read, and had none
    said = capsys.readouterr().err
    assert "        scans  4 of 6 used (66.7 %)\n" in said
    assert "         lost  16.7 % of the log's scans, to damage\n" in said
    assert replay("-q", log, "--fail-if", "used_share<0.95") == 3
    assert replay("-q", log, "--fail-if", "lost_share>0.1") == 3
    assert replay("-q", log, "--fail-if", "lost_share>0.2") == 0


def test_damage_is_told_with_q_too(capsys: pytest.CaptureFixture[str]) -> None:
    messages = [m for t in range(1, 51) for m in (odom(t), scan(t, [2.0 + t / 99] * 90))]
    data = Path(mcap_file(Path(), *messages)).read_bytes()
    half = len(data) // 2
    Path("hole.mcap").write_bytes(data[:half] + data[half + 100 :])
    assert replay("-q", "hole.mcap", "--json", "t.json", "--fail-if", "used_share<1") == 3
    *warnings, complaint = capsys.readouterr().err.splitlines()
    assert all(line.startswith("Warning: hole.mcap: ") for line in warnings)
    summary = json.loads(Path("t.json").read_text())["summary"]
    lost = summary["skipped"]["scans lost in damaged parts of the file"]
    assert summary["scans"] == summary["used"] + lost == 50
    assert summary["lost_share"] == round(lost / 50, 6) > 0
    assert f"Warning: hole.mcap: {lost} scans lost in damaged parts of the file" in warnings
    assert complaint.startswith("Error: hole.mcap: used_share is 0.")


@pytest.mark.parametrize(
    ("part", "used", "lost"),
    [
        ([], 30, 10),
        (["--end", "19"], 20, 0),  # scans 1 to 20, before the damage
        (["--end", "24"], 20, 5),  # 21 to 25
        (["--start", "25"], 10, 5),  # 26 to 40, a second apart
        (["--start", "32"], 8, 0),
        (["--every", "4"], 7, 3),  # of 1, 5, ... 37: 21, 25, 29
    ],
)
def test_scans_lost_outside_the_part_asked_for_do_not_count(
    part: list[str], used: int, lost: int
) -> None:
    """Of 40 scans at 0, 1, ... 39 s, numbers 21 to 30 cannot be read."""
    broken = {"data": b"\x00\x01\x00\x00abc"}
    log = mcap_file(
        Path(),
        *(scan(t, [2.0] * 90, **(broken if t in range(21, 31) else {})) for t in range(1, 41)),
    )
    summary = traced(log, *part)["summary"]
    assert (summary["used"], summary["scans"]) == (used, used + lost)
    assert summary["lost_share"] == round(lost / (used + lost), 6)
    what = "messages on /scan without readable content"
    assert summary["skipped"] == ({what: lost} if lost else {})


def test_stamps_that_jump_back_a_little_are_put_in_order() -> None:
    late = RECORDS[:30] + RECORDS[40:50] + RECORDS[30:40] + RECORDS[50:]
    trace = traced(write_log("late.mcap", late))
    assert trace["poses"] == traced(CORRIDOR)["poses"]
    assert trace["summary"]["damage"] == {}


def test_stamps_of_a_clock_that_was_set_back_cost_scans_but_not_the_map() -> None:
    second = 10**9
    empty = np.full(4, np.nan, dtype=np.float32)
    blind = [RangeScan((10 + t) * second, 0.0, 0.1, empty) for t in range(2100)]
    back = [RangeScan((5 + t) * second, 0.0, 0.1, empty) for t in range(3)]
    # Log times in the order of writing, as a recorder has them; only the stamps jump.
    sent = [
        replace(scan(record.stamp_ns / second, [1.0] * 4), log_ns=(10_000 + k) * second)
        for k, record in enumerate(blind + back)
    ]
    log = mcap_file(Path(), *sent)
    assert traced(log, "--search", "none")["summary"]["used"] == 2103
    summary = traced(log, "--search", "none", "--time-source", "header")["summary"]
    assert summary["used"] == 2100
    assert summary["skipped"] == {"scans with a stamp that jumps back, dropped": 3}
    assert summary["scans"] == 2103


# Logs with too much or too little


def test_no_scans(capsys: pytest.CaptureFixture[str]) -> None:
    assert replay(mcap_file(Path(), odom(1), odom(2))) == 1
    assert complaint(capsys).startswith(
        "Error: a.mcap: no range scans among /odom (nav_msgs/msg/Odometry, 2 messages); expected "
    )


def test_several_scan_topics(capsys: pytest.CaptureFixture[str]) -> None:
    log = mcap_file(Path(), scan(1, topic="/front"), scan(2, topic="/rear"), odom(1))
    assert replay(log) == 1
    assert complaint(capsys) == (
        "Error: a.mcap: several scan topics: /front (sensor_msgs/msg/LaserScan, 1 message), "
        "/rear (sensor_msgs/msg/LaserScan, 1 message); expected one of them named with "
        "--scan-topic, several lasers of a robot with one --scan-topic each, or --scan-topic all"
    )
    assert traced(log, "--scan-topic", "/rear")["summary"]["used"] == 1


def test_a_topic_that_is_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    assert replay(CORRIDOR, "--scan-topic", "/top") == 1
    assert "no scan topic /top among /scan (" in complaint(capsys)
    assert replay(CORRIDOR, "--odom-topic", "/wheels") == 1
    assert "no odometry topic /wheels among /odom (" in complaint(capsys)


def test_without_odometry_scans_are_matched_from_where_the_last_one_was(
    capsys: pytest.CaptureFixture[str],
) -> None:
    scans = (record for record in RECORDS if isinstance(record, RangeScan))
    log = write_log("blind.mcap", scans)
    assert replay(log, "--json", "t.json") == 0
    note = "Note: no odometry: poses come from matching scans alone\n"
    assert note in capsys.readouterr().err
    trace = traced(log)
    assert all(pose["odom"] is None for pose in trace["poses"])
    assert trace["summary"]["matched"] == 49
    seeing = traced(CORRIDOR)
    for blind, sure in zip(trace["poses"], seeing["poses"], strict=True):
        assert Pose2D(blind["x"], blind["y"]).distance(Pose2D(sure["x"], sure["y"])) < 0.1


# Odd scans


def spoilt(ranges: NDArray[np.float32], values: Iterable[float]) -> NDArray[np.float32]:
    """Every tenth beam has another of these values."""
    spoilt = ranges.copy()
    spoilt[::10] = np.resize(list(values), len(spoilt[::10]))
    return spoilt


@pytest.mark.parametrize(
    "values", [[np.nan], [-1.0], [0.0], [-np.inf], [np.nan, -2.0, 0.0, -np.inf, -1e30, -1e-30]]
)
def test_readings_that_are_none_are_left_out(values: list[float]) -> None:
    def log(name: str, of: list[float]) -> str:
        change = {k: {"ranges": spoilt(s.ranges, of)} for k, s in enumerate(scans_of(RECORDS))}
        return write_log(name, with_scans(change))

    found, expected = traced(log("odd.mcap", values)), traced(log("nan.mcap", [np.nan]))
    assert found["poses"] == expected["poses"]
    assert found["summary"]["used"] == 50
    assert expected["summary"]["matched"] == 49


def scans_of(records: list[Record]) -> list[RangeScan]:
    return [record for record in records if isinstance(record, RangeScan)]


@pytest.mark.parametrize("far", [np.inf, 1e30, 13.0])
def test_readings_beyond_the_sensors_range_are_no_return(far: float) -> None:
    change = {k: {"ranges": spoilt(s.ranges, [far])} for k, s in enumerate(scans_of(RECORDS))}
    trace = traced(write_log("far.mcap", with_scans(change)), "--map", "m.txt")
    assert trace["summary"]["matched"] == 49
    assert traced(CORRIDOR, "--map", "usual.txt")["summary"]["matched"] == 49
    size = [len(Path(name).read_text().splitlines()) for name in ("m.txt", "usual.txt")]
    assert abs(size[0] - size[1]) <= 2  # no wall far away


def test_scans_without_any_reading_are_carried_on_by_odometry() -> None:
    nothing = np.full(180, np.nan, dtype=np.float32)
    trace = traced(write_log("a.mcap", with_scans({k: {"ranges": nothing} for k in (20, 21)})))
    assert [pose["status"] for pose in trace["poses"][19:23]] == [
        "matched", "odometry", "odometry", "matched",
    ]  # fmt: skip
    assert trace["poses"][20]["score"] is None
    assert trace["summary"]["odometry"] == 2


def test_a_log_of_blind_scans_has_a_trace_and_an_empty_map() -> None:
    nothing = np.full(180, np.nan, dtype=np.float32)
    log = write_log("a.mcap", with_scans({k: {"ranges": nothing} for k in range(50)}))
    assert replay("-q", log, "--fail-if", "matched<1") == 3
    assert sorted(path.name for path in Path("a-slam").iterdir()) == [
        "map.pgm", "map.png", "map.yaml", "trace.json",
    ]  # fmt: skip


def test_beam_counts_and_angles_may_change_from_scan_to_scan() -> None:
    change: dict[int, dict[str, Any]] = {}
    for k, record in enumerate(scans_of(RECORDS)):
        if k % 3 == 1:  # every second beam
            step = 2 * record.angle_increment
            change[k] = {"ranges": record.ranges[::2], "angle_increment": step}
        elif k % 3 == 2:  # a few beams fewer at the end
            change[k] = {"ranges": record.ranges[:-7]}
    trace = traced(write_log("a.mcap", with_scans(change)))
    assert trace["summary"]["used"] == 50
    assert trace["summary"]["matched"] == 49
    for one, other in zip(trace["poses"], traced(CORRIDOR)["poses"], strict=True):
        assert Pose2D(one["x"], one["y"]).distance(Pose2D(other["x"], other["y"])) < 0.05


def test_one_beam_and_one_scan() -> None:
    assert traced(mcap_file(Path(), scan(1, [2.0]), odom(1)))["summary"]["used"] == 1


def test_odometry_that_leaps_is_not_believed() -> None:
    leaping = [
        replace(record, pose=Pose2D(record.pose.x + 500, record.pose.y, record.pose.theta))
        if isinstance(record, Odometry) and k > len(RECORDS) // 2
        else record
        for k, record in enumerate(RECORDS)
    ]
    trace = traced(write_log("a.mcap", leaping))
    assert trace["summary"]["odometry_jumps"] >= 1
    end, usual = (poses["poses"][-1] for poses in (trace, traced(CORRIDOR)))
    assert Pose2D(end["x"], end["y"]).distance(Pose2D(usual["x"], usual["y"])) < 0.1


def test_a_map_of_absurd_size(capsys: pytest.CaptureFixture[str]) -> None:
    far = Mount(Pose2D(1e6, 0, 0))
    scans = {k: {"mount": far} for k in range(50)}
    assert replay(write_log("a.mcap", with_scans(scans))) == 1
    sentence = r"Error: a\.mcap: the map would be [\d,]{6,} m x [\d,]{6,} m; expected .*"
    assert re.fullmatch(sentence, complaint(capsys))


# Wishes that cannot be granted are refused before the work


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["--map", "m.jpg"], "--map m.jpg: does not end in .txt, .yaml, .yml, .pgm, .png."),
        (["--map", "map"], "--map map: does not end in"),
        (["--trace", "t.txt"], "--trace t.txt: does not end in .tum, .kitti, .g2o, .csv."),
        (["--json", "-", "--map", "-"], "Two results cannot both be written to standard output."),
        (["--png", "m.pgm", "--map", "m.yaml"], "Two results cannot both be written to m.pgm."),
        (["--json", "a", "--mcap", "./a"], "Two results cannot both be written to ./a."),
        (["--range-min", "3", "--range-max", "2"], "--range-max is not more than --range-min."),
        (["--resolution", "0"], "0.0 is not in the range 0.001<=x<=100."),
        (["--resolution", "nan"], "'nan' is not a finite number."),
        (["--window-xy", "inf"], "'inf' is not a finite number."),
        (["--step-xy", "-1"], "-1.0 is not in the range x>0."),
        (["--search", "all"], "'all' is not one of 'window', 'book', 'none'."),
        (["--no-return", "maybe"], "'maybe' is not one of 'clear', 'ignore'."),
        (["--laser-pose", "1,2"], "'1,2' is not of the form X,Y,YAW_DEG[,flip]."),
        (["--laser-pose", "200,0,0"], "'200,0,0' is more than 100 m off the robot."),
        (["--start", "5", "--end", "4"], "--end is before --start."),
        (["--every", "0"], "0 is not in the range x>=1."),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_usage(
    arguments: list[str], problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert replay(CORRIDOR, *arguments) == 2
    assert problem in capsys.readouterr().err
    assert files() == []


@pytest.mark.usefixtures("no_work")
def test_a_folder_that_is_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    Path("taken").write_text("mine")
    assert replay(CORRIDOR, "-o", "taken/out") == 1
    assert complaint(capsys) == "Error: taken/out/map.png: cannot be written: Not a directory"
    assert Path("taken").read_text() == "mine"


@pytest.mark.usefixtures("no_work")
def test_a_file_that_is_a_folder(capsys: pytest.CaptureFixture[str]) -> None:
    Path("out/trace.json").mkdir(parents=True)
    assert replay(CORRIDOR, "-o", "out") == 1
    assert complaint(capsys) == "Error: out/trace.json: is a directory; expected a file name"


@pytest.mark.usefixtures("no_work")
@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission(capsys: pytest.CaptureFixture[str]) -> None:
    Path("locked").mkdir(mode=0o500)
    assert replay(CORRIDOR, "-o", "locked/out") == 1
    assert complaint(capsys) == "Error: locked/out/map.png: cannot be written: Permission denied"


@pytest.mark.usefixtures("no_work")
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no file system that is read-only")
def test_a_file_system_where_nothing_can_be_written(capsys: pytest.CaptureFixture[str]) -> None:
    assert replay(CORRIDOR, "-o", "/proc/mapcli-out") == 1
    line = complaint(capsys)
    assert line.startswith("Error: /proc/mapcli-out/map.png: cannot be written: ")


@pytest.mark.usefixtures("no_work")
def test_the_log_itself_is_never_replaced(capsys: pytest.CaptureFixture[str]) -> None:
    Path("robot.mcap").write_bytes(CORRIDOR_BYTES)
    assert replay("robot.mcap", "--mcap", "./robot.mcap") == 1
    assert complaint(capsys) == "Error: ./robot.mcap: is one of the files to be read"
    assert Path("robot.mcap").read_bytes() == CORRIDOR_BYTES


def test_fixtures_are_where_these_tests_look() -> None:
    assert sorted(path.name for path in FIXTURES.glob("*.mcap")) == [
        "apartment.mcap",
        "corridor.mcap",
        "lateral.mcap",
    ]
