"""Fitting a scan's pose to surfels: Gauss-Newton on the distances of its points to the walls.

Lengths are in metres; for surfels see `surfels`.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mapcli.algorithms._kernels.surfels import Table, nearest_surfel

STILL, STILL_TURN = 5e-4, 1e-4
"""Metres and radians that a pose moves in the last round of a fit."""
STEPS = 3
"""Of Gauss-Newton in a round."""


@njit(cache=True)
def associate(
    table: Table,
    points: NDArray[np.float64],
    pose: NDArray[np.float64],
    shape: tuple[float, float, float],
    partners: NDArray[np.int64],
) -> int:
    """Find the surfel of each point at a pose: fills `partners`, returns how many have one."""
    c, s = cos(pose[2]), sin(pose[2])
    fitted = 0
    for p in range(len(points)):
        x = pose[0] + c * points[p, 0] - s * points[p, 1]
        y = pose[1] + s * points[p, 0] + c * points[p, 1]
        partners[p] = nearest_surfel(table, x, y, shape[0], shape[1])
        fitted += partners[p] >= 0
    return fitted


@njit(cache=True)
def linearise(
    surfels: NDArray[np.float64],
    partners: NDArray[np.int64],
    points: NDArray[np.float64],
    pose: NDArray[np.float64],
    doubt: float,
    normal: NDArray[np.float64],
    gradient: NDArray[np.float64],
) -> None:
    """Normal matrix and gradient of how badly points fit at a pose.

    Args:
        surfels, partners: the walls, and which one each point is at, -1 for none.
        doubt: deviations at which a point's say is a quarter.
        normal, gradient: shape (3, 3) and (3,), filled; the upper triangle only.
    """
    c, s = cos(pose[2]), sin(pose[2])
    for k in range(3):
        gradient[k] = 0.0
        for j in range(3):
            normal[k, j] = 0.0
    for p in range(len(points)):
        if partners[p] < 0:
            continue
        f = surfels[partners[p]]
        rx, ry = c * points[p, 0] - s * points[p, 1], s * points[p, 0] + c * points[p, 1]
        ex, ey = f[0] - pose[0] - rx, f[1] - pose[1] - ry
        square = f[2] * ex * ex + 2 * f[3] * ex * ey + f[4] * ey * ey
        say = doubt * doubt / (doubt * doubt + square)
        say *= say
        xx, xy, yy = say * f[2], say * f[3], say * f[4]
        # The columns of the information times how a turn moves the point, (-ry, rx).
        tx, ty = xy * rx - xx * ry, yy * rx - xy * ry
        normal[0, 0] += xx
        normal[0, 1] += xy
        normal[1, 1] += yy
        normal[0, 2] += tx
        normal[1, 2] += ty
        normal[2, 2] += rx * ty - ry * tx
        gx, gy = xx * ex + xy * ey, xy * ex + yy * ey
        gradient[0] += gx
        gradient[1] += gy
        gradient[2] += rx * gy - ry * gx


@njit(cache=True)
def refine(
    table: Table,
    points: NDArray[np.float64],
    start: NDArray[np.float64],
    predicted: NDArray[np.float64],
    prior: tuple[float, float, float],
    shape: tuple[float, float, float],
    rounds: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Gauss-Newton on the distances of points to the walls, and of the pose to the prediction.

    Args:
        points: shape (n, 2), in the robot's frame.
        start: (x, y, theta) in the world; predicted: what odometry says.
        prior: (information per squared metre, per squared radian, squared deviations at which
            the prediction's say has fallen to a quarter).
        shape: (cell, thickness of a wall, deviations at which a point's say is a quarter).
        rounds: how often at most each point looks for its wall anew.

    Returns:
        The pose, the normal matrix there from the points alone, how many points have a wall.
    """
    pose = start.copy()
    partners = np.empty(len(points), np.int64)
    normal, gradient = np.zeros((3, 3)), np.zeros(3)
    total, right, step = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    fitted = 0
    for _ in range(rounds):
        fitted = associate(table, points, pose, shape, partners)
        x, y, theta = pose[0], pose[1], pose[2]
        for _ in range(STEPS):  # cheap beside the association
            linearise(table[3], partners, points, pose, shape[2], normal, gradient)
            add_prior(pose, predicted, prior, normal, gradient, total, right)
            solve3(total, right, step)
            for k in range(3):
                pose[k] += step[k]
        off = abs(pose[0] - x) + abs(pose[1] - y)
        if off < STILL and abs(pose[2] - theta) < STILL_TURN:
            break
    return pose, normal, fitted


@njit(cache=True)
def add_prior(
    pose: NDArray[np.float64],
    predicted: NDArray[np.float64],
    prior: tuple[float, float, float],
    normal: NDArray[np.float64],
    gradient: NDArray[np.float64],
    total: NDArray[np.float64],
    right: NDArray[np.float64],
) -> None:
    """Add the pull of the prediction, which weakens where the pose is far from it.

    `total` and `right` are filled: the sums. (Loops, since numba compiles the assignment of whole
    arrays together with the texts of its errors, for seconds.)
    """
    x, y, turn = predicted[0] - pose[0], predicted[1] - pose[1], predicted[2] - pose[2]
    say_xy = prior[2] / (prior[2] + prior[0] * (x * x + y * y))
    say_turn = prior[2] / (prior[2] + prior[1] * turn * turn)
    for k in range(3):
        right[k] = gradient[k]
        for j in range(k, 3):
            total[k, j] = normal[k, j]
    xy, theta = prior[0] * say_xy * say_xy, prior[1] * say_turn * say_turn
    total[0, 0] += xy
    total[1, 1] += xy
    total[2, 2] += theta
    right[0] += xy * x
    right[1] += xy * y
    right[2] += theta * turn


@njit(cache=True)
def solve3(
    normal: NDArray[np.float64], right: NDArray[np.float64], solution: NDArray[np.float64]
) -> None:
    """Solve a symmetric 3 x 3 system, of which the upper triangle is given, by Cramer's rule."""
    a00, a11, a22 = normal[0, 0] + 1e-9, normal[1, 1] + 1e-9, normal[2, 2] + 1e-9
    a01, a02, a12 = normal[0, 1], normal[0, 2], normal[1, 2]
    c00, c01, c02 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
    c11, c12, c22 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
    determinant = a00 * c00 + a01 * c01 + a02 * c02
    x, y, z = right[0], right[1], right[2]
    solution[0] = (c00 * x + c01 * y + c02 * z) / determinant
    solution[1] = (c01 * x + c11 * y + c12 * z) / determinant
    solution[2] = (c02 * x + c12 * y + c22 * z) / determinant
