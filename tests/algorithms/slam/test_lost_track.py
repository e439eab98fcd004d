"""A robot that is lost: what adds up, what is not written, and when the map begins anew."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.looping import laps, log_of, ring, rooms, scan_at

from mapcli.algorithms.slam.lost_track import ANYWHERE, MOST_SCANS, LostTrack
from mapcli.algorithms.slam.match import Match
from mapcli.algorithms.slam.motion_model import MotionModel, OdometryUncertainty
from mapcli.algorithms.slam.slam import Slam, SlamParameters
from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan
from mapcli.model.se2_uncertainty import CERTAIN, StandardDeviations

FOUND = Match(Pose2D(), 0.9, 50, found=True)
BLIND = Match(Pose2D(), 0.0, 0, found=False)
CONTRADICTED = Match(Pose2D(), 0.1, 50, found=False, is_contradicted=True)
STEP = OdometryUncertainty(StandardDeviations(0.03, 0.04), 2.0)
MODEL = MotionModel()


def test_what_the_map_does_not_tell_adds_up() -> None:
    lost = LostTrack(MODEL)
    lost.update(BLIND, STEP)
    assert lost.deviations == pytest.approx((0.03, 0.04))
    lost.update(BLIND, STEP)  # the heading is off by 0.04 while it drives 2 m
    assert lost.deviations == pytest.approx((math.sqrt(2 * 0.03**2 + 0.08**2), 0.04 * math.sqrt(2)))
    assert lost.lost_scans == 0
    lost.update(FOUND, STEP)
    assert lost.deviations == CERTAIN


def test_odometry_that_the_map_contradicts_counts_as_silent() -> None:
    lost = LostTrack(MODEL)
    lost.update(CONTRADICTED, STEP)
    expected = math.hypot(0.03, MODEL.silent_xy)
    assert lost.deviations.xy == pytest.approx(expected)
    silent = math.radians(MODEL.silent_turn_deg)
    assert lost.deviations.theta == pytest.approx(math.hypot(0.04, silent))


def test_a_robot_is_elsewhere_when_the_map_goes_on_contradicting() -> None:
    lost = LostTrack(MODEL)
    for match in [CONTRADICTED, *[BLIND, CONTRADICTED] * MOST_SCANS][:MOST_SCANS]:
        lost.update(match, STEP)
        assert not lost.is_elsewhere
    lost.update(BLIND, STEP)
    assert lost.is_elsewhere
    assert lost.deviations == ANYWHERE
    assert lost.lost_scans == MOST_SCANS + 1
    lost.begin_anew()
    assert (lost.is_elsewhere, lost.lost_scans, lost.deviations) == (False, 0, CERTAIN)


WAY = laps(10, 0.2)


def around(poses: list[Pose2D]) -> list[RangeScan]:
    return [scan_at(ring(), pose, k) for k, pose in enumerate(poses)]


def test_what_the_map_contradicts_is_not_written() -> None:
    scans = around(WAY)
    for k in (20, 23, 24):
        scans[k] = scan_at(rooms(3), Pose2D(2.0, 0.0, 1.0), k)
    slam = Slam()
    found = list(slam.replay(log_of(scans, WAY)))
    assert [k for k, one in enumerate(found) if one.status == "odometry"] == [20, 23, 24]
    assert {20, 23, 24}.isdisjoint(frame.scan for frame in slam.trajectory.keyframes)
    assert not any(frame.is_first for frame in slam.trajectory.keyframes)


def test_a_robot_that_was_carried_begins_anew() -> None:
    """It drives round the ring, is put down between rooms, and drives on; the wheels did not count
    meanwhile."""
    there = [Pose2D(0.2 * k + 0.5) for k in range(40)]
    scans = around(WAY)
    scans += [scan_at(rooms(4), pose, len(WAY) + k) for k, pose in enumerate(there)]
    away = WAY[-1].compose(there[0].inverse())
    odom = [*WAY, *(away.compose(pose) for pose in there)]
    slam = Slam()
    found = list(slam.replay(log_of(scans, odom)))
    first = [frame for frame in slam.trajectory.keyframes if frame.is_first]
    assert [frame.scan for frame in first] == [len(WAY) + MOST_SCANS]
    assert [frame.lost_since for frame in first] == [len(WAY)]
    assert math.sqrt(first[0].covariance[2, 2]) > 3.0
    lost = [k for k, one in enumerate(found) if one.status == "odometry"]
    assert lost == list(range(len(WAY), len(WAY) + MOST_SCANS + 1))
    for traced, pose in zip(found[len(WAY) :], there, strict=True):
        assert WAY[0].between(away.compose(pose)).distance(traced.pose) < 0.05


def test_a_map_that_never_forgets_is_always_written_to() -> None:
    scans = around(WAY)
    scans[20] = scan_at(rooms(3), Pose2D(2.0, 0.0, 1.0), 20)
    slam, plain = Slam(), Slam(SlamParameters().without_loops())
    before = {}
    for one in (slam, plain):
        poses = one.replay(log_of(scans[:21], WAY[:21]))
        for _ in range(20):
            next(poses)
        before[one] = np.count_nonzero(one.map.log_odds)
        next(poses)
    assert np.count_nonzero(slam.map.log_odds) == before[slam]
    assert np.count_nonzero(plain.map.log_odds) > before[plain]
