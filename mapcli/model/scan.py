"""What a log is made of: range scans and odometry, with their stamps."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mapcli.model.pose import Pose2D
from mapcli.model.sweep import AT_ONCE, BeamOrder, BeamTiming, SweepMotion

NANOSECONDS = 1_000_000_000
"""In a second."""


LATEST_STAMP_S = 2**31
"""Stamps are below this, seconds: ROS 2 keeps them in an int32, until 2038."""


@dataclass(frozen=True, slots=True)
class Mount:
    """Where the laser sits on the robot.

    Attributes:
        pose: pose of the laser in the robot's frame (`robot_from_laser`), seen from above.
        flipped: the laser hangs upside down, so its bearings run clockwise seen from above.
    """

    pose: Pose2D = field(default_factory=Pose2D)
    flipped: bool = False


@dataclass(frozen=True, eq=False)
class RangeScan:
    """One turn of a range sensor.

    Attributes:
        stamp_ns: the scan's time, nanoseconds: that of the first beam unless `timing` says else.
        angle_min: bearing of the first beam in the laser's frame, radians.
        angle_increment: from one beam to the next, radians; negative for clockwise sensors.
        ranges: shape (n,), float32, metres. As REP 117 has it: +inf is no return within range,
            -inf too close to measure, NaN an invalid reading. Readers translate the habits of
            older drivers (zero, range_max + 1) into these; algorithms see only REP 117.
        range_min, range_max: the sensor's limits, metres.
        mount: where the sensor sits on the robot.
        timing: when the beams are taken.
        motion: of the robot meanwhile; None is not known, and for beams taken at once.
    """

    stamp_ns: int
    angle_min: float
    angle_increment: float
    ranges: NDArray[np.float32]
    range_min: float = 0.0
    range_max: float = float("inf")
    mount: Mount = field(default_factory=Mount)
    timing: BeamTiming = AT_ONCE
    motion: SweepMotion | None = None

    @property
    def first_ns(self) -> int:
        """When the first beam is taken, nanoseconds."""
        if not self.timing.increment:
            return self.stamp_ns
        return self.stamp_ns - round(self.timing.before_stamp(len(self.ranges)) * NANOSECONDS)

    @property
    def last_ns(self) -> int:
        """When the last beam is taken, nanoseconds."""
        if not self.timing.increment:
            return self.stamp_ns
        return self.first_ns + round(self.timing.span(len(self.ranges)) * NANOSECONDS)

    def beam_seconds(self) -> NDArray[np.float64]:
        """When each beam is taken, shape (n,), seconds after the stamp."""
        return self.timing.after_stamp(len(self.ranges))

    def bearings(self) -> NDArray[np.float64]:
        """Bearing of each beam in the laser's frame seen from above, shape (n,), radians."""
        return _bearings(len(self.ranges), self.angle_min, self.angle_increment, self.mount.flipped)

    def hits(self, nearest: float = -np.inf, farthest: float = np.inf) -> NDArray[np.int64]:
        """Numbers of the beams that hit something between two ranges, ascending."""
        hit = np.isfinite(self.ranges) & (self.ranges >= nearest) & (self.ranges <= farthest)
        return np.flatnonzero(hit)  # taking by number is twice as fast as by truth

    def points(self, nearest: float = -np.inf, farthest: float = np.inf) -> NDArray[np.float64]:
        """Ends of the beams that hit something between two ranges, shape (k, 2), metres in the
        robot's frame when each was taken."""
        hits = self.hits(nearest, farthest)
        ends = self._directions().take(hits, axis=0) * self.ranges.take(hits)[:, None]
        return self.mount.pose.apply(ends)

    def free_ends(self, length: float) -> NDArray[np.float64]:
        """Points `length` metres along the beams that hit nothing until there, shape (k, 2), in
        the robot's frame when each was taken."""
        return self.mount.pose.apply(self._directions()[self.ranges > length] * length)

    def _directions(self) -> NDArray[np.float64]:
        return _directions(
            len(self.ranges), self.angle_min, self.angle_increment, self.mount.flipped
        )


def _bearings(
    beams: int, angle_min: float, angle_increment: float, flipped: bool
) -> NDArray[np.float64]:
    bearings = angle_min + angle_increment * np.arange(beams, dtype=np.float64)
    return -bearings if flipped else bearings


@lru_cache(maxsize=16)
def _directions(
    beams: int, angle_min: float, angle_increment: float, flipped: bool
) -> NDArray[np.float64]:
    """Unit vectors along the beams, shape (n, 2); the scans of a log share a few geometries."""
    bearings = _bearings(beams, angle_min, angle_increment, flipped)
    return np.column_stack([np.cos(bearings), np.sin(bearings)])


def in_order(scan: RangeScan, order: BeamOrder) -> RangeScan:
    """A scan whose beams are taken in an order."""
    return replace(scan, timing=_timing(scan.timing, scan.timing.increment, order))


def turning(scan: RangeScan, turn_s: float, order: BeamOrder) -> RangeScan:
    """A scan whose beams are taken in an order, of a laser whose full turn takes some seconds."""
    increment = turn_s * abs(scan.angle_increment) / math.tau
    return replace(scan, timing=_timing(scan.timing, increment, order))


@lru_cache(maxsize=16)
def _timing(timing: BeamTiming, increment: float, order: BeamOrder) -> BeamTiming:
    return replace(timing, increment=increment, order=order)


@dataclass(frozen=True, slots=True)
class Odometry:
    """Where the robot's wheels say it is: `odom_from_robot` at a time."""

    stamp_ns: int
    pose: Pose2D


@dataclass(frozen=True, slots=True)
class TruePose:
    """Where the robot really is (`map_from_robot`), known only to a simulator."""

    stamp_ns: int
    pose: Pose2D


Record = Odometry | RangeScan | TruePose
"""What a log reader yields."""
