"""`mapcli info` about logs: the facts, the check-up, and the same as JSON."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.mcap_making import S, mcap_bytes, mcap_file, odom, scan, tf_static, transform
from support.sweeping import SweepingRobot

from mapcli import Pose2D, check_log, save_log
from mapcli.cli import main
from mapcli.model.scan import Odometry, RangeScan, Record
from mapcli.model.sweep import BeamTiming


def beam_scan(t: float, *ranges: float) -> RangeScan:
    return RangeScan(round(t * S), -1.0, 0.5, np.array(ranges or (t,), dtype=np.float32), 0.1, 9.0)


def wheel(t: float, x: float = 0.0, y: float = 0.0, theta: float = 0.0) -> Odometry:
    return Odometry(round(t * S), Pose2D(x, y, theta))


# The check-up


def test_facts_about_a_tiny_log() -> None:
    records: list[Record] = [
        wheel(1), beam_scan(1.5, 1, 2, 3), wheel(2, 3, 4), beam_scan(2.5, 4), wheel(3, 3, 4, 1.0),
    ]  # fmt: skip
    check = check_log(records)
    assert (check.start_ns, check.end_ns) == (1 * S, 3 * S)
    assert (check.scans.count, check.odometry.count) == (2, 3)
    assert (check.scans.period_s, check.odometry.period_s) == (1.0, 1.0)
    assert check.beams == (1, 3)
    assert check.bearings == (-1.0, 0.0)
    assert check.range_limits == (0.1, 9.0)
    assert check.distance_m == 5.0
    assert check.turned_rad == 1.0
    assert (check.jumps, check.repeated_scans, check.scans_outside_odometry) == (0, 0, 0)


def test_an_empty_log() -> None:
    check = check_log([])
    assert (check.scans.count, check.odometry.count, check.beams) == (0, 0, (0, 0))


def test_gaps_are_much_longer_than_usual() -> None:
    times = [t / 10 for t in range(100) if not 30 < t < 50]
    check = check_log([beam_scan(t) for t in times])
    assert check.scans.gaps == 1
    assert (check.scans.longest_gap_s, check.scans.longest_gap_at_s) == pytest.approx((2.0, 3.0))
    assert check_log([beam_scan(t * 10) for t in range(20)]).scans.gaps == 0


def test_jumps_are_faster_than_robots() -> None:
    records = [wheel(1), wheel(2, 1), wheel(3, 100), wheel(4, 101), wheel(5, 101, 0, 3.1)]
    check = check_log(records)
    assert (check.jumps, check.first_jump_at_s) == (1, 2.0)
    assert check.distance_m == 2.0
    burst = check_log([wheel(1), wheel(1, 0.5), wheel(1, 0.5, 0, 3.0)])
    assert (burst.jumps, burst.first_jump_at_s) == (1, 0.0)
    assert burst.distance_m == 0.5


def test_turns_are_counted_the_short_way() -> None:
    assert check_log([wheel(1, 0, 0, 3.1), wheel(2, 0, 0, -3.1)]).turned_rad == pytest.approx(
        math.tau - 6.2
    )


def test_repeats_and_scans_outside_the_odometry() -> None:
    nan = math.nan
    records = [
        beam_scan(1, nan),
        wheel(2),
        beam_scan(3, nan),
        beam_scan(3, 5),
        wheel(4),
        beam_scan(5, 6),
    ]
    check = check_log(records)
    assert (check.repeated_scans, check.scans_outside_odometry) == (1, 2)
    assert check.scans.same_stamps == 1
    assert check_log([beam_scan(1), beam_scan(2)]).scans_outside_odometry == 0


# `mapcli info`


def info(*args: str) -> int:
    with pytest.raises(SystemExit) as stop:
        main(["info", *args])
    return int(stop.value.code or 0)


BODY = [
    tf_static(0.5, transform(0, "base_link", "laser", (0.25, 0, 0), (180, 0, 90))),
    odom(1, 0),
    scan(1.5, [1, 2, math.inf, math.nan], log=1.6),
    odom(2, 1),
    scan(2.5, [3, 0.01, 11, 5], log=2.6),
    odom(3, 2),
]


@pytest.fixture
def good(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    mcap_file(tmp_path, *BODY)
    return "a.mcap"


GOOD = """\
a.mcap: log
  duration    2.0 s
  topic       /odom: 3 messages, 1 per second, nav_msgs/msg/Odometry (cdr) <- used
  topic       /scan: 2 messages, 1 per second, sensor_msgs/msg/LaserScan (cdr) <- used
  topic       /tf_static: 1 message, tf2_msgs/msg/TFMessage (cdr)
  scans       2, every 1 s; 4 beams from -28.6479 to 57.2958 deg, up to 10 m
  beams       25.0% without return, 12.5% too close, 12.5% invalid
  laser       x 0.25 m, y 0 m, yaw 90 deg on the robot, upside down
  odometry    2.0 m and 0 deg of turns, every 1 s
  note        laser /scan: mounted upside down, at x 0.250 m, y 0.000 m, yaw 90.0 deg
  check-up    nothing odd found
