"""The simulated robot: sensors, records, and the command that made the fixtures."""

from __future__ import annotations

import shlex
from itertools import pairwise
from pathlib import Path

import pytest
from conftest import FIXTURES
from conftest import run as run_mapcli
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore

from mapcli.algorithms.simulation.simulate import POSE_STEP


def run(*arguments: object) -> int:
    return run_mapcli("simulate", *arguments)


def messages(file: Path) -> list[tuple[str, int, bytes]]:
    with file.open("rb") as stream:
        return [(c.topic, m.log_time, m.data) for _, c, m in make_reader(stream).iter_messages()]


CORRIDOR = FIXTURES / "corridor.yaml", "--path", FIXTURES / "corridor-path.txt"


FAST = "--odom-rate", 4, "--scan-rate", 1, "--beams", 12


def test_fixture_is_what_the_command_makes(tmp_path: Path) -> None:
    """Messages are compared, not files: releases of zstandard may pack them differently."""
    readme = (FIXTURES / "README.md").read_text()
    line = next(line for line in readme.splitlines() if line.endswith("fixtures/corridor.mcap"))
    words = [word.replace("fixtures/", f"{FIXTURES}/") for word in shlex.split(line)]
    assert words[:2] == ["mapcli", "simulate"]
    assert run(*words[2:-1], tmp_path / "again.mcap") == 0
    assert messages(tmp_path / "again.mcap") == messages(FIXTURES / "corridor.mcap")


def test_same_bytes_every_time(tmp_path: Path) -> None:
    for name in ("a.mcap", "b.mcap"):
        assert run(*CORRIDOR, *FAST, "--seed", 0, tmp_path / name) == 0
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    assert run(*CORRIDOR, *FAST, "--seed", 1, tmp_path / "b.mcap") == 0
    assert (tmp_path / "a.mcap").read_bytes() != (tmp_path / "b.mcap").read_bytes()


def test_what_is_in_the_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "log.mcap"
    assert run(*CORRIDOR, *FAST, "--laser-pose", "0.1,0,90", "-v", out) == 0
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "0.00 s  waypoint   1  (0.80, 0.90)" in shown.err
    assert "4.5 m in 9.9 s, 10 scans, 41 odometry readings" in shown.err
    store = get_typestore(Stores.ROS2_HUMBLE)
    logged = messages(out)
    assert all(a[1] <= b[1] for a, b in pairwise(logged))
    topics = [topic for topic, _, _ in logged]
    assert {topic: topics.count(topic) for topic in topics} == {
        "/ground_truth": 41, "/odom": 41, "/tf": 41, "/tf_static": 1, "/scan": 10,
    }  # fmt: skip
    data = {topic: data for topic, _, data in reversed(logged)}
    scan = store.deserialize_cdr(data["/scan"], "sensor_msgs/msg/LaserScan")
    assert len(scan.ranges) == 12
    assert scan.range_max == 12
    true = store.deserialize_cdr(data["/ground_truth"], "geometry_msgs/msg/PoseStamped")
    assert (true.pose.position.x, true.pose.position.y) == pytest.approx((0.8, 0.9), abs=POSE_STEP)
    assert true.header.stamp.sec == 1_600_000_000


def test_quiet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*CORRIDOR, *FAST, "-q", tmp_path / "log.mcap") == 0
    assert capsys.readouterr() == ("", "")


def test_a_grid_map_as_world(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "map.txt").write_text("####\n#..#\n#..#\n####\n")
    (tmp_path / "path.txt").write_text("1.5 1.5\n2.5 1.5\n")
    out = tmp_path / "log.mcap"
    assert run(tmp_path / "map.txt", "--path", tmp_path / "path.txt", out) == 0
    assert "1.0 m in 3.0 s" in capsys.readouterr().err


