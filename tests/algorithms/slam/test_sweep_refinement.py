"""Scans that were taken beam by beam while the robot drove and turned."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support.sweeping import SECOND, START_NS, SweepingRobot, ate

from mapcli import Pose2D, SlamParameters, replay
from mapcli.algorithms.slam._kernels.pose_chain import OdometrySteps
from mapcli.algorithms.slam.replay import Replayed
from mapcli.algorithms.slam.sweep_path import shares_of_odometry
from mapcli.model.scan import Mount, RangeScan
from mapcli.model.sweep import AT_ONCE, BeamTiming, ScanStamp

STAMPS: dict[ScanStamp, float] = {"first": 0.0, "middle": 0.5, "last": 1.0}
"""The share of a sweep that is over at the stamp."""


def error(replayed: Replayed, robot: SweepingRobot) -> float:
    return ate([pose.pose for pose in replayed.trace.poses], robot.truth())


@pytest.mark.slow
@pytest.mark.parametrize("stamp", STAMPS)
@pytest.mark.parametrize("flipped", [False, True])
def test_beams_are_put_where_they_were_taken(stamp: ScanStamp, flipped: bool) -> None:
    robot = SweepingRobot(flipped=flipped, mid=STAMPS[stamp])
    replayed = replay(robot.records(BeamTiming(robot.increment, stamp, order=None)))
    at_once = error(replay(robot.records(AT_ONCE)), robot)
    assert error(replayed, robot) < 0.003
    assert at_once > 0.03
    sweep = replayed.summary.sweep
    assert sweep is not None
    assert sweep.order == ("backward" if flipped else "forward")
    assert sweep.turn_time_s == pytest.approx(0.181, abs=1e-3)
    assert sweep.crispness is not None
    assert sweep.crispness.deskewed > 0.99
    assert sweep.crispness.at_once < 0.9


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "metres"), [(0.02, 0.01), (0.1, 0.02)])
def test_while_the_robot_drives_the_motion_found_helps_noisy_wheels(
    noise: float, metres: float
) -> None:
    robot = SweepingRobot(noise=noise)
    plain = SlamParameters().without_loops()
    replayed = replay(robot.records(BeamTiming(robot.increment)), plain)
    assert error(replayed, robot) < metres
    assert replayed.summary.sweep is not None
    assert replayed.summary.sweep.crispness is None


@pytest.mark.slow
def test_without_odometry_the_poses_show_the_motion() -> None:
    robot = SweepingRobot(period_s=0.1, beams=120, seconds=8)
    timing = BeamTiming(robot.increment)
    scans = [robot.scan(k, timing) for k in range(1, int(robot.seconds / robot.period_s))]
    deskewed = error(replay(scans), robot)
    at_once = error(replay([replace(scan, timing=AT_ONCE) for scan in scans]), robot)
    assert deskewed < 0.005 < at_once


@pytest.mark.slow
def test_after_a_pause_a_sweep_stays_as_odometry_has_it() -> None:
    # Of a sweep a fifth of a second long, every third is used.
    robot = SweepingRobot(noise=0.005)
    records = robot.records(BeamTiming(robot.increment))
    taken = iter(range(len(records)))
    some = [one for one in records if not hasattr(one, "ranges") or next(taken) % 3 == 0]
    replayed = replay(some)
    found = [pose.pose for pose in replayed.trace.poses]
    assert ate(found, robot.truth()[::3]) < 0.006


@pytest.mark.slow
def test_a_slow_laser_goes_by_good_wheels() -> None:
    # A cubic through poses 0.7 s apart is 14 mm off.
    robot = SweepingRobot(period_s=0.7, seconds=24, noise=0.005)
    assert error(replay(robot.records(BeamTiming(robot.increment))), robot) < 0.005


@pytest.mark.slow
@pytest.mark.parametrize("later_s", [0.0, 0.004, 0.1])
def test_sweeps_of_two_lasers_overlap(later_s: float) -> None:
    front = SweepingRobot()
    back = replace(
        front,
        mount=Mount(Pose2D(-0.2, 0, -1.0)),
        pose_at=lambda t: front.pose_at(t + later_s),
    )
    timing, more_ns = BeamTiming(front.increment), round(later_s * SECOND)
    later = [one for one in back.records(timing) if isinstance(one, RangeScan)]
    later = [replace(one, stamp_ns=one.stamp_ns + more_ns) for one in later]
    records = sorted([*front.records(timing), *later], key=lambda one: one.stamp_ns)
    scans = [one for one in records if isinstance(one, RangeScan)]
    true = [front.pose_at((one.stamp_ns - START_NS) / SECOND) for one in scans]
    assert ate([pose.pose for pose in replay(records).trace.poses], true) < 0.01


def path(step: float, turns: float) -> np.ndarray:
    """Poses of a robot that turns there and back while it drives."""
    t = step * np.arange(40)
    return np.column_stack([t, np.zeros(40), turns * np.sin(2 * t)])


def steps_of(poses: np.ndarray, noise: float) -> OdometrySteps:
    rng, counted = np.random.default_rng(1), []
    for a, b in pairwise(Pose2D(*pose) for pose in poses.tolist()):
        motion = a.between(b)
        counted.append((motion.x, motion.y, motion.theta + noise * rng.standard_normal()))
    return OdometrySteps(np.array(counted), np.ones((len(counted), 3)))


@pytest.mark.parametrize(
    ("step", "noise", "least", "most"), [(0.1, 0.05, 0.0, 0.01), (0.9, 0.0, 0.99, 1.0)]
)
def test_the_way_goes_by_what_is_less_off(
    step: float, noise: float, least: float, most: float
) -> None:
    poses, follows = path(step, 0.5), np.ones(39, np.bool_)
    shares = shares_of_odometry(poses, follows, steps_of(poses, noise))
    assert ((least <= shares[:, 2]) & (shares[:, 2] <= most)).all()


def test_odometry_has_no_share_of_what_it_did_not_count() -> None:
    poses, follows = path(0.9, 0.5), np.ones(39, np.bool_)
    steps = steps_of(poses, 0.0)
    steps.information[20], follows[10] = 0, False
    shares = shares_of_odometry(poses, follows, steps)
    assert (shares[[10, 20]] == 0).all()
    assert (shares[[0, 30], 2] > 0.99).all()
    assert (shares_of_odometry(poses[:4], follows[:3], steps_of(poses[:4], 0.0)) == 0).all()
