"""Odometry that counts backwards or nothing at all, where one scan does not tell."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support.looping import box, laps, log_of, ring, scan_at, worst

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.scans.ray_casting import edges_of
from mapcli.algorithms.slam.inertia import JITTER
from mapcli.algorithms.slam.match import Match, MatchHistory, MatchParameters
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.odometry_faults import OdometryFaults
from mapcli.algorithms.slam.pose_refinement import ScanInMap
from mapcli.algorithms.slam.replay import ReplayRun
from mapcli.algorithms.slam.slam import Slam, SlamParameters
from mapcli.model.pose import Pose2D
from mapcli.model.world import World

SECOND = 10**9
STEP = Pose2D(0.25)


def corridor(length: float = 60.0) -> np.ndarray:
    """Two metres wide, with niches 12 cm deep on one side, nowhere equally far apart."""
    walls = [box(-3.0, -1.3, length, -1.12), box(-3.0, 1.0, length, 1.2)]
    ends = [box(-3.2, -1.3, -3.0, 1.2), box(length, -1.3, length + 0.2, 1.2)]
    at, posts = -3.0, []
    for k in range(1000):
        until = min(length, at + 1.5 + 0.8 * (k * k % 5))
        posts.append(box(at, -1.12, until, -1.0))
        at = until + 0.9
        if at >= length:
            break
    return edges_of(World.of([*walls, *ends, *posts]))


CORRIDOR = corridor()


def drive(steps: list[float]) -> list[Pose2D]:
    """Along the corridor."""
    return [Pose2D(float(x)) for x in np.cumsum([0.0, *steps])]


def counted(true: list[Pose2D], factors: dict[int, float]) -> list[Pose2D]:
    """What odometry counts: each motion times a factor, which is 1 where it is not named."""
    odom = [Pose2D()]
    for k, (a, b) in enumerate(pairwise(true)):
        motion, factor = a.between(b), factors.get(k, 1.0)
        odom.append(odom[-1].compose(Pose2D(factor * motion.x, motion.y, motion.theta)))
    return odom


def replayed(
    true: list[Pose2D], odom: list[Pose2D], *, detect: bool = True
) -> tuple[list[Pose2D], set[str], int]:
    """The poses in the end, all active hypotheses, and at how many scans odometry was wrong."""
    slam, active = Slam(SlamParameters(detect_odometry_faults=detect)), set()
    scans = [scan_at(CORRIDOR, pose, k) for k, pose in enumerate(true)]
    for _ in slam.replay(log_of(scans, odom)):
        active.add(slam.faults.active)
    return slam.trajectory.poses, active, len(slam.faults.failures)


# --- inertia, where the robot sees nothing


def blindly(motions: list[float], seconds: float) -> OdometryFaults:
    """After these counted motions of a robot that sees nothing."""
    faults, pose = OdometryFaults(), Pose2D()
    nothing = Perception(np.empty((0, 2)), np.empty((0, 2)), np.zeros(2))
    scan = ScanInMap(OccupancyGrid(), nothing, MatchParameters())
    faults.motion(0, None)
    for k, metres in enumerate(motions, 1):
        motion = faults.motion(round(k * seconds * SECOND), Pose2D(metres))
        assert motion is not None
        here = Match(pose.compose(motion), 0.0, 0, found=False)
        uncertainty = MotionModel().uncertainty(motion)
        pose = faults.select(pose, uncertainty, here, scan, MatchHistory(0.9)).pose
    return faults


def test_no_robot_turns_round_between_two_scans() -> None:
    # From 1 m/s to -1 m/s in a quarter of a second: 8 m/s², eight deviations.
    assert blindly([0.25, 0.25, -0.25], 0.25).active == "reversed"
    assert blindly([0.25, 0.25, -0.25, -0.25], 0.25).active == "reversed"
    # And back as soon as the wheels turn round again.
    assert blindly([0.25, 0.25, -0.25, -0.25, 0.25], 0.25).active == "odometry"


def test_wheels_that_fail_between_two_scans() -> None:
    # A little more than half of the third step is counted as it was, and the rest backwards.
    faults = blindly([0.125, 0.125, 0.02, -0.125], 0.125)
    assert faults.active == "reversed"
    assert faults.failures == {3: "reversed", 4: "reversed"}  # the step in between, too


def test_a_robot_that_has_time_may_turn_round() -> None:
    assert blindly([0.25, 0.25, -0.25, -0.25], 2.0).active == "odometry"
    assert blindly([0.25, 0.2, 0.1, 0.0, -0.1, -0.2, -0.25], 0.25).active == "odometry"


def test_at_standstill_odometry_is_as_good_as_new() -> None:
    assert blindly([0.25, 0.25, -0.25, 0.0], 0.25).active == "odometry"


def test_a_stop_alone_is_no_failure() -> None:
    # 4 m/s²: four deviations are eight nats, and twelve are needed.
    faults = blindly([0.25, 0.25, 0.0], 0.25)
    assert faults.active == "odometry"
    deviation = math.hypot(0.25, math.sqrt(2) * JITTER / 0.25)
    assert faults.alternatives["keeps going"].log_ratio == pytest.approx((1 / deviation) ** 2 / 2)


def test_without_odometry_every_hypothesis_ends() -> None:
    faults = blindly([0.25, 0.25, -0.25], 0.25)
    assert faults.motion(SECOND, None) is None
    assert faults.active == "odometry"
    assert not faults.alternatives


# --- in a corridor


def test_odometry_that_counts_backwards_while_the_robot_drives() -> None:
    true = drive([0.25] * 100)
    odom = counted(true, dict.fromkeys(range(40, 60), -1.0))
    assert worst(odom, true) == pytest.approx(10)
    poses, active, failed = replayed(true, odom)
    assert active == {"odometry", "reversed"}
    assert failed == 20
    assert worst(poses, true) < 0.1
    poses, active, failed = replayed(true, odom, detect=False)
    assert (active, failed) == ({"odometry"}, 0)
    assert worst(poses, true) > 5


def test_odometry_that_counts_backwards_is_found_out_in_every_mode() -> None:
    true = drive([0.25] * 100)
    odom = counted(true, dict.fromkeys(range(40, 60), -1.0))
    scans = [scan_at(CORRIDOR, pose, k) for k, pose in enumerate(true)]
    plain = SlamParameters().without_loops()
    mapping = ReplayRun(Slam(plain))
    list(mapping.track(log_of(scans, odom)))
    assert worst([one.pose for one in mapping.poses], true) < 0.1
    # In the map that it made, which is gone on from, or left alone.
    for frozen in (False, True):
        known = OccupancyGrid.from_grid_map(mapping.slam.map.to_grid_map(), plain.map)
        local_map = replace(plain.local_map, frozen=frozen)
        run = ReplayRun(Slam(replace(plain, local_map=local_map), Pose2D(), known))
        list(run.track(log_of(scans, odom)))
        assert worst([one.pose for one in run.poses], true) < 0.2  # its walls are cells
        assert set(run.slam.faults.failures.values()) <= {"reversed"}


def test_in_a_map_that_remembers_only_inertia_raises_suspicion() -> None:
    # The robot stands before its wheels fail: what the map says alone may be an old lap.
    faults = OdometryFaults(map_remembers=True)
    faults.motion(0, None)
    here = Match(Pose2D(), 0.0, 0, found=False)
    nothing = Perception(np.empty((0, 2)), np.empty((0, 2)), np.zeros(2))
    scan = ScanInMap(OccupancyGrid(), nothing, MatchParameters())
    for k, metres in enumerate([0.0, 0.0, -0.02, -0.06], 1):
        motion = faults.motion(k * SECOND // 4, Pose2D(metres))
        faults.select(Pose2D(), MotionModel().uncertainty(motion), here, scan, MatchHistory(0.9))
        assert "reversed" not in faults.alternatives
        assert "keeps going" not in faults.alternatives


def test_odometry_that_counts_backwards_while_the_robot_backs_up() -> None:
    # It stops first, so inertia says nothing; what was believed meanwhile is put right.
    slower, faster = [0.2, 0.15, 0.1, 0.05, 0.0], [0.05, 0.1, 0.15, 0.2]
    back = [-step for step in (*faster, *[0.25] * 20, *slower)]
    true = drive([*faster, *[0.25] * 60, *slower, *back, *faster, *[0.25] * 30])
    first = 4 + 60 + 5
    odom = counted(true, dict.fromkeys(range(first, first + len(back)), -1.0))
    assert worst(odom, true) > 11
    poses, active, failed = replayed(true, odom)
    assert "reversed" in active
    assert failed == pytest.approx(len(back), abs=5)  # the slow ones at its ends may be either
    assert worst(poses, true) < 0.2


def test_odometry_that_counts_nothing() -> None:
    true = drive([0.4] * 90)
    poses, active, failed = replayed(true, counted(true, dict.fromkeys(range(40, 55), 0.0)))
    assert active == {"odometry", "keeps going"}
    assert failed == pytest.approx(15, abs=2)
    assert worst(poses, true) < 0.3


def test_good_odometry_stays_active() -> None:
    rng = np.random.default_rng(3)
    true = drive([0.1, 0.2, *[0.25] * 60, 0.15, 0.05, 0, 0, -0.1, *[-0.25] * 30])
    noisy = {k: float(f) for k, f in enumerate(rng.normal(1.03, 0.1, len(true)))}
    poses, active, failed = replayed(true, counted(true, noisy))
    assert active == {"odometry"}
    assert failed == 0
    assert worst(poses, true) < 0.3


def test_good_odometry_stays_active_round_corners() -> None:
    edges, true = ring(), laps(72)
    slam = Slam()
    scans = [scan_at(edges, pose, k) for k, pose in enumerate(true)]
    for _ in slam.replay(log_of(scans, true)):
        assert slam.faults.active == "odometry"
