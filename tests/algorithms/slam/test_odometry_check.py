"""Odometry that is wrong throughout, on a drive made by hand, with some noise."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np
import pytest

from mapcli.algorithms.slam.odometry_check import odometry_reasons
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.trace import TracedPose

Change = Callable[[Pose2D], Pose2D | None]


def drive(change: Change, share: float = 1.0) -> list[TracedPose]:
    """An eight of two circles of 3 m, twice round; odometry is changed for a share of it."""
    rng, poses = np.random.default_rng(1), [Pose2D()]
    for k in range(800):
        turn = math.radians(3.6 if k % 200 < 100 else -3.6)
        poses.append(poses[-1].compose(Pose2D(0.19, 0.0, turn)))
    traced = []
    for k, pose in enumerate(poses):
        odom = pose.compose(Pose2D(*rng.normal(0, (0.01, 0.01, 0.005)).tolist()))
        said = change(odom) if k < share * len(poses) else odom
        traced.append(TracedPose(k, pose, said, 0.9, "matched"))
    return traced


def texts(poses: list[TracedPose]) -> list[str]:
    return [one.text for one in odometry_reasons(poses, 1.0)]


WRONG: dict[str, Change] = {
    "odometry counts 1,0.. m for every metre of the map": (
        lambda p: Pose2D(1000 * p.x, 1000 * p.y, p.theta)
    ),
    "odometry counts 0\\.5.? m for every metre of the map": (
        lambda p: Pose2D(p.x / 2, p.y / 2, p.theta)
    ),
    "odometry never turns": lambda p: Pose2D(p.x, p.y, 0.3),
    "odometry turns the other way than the robot": lambda p: Pose2D(p.x, p.y, -p.theta),
    "odometry's heading looks like degrees": (
        lambda p: Pose2D(p.x, p.y, wrap_angle(math.degrees(p.theta)))
    ),
}


@pytest.mark.parametrize("text", WRONG)
def test_odometry_that_is_wrong_throughout(text: str) -> None:
    (found,) = odometry_reasons(drive(WRONG[text]), 9.0)
    assert re.fullmatch(text, found.text)
    assert (found.kind, found.verdict) == ("odometry_wrong", "doubtful")
    assert (found.from_s, found.to_s) == (0.0, 9.0)


@pytest.mark.parametrize("text", WRONG)
def test_wheels_that_fail_for_half_the_drive_are_not(text: str) -> None:
    assert texts(drive(WRONG[text], 0.5)) == []


@pytest.mark.parametrize(("deg", "way", "other"), [(30, "right", "left"), (-30, "left", "right")])
def test_a_laser_that_looks_elsewhere(deg: float, way: str, other: str) -> None:
    # The map's robot looks where the laser does, so much to the left of where the wheels roll.
    (found,) = odometry_reasons(drive(lambda p: p.compose(Pose2D(theta=-math.radians(deg)))), 1.0)
    assert (found.kind, found.verdict) == ("laser_turned", "doubtful")
    assert found.text == (
        f"the robot drives 30 deg to the {way} of ahead: the laser is mounted as far to the "
        f"{other} of where the log says"
    )


@pytest.mark.parametrize(
    "change",
    [
        lambda p: p,
        lambda p: Pose2D(1.2 * p.x, 1.2 * p.y, 1.1 * p.theta),
        lambda p: None,
        lambda p: Pose2D(),
        lambda p: p.compose(Pose2D(theta=math.radians(8))),
    ],
)
def test_what_calibration_makes_good(change: Change) -> None:
    assert texts(drive(change)) == []


def test_a_short_drive_tells_nothing() -> None:
    assert texts(drive(lambda p: Pose2D(9 * p.x, 9 * p.y, -p.theta))[:15]) == []
