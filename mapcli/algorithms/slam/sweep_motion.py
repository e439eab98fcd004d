"""How the robot moves while its laser sweeps, as the front end knows it.

Odometry tells (`scans.odometry_interpolation`), and so does inertia: the robot goes on as it went
between the last two scans, by their matched poses. Over a part of a second the noise of wheels may
be larger than what a robot can change its speed by. How far each was off shows at every scan; the
two are weighed by the inverse of their mean squares.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.stale_odometry import SHORTEST_STEP
from mapcli.model.pose import Pose2D
from mapcli.model.scan import NANOSECONDS, RangeScan
from mapcli.model.sweep import SweepMotion

WEIGHT = 0.1
"""Of the newest error in the running means of squares."""

FEWEST = 3
"""Steps that odometry and inertia were compared over before inertia counts."""

SAME_M = 0.02
"""Metres; a scan whose farthest point moves less when it is deskewed anew is not matched again: it
is the last of many that moved, and half a cell is what a single point is worth."""


class SweepMotionFilter:
    """The motion of a sweep, weighed of odometry's and inertia's (stateful: `update`)."""

    def __init__(self) -> None:
        self._velocity: NDArray[np.float64] | None = None  # metres and radians per second
        self._by_odometry, self._by_inertia = np.zeros(3), np.zeros(3)  # mean squares
        self._compared = 0
        self._last: tuple[int, Pose2D | None] | None = None

    def deskewed(self, perception: Perception, scan: RangeScan) -> Perception:
        """A perception deskewed by the likeliest motion during its scan; itself if its beams were
        taken at once, or if its points hardly move."""
        sweep = perception.sweep
        if sweep is None:
            return perception
        motion = self.motion(scan)
        # Both are straight between the same times.
        other = motion.poses - sweep.motion.at(motion.seconds)
        x, y, theta = np.abs(other).max(axis=0)
        farthest = float(np.abs(perception.hits).max(initial=0.0))
        same = math.hypot(x, y) + theta * farthest < SAME_M
        return perception if same else perception.deskewed(motion)

    def motion(self, scan: RangeScan) -> SweepMotion:
        """The likeliest motion during a scan."""
        counted = scan.motion
        if counted is None:
            ends = np.array([scan.first_ns - scan.stamp_ns, scan.last_ns - scan.stamp_ns])
            counted = SweepMotion(ends / NANOSECONDS, np.zeros((2, 3)))
        if self._velocity is None or (scan.motion is not None and self._compared < FEWEST):
            return counted
        total = self._by_odometry + self._by_inertia
        share = self._by_odometry / np.maximum(total, np.finfo(float).tiny)
        share = np.ones(3) if scan.motion is None else share
        going_on = counted.seconds[:, None] * self._velocity
        return SweepMotion(counted.seconds, counted.poses + share * (going_on - counted.poses))

    def update(self, scan: RangeScan, odom: Pose2D | None, found: Pose2D | None) -> None:
        """Compare both with the motion since the last scan.

        Args:
            odom: the odometry's pose at the stamp.
            found: the motion between the matched poses; None if the scan was not found.
        """
        last, self._last = self._last, (scan.stamp_ns, odom)
        seconds = (scan.stamp_ns - last[0]) / NANOSECONDS if last else 0.0
        if found is None or last is None or seconds < SHORTEST_STEP:
            self._velocity = None
            return
        moved = _numbers(found)
        if self._velocity is not None and last[1] is not None and odom is not None:
            self._compared += 1
            weight = max(WEIGHT, 1 / self._compared)
            off, off_by_inertia = (
                moved - _numbers(last[1].between(odom)),
                moved - seconds * self._velocity,
            )
            self._by_odometry += weight * (off**2 - self._by_odometry)
            self._by_inertia += weight * (off_by_inertia**2 - self._by_inertia)
        self._velocity = moved / seconds


def _numbers(pose: Pose2D) -> NDArray[np.float64]:
    return np.array([pose.x, pose.y, pose.theta])
