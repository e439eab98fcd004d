"""A differential-drive robot follows waypoints: where it is at every moment, in closed form.

The path is made of segments of constant curvature: straight lines, arcs that round the corners,
turns on the spot. On each segment the speed follows a trapezoidal profile over time: acceleration,
constant speed, braking, all within the robot's limits. Nothing is integrated step by step, so any
sampling gives the same drive.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import accumulate

from mapcli.errors import DataError
from mapcli.model.pose import Pose2D

STRAIGHT = 1e-9
"""Corners that turn less than this (radians) are none."""


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
