"""Walls finer than cells: the points that fell into each cell, and the lines through them.

A map of surfels is a hash table from cells to MOMENTS of the points in them: how many, and the
sums of x, y, xx, xy, yy, taken from the cell's centre. A SURFEL is the line through the points of
a cell and its neighbours: a mean and an information matrix that is large across the wall, and
zero along it, so that a scan in a corridor says nothing about how far along the robot is.

Lengths are in metres.
"""

from __future__ import annotations

from math import floor, sqrt

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms._kernels.compiling import kernel

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


@kernel
def find(keys: NDArray[np.int64], u: int, v: int) -> int:
    """Where a cell is in the hash table, or where it would go."""
    key = ((u + BIAS) << 31) | (v + BIAS)
    mask = len(keys) - 1
    at = ((key * 0x9E3779B97F4A7C1) >> 20) & mask
    while keys[at] != EMPTY and keys[at] != key:
        at = (at + 1) & mask
    return at


@kernel
def slot_of(keys: NDArray[np.int64], slots: NDArray[np.int64], u: int, v: int) -> int:
    """The slot of a cell, or -1."""
    at = find(keys, u, v)
    return slots[at] if keys[at] != EMPTY else -1


@kernel
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
        slot = slots[at]
        moments[slot, 0] += 1.0
        moments[slot, 1] += x
        moments[slot, 2] += y
        moments[slot, 3] += x * x
        moments[slot, 4] += x * y
        moments[slot, 5] += y * y
    return used


@kernel
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


@kernel
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
                x, y = du * cell, dv * cell
                m, mx, my = moments[slot, 0], moments[slot, 1], moments[slot, 2]
                n += m
                sx += mx + m * x
                sy += my + m * y
                sxx += moments[slot, 3] + 2 * x * mx + m * x * x
                sxy += moments[slot, 4] + x * my + y * mx + m * x * y
                syy += moments[slot, 5] + 2 * y * my + m * y * y
        if reach > 0 and n >= FEWEST:
            break
    return n, sx, sy, sxx, sxy, syy


@kernel
def make_surfel(
    moments: tuple[float, float, float, float, float, float],
    centre: tuple[float, float],
    thickness: float,
    surfels: NDArray[np.float64],
    at: int,
) -> int:
    """Fit a line to points: fills surfel `at`, returns FRESH, or NONE when they are too few."""
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
    surfels[at, 0], surfels[at, 1] = centre[0] + x, centre[1] + y
    surfels[at, 2], surfels[at, 3] = mean + gap * cos2, gap * sin2
    surfels[at, 4] = mean - gap * cos2
    return FRESH


@kernel
def nearest_surfel(table: Table, x: float, y: float, cell: float, thickness: float) -> int:
    """The slot of the surfel whose points are nearest to a point, if any are near.

    -1 where there is none, or no wall can be told from the points.
    """
    best, u, v = nearest_cell(table, x, y, cell)
    if best < 0:
        return best
    keys, slots, moments, surfels, states = table
    if states[best] == STALE:
        around = patch(keys, slots, moments, u, v, cell)
        centre = ((u + 0.5) * cell, (v + 0.5) * cell)
        states[best] = make_surfel(around, centre, thickness, surfels, best)
    return best if states[best] == FRESH else -1


@kernel
def nearest_cell(table: Table, x: float, y: float, cell: float) -> tuple[int, int, int]:
    """The slot of the cell whose points' mean is nearest to a point, -1 where none are near, and
    the cell."""
    keys, slots, moments, _, _ = table
    u, v = floor(x / cell), floor(y / cell)
    best, at_u, at_v, nearest = -1, u, v, np.inf
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
                m = moments[slot, 0]
                off_x = (u + du + 0.5) * cell + moments[slot, 1] / m - x
                off_y = (v + dv + 0.5) * cell + moments[slot, 2] / m - y
                square = off_x * off_x + off_y * off_y
                if square < nearest:
                    best, nearest, at_u, at_v = slot, square, u + du, v + dv
    return best, at_u, at_v
