"""How far the world seems to move when the robot does."""

from __future__ import annotations

import math

import numpy as np

from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan

MOVED_M = 0.02
"""Metres from one scan to the next, from which on the robot counts as moving: about what lasers err
by."""


def metres_moved(scan: RangeScan, moved: Pose2D) -> float:
    """How far the end of a beam of median range moves when the robot does, about."""
    ranges = scan.ranges[np.isfinite(scan.ranges)]
    reach = float(np.median(ranges)) if len(ranges) else 0.0
    return math.hypot(moved.x, moved.y) + abs(moved.theta) * reach
