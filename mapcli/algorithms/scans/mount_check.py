"""Whether the laser sits on the robot as the log says, by consecutive scans and odometry.

A mirrored laser sees the room turn the other way than the wheels do, and one that is mounted
backwards sees it move the other way. So the points of a scan are moved by odometry into the next
one, under the mount that the log tells and under others, and the mount under which they meet its
readings is right. Wheels that fail for a while make mounts win and lose at times; what is said is
what holds over the whole drive.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.model.pose import Pose2D, rounded_angle, wrap_angle
from mapcli.model.scan import Mount, RangeScan

YAWS = np.array([0.0, math.pi, math.pi / 2, -math.pi / 2] * 2)
SIDES = np.repeat([1.0, -1.0], 4)
"""The mounts that are compared, relative to the one that the log tells, which is the first: turned
by an angle, and seen from above or from below."""

LEAST_M, LEAST_RAD = 0.2, math.radians(10)
"""Scans are compared that are so far apart, or so much turned: more than odometry errs."""

MOST_M, MOST_RAD = 2.0, math.radians(60)
"""...and not farther, lest they see something else."""

POINTS, LEAST_POINTS = 40, 15
"""Points of a scan that are compared, and that must meet a reading, for a comparison."""

FARTHEST_M = 0.5
"""Points farther from a reading than this belong to something else."""

CLEARLY, NOISE_M = 0.7, 0.01
"""A mount wins when its mean distance is less than this share of the other's, less the noise of
readings. Where the room looks the same under both, neither does."""

PAIRS_AT_ONCE = 32
"""After so many comparisons every second pair is compared, after as many more every fourth..., so
that a long drive costs little more than a short one."""

LEAST_WINS, WINS_PER_LOSS = 10, 3
"""Over the drive another mount must win so often, and so many times as often as it loses. On right
logs, reversed wheels for a tenth of the drive included, the right mount wins ten times as often."""


class MountFinding(NamedTuple):
    """A laser that does not sit as the log says.

    Attributes:
        right: where it sits.
        turn: from the yaw that the log tells to the right one, radians.
        mirrored: it is seen from the other side, so its beams run the other way.
    """

    right: Mount
    turn: float
    mirrored: bool


class MountCheck:
    """Compares mounts while a log is read (stateful).

    Attributes:
        wins: shape (8, 8), how often a mount (row) was clearly better than another (column).
    """

    def __init__(self) -> None:
        self.wins = np.zeros((len(YAWS), len(YAWS)), dtype=np.int64)
        self._before: tuple[RangeScan, Pose2D] | None = None
        self._told = Mount()
        self._pairs, self._compared = 0, 0

    def watched(
        self, scans: Iterable[tuple[RangeScan, Pose2D | None]]
    ) -> Iterator[tuple[RangeScan, Pose2D | None]]:
        """The scans with odometry at their stamps, in order."""
        for scan, odom in scans:
            self._add(scan, odom)
            yield scan, odom

    def _add(self, scan: RangeScan, odom: Pose2D | None) -> None:
        if odom is None:
            self._before = None
            return
        if self._before is not None:
            before, pose = self._before
            motion = pose.between(odom)
            if not has_moved(motion):
                return
            is_wanted = not is_far(motion) and scan.mount == before.mount
            self._told = scan.mount
            if is_wanted and self._is_next():
                self.wins += _wins(before, scan, motion)
        self._before = scan, odom

    def _is_next(self) -> bool:
        """Whether this pair is compared: fewer and fewer are."""
        self._pairs += 1
        if self._pairs % (1 << self._compared // PAIRS_AT_ONCE):
            return False
        self._compared += 1
        return True

    def finding(self) -> MountFinding | None:
        """The mount that is right after all; None where the log tells it, as far as is known."""
        best = int(np.argmax(self.wins[:, 0] - self.wins[0]))
        won, lost = int(self.wins[best, 0]), int(self.wins[0, best])
        if won < LEAST_WINS or won < WINS_PER_LOSS * lost:
            return None
        told, turn, mirrored = self._told, float(YAWS[best]), bool(SIDES[best] < 0)
        yaw = rounded_angle(wrap_angle(told.pose.theta + turn))
        right = Mount(replace(told.pose, theta=yaw), told.flipped != mirrored)
        return MountFinding(right, turn, mirrored)


def has_moved(motion: Pose2D) -> bool:
    """Whether scans are so far apart, or so much turned, that they are compared."""
    return math.hypot(motion.x, motion.y) >= LEAST_M or abs(motion.theta) >= LEAST_RAD


def is_far(motion: Pose2D) -> bool:
    """Whether they may see something else."""
    return math.hypot(motion.x, motion.y) > MOST_M or abs(motion.theta) > MOST_RAD


def _wins(before: RangeScan, after: RangeScan, motion: Pose2D) -> NDArray[np.bool_]:
    """Which mounts are clearly better than which others for a pair of scans, shape (8, 8).

    Args:
        motion: of the robot between them, in its frame at the first.
    """
    distances = _distances(before, after, motion)
    better = distances[:, None] < CLEARLY * distances - NOISE_M
    return np.asarray(better)


def _distances(before: RangeScan, after: RangeScan, motion: Pose2D) -> NDArray[np.float64]:
    """Under each mount, the mean distance of points of one scan, moved by odometry, from the
    readings of the next in the same direction, shape (8,), metres; nan where few meet any."""
    hits = np.flatnonzero(np.isfinite(before.ranges))
    if len(hits) < LEAST_POINTS or after.angle_increment == 0:
        return np.full(len(YAWS), np.nan)
    hits = hits[:: 1 + len(hits) // POINTS]
    bearings = before.angle_min + before.angle_increment * hits
    points = before.ranges[hits] * np.exp(1j * bearings)
    place = complex(before.mount.pose.x, before.mount.pose.y)
    yaws = np.exp(1j * (before.mount.pose.theta + YAWS))[:, None]
    flipped = (SIDES < 0) != before.mount.flipped
    # Into the robot's frame, by odometry to the next scan, and back into the laser's.
    points = yaws * np.where(flipped[:, None], points.conj(), points) + place
    points = (points - complex(motion.x, motion.y)) * np.exp(-1j * motion.theta)
    points = (points - place) * yaws.conj()
    points = np.where(flipped[:, None], points.conj(), points)
    return _mean_distances(points, after)


def _mean_distances(points: NDArray[np.complex128], scan: RangeScan) -> NDArray[np.float64]:
    """Of points in the laser's frame, shape (m, n), from the readings of the nearest beams: the
    mean over each row; nan where few beams meet any."""
    turn = math.tau / abs(scan.angle_increment)
    beams = np.rint((np.angle(points) - scan.angle_min) / scan.angle_increment % turn)
    readings = np.append(scan.ranges, np.nan)[np.minimum(beams, len(scan.ranges)).astype(np.int64)]
    distances = np.minimum(np.abs(np.abs(points) - readings), FARTHEST_M)
    meets = np.isfinite(readings)
    count = meets.sum(axis=1)
    total = np.where(meets, distances, 0.0).sum(axis=1)
    return np.where(count >= LEAST_POINTS, total / np.maximum(count, 1), np.nan)
