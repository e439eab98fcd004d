"""Where a laser sits, found from scans and wheels, of logs that do not tell."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest
from conftest import FIXTURES, SHARED

from mapcli import open_log
from mapcli.algorithms.scans.mount_check import MountCheck
from mapcli.algorithms.scans.odometry_interpolation import ScanAtOdometry, odometry_at_scans
from mapcli.algorithms.slam.laser_calibration import (
    MOST_PAIRS,
    LaserCalibration,
    LaserEstimate,
)
from mapcli.model.log import LogOptions
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount

SIMULATED = SHARED / "datasets" / "simulated"

APARTMENT = list(odometry_at_scans(open_log(FIXTURES / "apartment.mcap").records()))
"""Its laser is at the robot's centre and looks ahead."""


def estimate(scans: Iterable[ScanAtOdometry], *, wanted: bool = True) -> LaserEstimate | None:
    check, calibration = MountCheck(), LaserCalibration(lambda: wanted)
    assert len(list(calibration.watched(check.watched(scans)))) > 0
    return calibration.estimate(check)


def seen_from(mount: Mount) -> list[ScanAtOdometry]:
    """The same drive by the odometry of a robot on which the laser is mounted so, and does not tell
    it: its centre is elsewhere."""
    side = -1 if mount.flipped else 1
    back = mount.pose.inverse()
    return [
        (
            replace(
                scan, angle_min=side * scan.angle_min, angle_increment=side * scan.angle_increment
            ),
            odom and odom.compose(back),
        )
        for scan, odom in APARTMENT
    ]


@pytest.mark.parametrize(
    ("x", "y", "yaw_deg", "flipped"),
    [
        (0.34, 0.0, 0.0, False),
        (-0.12, 0.0, 0.0, False),
        (0.2, -0.1, 0.0, False),
        (0.15, 0.0, 180.0, False),
        (0.0, 0.0, 5.0, False),
        (0.1, 0.1, -90.0, False),
        (0.2, 0.0, 0.0, True),
        (-0.2, 0.05, 180.0, True),
    ],
)
def test_where_the_laser_sits(x: float, y: float, yaw_deg: float, flipped: bool) -> None:
    found = estimate(seen_from(Mount(Pose2D(x, y, math.radians(yaw_deg)), flipped)))
    assert found is not None
    assert found.mount.flipped is flipped
    assert (found.mount.pose.x, found.mount.pose.y) == pytest.approx((x, y), abs=0.02)
    assert math.cos(found.mount.pose.theta - math.radians(yaw_deg)) > math.cos(math.radians(0.6))
    off = np.array(found.found) - (x, y, math.radians(yaw_deg))
    off[2] = (off[2] + math.pi) % math.tau - math.pi
    assert (np.abs(off) < 3 * np.array(found.errors)).all()
    assert max(found.errors[:2]) < 0.02


def test_what_does_not_differ_is_told_as_in_the_middle() -> None:
    found = estimate(seen_from(Mount(Pose2D(0.34, 0.0, 0.0))))
    assert found is not None
    assert found.mount == Mount(Pose2D(0.34, 0.0, 0.0))


@pytest.mark.parametrize("x", [0.0, 0.03, -0.03])
def test_nothing_is_told_of_a_laser_in_the_middle(x: float) -> None:
    assert estimate(seen_from(Mount(Pose2D(x, 0.0, 0.0)))) is None


@pytest.mark.parametrize(
    "change", ["stands", "no odometry", "sees nothing", "short", "other times"]
)
def test_nothing_is_told_where_nothing_is_known(change: str) -> None:
    elsewhere = seen_from(Mount(Pose2D(0.3, 0.0, 0.0)))
    changes: dict[str, Callable[[], list[ScanAtOdometry]]] = {
        "stands": lambda: [(scan, Pose2D()) for scan, _ in elsewhere],
        "no odometry": lambda: [(scan, None) for scan, _ in elsewhere],
        "sees nothing": lambda: [
            (replace(scan, ranges=np.full_like(scan.ranges, np.inf)), odom)
            for scan, odom in elsewhere
        ],
        "short": lambda: elsewhere[:100],
        "other times": lambda: [
            (scan, odom) for (scan, _), (_, odom) in zip(elsewhere, elsewhere[::-1], strict=True)
        ],
    }
    assert estimate(changes[change]()) is None


def test_nothing_is_kept_where_the_log_tells() -> None:
    calibration = LaserCalibration(lambda: False)
    list(calibration.watched(APARTMENT))
    assert not calibration._pairs


def test_a_long_drive_keeps_no_more_pairs() -> None:
    calibration = LaserCalibration(lambda: True)
    for _ in range(5):
        list(calibration.watched(APARTMENT))
        assert 0 < len(calibration._pairs) <= MOST_PAIRS
    stamps = [pair.after.stamp_ns for pair in calibration._pairs]
    assert np.count_nonzero(np.diff(stamps) < 0) == 4  # of all drives


@pytest.mark.skipif(not SIMULATED.is_dir(), reason="needs the shared datasets")
@pytest.mark.parametrize(
    ("log", "mount"),
    [
        ("depot-people", Mount(Pose2D(0.12, 0.0, 0.0))),
        ("depot-fast", Mount(Pose2D(0.12, 0.0, 0.0))),
        ("depot-spinning", Mount(Pose2D(0.1, 0.0, math.pi))),
        ("depot-wheels", None),  # in the middle; wheels reversed, frozen and slipping for a while
    ],
)
def test_logs_of_another_simulator(log: str, mount: Mount | None) -> None:
    records = open_log(SIMULATED / f"{log}.mcap", LogOptions(laser_pose=Mount())).records()
    found = estimate(odometry_at_scans(records))
    if mount is None:
        assert found is None
        return
    assert found is not None
    off = found.mount.pose.between(mount.pose)
    assert (np.abs((off.x, off.y)) < 2 * np.array(found.errors[:2])).all()
    assert math.cos(off.theta) == pytest.approx(1.0)
