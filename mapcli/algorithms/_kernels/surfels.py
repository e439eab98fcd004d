"""Walls finer than cells: the points that fell into each cell, and fitting scans to them.

A map of surfels is a hash table from cells to MOMENTS of the points in them: how many, and the
sums of x, y, xx, xy, yy, taken from the cell's centre. A SURFEL is the line through the points of
a cell and its neighbours: a mean and an information matrix that is large across the wall, and
zero along it, so that a scan in a corridor says nothing about how far along the robot is.

Lengths are in metres.
"""

from __future__ import annotations

from math import cos, floor, sin, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

EMPTY = -1
BIAS = 1 << 30
MOST_ROUND = 0.15
"""Points whose narrow spread is more than this share of their wide one are no line but a lump,
which holds a scan in both directions, if weakly."""
FARTHEST_PARTNER = 3
"""Cells from a point to the wall that it may belong to."""
WIDEST_PATCH = 5
"""Cells around a cell that may lend it their points when it has few."""
FEWEST = 4
"""Points that make a surfel."""

Table = tuple[
    NDArray[np.int64],  # keys of the hash table
    NDArray[np.int64],  # their slots
    NDArray[np.float64],  # moments, shape (slots, 6)
    NDArray[np.float64],  # surfels, shape (slots, 5): mean x, y; information xx, xy, yy
    NDArray[np.int8],  # what is known about each surfel: STALE, NONE or FRESH
]
STALE, NONE, FRESH = 0, 1, 2
STILL, STILL_TURN = 5e-4, 1e-4
"""Metres and radians that a pose moves in the last round of a fit."""
STEPS = 3
"""Of Gauss-Newton in a round."""


@njit(cache=True)
def find(keys: NDArray[np.int64], u: int, v: int) -> int:
    """Where a cell is in the hash table, or where it would go."""
    key = ((u + BIAS) << 31) | (v + BIAS)
    mask = len(keys) - 1
    at = ((key * 0x9E3779B97F4A7C1) >> 20) & mask
    while keys[at] != EMPTY and keys[at] != key:
        at = (at + 1) & mask
    return at


@njit(cache=True)
def slot_of(keys: NDArray[np.int64], slots: NDArray[np.int64], u: int, v: int) -> int:
    """The slot of a cell, or -1."""
    at = find(keys, u, v)
    return slots[at] if keys[at] != EMPTY else -1


@njit(cache=True)
def add_points(
    keys: NDArray[np.int64],
    slots: NDArray[np.int64],
    moments: NDArray[np.float64],
    used: int,
    points: NDArray[np.float64],
    cell: float,
) -> int:
    """Add world points, shape (n, 2); returns the new number of slots in use.

    There must be room for n more in `moments`, and the hash table must stay half empty.
    """
    for p in range(len(points)):
        u, v = floor(points[p, 0] / cell), floor(points[p, 1] / cell)
        at = find(keys, u, v)
        if keys[at] == EMPTY:
            keys[at] = ((u + BIAS) << 31) | (v + BIAS)
            slots[at] = used
            used += 1
        x, y = points[p, 0] - (u + 0.5) * cell, points[p, 1] - (v + 0.5) * cell
        m = moments[slots[at]]
        m[0] += 1.0
        m[1] += x
        m[2] += y
        m[3] += x * x
        m[4] += x * y
        m[5] += y * y
    return used


@njit(cache=True)
def rehash(
    old_keys: NDArray[np.int64],
    old_slots: NDArray[np.int64],
    keys: NDArray[np.int64],
    slots: NDArray[np.int64],
) -> None:
    """Fill a larger hash table from a smaller one."""
    for k in range(len(old_keys)):
        if old_keys[k] != EMPTY:
            at = find(keys, (old_keys[k] >> 31) - BIAS, (old_keys[k] & ((1 << 31) - 1)) - BIAS)
            keys[at] = old_keys[k]
            slots[at] = old_slots[k]


