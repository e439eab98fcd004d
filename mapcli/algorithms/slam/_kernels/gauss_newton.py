"""Gauss-Newton on the residuals of a scan's points from their surfels.

What is brought down is, over the points p that have a surfel,

    sum of  rho(s_p e_p^T I_p e_p)  +  the same for the prediction,

    e_p = m_p - (t + R(theta) p)     the residual, from the point in the map to the surfel's mean
    I_p                              the surfel's information: large across its line, 0 along it
    s_p = 1 / (1 + b J^T I_p J)      what is left of it, since the point's bearing is known to a
                                     variance b only, and J is how the point moves with it
    rho(q) = s^2 q / (s^2 + q)       the robust kernel of Geman and McClure, of scale s

With I_p of rank one, e_p^T I_p e_p is the squared distance from the point to the line, over its
variance; and s_p adds to this the variance of the bearing across the line, which is the larger the
farther the point is and the flatter its beam hits. Poses (x, y, theta) are those of the robot in
the map; metres and radians.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.pose import Pose
from mapcli.algorithms.slam._kernels.surfel_map import (
    INFORMATION_XX,
    INFORMATION_XY,
    INFORMATION_YY,
    SURFEL_X,
    SURFEL_Y,
)

STILL, STILL_TURN = 5e-4, 1e-4
"""Metres and radians; a pose that moves less has the same correspondences as before."""
STEPS, LAST_STEP = 3, 0.2
"""Gauss-Newton steps for the same correspondences at most; the last one moves this share of the
above."""
LEAST_INFORMATION = 1e-9
"""What is known anyway, so that every system can be solved."""
SQUARED_SCALE = 3.0 * 3.0
"""Of the robust kernel of points, s^2: at three standard deviations a point's weight is a
quarter."""


class NormalEquations(NamedTuple):
    """J^T W J d = J^T W e for a small change d = (x, y, theta) of the pose, in the map's axes.

    Attributes:
        xx, xy, xt, yy, yt, tt: upper triangle of the symmetric matrix J^T W J, by rows: the
            information of the scan on its pose.
        gx, gy, gt: the right side J^T W e, minus half the gradient of the robust cost.
    """

    xx: float
    xy: float
    xt: float
    yy: float
    yt: float
    tt: float
    gx: float
    gy: float
    gt: float


class Prediction(NamedTuple):
    """Where a pose is expected, as odometry has it.

    Attributes:
        pose: theta on the same turn of the circle as that of the pose that is fitted.
        information_ahead, information_left, information_theta: in the frame of `pose`, m^-2 and
            rad^-2; 0 if nothing is expected.
        squared_scale: of the robust kernel on its squared deviations: a prediction that the scan
            contradicts by far has little weight.
    """

    pose: Pose
    information_ahead: float
    information_left: float
    information_theta: float
    squared_scale: float


@kernel
def gauss_newton(
    surfels: NDArray[np.float64],
    points: NDArray[np.float64],
    correspondences: NDArray[np.int64],
    pose: Pose,
    prediction: Prediction,
    bearing_variance: float,
) -> tuple[Pose, NormalEquations]:
    """The pose at which points fit the surfels that they belong to, and the last normal equations
    on the way there, from the points alone."""
    for _ in range(STEPS):
        equations = linearise(surfels, points, correspondences, pose, bearing_variance)
        before = pose
        pose = solve_step(pose, with_prediction(equations, pose, prediction))
        if is_still(before, pose, LAST_STEP):
            break
    return pose, equations


@kernel
def is_still(before: Pose, after: Pose, share: float) -> bool:
    """Whether a pose has moved less than a share of STILL and STILL_TURN."""
    off = abs(after.x - before.x) + abs(after.y - before.y)
    return off < share * STILL and abs(after.theta - before.theta) < share * STILL_TURN


@kernel
def linearise(
    surfels: NDArray[np.float64],
    points: NDArray[np.float64],
    correspondences: NDArray[np.int64],
    pose: Pose,
    bearing_variance: float,
) -> NormalEquations:
    """The normal equations of the points that have a surfel, at a pose.

    A point p of the robot is at t + r in the map, r = R(theta) p; its residual is e = m - (t + r),
    m the surfel's mean. With W the surfel's information times the robust weight, the Jacobian of
    t + r by (x, y, theta) and the sums over the points are

        J = [1  0  -ry]    J^T W J = [Wxx  Wxy  tx           ]    J^T W e = [gx           ]
            [0  1   rx]              [Wxy  Wyy  ty           ]              [gy           ]
                                     [tx   ty   rx ty - ry tx]              [rx gy - ry gx]

    where (tx, ty) = W (-ry, rx): a turn moves r to its left, as does an error of the bearing; and
    (gx, gy) = W e.
    """
    x, y, theta = pose
    c, s = cos(theta), sin(theta)
    n_xx = n_xy = n_xt = n_yy = n_yt = n_tt = g_x = g_y = g_t = 0.0
    for p in range(len(points)):
        at = correspondences[p]
        if at == 0:
            continue
        px, py = points[p, 0], points[p, 1]
        rx, ry = c * px - s * py, s * px + c * py
        ex, ey = surfels[at, SURFEL_X] - x - rx, surfels[at, SURFEL_Y] - y - ry
        xx, xy, yy = weighted_information(surfels, at, (ex, ey), (rx, ry), bearing_variance)
        tx, ty = xy * rx - xx * ry, yy * rx - xy * ry
        gx, gy = xx * ex + xy * ey, xy * ex + yy * ey
        n_xx += xx
        n_xy += xy
        n_yy += yy
        n_xt += tx
        n_yt += ty
        n_tt += rx * ty - ry * tx
        g_x += gx
        g_y += gy
        g_t += rx * gy - ry * gx
    return NormalEquations(n_xx, n_xy, n_xt, n_yy, n_yt, n_tt, g_x, g_y, g_t)


@kernel
def weighted_information(
    surfels: NDArray[np.float64],
    at: int,
    residual: tuple[float, float],
    seen: tuple[float, float],
    bearing_variance: float,
) -> tuple[float, float, float]:
    """W = (xx, xy, yy): the surfel's information, less what the error of the point's bearing takes,
    times the robust weight of its residual.

    Args:
        residual: (ex, ey); seen: (rx, ry), the point from the robot; both in the map's axes.
    """
    (ex, ey), (rx, ry) = residual, seen
    xx, xy, yy = (
        surfels[at, INFORMATION_XX],
        surfels[at, INFORMATION_XY],
        surfels[at, INFORMATION_YY],
    )
    turned = xx * ry * ry - 2 * xy * rx * ry + yy * rx * rx  # J^T I J
    share = 1 / (1 + bearing_variance * turned)
    square = share * (xx * ex * ex + 2 * xy * ex * ey + yy * ey * ey)
    root = sqrt_robust_weight(square, SQUARED_SCALE)
    weight = share * root * root
    return weight * xx, weight * xy, weight * yy


@kernel
def sqrt_robust_weight(square: float, squared_scale: float) -> float:
    """The root of the robust weight of Geman and McClure, (s^2 / (s^2 + q))^2, of a squared
    deviation q: 1 for none, a quarter where q = s^2."""
    return squared_scale / (squared_scale + square)


@kernel
def in_map_axes(
    information: tuple[float, float], residual: tuple[float, float], heading: float, scale: float
) -> tuple[float, float, float]:
    """Information on a position, known ahead and to the left of a heading, times the robust weight
    of its residual: (xx, xy, yy) in the map's axes.

    Args:
        residual: in the map's axes; scale: squared, of the robust kernel.
    """
    (ahead, left), (x, y) = information, residual
    c, s = cos(heading), sin(heading)
    square = ahead * (c * x + s * y) ** 2 + left * (c * y - s * x) ** 2
    root = sqrt_robust_weight(square, scale)
    ahead, left = ahead * root * root, left * root * root
    return c * c * ahead + s * s * left, c * s * (ahead - left), s * s * ahead + c * c * left


@kernel
def with_prediction(
    equations: NormalEquations, pose: Pose, prediction: Prediction
) -> NormalEquations:
    """Add the prior factor of the predicted pose, position and heading each with a robust weight.

    Its residual is predicted - pose and its Jacobian the identity.
    """
    n, expected, scale = equations, prediction.pose, prediction.squared_scale
    x, y, turn = expected.x - pose.x, expected.y - pose.y, expected.theta - pose.theta
    position = prediction.information_ahead, prediction.information_left
    xx, xy, yy = in_map_axes(position, (x, y), expected.theta, scale)
    per_radian = prediction.information_theta
    root_turn = sqrt_robust_weight(per_radian * turn * turn, scale)
    theta = per_radian * root_turn * root_turn
    return NormalEquations(
        n.xx + xx, n.xy + xy, n.xt, n.yy + yy, n.yt, n.tt + theta,
        n.gx + xx * x + xy * y, n.gy + xy * x + yy * y, n.gt + theta * turn,
    )  # fmt: skip


@kernel
def solve_step(pose: Pose, equations: NormalEquations) -> Pose:
    """A pose after one Gauss-Newton step: the solution of the normal equations, by
    Cramer's rule."""
    a00, a01, a02, a11, a12, a22, x, y, z = equations
    a00 += LEAST_INFORMATION
    a11 += LEAST_INFORMATION
    a22 += LEAST_INFORMATION
    c00, c01, c02 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
    c11, c12, c22 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
    determinant = a00 * c00 + a01 * c01 + a02 * c02
    return Pose(
        pose.x + (c00 * x + c01 * y + c02 * z) / determinant,
        pose.y + (c01 * x + c11 * y + c12 * z) / determinant,
        pose.theta + (c02 * x + c12 * y + c22 * z) / determinant,
    )