def test_troubles_of_laser_and_wheels(tmp_path: Path) -> None:
    """A laser of half a second a turn looks 1 m far in the corridor and has a twin behind it."""
    out, store = tmp_path / "log.mcap", get_typestore(Stores.ROS2_HUMBLE)
    lasers = "--range-max", 1, "--no-return", "7,8", "--rear-laser-pose", "-0.2,0,180"
    people = "--people", 2, "--glass", 0.2, "--start-time", 1_700_000_000.5
    wheels = "--odom-delay", 0.2, "--odom-fault", "stale@3-4", "--odom-fault", "slip-left@5-6"
    options = *CORRIDOR, *FAST, "--turn-time", 0.5, *lasers, *wheels, *people
    assert run(*options, out) == 0
    logged = messages(out)
    assert run(*options, tmp_path / "again.mcap") == 0
    assert out.read_bytes() == (tmp_path / "again.mcap").read_bytes()
    assert {topic for topic, _, _ in logged} == {
        "/ground_truth", "/odom", "/tf", "/tf_static", "/scan", "/scan_2",
    }  # fmt: skip
    assert logged[0][1] == 1_700_000_000_500_000_000
    for topic, frame, x in (("/scan", "laser", 0), ("/scan_2", "laser_2", -0.2)):
        scans = [store.deserialize_cdr(data, "sensor_msgs/msg/LaserScan")
                 for name, _, data in logged if name == topic]  # fmt: skip
        assert {scan.header.frame_id for scan in scans} == {frame}
        assert [scan.time_increment for scan in scans] == pytest.approx([0.5 / 12] * len(scans))
        assert {7, 8} <= {float(r) for scan in scans for r in scan.ranges if r > 1} <= {7, 8}
        mounts = [store.deserialize_cdr(data, "tf2_msgs/msg/TFMessage").transforms[0]
                  for name, _, data in logged if name == "/tf_static"]  # fmt: skip
        assert [m.transform.translation.x for m in mounts if m.child_frame_id == frame] == [x]


def test_a_tour_of_a_grid_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "map.txt").write_text("######\n#..#.#\n#....#\n######\n")
    tour = tmp_path / "map.txt", "--tour", 3, *FAST
    assert run(*tour, "-v", tmp_path / "a.mcap") == 0
    shown = capsys.readouterr().err.splitlines()
    assert shown[0].split(maxsplit=4)[4] == shown[-2].split(maxsplit=4)[4]  # it comes home
    assert len(shown) >= 6
    assert run(*tour, "--seed", 1, tmp_path / "b.mcap") == 0
    assert (tmp_path / "a.mcap").read_bytes() != (tmp_path / "b.mcap").read_bytes()


def test_a_tour_needs_a_grid_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(CORRIDOR[0], "--tour", 3, tmp_path / "a.mcap") == 1
    assert "corridor.yaml: is no grid map; expected one for --tour" in capsys.readouterr().err


def test_a_drive_into_a_wall(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "path.txt", tmp_path / "log.mcap"
    path.write_text("0.8 0.9\n4 1\n9 1\n")
    assert run(FIXTURES / "corridor.yaml", "--path", path, out) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"Error: {path}: at (7.")
    assert "), on the way to waypoint 3, the robot is 0.1" in error
    assert error.endswith("expected at least its radius, 0.15 m\n")
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere.yaml", "--path", CORRIDOR[2]], "Error: nowhere.yaml: no such file"),
        ([CORRIDOR[0], "--path", "nowhere.txt"], "Error: nowhere.txt: no such file"),
        ([*CORRIDOR, "--odom-fault", "slip@90-91"], "slip begins at 90 s; expected a time before"),
    ],
)
def test_data_errors(
    arguments: list[object], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(*arguments, tmp_path / "log.mcap") == 1
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([CORRIDOR[0]], "Missing option '--path'"),
        (["-", "--path", "-"], "cannot both be standard input"),
        ([*CORRIDOR, "--seed", "-1"], "'--seed'"),
        ([*CORRIDOR, "--tour", "3"], "--path and --tour are two ways: leave out one."),
        ([CORRIDOR[0], "--tour", "0"], "'--tour'"),
        ([*CORRIDOR, "--start-time", "3e9"], "'3e9' is more than 2.14748e+09"),
        ([*CORRIDOR, "--no-return", "a"], "'a' is not of the form M[,M...]."),
        ([*CORRIDOR, "--no-return", "-1"], "no_return is (-1.0,); expected metres, 0 or more"),
        ([*CORRIDOR, "--turn-time", "0.2"], "turn_time is 0.2; expected seconds, up to those"),
        ([*CORRIDOR, "--glass", "2"], "'--glass'"),
        ([*CORRIDOR, "--beams", "0"], "beams is 0; expected more than 0."),
        ([*CORRIDOR, "--range-max", "nan"], "range_max is nan"),
        ([*CORRIDOR, "--odom-noise", "1,2,3"], "'1,2,3' is not of the form A1,A2,A3,A4."),
        ([*CORRIDOR, "--odom-fault", "slip@5"], "'slip@5' is not of the form KIND@T0-T1"),
        ([*CORRIDOR, "--odom-fault", "nap@5-6"], "fault 'nap'; expected reverse-sign or slip"),
        ([*CORRIDOR, "--odom-fault", "slip@6-5"], "expected an end after its begin."),
        ([*CORRIDOR, "--robot-radius", "0"], "'--robot-radius'"),
    ],
)
def test_wrong_usage(
    arguments: list[object], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(*arguments, tmp_path / "log.mcap") == 2
    assert message in " ".join(capsys.readouterr().err.split())
