"""A differential-drive robot follows waypoints: where it is at every moment, in closed form.

The path is made of segments of constant curvature: straight lines, arcs that round the corners,
turns on the spot. On each segment the speed follows a trapezoidal profile over time: acceleration,
constant speed, braking, all within the robot's limits. Nothing is integrated step by step, so any
sampling gives the same drive.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import accumulate, pairwise

from mapcli.errors import DataError
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.waypoint import Waypoint

STRAIGHT = 1e-9
"""Corners that turn less than this (radians) are none."""

SHARP = math.radians(150)
"""Corners that turn more than this are turned on the spot: their arcs would hardly move."""


LONGEST_S = 7 * 86_400.0
"""Seconds that a drive may take; more is a slip of the pen in the path."""


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """What the robot's drive can do.

    Attributes:
        speed: metres per second, where the path does not say less.
        acceleration: metres per second squared, speeding up and braking.
        turn_rate_deg, turn_acceleration_deg: the same for turns, in degrees.
        corner_cut: metres before and after a corner that an arc rounds off, which is the radius
            of a right-angled one; 0 turns on the spot.

    Raises:
        DataError: a limit outside 1e-6 to 1e6 (`corner_cut` may be 0).
    """

    speed: float = 0.5
    acceleration: float = 0.5
    turn_rate_deg: float = 60.0
    turn_acceleration_deg: float = 120.0
    corner_cut: float = 0.25

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not (1e-6 <= value <= 1e6 or (value == 0 and item.name == "corner_cut")):
                raise DataError(f"{item.name} is {value:g}", expected="more than 0, up to 1e6")


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """A trapezoidal speed profile along a length: from `start` up to `peak` and down to `end`."""

    length: float
    start: float
    end: float
    peak: float
    acceleration: float

    @property
    def rise(self) -> float:
        return (self.peak - self.start) / self.acceleration

    @property
    def fall(self) -> float:
        return (self.peak - self.end) / self.acceleration

    @property
    def duration(self) -> float:
        ramps = (self.start + self.peak) / 2 * self.rise + (self.peak + self.end) / 2 * self.fall
        return self.rise + self.fall + (self.length - ramps) / self.peak

    def travelled(self, time: float) -> float:
        """Length covered after `time`, which lies in [0, duration]."""
        if time < self.rise:
            return time * (self.start + self.acceleration * time / 2)
        left = self.duration - time
        if left < self.fall:
            return self.length - left * (self.end + self.acceleration * left / 2)
        return self.rise * (self.start + self.peak) / 2 + self.peak * (time - self.rise)


@dataclass(frozen=True, slots=True)
class PathSegment:
    """A segment of the path with constant curvature.

    Attributes:
        start: pose at its beginning.
        distance: metres along the path, negative in reverse.
        turn: radians turned on the way.
        waypoint: index of the waypoint that it leads to.
        speed_limit: metres per second; radians per second in a turn on the spot.
        pause: seconds to stand still afterwards.
    """

    start: Pose2D
    distance: float
    turn: float
    waypoint: int
    speed_limit: float
    pause: float = 0.0

    @property
    def length(self) -> float:
        """Metres, or radians for a turn on the spot."""
        return abs(self.distance) if self.distance else abs(self.turn)

    def pose_at(self, fraction: float) -> Pose2D:
        return self.start.compose(arc(self.distance * fraction, self.turn * fraction))


def arc(distance: float, turn: float) -> Pose2D:
    """The motion of a robot that drives `distance` while it turns by `turn`, evenly."""
    if abs(turn) < STRAIGHT:
        return Pose2D(distance, 0.0, turn)
    radius = distance / turn
    return Pose2D(radius * math.sin(turn), radius * (1 - math.cos(turn)), turn)


@dataclass(frozen=True)
class Drive:
    """The planned drive: segments one after the other in time, each with its speeds.

    Attributes:
        segments, profiles: of equal number.
        start_pause: seconds that the robot stands at the start.
    """

    segments: tuple[PathSegment, ...]
    profiles: tuple[Trapezoid, ...]
    start_pause: float = 0.0

    @cached_property
    def _begins(self) -> list[float]:
        """When each segment begins, and the end of the last."""
        durations = [
            p.duration + q.pause for p, q in zip(self.profiles, self.segments, strict=True)
        ]
        return list(accumulate(durations, initial=self.start_pause))

    @property
    def duration(self) -> float:
        """Seconds from the start to the end, pauses included."""
        return self._begins[-1]

    @property
    def distance(self) -> float:
        """Metres driven, forwards and in reverse."""
        return sum(abs(segment.distance) for segment in self.segments)

    def arrivals(self) -> list[float]:
        """When the robot has done with each waypoint: passed it, turned there and paused."""
        last = {
            segment.waypoint: end
            for segment, end in zip(self.segments, self._begins[1:], strict=True)
        }
        return [self.start_pause, *last.values()]

    def waypoint_at(self, time: float) -> int:
        """Index of the waypoint that the robot drives to, turns at or stands at."""
        return self.segments[self._index_at(time)].waypoint

    def pose_at(self, time: float) -> Pose2D:
        """Where the robot is; before and after the drive it stands at the ends of the path."""
        i = self._index_at(time)
        profile = self.profiles[i]
        moving = min(max(time - self._begins[i], 0.0), profile.duration)
        return self.segments[i].pose_at(profile.travelled(moving) / profile.length)

    def _index_at(self, time: float) -> int:
        return min(max(bisect_right(self._begins, time) - 1, 0), len(self.segments) - 1)


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
