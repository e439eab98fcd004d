"""The last millimetres of a match: Levenberg-Marquardt on the bilinear likelihood field.

Poses are (u, v, theta) in cells and radians; points are in the robot's frame, in cells.
"""

from __future__ import annotations

from math import cos, floor, sin, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mapcli.algorithms._kernels.matching import FULL

FARTHEST_REFINEMENT = 24.0
"""Cells that the refinement may move a point: less than `occupancy.MARGIN`."""


@njit(cache=True)
def refine(
    field: NDArray[np.uint8],
    points: NDArray[np.float64],
    start: NDArray[np.float64],
    prior_pose: NDArray[np.float64],
    weights: tuple[float, float],
    iterations: int,
) -> NDArray[np.float64]:
    """Levenberg-Marquardt on the bilinear field: the last millimetres.

    Minimises the sum over the points of (1 - field)^2 plus `weights` times the squared distance
    from `prior_pose`, from `start` on. Never returns a pose worse than `start`, nor one that
    moves any point more than `FARTHEST_REFINEMENT` cells, beyond which the array may end.

    Args:
        field: 255 on walls, 0 away from them.
        points: shape (n, 2).
        start, prior_pose: (u, v, theta).
        weights: (per squared cell, per squared radian).
        iterations: at most.
    """
    farthest = 0.0
    for p in range(len(points)):
        farthest = max(farthest, sqrt(points[p, 0] ** 2 + points[p, 1] ** 2))
    best = start.copy()
    least, kept_normal, kept_gradient = linearise(field, points, start, prior_pose, weights)
    damping = 1e-3
    for _ in range(iterations):
        step = solve3(kept_normal, kept_gradient, damping)
        if abs(step[0]) < 1e-3 and abs(step[1]) < 1e-3 and abs(step[2]) < 1e-5:
            break
        pose = best + step
        shift = abs(pose[0] - start[0]) + abs(pose[1] - start[1])
        if shift + abs(pose[2] - start[2]) * farthest > FARTHEST_REFINEMENT:
            damping *= 10.0
            continue
        cost, normal, gradient = linearise(field, points, pose, prior_pose, weights)
        if cost < least:
            least = cost
            best = pose
            damping *= 0.3
            kept_normal, kept_gradient = normal, gradient
        else:
            damping *= 10.0
    return best


@njit(cache=True)
def linearise(
    field: NDArray[np.uint8],
    points: NDArray[np.float64],
    pose: NDArray[np.float64],
    prior_pose: NDArray[np.float64],
    weights: tuple[float, float],
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Cost, normal matrix and gradient of `refine` at a pose."""
    a = np.zeros((3, 3))
    g = np.zeros(3)
    cost = 0.0
    c, s = cos(pose[2]), sin(pose[2])
    for p in range(len(points)):
        x = c * points[p, 0] - s * points[p, 1]
        y = s * points[p, 0] + c * points[p, 1]
        u, v = pose[0] + x - 0.5, pose[1] + y - 0.5  # values live at cell centres
        i, j = floor(u), floor(v)
        right, up = u - i, v - j
        m00, m10 = field[j, i] / FULL, field[j, i + 1] / FULL
        m01, m11 = field[j + 1, i] / FULL, field[j + 1, i + 1] / FULL
        left_right_low, left_right_high = m10 - m00, m11 - m01
        low, high = m00 + left_right_low * right, m01 + left_right_high * right
        r = 1.0 - (low + (high - low) * up)
        gu = left_right_low + (left_right_high - left_right_low) * up
        gv = high - low
        gt = x * gv - y * gu
        cost += r * r
        a[0, 0] += gu * gu
        a[0, 1] += gu * gv
        a[0, 2] += gu * gt
        a[1, 1] += gv * gv
        a[1, 2] += gv * gt
        a[2, 2] += gt * gt
        g[0] += gu * r
        g[1] += gv * r
        g[2] += gt * r
    for k in range(3):
        weight = weights[min(k // 2, 1)]
        off = prior_pose[k] - pose[k]
        cost += weight * off * off
        a[k, k] += weight
        g[k] += weight * off
    a[1, 0], a[2, 0], a[2, 1] = a[0, 1], a[0, 2], a[1, 2]
    return cost, a, g


@njit(cache=True)
def solve3(
    normal: NDArray[np.float64], gradient: NDArray[np.float64], damping: float
) -> NDArray[np.float64]:
    """Solve (normal + damping * its diagonal) x = gradient by Cramer's rule."""
    a = normal.copy()
    for k in range(3):
        a[k, k] += damping * a[k, k] + 1e-9
    c00 = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
    c01 = a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
    c02 = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
    det = a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02
    c11 = a[0, 0] * a[2, 2] - a[0, 2] * a[2, 0]
    c12 = a[0, 1] * a[2, 0] - a[0, 0] * a[2, 1]
    c22 = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
    b = gradient
    return np.array(
        [
            (c00 * b[0] + c01 * b[1] + c02 * b[2]) / det,
            (c01 * b[0] + c11 * b[1] + c12 * b[2]) / det,
            (c02 * b[0] + c12 * b[1] + c22 * b[2]) / det,
        ]
    )
