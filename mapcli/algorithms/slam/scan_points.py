"""The points of a scan as they are matched: one for each cell, and how far they reach."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam._kernels.voxel_filter import first_of_each_cell
from mapcli.model.pose import Pose2D


def voxel_filtered(points: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """One point per square of side `cell` (a voxel grid filter), so that near surfaces, which
    many beams hit, do not outvote far ones; points: shape (n, 2)."""
    return points[first_of_each_cell(points, cell)]


class ScanPoints(NamedTuple):
    """The hits of a scan, voxel_filtered, in the robot's frame.

    Attributes:
        metres, cells: shape (n, 2), the same points twice.
        radius: metres from the robot to the farthest one.
        numbers: shape (n,), of the hits that they are.
    """

    metres: NDArray[np.float64]
    cells: NDArray[np.float64]
    radius: float
    numbers: NDArray[np.int64]


@lru_cache(maxsize=1)
def points_of(perception: Perception, cell: float) -> ScanPoints:
    """A scan's points; the last scan's are kept, since they are asked for again."""
    numbers = first_of_each_cell(perception.hits, cell)
    points = perception.hits[numbers]
    return ScanPoints(points, points / cell, radius_of(points), numbers)


def radius_of(points: NDArray[np.float64]) -> float:
    """Distance of the farthest of the points, shape (n, 2), from the origin."""
    return math.sqrt(float((points[:, 0] ** 2 + points[:, 1] ** 2).max(initial=0.0)))


def window_box(
    points: NDArray[np.float64], middle: Pose2D, half_xy: float, half_turn: float
) -> NDArray[np.float64]:
    """The lowest and the highest (x, y), in the map, where points may lie at the poses of a window.

    Args:
        points: shape (n, 2), metres in the robot's frame.
        middle: of the window, a pose in the map; half_xy, half_turn: metres and radians.
    """
    radius = radius_of(points)
    seen, centre = middle.apply(points), np.array([middle.x, middle.y])
    low = np.maximum(seen.min(axis=0) - half_turn * radius, centre - radius)
    high = np.minimum(seen.max(axis=0) + half_turn * radius, centre + radius)
    return np.array([low - half_xy, high + half_xy])
