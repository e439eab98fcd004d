"""The wheels' motions from scan to scan: leaps, silence, and what is expected of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mapcli.algorithms.slam.motion_model import HIGHEST_SPEED, DeadReckoning, MotionModel
from mapcli.model.pose import Pose2D

SECOND = 10**9
SURE = np.diag([0.003**-2, 0.003**-2, math.radians(0.1) ** -2])


def test_the_first_scan_has_no_motion() -> None:
    assert DeadReckoning().motion(0, Pose2D(5, 6, 1)) is None


def test_a_motion_is_seen_from_the_robot() -> None:
    wheels = DeadReckoning()
    wheels.motion(0, Pose2D(5, 6, math.pi / 2))
    motion = wheels.motion(SECOND, Pose2D(5, 7, math.pi))
    assert motion is not None
    assert (motion.x, motion.y, motion.theta) == pytest.approx((1, 0, math.pi / 2))


@pytest.mark.parametrize("seconds", [0, 1, 10])
def test_only_leaps_are_jumps(seconds: int) -> None:
    farthest = 1.0 + HIGHEST_SPEED * seconds
    for metres, jumps in ((farthest - 0.01, 0), (farthest + 0.01, 1)):
        wheels = DeadReckoning()
        wheels.motion(0, Pose2D())
        motion = wheels.motion(seconds * SECOND, Pose2D(metres))
        assert wheels.jumps == jumps
        assert motion == (None if jumps else Pose2D(metres))


def test_after_a_jump_the_wheels_are_believed_again() -> None:
    wheels = DeadReckoning()
    places = [Pose2D(), Pose2D(0.1), Pose2D(40.1), Pose2D(40.2)]
    motions = [wheels.motion(k * SECOND // 10, pose) for k, pose in enumerate(places)]
    assert motions[2] is None
    assert motions[3] is not None
    assert motions[3].x == pytest.approx(0.1)
    assert wheels.jumps == 1


def test_silence_is_no_motion_and_no_jump() -> None:
    wheels = DeadReckoning()
    places = [Pose2D(), None, Pose2D(50.0), Pose2D(50.1)]
    motions = [wheels.motion(k * SECOND // 10, pose) for k, pose in enumerate(places)]
    assert motions[:3] == [None] * 3
    assert motions[3] is not None
    assert wheels.jumps == 0


def test_uncertainty_by_hand() -> None:
    model = MotionModel(0.02, 0.1, 0.05, 0.5, 0.15, 2.0, 0.3, 10.0)
    uncertainty = model.uncertainty(Pose2D(0.3, -0.4, -0.2))  # half a metre and 0.2 rad
    assert uncertainty.deviations.xy == pytest.approx(0.02 + 0.1 * 0.5 + 0.05 * 0.2)
    assert uncertainty.deviations.theta == pytest.approx(math.radians(0.5 + 2.0 * 0.5) + 0.15 * 0.2)
    assert uncertainty.metres == pytest.approx(0.5)
    standing = model.uncertainty(Pose2D())
    assert standing.deviations == pytest.approx((0.02, math.radians(0.5)))
    silent = model.uncertainty(None)
    assert (silent.deviations, silent.metres) == ((0.3, math.radians(10)), 0)


def test_motions_are_corrected_by_what_was_learned() -> None:
    wheels = DeadReckoning()
    for k in range(200):  # counts 5 % more than it drives
        motion = wheels.motion(k * SECOND // 10, Pose2D(0.21 * k))
        if motion is not None:
            wheels.calibrate(Pose2D(0.2), SURE)
    assert motion is not None
    assert motion.x == pytest.approx(0.2, abs=0.001)


def test_nothing_is_learned_without_odometry_or_without_a_map() -> None:
    wheels = DeadReckoning()
    wheels.motion(0, Pose2D())
    wheels.calibrate(Pose2D(0.3), SURE)  # the first scan
    wheels.motion(SECOND, Pose2D(0.21))
    wheels.calibrate(Pose2D(0.2), None)  # the map says nothing about how well it knows
    wheels.motion(2 * SECOND, None)
    wheels.calibrate(Pose2D(0.2), SURE)  # silence
    assert wheels.calibration.metres == 1
    wheels.motion(3 * SECOND, Pose2D(0.21))
    wheels.motion(4 * SECOND, Pose2D(0.42))
    wheels.calibrate(Pose2D(0.2), SURE)
    assert wheels.calibration.metres < 1
