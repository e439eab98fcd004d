"""The sweep of a laser: when each beam of a scan is taken, and how the robot moves meanwhile.

A laser that spins takes its beams one after another. While a robot moves, each is taken from
another pose; DESKEWING puts its end where it was seen, in the robot's frame at the scan's stamp.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

ScanStamp = Literal["first", "middle", "last"]
"""Which beam the stamp of a scan is of, in the order in which they are taken."""

BeamOrder = Literal["forward", "backward"]
"""`backward`: the last beam of the array was taken first, as by drivers that flip the array of a
laser that spins clockwise."""


@dataclass(frozen=True, slots=True)
class BeamTiming:
    """When the beams of a scan are taken.

    Attributes:
        increment: seconds from one beam to the next, not negative; 0 takes all at once.
        stamp: which of them the scan's stamp is of.
        order: in which they are taken; None is not known, and forward until it is.
    """

    increment: float = 0.0
    stamp: ScanStamp = "first"
    order: BeamOrder | None = "forward"

    def span(self, beams: int) -> float:
        """Seconds from the first beam to the last."""
        return self.increment * max(beams - 1, 0)

    def before_stamp(self, beams: int) -> float:
        """Seconds from the first beam to the stamp."""
        return self.span(beams) * _SHARES[self.stamp]

    def after_stamp(self, beams: int) -> NDArray[np.float64]:
        """Seconds after the stamp at which each beam of the array is taken, shape (n,)."""
        return _after_stamp(self, beams)


AT_ONCE = BeamTiming()

_SHARES: dict[ScanStamp, float] = {"first": 0.0, "middle": 0.5, "last": 1.0}
"""Of a sweep, before the stamp."""


@lru_cache(maxsize=16)
def _after_stamp(timing: BeamTiming, beams: int) -> NDArray[np.float64]:
    numbers = np.arange(beams, dtype=np.float64)
    seconds: NDArray[np.float64] = timing.increment * numbers - timing.before_stamp(beams)
    return seconds[::-1].copy() if timing.order == "backward" else seconds


@dataclass(frozen=True, slots=True, eq=False)
class SweepMotion:
    """How the robot moves while its laser sweeps.

    Attributes:
        seconds: shape (m,), ascending, after the scan's stamp; before the first and after the last
            the robot counts as standing.
        poses: shape (m, 3), where the robot is then, in its own frame at the stamp: metres, and
            radians, which are not wrapped.
    """

    seconds: NDArray[np.float64]
    poses: NDArray[np.float64]

    def at(self, seconds: NDArray[np.float64]) -> NDArray[np.float64]:
        """The poses at times after the stamp, interpolated, shape (n, 3)."""
        poses: NDArray[np.float64] = np.empty((len(seconds), 3))
        for column in range(3):
            poses[:, column] = np.interp(seconds, self.seconds, self.poses[:, column])
        return poses

    def deskew(
        self, points: NDArray[np.float64], seconds: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Points as seen at these times, in the robot's frame at the stamp, shape (n, 2).

        Args:
            points: shape (n, 2), each in the robot's frame at its time.
        """
        poses = self.at(seconds)
        x, y, theta = poses[:, 0], poses[:, 1], poses[:, 2]
        cos, sin = np.cos(theta), np.sin(theta)
        u, v = points[:, 0], points[:, 1]
        moved = np.empty((len(points), 2))
        moved[:, 0] = cos * u - sin * v + x
        moved[:, 1] = sin * u + cos * v + y
        return moved


STILL = SweepMotion(np.zeros(1), np.zeros((1, 3)))
"""Of a robot that stands."""