"""


def test_a_good_log(good: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert info(good) == 0
    assert capsys.readouterr().out == GOOD


def test_as_json(good: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert info(good, "--json", "-") == 0
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert (document["format"], document["version"], document["kind"]) == (
        "mapcli.log-info", 1, "log",
    )  # fmt: skip
    assert document["input"][0]["file"] == "a.mcap"
    assert len(document["input"][0]["sha256"]) == 64
    assert document["uses"] == {"scan_topic": "/scan", "odom_topic": "/odom"}
    assert [topic["name"] for topic in document["topics"]] == ["/odom", "/scan", "/tf_static"]
    assert document["scans"]["no_return_share"] == 0.25
    assert document["lasers"][0]["flipped"] is True
    assert document["odometry"]["distance_m"] == 2.0
    assert document["delays_s"] == {"/odom": 0.0, "/scan": 0.1}
    assert (document["damage"], document["warnings"]) == ({}, [])


MOUNTED = tf_static(0, transform(0, "base_link", "laser"))


def test_odd_things_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    messages = [odom(t / 10, log=t / 10) for t in range(1, 100)]
    messages += [scan(t / 10, log=t / 10) for t in range(2, 100) if not 30 < t < 60]
    messages += [scan(9.9, log=9.95), odom(9.91, 50, log=15), scan(20, log=20), scan(19, log=21)]
    data = mcap_bytes(*messages)
    path = tmp_path / "a.mcap"
    path.write_bytes(data[:-40])
    assert info(str(path)) == 0
    warnings = [line[14:] for line in capsys.readouterr().out.splitlines() if "  warning" in line]
    assert warnings == [
        f"1 file cut short (byte {len(data) - 40})",
        "mount unknown: the log does not tell where the laser sits, assumed at the robot's centre",
        "2 gaps in the scans, the longest of 9.1 s at 9.8 s",
        "1 record out of order, put in order by their stamps",
        "1 scan with the stamp of the one before",
        "71 scans with the very ranges of the one before",
        "2 scans before the first or after the last odometry",
        "1 jump of the odometry, the first at 9.8 s",
        "the odometry never moves",
    ]


def test_clocks_that_differ_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Those of the recording are taken."""
    messages = [odom(t / 10, t, log=t / 10 + 5) for t in range(100)]
    path = mcap_file(tmp_path, MOUNTED, *messages, *(scan(t / 10, log=t / 10) for t in range(100)))
    assert info(path, "--json", "-") == 0
    document = json.loads(capsys.readouterr().out)
    why = "stamps of /odom and /scan are 5.0 s apart"
    assert document["clock"] == {"source": "log", "why": why}
    assert f"{why}: times of recording are used" in document["notes"]
    assert document["delays_s"] == {"/odom": 5.0, "/scan": 0.0}
    assert document["reasons"] == []


def test_clocks_that_drift_apart_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each message by less than shows; the other clock is taken on demand."""
    messages = [odom(t / 10, t / 10, log=t / 10 * 1.02) for t in range(3000)]
    path = mcap_file(tmp_path, MOUNTED, *messages, *(scan(t / 10, log=t / 10) for t in range(3000)))
    assert info(path, "--json", "-") == 0
    (reason,) = json.loads(capsys.readouterr().out)["reasons"]
    assert (reason["kind"], reason["try"]) == ("clocks_differ", "--time-source log")
    told = (
        "scans were recorded 0.0 s after their stamps, odometry 3.0 s after its: "
        "their clocks differ"
    )
    assert reason["text"] == told


def test_a_log_that_cannot_be_mapped_is_described(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = mcap_file(tmp_path, scan(1, topic="/a"), scan(2, topic="/b"), odom(3))
    assert info(path) == 0
    out = capsys.readouterr().out
    assert "topic       /a: 1 message, sensor_msgs/msg/LaserScan (cdr)\n" in out
    assert "warning     slam-replay cannot use it: several scan topics: /a" in out
    assert "<- used" not in out
    assert info(mcap_file(tmp_path, odom(1)), "--json", "-") == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["scans"], document["odometry"]) == (None, None)
    assert "no range scans" in document["warnings"][0]


def test_carmen_with_other_topics(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.log"
    path.write_text("PARAM a b 1 host 1\nFLASER 2 1 2 0 0 0 0 0 0 1 host 1\n")
    assert info(str(path)) == 0
    out = capsys.readouterr().out
    assert "and 1 topic that mapping does not need (-v)\n" in out
    assert "FLASER: 1 message, CARMEN (carmen) <- used" in out
    assert info("-v", str(path)) == 0
    assert "PARAM: 1 message" in capsys.readouterr().out


def test_a_log_that_cannot_be_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"")
    assert info(str(path)) == 1
    assert capsys.readouterr().err.endswith(
        "a.mcap: is empty; expected an MCAP file, a ROS bag, a CARMEN log or a robot's CSV\n"
    )


@pytest.mark.parametrize(
    ("timing", "text"),
    [
        (BeamTiming(order=None), "  turn        looks as if a turn took 0.18"),
        (BeamTiming(SweepingRobot().increment, order=None), "  turn        0.181006 s; "),
    ],
)
def test_the_times_of_beams_are_found_as_by_slam_replay(
    timing: BeamTiming, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    records = SweepingRobot(flipped=True).records(timing)
    save_log(records, tmp_path / "robot.mcap")
    assert info(str(tmp_path / "robot.mcap"), "--json", str(tmp_path / "info.json")) == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if "  turn " in line)
    assert line.startswith(text)
    assert line.endswith("beams backward")
    scans = json.loads((tmp_path / "info.json").read_text())["scans"]
    assert scans["turn_time_found"] == (timing.increment == 0)
    assert scans["turn_time_s"] == pytest.approx(0.181, rel=0.02)
    assert scans["beam_order"] == "backward"
