"""The points of a scan as they are matched: one for each cell, and how far they reach."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam._kernels.branch_and_bound import thin
from mapcli.model.pose import Pose2D


def thinned(points: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """One point per square of side `cell`, so that near walls do not outvote far ones."""
    return points[thin(points, cell)]


class ScanPoints(NamedTuple):
    """The hits of a scan, thinned, in the robot's frame.

    Attributes:
        metres, cells: shape (n, 2), the same points twice.
        radius: metres from the robot to the farthest one.
    """

    metres: NDArray[np.float64]
    cells: NDArray[np.float64]
    radius: float


@lru_cache(maxsize=1)
def points_of(perception: Perception, cell: float) -> ScanPoints:
    """A scan's points; the last scan's are kept, since they are asked for again."""
    points = thinned(perception.hits, cell)
    return ScanPoints(points, points / cell, radius_of(points))


def radius_of(points: NDArray[np.float64]) -> float:
    """How far the farthest of the points, shape (n, 2), is from the origin."""
    return math.sqrt(float((points[:, 0] ** 2 + points[:, 1] ** 2).max(initial=0.0)))


def window_box(
    points: NDArray[np.float64], centre: Pose2D, half_xy: float, half_turn: float
) -> NDArray[np.float64]:
    """The lowest and the highest (x, y) where points may lie at the poses of a window."""
    radius = radius_of(points)
    seen, middle = centre.apply(points), np.array([centre.x, centre.y])
    low = np.maximum(seen.min(axis=0) - half_turn * radius, middle - radius)
    high = np.minimum(seen.max(axis=0) + half_turn * radius, middle + radius)
    return np.array([low - half_xy, high + half_xy])
