"""Planning a drive: waypoints become path segments, and each segment a speed profile."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from mapcli.algorithms.simulation.drive import (
    STRAIGHT,
    Drive,
    MotionLimits,
    PathSegment,
    Trapezoid,
)
from mapcli.errors import DataError
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.waypoint import Waypoint

SHARP = math.radians(150)
"""Corners that turn more than this are turned on the spot: their arcs would hardly move."""


LONGEST_S = 7 * 86_400.0
"""Seconds that a drive may take; more is a slip of the pen in the path."""


def plan_drive(waypoints: Sequence[Waypoint], limits: MotionLimits | None = None) -> Drive:
    """The drive along the waypoints.

    The robot passes near a waypoint where it can round the corner, and stops exactly at it where
    it turns on the spot, changes between forwards and reverse, or pauses. It starts at the first
    waypoint facing along its path, and ends at the last.

    Raises:
        DataError: fewer than two waypoints, two in a row at the same place, or a drive of more
            than a week.
    """
    limits = limits or MotionLimits()
    if len(waypoints) < 2:
        raise DataError(
            f"the path has {len(waypoints)} waypoint(s)",
            expected="the start and at least one more to drive to",
        )
    segments = _path_segments(_legs(waypoints, limits), limits)
    drive = Drive(tuple(segments), tuple(_profiles(segments, limits)), waypoints[0].pause)
    if not drive.duration <= LONGEST_S:
        raise DataError(f"the drive takes {drive.duration:g} s", expected="at most a week")
    return drive


@dataclass(frozen=True, slots=True)
class _Leg:
    """The straight line from one waypoint to the next, waypoint number `to`."""

    start: Pose2D
    length: float
    sign: int
    speed: float
    to: int
    pause: float

    def pose_at(self, metres: float) -> Pose2D:
        return self.start.compose(Pose2D(self.sign * metres))


def _legs(waypoints: Sequence[Waypoint], limits: MotionLimits) -> list[_Leg]:
    legs = []
    for i, (a, b) in enumerate(pairwise(waypoints), start=1):
        if (a.x, a.y) == (b.x, b.y):
            raise DataError(
                f"waypoint {i + 1} is at the same place as the one before, ({b.x:g}, {b.y:g})"
            )
        heading = math.atan2(b.y - a.y, b.x - a.x)
        start = Pose2D(a.x, a.y, wrap_angle(heading + math.pi) if b.back else heading)
        speed = min(limits.speed, b.speed or math.inf)
        length = math.hypot(b.x - a.x, b.y - a.y)
        legs.append(_Leg(start, length, -1 if b.back else 1, speed, i, b.pause))
    return legs


def _path_segments(legs: Sequence[_Leg], limits: MotionLimits) -> list[PathSegment]:
    """Legs shortened where an arc rounds the corner between them, and the corners."""
    cuts = [0.0, *(_corner_cut(a, b, limits.corner_cut) for a, b in pairwise(legs)), 0.0]
    segments = []
    for leg, following, before, after in zip(legs, [*legs[1:], None], cuts, cuts[1:], strict=False):
        straight = leg.length - before - after
        if straight > 0:
            start = leg.pose_at(before)
            segments.append(
                PathSegment(start, leg.sign * straight, 0.0, leg.to, leg.speed, leg.pause)
            )
        if following and abs(_corner(leg, following)) > STRAIGHT:
            segments.append(_corner_segment(leg, following, after, limits))
    return segments


def _corner(a: _Leg, b: _Leg) -> float:
    """Radians that the robot turns between two legs."""
    return wrap_angle(b.start.theta - a.start.theta)


def _corner_cut(a: _Leg, b: _Leg, cut: float) -> float:
    """Metres before and after the corner that its arc replaces; 0 where there is no arc."""
    rolls_on = a.sign == b.sign and not a.pause and STRAIGHT < abs(_corner(a, b)) < SHARP
    return min(cut, a.length / 2, b.length / 2) if rolls_on else 0.0


def _corner_segment(a: _Leg, b: _Leg, cut: float, limits: MotionLimits) -> PathSegment:
    turn = _corner(a, b)
    rate = math.radians(limits.turn_rate_deg)
    if not cut:
        return PathSegment(replace(b.start, theta=a.start.theta), 0.0, turn, a.to, rate)
    radius = cut / math.tan(abs(turn) / 2)
    speed_limit = min(a.speed, b.speed, rate * radius)
    return PathSegment(
        a.pose_at(a.length - cut), a.sign * radius * abs(turn), turn, a.to, speed_limit
    )


def _profiles(segments: Sequence[PathSegment], limits: MotionLimits) -> list[Trapezoid]:
    """As fast as the limits allow, with speeds that agree where segments meet."""
    accelerations = [
        limits.acceleration if segment.distance else math.radians(limits.turn_acceleration_deg)
        for segment in segments
    ]
    joints = [0.0, *(_joint_speed_limit(a, b) for a, b in pairwise(segments)), 0.0]
    for i, segment in enumerate(segments):
        joints[i + 1] = min(
            joints[i + 1], math.sqrt(joints[i] ** 2 + 2 * accelerations[i] * segment.length)
        )
    for i, segment in reversed(list(enumerate(segments))):
        joints[i] = min(
            joints[i], math.sqrt(joints[i + 1] ** 2 + 2 * accelerations[i] * segment.length)
        )
    return [
        Trapezoid(segment.length, start, end, _peak(segment, start, end, a), a)
        for segment, start, end, a in zip(segments, joints, joints[1:], accelerations, strict=False)
    ]


def _joint_speed_limit(a: PathSegment, b: PathSegment) -> float:
    """The highest speed from one segment into the next: 0 where the robot must stand."""
    rolls_on = a.distance * b.distance > 0 and not a.pause
    return min(a.speed_limit, b.speed_limit) if rolls_on else 0.0


def _peak(segment: PathSegment, start: float, end: float, acceleration: float) -> float:
    return min(
        segment.speed_limit, math.sqrt(acceleration * segment.length + (start**2 + end**2) / 2)
    )