@njit(cache=True)
def patch(
    keys: NDArray[np.int64],
    slots: NDArray[np.int64],
    moments: NDArray[np.float64],
    u: int,
    v: int,
    cell: float,
) -> tuple[float, float, float, float, float, float]:
    """Moments of the points around a cell, from its centre: the smallest patch with enough."""
    n = sx = sy = sxx = sxy = syy = 0.0
    for reach in range(WIDEST_PATCH + 1):
        for dv in range(-reach, reach + 1):
            for du in range(-reach, reach + 1):
                if max(abs(du), abs(dv)) < reach:
                    continue
                slot = slot_of(keys, slots, u + du, v + dv)
                if slot < 0:
                    continue
                m, x, y = moments[slot], du * cell, dv * cell
                n += m[0]
                sx += m[1] + m[0] * x
                sy += m[2] + m[0] * y
                sxx += m[3] + 2 * x * m[1] + m[0] * x * x
                sxy += m[4] + x * m[2] + y * m[1] + m[0] * x * y
                syy += m[5] + 2 * y * m[2] + m[0] * y * y
        if reach > 0 and n >= FEWEST:
            break
    return n, sx, sy, sxx, sxy, syy


@njit(cache=True)
def make_surfel(
    moments: tuple[float, float, float, float, float, float],
    centre: tuple[float, float],
    thickness: float,
    surfel: NDArray[np.float64],
) -> int:
    """Fit a line to points: fills `surfel`, returns FRESH, or NONE when they are too few."""
    n, sx, sy, sxx, sxy, syy = moments
    if n < FEWEST:
        return NONE
    x, y = sx / n, sy / n
    cxx, cxy, cyy = sxx / n - x * x, sxy / n - x * y, syy / n - y * y
    half, difference = (cxx + cyy) / 2, (cxx - cyy) / 2
    root = sqrt(difference * difference + cxy * cxy)
    wide, narrow = half + root, max(half - root, 0.0)
    # Information across (the direction of the narrow spread) and along.
    across = 1.0 / (narrow + thickness * thickness)
    along = 1.0 / (wide + thickness * thickness) if narrow > MOST_ROUND * wide else 0.0
    cos2, sin2 = (difference / root, cxy / root) if root > 0 else (0.0, 0.0)
    mean, gap = (along + across) / 2, (along - across) / 2
    surfel[0], surfel[1] = centre[0] + x, centre[1] + y
    surfel[2], surfel[3], surfel[4] = mean + gap * cos2, gap * sin2, mean - gap * cos2
    return FRESH


@njit(cache=True)
def nearest_surfel(table: Table, x: float, y: float, cell: float, thickness: float) -> int:
    """The slot of the surfel whose points are nearest to a point, if any are near.

    -1 where there is none, or no wall can be told from the points.
    """
    keys, slots, moments, surfels, states = table
    u, v = floor(x / cell), floor(y / cell)
    best, nearest = -1, np.inf
    at_u = at_v = 0
    for ring in range(FARTHEST_PARTNER + 1):
        # Nothing farther out can be nearer than what was found.
        if (ring - 1) * cell * (ring - 1) * cell >= nearest:
            break
        for dv in range(-ring, ring + 1):
            stride = 1 if abs(dv) == ring else max(2 * ring, 1)
            for du in range(-ring, ring + 1, stride):
                gap_x = max(0.0, (u + du) * cell - x, x - (u + du + 1) * cell)
                gap_y = max(0.0, (v + dv) * cell - y, y - (v + dv + 1) * cell)
                if gap_x * gap_x + gap_y * gap_y >= nearest:
                    continue
                slot = slot_of(keys, slots, u + du, v + dv)
                if slot < 0:
                    continue
                m = moments[slot]
                off_x = (u + du + 0.5) * cell + m[1] / m[0] - x
                off_y = (v + dv + 0.5) * cell + m[2] / m[0] - y
                square = off_x * off_x + off_y * off_y
                if square < nearest:
                    best, nearest, at_u, at_v = slot, square, u + du, v + dv
    if best >= 0 and states[best] == STALE:
        around = patch(keys, slots, moments, at_u, at_v, cell)
        centre = ((at_u + 0.5) * cell, (at_v + 0.5) * cell)
        states[best] = make_surfel(around, centre, thickness, surfels[best])
    return best if best >= 0 and states[best] == FRESH else -1


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
