"""The motion of a sweep, of odometry and of inertia."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mapcli import Pose2D
from mapcli.algorithms.scans.perception import Sweep
from mapcli.algorithms.slam.sweep_motion import SweepMotionFilter
from mapcli.model.scan import RangeScan
from mapcli.model.sweep import STILL, BeamTiming, SweepMotion

SECOND = 10**9
SECONDS = np.array([0.0, 0.5])
HITS = np.array([[1.0, 0.0], [5.0, 0.0]])
RAW = np.concatenate([HITS, np.zeros((1, 2))])
SEEN = Sweep(RAW, np.array([0.0, 0.5, 0.25]), STILL).perception(2)


def scan(k: int, counted: float | None) -> RangeScan:
    """Of a robot that moves ahead by odometry, metres a second."""
    one = RangeScan(k * SECOND, 0.0, 1.0, np.ones(2, np.float32), timing=BeamTiming(0.5))
    if counted is None:
        return one
    return replace(one, motion=SweepMotion(SECONDS, np.array([[0, 0, 0], [counted / 2, 0, 0]])))


def moved(motions: SweepMotionFilter, one: RangeScan) -> float:
    """How far the second hit, half a second after the stamp, is put ahead."""
    return float(motions.deskewed(SEEN, one).hits[1, 0] - 5)


def drive(counted: list[float], found: list[float]) -> SweepMotionFilter:
    motions, odom = SweepMotionFilter(), 0.0
    motions.update(scan(0, 0.0), Pose2D(), None)
    for k, (step, true) in enumerate(zip(counted, found, strict=True), start=1):
        odom += step
        motions.update(scan(k, step), Pose2D(odom), Pose2D(true))
    return motions


def test_at_first_odometry_is_believed() -> None:
    assert moved(drive([1.0], [2.0]), scan(2, 1.0)) == pytest.approx(0.5)


def test_wheels_that_count_wrong_are_corrected_by_how_the_robot_went() -> None:
    assert moved(drive([1.0] * 8, [2.0] * 8), scan(9, 1.0)) == pytest.approx(1.0)


def test_a_robot_whose_speed_changes_is_believed_its_wheels() -> None:
    speeds = [1.0, -1.0] * 5
    assert moved(drive(speeds, speeds), scan(11, 1.0)) == pytest.approx(0.5)


def test_without_odometry_the_robot_goes_on() -> None:
    assert moved(drive([1.0], [2.0]), scan(2, None)) == pytest.approx(1.0)


def test_after_a_scan_that_was_not_found_odometry_is_all_there_is() -> None:
    motions = drive([1.0] * 8, [2.0] * 8)
    motions.update(scan(9, 1.0), Pose2D(9), None)
    assert moved(motions, scan(10, 1.0)) == pytest.approx(0.5)


def test_beams_taken_at_once_stay() -> None:
    at_once = replace(SEEN, sweep=None)
    assert drive([1.0], [2.0]).deskewed(at_once, scan(2, 1.0)) is at_once
