"""Gauss-Newton on all poses of a trajectory whose scans were taken beam by beam.

Between two scans the robot's pose is a cubic of the time (Hermite, Catmull and Rom) or goes as
odometry has it, or a mean of both, and a point is seen from the pose at its own time. So both
scans' poses move a point: at a share u of the way from the former to the latter, its residual's
Jacobian is (1 - u) J by the former and u J by the latter, J as in `gauss_newton.linearise`. Only
neighbours share points, so the normal equations are banded.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.gauss_newton import SQUARED_SCALE, weighted_information
from mapcli.algorithms.slam._kernels.pose_chain import (
    ChainEquations,
    Symmetric,
    add_pair,
    add_pose,
)
from mapcli.algorithms.slam._kernels.surfel_map import (
    INFORMATION_XX,
    INFORMATION_XY,
    INFORMATION_YY,
    SURFEL_X,
    SURFEL_Y,
    SurfelTable,
    nearest_surfel,
)

ALONE = -1
"""The step of a point that is not taken between two scans."""


class TimedPoints(NamedTuple):
    """Points of scans with the times at which they were taken.

    Attributes:
        points: shape (n, 2), metres in the robot's frame when each was taken.
        scans: shape (n,), the number of the scan.
        steps: shape (n,), the number of the scan from which to the next the robot was on its way,
            or ALONE; shares: shape (n,), of the time of that step.
        motions: shape (n, 3), the robot's pose then by odometry, in its frame at the stamp of the
            scan.
    """

    points: NDArray[np.float64]
    scans: NDArray[np.int64]
    steps: NDArray[np.int64]
    shares: NDArray[np.float64]
    motions: NDArray[np.float64]


class Path(NamedTuple):
    """The robot's way through the scans.

    Attributes:
        poses: shape (m, 3), at each scan in the map; headings go on over the half turn.
        velocities: shape (m, 3), per second; seconds: shape (m - 1,), from each to the next.
        counted: shape (m - 1, 3), the step by odometry, in the robot's frame at the former scan.
        shares: shape (m - 1, 3), of odometry beside the cubic, from 0 to 1.
    """

    poses: NDArray[np.float64]
    velocities: NDArray[np.float64]
    seconds: NDArray[np.float64]
    counted: NDArray[np.float64]
    shares: NDArray[np.float64]


@kernel
def place_points(timed: TimedPoints, path: Path, seen_from: NDArray[np.float64]) -> None:
    """Fill `seen_from`, (n, 3), with the robot's pose in the map at the time of each point."""
    poses = path.poses
    for p in range(len(timed.scans)):
        i, u, k = timed.steps[p], timed.shares[p], timed.scans[p]
        motion = (timed.motions[p, 0], timed.motions[p, 1], timed.motions[p, 2])
        x, y, theta = composed(poses, k, motion)
        seen_from[p, 0], seen_from[p, 1], seen_from[p, 2] = x, y, theta
        if i == ALONE:
            continue
        at_end = u * u * (3 - 2 * u)
        begins = path.seconds[i] * u * (1 - u) * (1 - u)
        ends = path.seconds[i] * u * u * (u - 1)
        # Where odometry comes to at the other scan is off, the more the nearer to that.
        step = (path.counted[i, 0], path.counted[i, 1], path.counted[i, 2])
        end = composed(poses, k, step if k == i else inverse(step))
        j, to_end = (i + 1, u) if k == i else (i, 1 - u)
        for a in range(3):
            cubic = (
                (1 - at_end) * poses[i, a]
                + at_end * poses[i + 1, a]
                + begins * path.velocities[i, a]
                + ends * path.velocities[i + 1, a]
            )
            seen_from[p, a] += to_end * (poses[j, a] - end[a])
            seen_from[p, a] += (1 - path.shares[i, a]) * (cubic - seen_from[p, a])


@kernel
def composed(
    poses: NDArray[np.float64], k: int, motion: tuple[float, float, float]
) -> tuple[float, float, float]:
    """A pose of the robot and a motion from there on."""
    x, y, theta = motion
    c, s = cos(poses[k, 2]), sin(poses[k, 2])
    return poses[k, 0] + c * x - s * y, poses[k, 1] + s * x + c * y, poses[k, 2] + theta


@kernel
def inverse(motion: tuple[float, float, float]) -> tuple[float, float, float]:
    """The motion that undoes another."""
    x, y, theta = motion
    c, s = cos(theta), sin(theta)
    return -c * x - s * y, s * x - c * y, -theta


@kernel
def add_points(
    table: SurfelTable,
    timed: TimedPoints,
    seen_from: NDArray[np.float64],
    bearing_variance: float,
    equations: ChainEquations,
) -> None:
    """Add what the points say that have a surfel near them; see `gauss_newton.linearise`."""
    surfels = table.surfels
    for p in range(len(timed.points)):
        x, y, theta = seen_from[p, 0], seen_from[p, 1], seen_from[p, 2]
        px, py = timed.points[p, 0], timed.points[p, 1]
        c, s = cos(theta), sin(theta)
        rx, ry = c * px - s * py, s * px + c * py
        at = nearest_surfel(table, x + rx, y + ry, rx, ry)
        if at == 0:
            continue
        ex, ey = surfels[at, SURFEL_X] - x - rx, surfels[at, SURFEL_Y] - y - ry
        xx, xy, yy = weighted_information(surfels, at, (ex, ey), (rx, ry), bearing_variance)
        tx, ty = xy * rx - xx * ry, yy * rx - xy * ry
        gx, gy = xx * ex + xy * ey, xy * ex + yy * ey
        matrix = Symmetric(xx, xy, tx, yy, ty, rx * ty - ry * tx)
        right = (gx, gy, rx * gy - ry * gx)
        i, u = timed.steps[p], timed.shares[p]
        if i == ALONE:
            add_pose(equations, timed.scans[p], matrix, right, 1.0)
            continue
        add_pose(equations, i, matrix, right, 1 - u)
        add_pose(equations, i + 1, matrix, right, u)
        add_pair(equations.matrix, i, matrix, u * (1 - u))


@kernel
def points_on_walls(
    table: SurfelTable, points: NDArray[np.float64], seen_from: NDArray[np.float64]
) -> int:
    """How many points lie on a surfel, within the scale of the robust kernel."""
    surfels, count = table.surfels, 0
    for p in range(len(points)):
        c, s = cos(seen_from[p, 2]), sin(seen_from[p, 2])
        rx, ry = c * points[p, 0] - s * points[p, 1], s * points[p, 0] + c * points[p, 1]
        x, y = seen_from[p, 0] + rx, seen_from[p, 1] + ry
        at = nearest_surfel(table, x, y, rx, ry)
        if at == 0:
            continue
        ex, ey = surfels[at, SURFEL_X] - x, surfels[at, SURFEL_Y] - y
        square = surfels[at, INFORMATION_XX] * ex * ex + surfels[at, INFORMATION_YY] * ey * ey
        count += square + 2 * surfels[at, INFORMATION_XY] * ex * ey <= SQUARED_SCALE
    return count
