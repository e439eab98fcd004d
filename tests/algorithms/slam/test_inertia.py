"""What changes of speed say, with numbers worked out by hand."""

from __future__ import annotations

import math

import pytest

from mapcli.algorithms.slam.inertia import JITTER, Inertia
from mapcli.model.pose import Pose2D


def after(*metres: float, seconds: float = 0.25) -> Inertia:
    """A robot that has made these steps."""
    inertia = Inertia()
    for each in metres:
        inertia.add(Pose2D(each), seconds)
    return inertia


def nats(change: float, seconds: float, step_s: float = 0.25) -> float:
    """Of a change of speed, m/s, in so many seconds."""
    return (change / math.hypot(seconds, math.sqrt(2) * JITTER / step_s)) ** 2 / 2


def test_a_reversal_in_one_step_begins_now() -> None:
    onset = after(0.25, 0.25).onset(Pose2D(-0.25), Pose2D(0.25), 0.25)
    assert onset.ratio == pytest.approx(nats(2.0, 0.25))
    assert onset.metres is None


def test_a_reversal_within_a_step_is_seen_over_both() -> None:
    # For half of the step forwards as before, then backwards: the robot made 0.25 m all the same.
    onset = after(0.25, 0.0).onset(Pose2D(-0.25), Pose2D(0.25), 0.25)
    assert onset.metres == pytest.approx(0.25)
    assert onset.ratio == pytest.approx(nats(2.0, 0.5))
    assert onset.ratio > 0  # as it would be if it began now: a stop is as near to either


def test_a_step_that_is_not_between_is_no_part_of_a_failure() -> None:
    onset = after(0.25, 0.6).onset(Pose2D(-0.25), Pose2D(0.25), 0.25)
    assert onset.metres is None


def test_what_goes_on_as_before_is_likeliest() -> None:
    onset = after(0.25, 0.25).onset(Pose2D(0.25), Pose2D(-0.25), 0.25)
    assert onset.ratio == pytest.approx(-nats(2.0, 0.25))
    assert onset.metres is None


def test_scans_that_were_read_out_at_once_tell_no_speed() -> None:
    assert after(0.25, 0.25, seconds=0.01).onset(Pose2D(-9), Pose2D(0.25), 0.25).ratio == 0


def test_a_robot_that_moved_otherwise_goes_on_from_there() -> None:
    inertia = after(-0.25, -0.25)
    inertia.restart(Pose2D(0.25), 0.25)
    assert inertia.onset(Pose2D(0.25), Pose2D(-0.25), 0.25).ratio < 0
