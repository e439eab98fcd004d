"""Some hundred scans, spread evenly over the way, which are held against each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.keyframes import Keyframe
from mapcli.algorithms.slam.scan_points import voxel_filtered
from mapcli.model.pose import Pose2D

CELL_M = 0.1
"""Of the grid of comparison, metres: walls that differ by less than about two cells agree, as laser
noise and thin walls seen from both sides must."""

REACH_M = 15.0
"""Metres; farther ends are sparse and uncertain."""

MOST_SCANS = 400
"""Scans that are compared, at most; half as many at least, after a long drive."""

FIRST_STEP_M = 0.5
"""Metres (or radians, halved) between two of them at first; doubled whenever they are too many."""

TURN_M = 0.5
"""Metres that a radian of turning counts as."""


@dataclass(frozen=True, slots=True, eq=False)
class SampledScan:
    """A scan that is compared.

    Attributes:
        scan: its number.
        ends: shape (n, 2), float32, of its beams, one in each cell, in the robot's frame, metres.
        laser: shape (2,), where they start.
    """

    scan: int
    ends: NDArray[np.float32]
    laser: NDArray[np.float64]


class ScanSample:
    """Scans spread evenly over the way (stateful: `add` takes or leaves each scan of a log;
    `is_next`, and `take` if so, do the same where a perception is to be made only if need be).

    Attributes:
        scans: in time order, at most `MOST_SCANS`.
    """

    def __init__(self) -> None:
        self.scans: list[SampledScan] = []
        self._step, self._way, self._next = FIRST_STEP_M, 0.0, 0.0
        self._last: Pose2D | None = None
        self._count = 0

    def add(self, pose: Pose2D, perception: Perception) -> None:
        """The next scan, with its pose as tracked."""
        if self.is_next(pose):
            self.take(perception)

    def is_next(self, pose: Pose2D) -> bool:
        """Whether the next scan is one of the sample, by its pose as tracked."""
        self._count += 1
        if self._last is not None:
            turn = abs(self._last.between(pose).theta)
            self._way += self._last.distance(pose) + TURN_M * turn
        self._last = pose
        return self._way >= self._next

    def take(self, perception: Perception) -> None:
        """Have the last scan in the sample."""
        self._next = self._way + self._step
        away = np.hypot(*(perception.hits - perception.laser).T)
        ends = voxel_filtered(perception.hits[away < REACH_M], CELL_M).astype(np.float32)
        self.scans.append(SampledScan(self._count - 1, ends, perception.laser))
        if len(self.scans) > MOST_SCANS:
            del self.scans[1::2]
            self._step *= 2


def sample_of_keyframes(keyframes: Sequence[Keyframe]) -> list[SampledScan]:
    """Keyframes spread evenly over the way, to be compared, by the numbers of their scans."""
    sample = ScanSample()
    for keyframe in keyframes:
        sample.add(keyframe.pose, keyframe.perception)
    return [replace(one, scan=keyframes[one.scan].scan) for one in sample.scans]
