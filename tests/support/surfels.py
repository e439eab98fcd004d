"""Tables of surfels for tests, and points to fill them with."""

from __future__ import annotations

from math import cos, floor, sin

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels import surfel_map as kernels
from mapcli.algorithms.slam._kernels.gauss_newton import NormalEquations
from mapcli.algorithms.slam._kernels.pose import Pose
from mapcli.algorithms.slam._kernels.sparse_grid import BORDER, SIDE, SparseGrid, Used

Floats = NDArray[np.float64]

CELL, THICKNESS = 0.05, 0.015


def empty_table(room: int, extent: float = 0.0) -> kernels.SurfelTable:
    """Room for so many tiles and slots, and for points so far from the origin, metres."""
    far = BORDER + 1 + floor(extent / CELL / SIDE)
    directory = np.zeros((2 * far, 2 * far), np.int32)
    moments = np.zeros((room, 10))
    moments[0, [kernels.MEAN_X, kernels.MEAN_Y]] = kernels.NOWHERE
    grid = SparseGrid(directory, (-far, -far), np.zeros((room, SIDE, SIDE), np.int32))
    surfels, states = np.zeros((room, 7)), np.zeros(room, np.int8)
    return kernels.SurfelTable(grid, moments, surfels, states, CELL, THICKNESS)


def table_of(points: Floats, rays: Floats | None = None) -> tuple[kernels.SurfelTable, Used]:
    """A table with these points, seen along these rays or from anywhere, and the numbers of tiles
    and slots in it."""
    table = empty_table(len(points) + 1, np.abs(points).max(initial=0.0))
    done, used = kernels.add_points(
        table, (1, 1), points, np.zeros_like(points) if rays is None else rays, 0
    )
    assert done == len(points)
    return table, used


def scattered(seed: int, count: int, extent: float) -> Floats:
    """Points on both sides of zero, some of them on walls."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-extent, extent, (count, 2))
    points[::3, 1] = rng.normal(0.013, 0.004, len(points[::3]))
    points[1::3, 0] = rng.normal(-0.21, 0.004, len(points[1::3]))
    return points


def moved(points: Floats, pose: Floats | Pose) -> Floats:
    """Points of the robot in the map."""
    c, s = cos(pose[2]), sin(pose[2])
    return points @ np.array([[c, s], [-s, c]]) + pose[:2]


def pose_of(pose: Floats) -> Pose:
    x, y, theta = pose.tolist()
    return Pose(x, y, theta)


def full_of(system: NormalEquations) -> tuple[Floats, Floats]:
    """Normal matrix and gradient."""
    xx, xy, xt, yy, yt, tt, *gradient = system
    return np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]]), np.array(gradient)
