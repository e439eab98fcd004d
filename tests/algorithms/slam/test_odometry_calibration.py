"""Online calibration of odometry: its systematic errors, from the log."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.odometry_calibration import OdometryCalibration
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import StandardDeviations

SURE = np.diag([0.003**-2, 0.003**-2, math.radians(0.1) ** -2])
WIDE = StandardDeviations(10.0, 10.0)
"""Standard deviations within which nothing is an outlier."""


def drive(seed: int, steps: int) -> list[Pose2D]:
    """True motions: 20 cm ahead, sometimes back, and turns of 14 to 23 degrees either way."""
    rng = np.random.default_rng(seed)
    ahead = rng.choice([0.2, 0.2, 0.2, -0.2], steps)
    turns = rng.choice([-1, 1], steps) * rng.uniform(0.25, 0.4, steps)
    return [Pose2D(x, 0.0, turn) for x, turn in zip(ahead.tolist(), turns.tolist(), strict=True)]


def calibrated(
    true: list[Pose2D],
    factors: tuple[float, float, float] = (1.0, 1.0, 0.0),
    noise: tuple[float, float] = (0.0, 0.0),
    deviations: StandardDeviations = WIDE,
    seed: int = 0,
) -> OdometryCalibration:
    """Of odometry that counts `factors` of metres, turns and radians per metre, with noise."""
    rng, calibration = np.random.default_rng(seed), OdometryCalibration()
    metres, turns, drift = factors
    for motion in true:
        turn = turns * motion.theta + drift * motion.x
        counted = Pose2D(
            metres * motion.x + rng.normal(0, noise[0]), 0.0, turn + rng.normal(0, noise[1])
        )
        calibration.update(counted, motion, SURE, deviations)
    return calibration


def test_without_motion_nothing_is_corrected() -> None:
    motion = Pose2D(0.3, -0.1, 0.4)
    same = OdometryCalibration().correct(motion)
    assert (same.x, same.y, same.theta) == pytest.approx((0.3, -0.1, 0.4))


def test_correct_by_hand() -> None:
    calibration = OdometryCalibration()
    calibration.metres, calibration.turns, calibration.drift = 1.1, 0.9, 0.02
    corrected = calibration.correct(Pose2D(2.0, -1.0, 0.5))
    assert (corrected.x, corrected.y, corrected.theta) == pytest.approx((2.2, -1.1, 0.45 + 0.04))


def test_exact_odometry_stays_exact() -> None:
    calibration = calibrated(drive(0, 300))
    assert calibration.metres == pytest.approx(1, abs=1e-12)
    assert calibration.turns == pytest.approx(1, abs=1e-12)
    assert calibration.drift == pytest.approx(0, abs=1e-12)


def test_odometry_that_counts_too_much_and_turns_too_little() -> None:
    # 3 % too much, 5 % too little: after 200 m, of which 1 m is given away to the prior.
    calibration = calibrated(drive(0, 1000), (1.03, 0.95, 0.0))
    assert calibration.metres == pytest.approx(1 / 1.03, abs=0.03 * 2 / 200)
    assert calibration.turns == pytest.approx(1 / 0.95, abs=1e-3)
    assert calibration.drift == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_noise_does_not_shift_what_is_calibrated(seed: int) -> None:
    # Least squares would take noise for motion: factors too low by (0.05 / 0.2)^2 = 6 % and by
    # (0.05 / 0.33)^2 = 2.3 %. Signs as instruments err by chance alone: 0.25 / sqrt(4000) = 0.4 %
    # and 0.24 %, and three times that at most. (Turns are far from `TURNING`: noise decides
    # which of those near it count.)
    noise = 0.05, 0.05
    calibration = calibrated(drive(seed, 4000), (1.03, 0.95, 0.0), noise, seed=seed)
    assert calibration.metres == pytest.approx(1 / 1.03, abs=0.012)
    assert calibration.turns == pytest.approx(1 / 0.95, abs=0.008)


def test_a_robot_that_pulls_to_one_side() -> None:
    # 2 degrees per metre; the true turn is what was counted less that.
    drift = math.radians(2.0)
    calibration = calibrated(drive(0, 1000), (1.0, 1.0, drift))
    assert calibration.drift == pytest.approx(-drift, abs=0.02 * drift)
    assert calibration.turns == pytest.approx(1, abs=1e-3)


def test_driving_straight_does_not_ruin_the_factor_of_turns() -> None:
    # 400 m along a corridor: heading noise of half a degree must not pass for turning.
    true = [Pose2D(0.2, 0.0, 0.0)] * 2000
    calibration = calibrated(true, (1.0, 1.0, 0.0), (0.0, math.radians(0.5)))
    assert calibration.turns == pytest.approx(1, abs=0.01)
    assert calibration.drift == pytest.approx(0, abs=math.radians(0.5) / math.sqrt(2000) * 3 / 0.2)


def test_straight_driving_after_turning_keeps_what_was_calibrated() -> None:
    calibration = calibrated(drive(0, 400), (1.0, 0.95, 0.0))
    before = calibration.turns
    for _ in range(1000):
        calibration.update(Pose2D(0.2), Pose2D(0.2), SURE, WIDE)
    assert calibration.turns == pytest.approx(before, abs=1e-3)


@pytest.mark.parametrize(
    "found",
    [Pose2D(1.0), Pose2D(-0.2), Pose2D(0.2, 0.5), Pose2D(0.2, 0.0, 0.6), Pose2D(0.2, 0.0, 3.1)],
)
def test_outliers_are_left_out(found: Pose2D) -> None:
    counted, calibration = Pose2D(0.2), OdometryCalibration()
    deviations = MotionModel().uncertainty(counted).deviations
    for _ in range(100):
        calibration.update(counted, found, SURE, deviations)
    assert (calibration.metres, calibration.turns, calibration.drift) == (1, 1, 0)


def test_a_motion_within_three_standard_deviations_is_no_outlier() -> None:
    calibration = OdometryCalibration()
    for off, counts in ((0.029, True), (0.031, False)):
        calibration = OdometryCalibration()
        calibration.update(Pose2D(0.2), Pose2D(0.2 + off), SURE, StandardDeviations(0.01, 1.0))
        assert (calibration.metres != 1) == counts


def test_what_the_map_does_not_fix_counts_little() -> None:
    # Along a corridor the match knows the heading, but not how far the robot has come.
    blind = np.diag([0.0, 0.01**-2, math.radians(0.1) ** -2])
    calibration = OdometryCalibration()
    for _ in range(500):
        calibration.update(Pose2D(0.22), Pose2D(0.2), blind, WIDE)
    assert calibration.metres == pytest.approx(1, abs=1e-3)


def test_backing_up_counts_as_much_as_driving_ahead() -> None:
    calibration = OdometryCalibration()
    for sign in (1, -1) * 200:
        calibration.update(Pose2D(0.22 * sign), Pose2D(0.2 * sign), SURE, WIDE)
    assert calibration.metres == pytest.approx(1 / 1.1, abs=0.01)
