"""Odometry that stands still while the robot moves, and then delivers the whole way at once.

A driver that misses readings of the wheels repeats the last one. Step by step that looks like
wheels that count nothing, and scans show the true motion meanwhile; the next fresh reading then
counts this motion a second time. So what is counted is held against what is found over all steps
since the two last agreed: the rest, counted less found, is where the robot has come to since the
last scan, if the reading was late. Wheels that did count nothing do not catch up. Inertia tells
which it is: of the step and the rest, one is a motion that no robot makes after the one before.
"""

from __future__ import annotations

import math

from mapcli.model.pose import Pose2D

ACCELERATION, TURN_ACCELERATION = 1.0, 2.0
"""Metres and radians per second squared: standard deviations of what robots do."""

IMPOSSIBLE_SIGMAS = 4.0
"""Standard deviations of a change of speed from which on no robot has made it."""

SHORTEST_STEP = 0.02
"""Seconds between stamps, at least, for a speed: two scans may have been read out at once."""


class StaleOdometry:
    """What was counted and what was found since both last agreed (stateful: both add up).

    Attributes:
        counted, found: the two motions, in the robot's frame where they last agreed.
    """

    def __init__(self) -> None:
        self.counted = self.found = Pose2D()
        self._before, self._before_s = Pose2D(), 0.0  # the last motion found, and its seconds

    def rest(self, step: Pose2D, seconds: float) -> Pose2D | None:
        """What the robot has done since the last scan if this step delivers what was late; None
        if it does not.

        Args:
            step: the motion counted since the last scan, in the robot's frame then.
        """
        if self.counted == self.found or not self.is_impossible(step, seconds):
            return None
        rest = self.found.between(self.counted.compose(step))
        return None if self.is_impossible(rest, seconds) else rest

    def is_impossible(self, motion: Pose2D, seconds: float) -> bool:
        """Whether no robot moves so after the last motion that was found."""
        if min(seconds, self._before_s) < SHORTEST_STEP:
            return False
        last, time = self._before, (seconds + self._before_s) / 2
        ahead = motion.x / seconds - last.x / self._before_s
        turning = motion.theta / seconds - last.theta / self._before_s
        sigmas = math.hypot(ahead / (ACCELERATION * time), turning / (TURN_ACCELERATION * time))
        return sigmas >= IMPOSSIBLE_SIGMAS

    def update(self, step: Pose2D | None, found: Pose2D, seconds: float, *, agrees: bool) -> None:
        """Add a step, as counted and as found in the map.

        A reading that is the last one once more agrees with a robot that is slow just then, and
        ends nothing.

        Args:
            step: None if nothing is known of the motion, or what was late has come.
            agrees: the two are the same, as far as odometry goes.
        """
        self._before, self._before_s = found, seconds
        is_repeated = step == Pose2D() and self.counted != self.found
        if step is None or (agrees and not is_repeated):
            self.counted = self.found = Pose2D()
        else:
            self.counted, self.found = self.counted.compose(step), self.found.compose(found)
