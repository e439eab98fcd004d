"""Gauss-Newton on a chain of poses: those of all scans, each of which shares what was measured with
the next one only, so that the normal equations are banded.

What scans say of their poses is added by `point_to_line_icp.add_scans`, or by `sweep_refinement`
where their beams were taken one after another; what odometry says of the steps is added here.
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
    in_map_axes,
    sqrt_robust_weight,
)

BAND = 6
"""Diagonals of the normal equations, the main one and those above: two poses of three numbers."""


class OdometrySteps(NamedTuple):
    """Motions by odometry, from each scan to the next.

    Attributes:
        counted: shape (m - 1, 3), in the robot's frame at the former.
        information: shape (m - 1, 3), ahead, to the left and on the heading, seen from the former:
            m^-2, rad^-2; 0 if not known.
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


class ChainEquations(NamedTuple):
    """Of small changes (x, y, theta) of all poses, one after the other.

    Attributes:
        matrix: shape (3 m, BAND); row i holds the columns i, i + 1 ... of the symmetric matrix.
        right: shape (3 m,).
    """

    matrix: NDArray[np.float64]
    right: NDArray[np.float64]


@kernel
def add_pose(
    equations: ChainEquations,
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
    odometry: OdometrySteps, poses: NDArray[np.float64], equations: ChainEquations
) -> None:
    """Add what odometry says, position and heading of each step with a robust weight.

    The residual of a step is the pose that odometry counts from the former scan on, less that of
    the latter, which is (a, b) off the former, all in the map's axes; but its weight turns with the
    former. So its Jacobians by the latter and the former are

        [-1   0   0]   [1   0  -b]
        [ 0  -1   0]   [0   1   a]
        [ 0   0  -1]   [0   0   1]
    """
    counted, information = odometry.counted, odometry.information
    for k in range(len(counted)):
        x, y = counted[k, 0], counted[k, 1]
        c, s = cos(poses[k, 2]), sin(poses[k, 2])
        a, b = poses[k + 1, 0] - poses[k, 0], poses[k + 1, 1] - poses[k, 1]
        ex, ey = a - (c * x - s * y), b - (s * x + c * y)
        et = poses[k + 1, 2] - poses[k, 2] - counted[k, 2]
        position, tt = (information[k, 0], information[k, 1]), information[k, 2]
        xx, xy, yy = in_map_axes(position, (ex, ey), poses[k, 2], SQUARED_SCALE)
        root_tt = sqrt_robust_weight(tt * et * et, SQUARED_SCALE)
        tt *= root_tt * root_tt
        gx, gy = xx * ex + xy * ey, xy * ex + yy * ey
        tx, ty = xy * a - xx * b, yy * a - xy * b
        former = Symmetric(xx, xy, tx, yy, ty, a * ty - b * tx + tt)
        latter = Symmetric(xx, xy, 0.0, yy, 0.0, tt)
        add_pose(equations, k, former, (gx, gy, tt * et + a * gy - b * gx), 1.0)
        add_pose(equations, k + 1, latter, (-gx, -gy, -tt * et), 1.0)
        add_pair(equations.matrix, k, latter, -1.0)
        equations.matrix[3 * k + 2, 1] -= tx
        equations.matrix[3 * k + 2, 2] -= ty


@kernel
def solve_banded(equations: ChainEquations) -> None:
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
