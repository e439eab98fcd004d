"""Lasers that do not sit where the log says, told by consecutive scans and odometry."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest
from conftest import FIXTURES, SHARED

from mapcli import open_log
from mapcli.algorithms.scans.mount_check import PAIRS_AT_ONCE, MountCheck, MountFinding
from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount, RangeScan

DATASETS = SHARED / "datasets"

Scan = tuple[RangeScan, Pose2D | None]

APARTMENT = list(odometry_at_scans(open_log(FIXTURES / "apartment.mcap").records()))


def found(scans: Iterable[Scan]) -> MountFinding | None:
    check = MountCheck()
    assert len(list(check.watched(scans))) > 0
    return check.finding()


def told(mount: Mount, scans: Iterable[Scan] = APARTMENT) -> list[Scan]:
    return [(replace(scan, mount=mount), odom) for scan, odom in scans]


@pytest.mark.parametrize(
    ("mount", "turn_deg", "mirrored"),
    [
        (Mount(Pose2D(theta=math.pi)), 180, False),
        (Mount(flipped=True), 0, True),
        (Mount(Pose2D(theta=math.pi), flipped=True), 180, True),
        (Mount(Pose2D(theta=-math.pi / 2)), 90, False),
        (Mount(Pose2D(theta=math.pi / 2)), -90, False),
    ],
)
def test_a_wrong_mount_is_told_from_the_right_one(
    mount: Mount, turn_deg: float, mirrored: bool
) -> None:
    finding = found(told(mount))
    assert finding is not None
    assert math.degrees(finding.turn) == pytest.approx(turn_deg)
    assert finding.mirrored is mirrored
    assert finding.right.flipped is False
    assert math.sin(finding.right.pose.theta) == pytest.approx(0, abs=1e-8)
    assert math.cos(finding.right.pose.theta) == pytest.approx(1)


def test_the_place_of_the_laser_stays() -> None:
    finding = found(told(Mount(Pose2D(0.02, 0.01, math.pi), flipped=True)))
    assert finding is not None
    assert finding.right == Mount(Pose2D(0.02, 0.01, 0.0))


def test_the_right_mount() -> None:
    assert found(APARTMENT) is None


def test_wheels_that_are_reversed_for_a_while() -> None:
    """A tenth of the drive goes backwards by the wheels."""
    poses = [odom for _, odom in APARTMENT if odom is not None]
    pose, scans = poses[0], [APARTMENT[0]]
    for k in range(1, len(poses)):
        step = poses[k - 1].between(poses[k])
        if 100 <= k < 150:
            step = Pose2D(-step.x, -step.y, step.theta)
        pose = pose.compose(step)
        scans.append((APARTMENT[k][0], pose))
    assert found(scans) is None


@pytest.mark.parametrize("change", ["stands", "no odometry", "no returns", "one beam"])
def test_nothing_is_told_where_nothing_is_known(change: str) -> None:
    changes: dict[str, Callable[[RangeScan, Pose2D | None], Scan]] = {
        "stands": lambda scan, _: (scan, Pose2D()),
        "no odometry": lambda scan, _: (scan, None),
        "no returns": lambda s, odom: (replace(s, ranges=np.full_like(s.ranges, np.inf)), odom),
        "one beam": lambda s, odom: (replace(s, ranges=s.ranges[:1], angle_increment=0.0), odom),
    }
    mirrored = told(Mount(flipped=True))
    assert found(changes[change](scan, odom) for scan, odom in mirrored) is None


def test_a_long_drive_costs_little_more() -> None:
    check = MountCheck()
    compared = []
    for _ in range(64):
        list(check.watched(APARTMENT))
        compared.append(check._compared)
    pairs = check._pairs
    assert compared[-1] <= PAIRS_AT_ONCE * (1 + math.log2(pairs / PAIRS_AT_ONCE))
    assert compared[-1] > compared[0]


@pytest.mark.skipif(not DATASETS.is_dir(), reason="needs the shared datasets")
@pytest.mark.parametrize(
    "log", sorted([*DATASETS.glob("*.log.gz"), *DATASETS.glob("simulated/*.mcap")]),
    ids=lambda path: path.name,
)  # fmt: skip
def test_real_drives(log: object) -> None:
    """Nothing is found in a log that is right, and what is wrong in it mirrored or backwards."""
    scans = list(odometry_at_scans(open_log(str(log)).records()))
    assert found(scans) is None
    for mirrored in (True, False):
        turn = 0.0 if mirrored else math.pi
        wrong = [
            (
                replace(
                    scan,
                    mount=Mount(
                        replace(scan.mount.pose, theta=scan.mount.pose.theta + turn),
                        scan.mount.flipped != mirrored,
                    ),
                ),
                odom,
            )
            for scan, odom in scans
        ]
        finding = found(wrong)
        assert finding is not None
        assert (finding.turn, finding.mirrored) == (turn, mirrored)
        assert finding.right.flipped == scans[0][0].mount.flipped
