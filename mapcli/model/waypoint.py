"""A waypoint of a simulated robot."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mapcli.errors import DataError


@dataclass(frozen=True, slots=True)
class Waypoint:
    """One stop or corner of a path; the first of a path is where the robot starts.

    Attributes:
        x, y: metres.
        back: the robot drives to it in reverse.
        speed: limit on the way to it, metres per second; None for the robot's own limit.
        pause: seconds that the robot stands at it.

    Raises:
        DataError: a number that is not finite, a speed that is not positive, a negative pause.
    """

    x: float
    y: float
    back: bool = False
    speed: float | None = None
    pause: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.x) and math.isfinite(self.y)):
            raise DataError(f"x {self.x:g}, y {self.y:g}", expected="finite numbers, in metres")
        if self.speed is not None and not (0 < self.speed < math.inf):
            raise DataError(f"speed {self.speed:g}", expected="metres per second, more than 0")
        if not 0 <= self.pause < math.inf:
            raise DataError(f"pause {self.pause:g}", expected="seconds, 0 or more")
