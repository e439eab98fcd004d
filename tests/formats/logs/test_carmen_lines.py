"""The lines of CARMEN logs that are not FLASER, ROBOTLASER1 and ODOM, and GMapping's."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from mapcli.errors import DataError
from mapcli.formats.documents.load_trajectory import load_trajectory
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.model.log import LogOptions
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount, Odometry, RangeScan, Record

ODOM = "ODOM 1 2 0.5 0 0 0 9.5 host 9.5"
ODOM_LATER = "ODOM 2 2 0.5 0 0 0 10.5 host 10.5"
FLASER = "FLASER 2 1 2.5 1 2 0.5 1 2 0.5 10 host 10"
RLASER = "RLASER 2 3 4 0.75 2 3.641593 1 2 0.5 10 host 10"
RAWLASER = "RAWLASER1 0 -1.5 3 0.5 5 0.01 0 7 1 2 3 4 5 6 0.5 2 9 9 10 host 10"
REAR = "PARAM robot_rearlaser_offset -0.25 0 host 0"
FRONT = "PARAM robot_frontlaser_offset 0.3 0 host 0"

GFS = """FRAME 0 0.000000 0.000000
ODOM 1.000 2.000 0.500000 1134860000.250000
ODO_UPDATE 2 1.000 2.000 0.500000 0.000000 1.010 2.000 0.500000 0.000000 1134860000.250000
LASER_READING 3 1.00 2.00 90.00 1.000000 2.000000 0.500000 1134860000.250000
SM_UPDATE 2 1.000 2.000 0.500000 -3.100000 1.010 2.000 0.500000 -3.200000
NEFF 1.900000
"""


def read(folder: Path, *lines: str, **options: object) -> tuple[list[Record], Log]:
    path = folder / "a.log"
    path.write_text("\n".join([*lines, ""]))
    log = open_log(str(path), LogOptions(**options))  # type: ignore[arg-type]
    return list(log.records()), log


def scan_of(records: list[Record]) -> RangeScan:
    (scan,) = (record for record in records if isinstance(record, RangeScan))
    return scan


def poses_of(records: list[Record]) -> list[Pose2D]:
    return [record.pose for record in records if isinstance(record, Odometry)]


def test_a_rear_laser(tmp_path: Path) -> None:
    """Where it sits is told by its poses, whatever the parameter is."""
    records, log = read(tmp_path, REAR, RLASER)
    scan = scan_of(records)
    assert scan.ranges.tolist() == [3.0, 4.0]
    assert scan.mount.pose.x == pytest.approx(-0.25 * math.cos(0.5), abs=1e-4)
    assert abs(scan.mount.pose.theta) == pytest.approx(math.pi, abs=1e-4)
    assert poses_of(records) == [Pose2D(1, 2, 0.5)]
    assert (log.scan_topics, log.odom_topic) == (["RLASER"], "RLASER")


def test_the_front_laser_comes_first(tmp_path: Path) -> None:
    records, log = read(tmp_path, ODOM, FLASER, RLASER, RAWLASER)
    assert log.scan_topics == ["FLASER"]
    assert scan_of(records).ranges.tolist() == [1.0, 2.5]
    records, _ = read(tmp_path, ODOM, FLASER, RLASER, RAWLASER, scan_topics=("RLASER",))
    assert scan_of(records).ranges.tolist() == [3.0, 4.0]
    with pytest.raises(DataError, match="2 lasers in a CARMEN log"):
        read(tmp_path, FLASER, RLASER, scan_topics=("FLASER", "RLASER"))


def test_a_raw_laser_literally(tmp_path: Path) -> None:
    """It tells no pose: odometry is that of the ODOM lines, the mount that of the parameters."""
    turned = "PARAM robot_frontlaser_angular_offset 90 0 host 0"
    side = "PARAM robot_frontlaser_side_offset 0.1 0 host 0"
    records, log = read(tmp_path, FRONT, turned, side, ODOM, RAWLASER, ODOM_LATER)
    scan = scan_of(records)
    assert (scan.stamp_ns, scan.angle_min, scan.angle_increment) == (10**10, -1.5, 0.5)
    assert scan.ranges.tolist() == [1, 2, 3, 4, math.inf, math.inf, 0.5]  # 5 is its maximum
    assert scan.mount.pose.x == 0.3
    assert scan.mount.pose.y == 0.1
    assert scan.mount.pose.theta == pytest.approx(math.pi / 2)
    assert poses_of(records) == [Pose2D(1, 2, 0.5), Pose2D(2, 2, 0.5)]
    assert (log.scan_topics, log.odom_topic) == (["RAWLASER1"], "ODOM")


def test_a_raw_laser_without_odometry(tmp_path: Path) -> None:
    records, log = read(tmp_path, RAWLASER)
    assert poses_of(records) == []
    assert log.odom_topic is None
    assert "no odometry: poses come from matching scans alone" in log.notes


@pytest.mark.parametrize(
    ("parameter", "laser", "mount"),
    [
        (FRONT, "1 2 0.5", Pose2D(0.3)),  # the laser's poses are the robot's
        (FRONT.replace("0.3", "0.0"), "1 2 0.5", Pose2D()),
        (FRONT, f"{1 + 0.2 * math.cos(0.5)} {2 + 0.2 * math.sin(0.5)} 0.5", Pose2D(0.2)),
        (FRONT.replace("0.3", "much"), "1 2 0.5", Pose2D()),
        ("PARAM robot_frontlaser_offset", "1 2 0.5", Pose2D()),
    ],
)
def test_where_the_laser_sits(tmp_path: Path, parameter: str, laser: str, mount: Pose2D) -> None:
    line = FLASER.replace("2.5 1 2 0.5", f"2.5 {laser}")
    found = scan_of(read(tmp_path, parameter, line)[0]).mount
    assert found.pose.x == pytest.approx(mount.x, abs=1e-4)
    assert (found.pose.y, found.pose.theta) == pytest.approx((0.0, 0.0), abs=1e-4)


def test_the_mount_of_a_corrected_log(tmp_path: Path) -> None:
    """Poses of its lasers are on the map, and tell nothing."""
    later = FLASER.replace("2.5 1 2 0.5", "2.5 7 3 0.5").replace("10 host 10", "11 host 11")
    records, log = read(tmp_path, FRONT, FLASER, later)
    mounts = [record.mount for record in records if isinstance(record, RangeScan)]
    assert mounts == [Mount(Pose2D(0.3))] * 2
    assert not any("corrected" in note for note in log.notes)


@pytest.mark.parametrize(("most", "limit"), [("20", 20.0), ("81.9", 80.0), ("2", 80.0)])
def test_the_longest_range(tmp_path: Path, most: str, limit: float) -> None:
    """2 m are denied by a reading of 2.5 m."""
    parameter = f"PARAM robot_front_laser_max {most} 0 host 0"
    assert scan_of(read(tmp_path, parameter, FLASER)[0]).range_max == limit


def test_a_log_of_gmapping_literally(tmp_path: Path) -> None:
    records, log = read(tmp_path, *GFS.splitlines())
    assert log.damage.counts == {}
    assert (log.scan_topics, log.odom_topic) == (["LASER_READING"], "ODOM")
    scan = scan_of(records)
    assert scan.stamp_ns == 1134860000_250_000_000
    assert scan.ranges.tolist() == [1.0, 2.0, math.inf]
    assert scan.mount == Mount()
    assert poses_of(records) == [Pose2D(1, 2, 0.5)] * 2


def test_a_line_of_gmapping_that_is_cut(tmp_path: Path) -> None:
    lines = GFS.splitlines()
    cut = lines[3].rsplit(" ", 2)[0]
    _, log = read(tmp_path, *lines, cut)
    assert log.damage.counts == {"lines without a valid LASER_READING message": 1}
    assert log.damage.scans_lost == 1


def test_other_remissions_are_no_scans(tmp_path: Path) -> None:
    _, log = read(tmp_path, FLASER, "REMISSIONFLASER 2 1.00 9.0 2.50 9.0 10 host 10")
    assert log.damage.counts == {}


def test_true_poses_are_a_reference(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    lines = [FLASER, "TRUEPOS 3 4 0.5 1 2 0.5 11 host 11", "TRUEPOS 1 2 0.25 1 2 0.5 10 host 10"]
    path.write_text("\n".join([*lines, "TRUEPOS 1 2", ""]))
    for topic in (None, "TRUEPOS"):
        truth = load_trajectory(path, topic).trajectory
        assert truth.stamps_ns is not None
        assert truth.stamps_ns.tolist() == [10**10, 11 * 10**9]
        np.testing.assert_array_equal(truth.poses, [[1, 2, 0.25], [3, 4, 0.5]])
