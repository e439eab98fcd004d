"""A pose as kernels take it."""

from __future__ import annotations

from typing import NamedTuple


class Pose(NamedTuple):
    """Pose of the robot in the map: metres and radians. `model.pose.Pose2D` for compiled loops,
    which take tuples only."""

    x: float
    y: float
    theta: float
