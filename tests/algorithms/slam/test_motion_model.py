"""Dead reckoning from scan to scan: jumps, silence, and how far off it may be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mapcli.algorithms.slam.motion_model import (
    FAILURE_COST,
    HIGHEST_SPEED,
    MODEL_NOISE,
    SIDEWAYS,
    DeadReckoning,
    MotionModel,
    OdometryNoise,
    OdometryUncertainty,
)
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import StandardDeviations

SECOND = 10**9
SURE = np.diag([0.003**-2, 0.003**-2, math.radians(0.1) ** -2])


def test_the_first_scan_has_no_motion() -> None:
    assert DeadReckoning().motion(0, Pose2D(5, 6, 1)) is None


def test_a_motion_is_seen_from_the_robot() -> None:
    odometry = DeadReckoning()
    odometry.motion(0, Pose2D(5, 6, math.pi / 2))
    motion = odometry.motion(SECOND, Pose2D(5, 7, math.pi))
    assert motion is not None
    assert (motion.x, motion.y, motion.theta) == pytest.approx((1, 0, math.pi / 2))


@pytest.mark.parametrize("seconds", [0, 1, 10])
def test_only_leaps_are_jumps(seconds: int) -> None:
    farthest = 1.0 + HIGHEST_SPEED * seconds
    for metres, jumps in ((farthest - 0.01, 0), (farthest + 0.01, 1)):
        odometry = DeadReckoning()
        odometry.motion(0, Pose2D())
        motion = odometry.motion(seconds * SECOND, Pose2D(metres))
        assert odometry.jumps == jumps
        assert motion == (None if jumps else Pose2D(metres))


def test_after_a_jump_odometry_is_believed_again() -> None:
    odometry = DeadReckoning()
    places = [Pose2D(), Pose2D(0.1), Pose2D(40.1), Pose2D(40.2)]
    motions = [odometry.motion(k * SECOND // 10, pose) for k, pose in enumerate(places)]
    assert motions[2] is None
    assert motions[3] is not None
    assert motions[3].x == pytest.approx(0.1)
    assert odometry.jumps == 1


def test_silence_is_no_motion_and_no_jump() -> None:
    odometry = DeadReckoning()
    places = [Pose2D(), None, Pose2D(50.0), Pose2D(50.1)]
    motions = [odometry.motion(k * SECOND // 10, pose) for k, pose in enumerate(places)]
    assert motions[:3] == [None] * 3
    assert motions[3] is not None
    assert odometry.jumps == 0


def test_uncertainty_by_hand() -> None:
    model = MotionModel(
        xy_floor=0.01, xy_per_m=0.1, xy_per_rad=0.2,
        turn_floor_deg=1.0, turn_per_rad=0.5, turn_deg_per_m=2.0,
        silent_xy=0.4, silent_turn_deg=30.0,
    )  # fmt: skip
    moved = model.uncertainty(Pose2D(3, -4, -0.1))  # 5 m, 0.1 rad
    assert moved.deviations.xy == pytest.approx(0.01 + 0.5 + 0.02)
    assert moved.deviations.theta == pytest.approx(math.radians(1 + 10) + 0.05)
    assert moved.metres == pytest.approx(5)
    standing = OdometryUncertainty(StandardDeviations(0.01, math.radians(1)), 0, sideways=SIDEWAYS)
    assert model.uncertainty(Pose2D()) == standing
    silent = OdometryUncertainty(StandardDeviations(0.4, math.radians(30)), 0, window_sigmas=2)
    assert model.uncertainty(None) == silent


def test_wheels_err_ahead_unless_they_roll_sideways() -> None:
    model = MotionModel(xy_floor=0.0, xy_per_m=0.1)
    for motion, left in (((2.0, 0.0), 0.2 * SIDEWAYS), ((0.0, -2.0), 0.2), ((1.6, 1.2), 0.12)):
        axes = model.uncertainty(Pose2D(*motion)).along_axes()
        assert (axes.ahead, axes.left) == pytest.approx((0.2, left))
    silent = model.uncertainty(None).along_axes(2.0)
    assert silent.ahead == silent.left == pytest.approx(2 * model.silent_xy)


def test_what_separates_two_poses() -> None:
    uncertainty = OdometryUncertainty(StandardDeviations(0.1, 0.02), 0)
    here = Pose2D(1, 2, 3.13)
    for x, theta, separated in ((0.19, 0.039, False), (0.21, 0.0, True), (0.0, -0.041, True)):
        there = here.compose(Pose2D(x, 0, theta))
        assert uncertainty.separates(here, there, 2.0) == separated
        assert uncertainty.separates(here, there, 1.0) == (x > 0.1 or abs(theta) > 0.02)


def test_motions_are_corrected_by_the_calibration() -> None:
    odometry = DeadReckoning()
    for k in range(200):  # counts 5 % more than it drives
        motion = odometry.motion(k * SECOND // 10, Pose2D(0.21 * k))
        if motion is not None:
            odometry.calibrate(Pose2D(0.2), SURE)
    assert motion is not None
    assert motion.x == pytest.approx(0.2, abs=0.001)


def test_nothing_is_calibrated_without_odometry_or_without_a_map() -> None:
    odometry = DeadReckoning()
    odometry.motion(0, Pose2D())
    odometry.calibrate(Pose2D(0.3), SURE)  # the first scan
    odometry.motion(SECOND, Pose2D(0.21))
    odometry.calibrate(Pose2D(0.2), None)  # the map says nothing about how well it knows
    odometry.motion(2 * SECOND, None)
    odometry.calibrate(Pose2D(0.2), SURE)  # silence
    assert odometry.calibration is not None
    assert odometry.calibration.metres == 1
    odometry.motion(3 * SECOND, Pose2D(0.21))
    odometry.motion(4 * SECOND, Pose2D(0.42))
    odometry.calibrate(Pose2D(0.2), SURE)
    assert odometry.calibration.metres < 1


def test_without_calibration_motions_are_as_counted() -> None:
    odometry = DeadReckoning(calibrate=False)
    for k in range(20):
        motion = odometry.motion(k * SECOND, Pose2D(0.21 * k))
        odometry.calibrate(Pose2D(0.2), SURE)
    assert motion is not None
    assert motion.x == pytest.approx(0.21, abs=1e-9)


def test_what_odometry_errs_by_is_learned() -> None:
    noise, deviations = OdometryNoise(), StandardDeviations(0.1, 0.05)
    assert noise.shares == MODEL_NOISE
    for _ in range(500):  # half a deviation along each axis, a tenth of one in turning
        noise.update(Pose2D(1.0), Pose2D(1.05, 0.05, 0.005), deviations)
    assert noise.shares.xy == pytest.approx(0.5, abs=0.02)
    assert noise.shares.theta == pytest.approx(0.17, abs=0.03)
    before = noise.shares
    noise.update(Pose2D(1.0), Pose2D(-1.0), deviations)  # a failure: as if two deviations
    assert noise.shares.xy == pytest.approx(before.xy, abs=0.01)


def test_what_odometry_says_against_a_pose() -> None:
    uncertainty = OdometryUncertainty(
        StandardDeviations(0.1, 0.02), 1.0, usual=StandardDeviations(0.5, 2.0)
    )
    here = Pose2D(1, 2, 3.13)
    assert uncertainty.cost(here, here) == 0
    assert uncertainty.cost(here, here.compose(Pose2D(0.1))) == pytest.approx(2**2 / 2)
    assert uncertainty.cost(here, here.compose(Pose2D(theta=0.04))) == pytest.approx(1 / 2)
    assert uncertainty.cost(here, Pose2D()) == FAILURE_COST


def test_a_step_that_no_robot_makes_is_suspect() -> None:
    odometry = DeadReckoning()
    for k, metres in enumerate((0.0, 0.4, 0.8, 0.8)):
        motion = odometry.motion(k * SECOND // 5, Pose2D(metres))
        assert odometry.uncertainty(motion).is_suspect == (k == 3)
        odometry.compare(motion or Pose2D())
