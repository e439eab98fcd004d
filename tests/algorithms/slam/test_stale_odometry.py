"""Odometry that stands still and then catches up, and wheels that only seem to."""

from __future__ import annotations

from itertools import pairwise

import pytest
from support.looping import laps, log_of, ring, scan_at, worst

from mapcli.algorithms.slam.slam import Slam, SlamParameters
from mapcli.algorithms.slam.stale_odometry import StaleOdometry
from mapcli.model.pose import Pose2D

STEP, SECONDS = Pose2D(0.1, 0, 0.2), 0.2
STILL = Pose2D()


def after(counted: list[Pose2D], found: list[Pose2D]) -> StaleOdometry:
    """A robot that was found to move so while that was counted."""
    odometry = StaleOdometry()
    for one, other in zip(counted, found, strict=True):
        odometry.update(one, other, SECONDS, agrees=one == other)
    return odometry


def test_a_step_that_delivers_three() -> None:
    odometry = after([STEP, STILL, STILL], [STEP] * 3)
    rest = odometry.rest(STEP.compose(STEP).compose(STEP), SECONDS)
    assert rest is not None
    assert (rest.x, rest.y, rest.theta) == pytest.approx((0.1, 0, 0.2))


def test_wheels_that_counted_nothing_do_not_catch_up() -> None:
    assert after([STEP, STILL, STILL], [STEP] * 3).rest(STEP, SECONDS) is None


def test_nothing_is_late_where_both_agree() -> None:
    leap = Pose2D(3.0)
    assert after([STEP] * 3, [STEP] * 3).rest(leap, SECONDS) is None
    # Nor after a robot was carried, if it would have had to leap as well.
    assert after([STILL], [STEP]).rest(leap, SECONDS) is None


def test_a_robot_with_time_may_have_made_the_step() -> None:
    odometry, late = StaleOdometry(), STEP.compose(STEP)
    odometry.update(STILL, STEP, 5.0, agrees=False)
    assert odometry.rest(late, 5.0) is None


def test_two_scans_at_once_tell_no_speed() -> None:
    assert after([STILL], [STEP]).rest(STEP.compose(STEP), 0.0) is None


def test_what_agrees_is_forgotten() -> None:
    odometry = after([STILL, STEP], [STEP, STEP])
    assert odometry.counted == odometry.found == Pose2D()


def test_a_reading_that_is_repeated_while_the_robot_is_slow_ends_nothing() -> None:
    odometry, slow = after([STEP, STILL], [STEP, STEP]), Pose2D(0.05)
    odometry.update(STILL, slow, SECONDS, agrees=True)
    rest = odometry.rest(STEP.compose(slow).compose(slow), SECONDS)
    assert rest is not None
    assert (rest.x, rest.y, rest.theta) == pytest.approx((0.05, 0, 0))
    # A robot that was not late to begin with, and stands, is not either.
    assert after([STILL, STILL], [STILL, STILL]).counted == STILL


TRUE = laps(70.0)
HELD = {*range(30, 34), *range(60, 63), *range(100, 103)}
"""Scans at which the reading before is repeated: on the straight, in a bend, and later."""


def stale(true: list[Pose2D]) -> list[Pose2D]:
    odom = [true[0]]
    for k, pose in enumerate(true[1:], 1):
        odom.append(odom[-1] if k in HELD else pose)
    return odom


def tracked(parameters: SlamParameters) -> tuple[list[Pose2D], Slam]:
    edges, odom = ring(), stale(TRUE)
    assert max(a.distance(b) for a, b in pairwise(odom)) > 1.6
    slam = Slam(parameters)
    scans = [scan_at(edges, pose, k) for k, pose in enumerate(TRUE)]
    return [traced.pose for traced in slam.replay(log_of(scans, odom))], slam


@pytest.mark.parametrize("loops", [True, False])
def test_readings_that_stand_still_round_a_ring(loops: bool) -> None:
    # Where nothing contradicts a robot that stands, nothing is late, and the next reading leads on.
    parameters = SlamParameters() if loops else SlamParameters().without_loops()
    poses, slam = tracked(parameters)
    fresh = [k for k in range(len(TRUE)) if k not in HELD]
    assert worst([poses[k] for k in fresh], [TRUE[k] for k in fresh]) < 0.1
    assert slam.odometry.catch_ups >= 1
    assert slam.odometry.jumps == 0
