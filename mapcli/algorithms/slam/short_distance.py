"""Line 2 of Algorithm 9.2, "move a short distance": when there is something to compare again.

The test positions of the book lie a cell and a step of the heading apart. A robot that has moved
by less since the last comparison is nearest to where odometry takes it to be, if it was before.
"""

from __future__ import annotations

import math

from mapcli.algorithms.slam.match import MatchParameters
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount

ROUNDING = 1e-6
"""Share of a step by which one that is counted may fall short of it."""


class ShortDistance:
    """How far the robot has come by its odometry since each laser's last comparison (stateful).

    Attributes:
        step_m, step_rad: how far is far enough.
    """

    def __init__(self, step_m: float, step_rad: float) -> None:
        self.step_m, self.step_rad = step_m, step_rad
        self._since: dict[Mount, Pose2D] = {}

    def is_moved(self, motion: Pose2D | None, laser: Mount) -> bool:
        """Whether a laser's scan is to be compared, after the robot has moved; it is then.

        Args:
            motion: since the scan before; None is unknown, and may be far.
        """
        if motion is None:
            self._since.clear()
        for mount, since in self._since.items():
            self._since[mount] = since.compose(motion or Pose2D())
        if laser in self._since and not self._is_far(self._since[laser]):
            return False
        self._since[laser] = Pose2D()
        return True

    def _is_far(self, since: Pose2D) -> bool:
        far = math.hypot(since.x, since.y) >= self.step_m * (1 - ROUNDING)
        return far or abs(since.theta) >= self.step_rad * (1 - ROUNDING)


def short_distance(parameters: MatchParameters, cell: float) -> ShortDistance:
    """For a way of searching: `book` compares after the smallest of its steps, in position or in
    heading, the others every scan."""
    if parameters.search != "book":
        return ShortDistance(0.0, 0.0)
    steps = [abs(step) * cell for step in parameters.book_steps if step]
    turns = [math.radians(abs(turn)) for turn in parameters.turns_deg if turn]
    return ShortDistance(min(steps, default=cell), min(turns, default=math.inf))
