"""Inertia: how unlikely a change of speed is, since no robot turns round between two scans.

Wheels begin to fail between two scans. A part of the motion in between is counted as it was, so
that what no robot does in one step looks like two hard brakings. So this step is also held against
the last but one, where the last lies between them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from mapcli.algorithms.slam.stale_odometry import ACCELERATION, SHORTEST_STEP
from mapcli.model.pose import Pose2D

JITTER = 0.005
"""Metres by which the count of one step is off anyway: a standard deviation."""


class Step(NamedTuple):
    """Metres ahead, and the seconds that they took."""

    metres: float
    seconds: float

    @property
    def speed(self) -> float:
        return self.metres / self.seconds if self.seconds >= SHORTEST_STEP else math.nan


class Onset(NamedTuple):
    """When a motion other than the active one is likeliest to have begun.

    Attributes:
        ratio: log-likelihood of the other one less that of the active one, by inertia, nats.
        metres: of the step before, where it began during that; None if it begins now.
    """

    ratio: float
    metres: float | None = None


class Inertia:
    """The last two steps of a robot (stateful: `add` goes on)."""

    def __init__(self) -> None:
        self._last = self._last_but_one = Step(0.0, 0.0)

    def add(self, motion: Pose2D, seconds: float) -> None:
        """The next step."""
        self._last_but_one, self._last = self._last, Step(motion.x, seconds)

    def restart(self, motion: Pose2D, seconds: float) -> None:
        """The robot has moved so for a while, other than was thought."""
        self._last = self._last_but_one = Step(motion.x, seconds)

    def onset(self, active: Pose2D, other: Pose2D, seconds: float) -> Onset:
        """When the other motion of the next step is likeliest to have begun."""
        last, before = self._last, self._last_but_one
        step, instead = Step(active.x, seconds), Step(other.x, seconds)
        now = Onset(_cost(last, step) - _cost(last, instead))
        ends = before.speed, step.speed
        if not min(ends) <= last.speed <= max(ends):
            return now
        ratio = _cost(before, step, last.seconds) - _cost(before, instead, last.seconds)
        metres = (before.speed + instead.speed) / 2 * last.seconds
        return Onset(ratio, metres) if ratio > max(now.ratio, 0.0) else now


def _cost(before: Step, after: Step, pause: float = 0.0) -> float:
    """How unlikely a step is after another, so many seconds later: its negative log-likelihood."""
    if math.isnan(before.speed + after.speed):
        return 0.0  # two scans that were read out at once tell no speed
    seconds = (before.seconds + after.seconds) / 2
    deviation = math.hypot(ACCELERATION * (seconds + pause), math.sqrt(2) * JITTER / seconds)
    return ((after.speed - before.speed) / deviation) ** 2 / 2
