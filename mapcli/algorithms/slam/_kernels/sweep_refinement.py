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
from mapcli.algorithms.slam._kernels.gauss_newton import (
    LEAST_INFORMATION,
    SQUARED_SCALE,
    sqrt_robust_weight,
    weighted_information,
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

BAND = 6
"""Diagonals of the normal equations, the main one and those above: two poses of three numbers."""

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


class OdometrySteps(NamedTuple):
    """Motions by odometry, from each scan to the next.

    Attributes:
        counted: shape (m - 1, 3), in the robot's frame at the former.
        information: shape (m - 1, 2), on position and heading: m^-2, rad^-2; 0 if not known.
    """

    counted: NDArray[np.float64]
    information: NDArray[np.float64]


class Symmetric(NamedTuple):
    """A symmetric 3 x 3 matrix: its upper triangle by rows."""

    xx: float
    xy: float
    xt: float
    yy: float
    yt: float
    tt: float


class NormalEquations(NamedTuple):
    """Of small changes (x, y, theta) of all poses, one after the other.

    Attributes:
        matrix: shape (3 m, BAND); row i holds the columns i, i + 1 ... of the symmetric matrix.
        right: shape (3 m,).
    """

    matrix: NDArray[np.float64]
    right: NDArray[np.float64]


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
    equations: NormalEquations,
) -> None:
    """Add what the points say that have a surfel near them; see `gauss_newton.linearise`."""
    surfels = table.surfels
    for p in range(len(timed.points)):
        x, y, theta = seen_from[p, 0], seen_from[p, 1], seen_from[p, 2]
        px, py = timed.points[p, 0], timed.points[p, 1]
        c, s = cos(theta), sin(theta)
        rx, ry = c * px - s * py, s * px + c * py
        at = nearest_surfel(table, x + rx, y + ry)
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
        x = seen_from[p, 0] + c * points[p, 0] - s * points[p, 1]
        y = seen_from[p, 1] + s * points[p, 0] + c * points[p, 1]
        at = nearest_surfel(table, x, y)
        if at == 0:
            continue
        ex, ey = surfels[at, SURFEL_X] - x, surfels[at, SURFEL_Y] - y
        square = surfels[at, INFORMATION_XX] * ex * ex + surfels[at, INFORMATION_YY] * ey * ey
        count += square + 2 * surfels[at, INFORMATION_XY] * ex * ey <= SQUARED_SCALE
    return count


@kernel
def add_pose(
    equations: NormalEquations,
    k: int,
    matrix: Symmetric,
    right: tuple[float, float, float],
    share: float,
) -> None:
    """Add J^T W J and J^T W e of a residual to a pose, by which its Jacobian is a share of J."""
    normal, i, weight = equations.matrix, 3 * k, share * share
    normal[i, 0] += weight * matrix.xx
    normal[i, 1] += weight * matrix.xy
    normal[i, 2] += weight * matrix.xt
    normal[i + 1, 0] += weight * matrix.yy
    normal[i + 1, 1] += weight * matrix.yt
    normal[i + 2, 0] += weight * matrix.tt
    for a in range(3):
        equations.right[i + a] += share * right[a]


@kernel
def add_pair(normal: NDArray[np.float64], k: int, matrix: Symmetric, weight: float) -> None:
    """Add J^T W J between a pose and the next."""
    xx, xy, xt, yy, yt, tt = matrix
    i = 3 * k
    normal[i, 3] += weight * xx
    normal[i, 4] += weight * xy
    normal[i, 5] += weight * xt
    normal[i + 1, 2] += weight * xy
    normal[i + 1, 3] += weight * yy
    normal[i + 1, 4] += weight * yt
    normal[i + 2, 1] += weight * xt
    normal[i + 2, 2] += weight * yt
    normal[i + 2, 3] += weight * tt


@kernel
def add_odometry(
    odometry: OdometrySteps, poses: NDArray[np.float64], equations: NormalEquations
) -> None:
    """Add what odometry says, position and heading of each step with a robust weight.

    The residual of a step is the pose that odometry counts from the former scan on, (a, b) off it
    in the map's axes, less the pose of the latter. Its Jacobians by the latter and the former are

        [-1   0   0]   [1   0  -b]
        [ 0  -1   0]   [0   1   a]
        [ 0   0  -1]   [0   0   1]
    """
    for k in range(len(odometry.counted)):
        x, y = odometry.counted[k, 0], odometry.counted[k, 1]
        c, s = cos(poses[k, 2]), sin(poses[k, 2])
        a, b = c * x - s * y, s * x + c * y
        ex = poses[k + 1, 0] - poses[k, 0] - a
        ey = poses[k + 1, 1] - poses[k, 1] - b
        et = poses[k + 1, 2] - poses[k, 2] - odometry.counted[k, 2]
        xy, tt = odometry.information[k, 0], odometry.information[k, 1]
        root_xy = sqrt_robust_weight(xy * (ex * ex + ey * ey), SQUARED_SCALE)
        root_tt = sqrt_robust_weight(tt * et * et, SQUARED_SCALE)
        xy, tt = xy * root_xy * root_xy, tt * root_tt * root_tt
        former = Symmetric(xy, 0.0, -xy * b, xy, xy * a, xy * (a * a + b * b) + tt)
        latter = Symmetric(xy, 0.0, 0.0, xy, 0.0, tt)
        add_pose(equations, k, former, (xy * ex, xy * ey, tt * et + xy * (a * ey - b * ex)), 1.0)
        add_pose(equations, k + 1, latter, (-xy * ex, -xy * ey, -tt * et), 1.0)
        add_pair(equations.matrix, k, latter, -1.0)
        equations.matrix[3 * k + 2, 1] += xy * b
        equations.matrix[3 * k + 2, 2] -= xy * a


@kernel
def solve_banded(equations: NormalEquations) -> None:
    """Solve the normal equations in place, by L D L^T: `right` becomes the solution."""
    normal, right = equations.matrix, equations.right
    n = len(right)
    for i in range(n):
        normal[i, 0] += LEAST_INFORMATION
    for i in range(n):
        reach = min(BAND, n - i)
        for a in range(1, reach):
            share = normal[i, a] / normal[i, 0]
            for b in range(a, reach):
                normal[i + a, b - a] -= share * normal[i, b]
            right[i + a] -= share * right[i]
    for i in range(n - 1, -1, -1):
        for a in range(1, min(BAND, n - i)):
            right[i] -= normal[i, a] * right[i + a]
        right[i] /= normal[i, 0]
