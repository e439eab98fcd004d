"""Walls finer than cells: the points that fell into each cell, and the lines through them.

A map of surfels keeps the MOMENTS of the points in each cell: how many, and the sums of x, y, xx,
xy, yy, taken from the cell's centre. A SURFEL is the line through the points of a cell and its
neighbours: a mean and an information matrix that is large across the wall, and zero along it, so
that a scan in a corridor says nothing about how far along the robot is.

Lengths are in metres.
"""

from __future__ import annotations

from math import floor, sqrt

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.sparse_grid import (
    Corner,
    Directory,
    Tiles,
    enter,
    is_within,
    slot_of,
)

MOST_ROUND = 0.15
"""Points whose narrow spread is more than this share of their wide one are no line but a lump,
which holds a scan in both directions, if weakly."""
FARTHEST_PARTNER = 3
"""Cells from a point to the wall that it may belong to."""
WIDEST_PATCH = 5
"""Cells around a cell that may lend it their points when it has few."""
FEWEST = 4
"""Points that make a surfel."""
NOWHERE = 1e150
"""The mean of no points: farther than everything, even when it is squared."""

Table = tuple[
    Directory,  # of the cells with points in them; see `tiles`
    Corner,
    Tiles,
    NDArray[np.float64],  # points of each slot, shape (slots, 8): moments, and the mean x, y
    NDArray[np.float64],  # surfels, shape (slots, 5): mean x, y; information xx, xy, yy
    NDArray[np.int8],  # what is known about each surfel: STALE, NONE or FRESH
]
STALE, NONE, FRESH = 0, 1, 2


@kernel
def add_points(
    table: Table,
    used: tuple[int, int],
    points: NDArray[np.float64],
    first: int,
    cell: float,
) -> tuple[int, tuple[int, int]]:
    """Add world points, shape (n, 2), from the first on, up to one that there is no room for.

    Returns:
        The number of that one, or of all; and how many tiles and slots are used.
    """
    directory, corner, tiles, sums, _, _ = table
    for p in range(first, len(points)):
        u, v = floor(points[p, 0] / cell), floor(points[p, 1] / cell)
        slot, used = enter(directory, corner, tiles, used, len(sums), u, v)
        if slot == 0:
            return p, used
        centre_x, centre_y = (u + 0.5) * cell, (v + 0.5) * cell
        x, y = points[p, 0] - centre_x, points[p, 1] - centre_y
        sums[slot, 0] += 1.0
        sums[slot, 1] += x
        sums[slot, 2] += y
        sums[slot, 3] += x * x
        sums[slot, 4] += x * y
        sums[slot, 5] += y * y
        sums[slot, 6] = centre_x + sums[slot, 1] / sums[slot, 0]
        sums[slot, 7] = centre_y + sums[slot, 2] / sums[slot, 0]
    return len(points), used


@kernel
def patch(
    table: Table, u: int, v: int, cell: float
) -> tuple[float, float, float, float, float, float]:
    """Moments of the points around a cell, from its centre: the smallest patch with enough."""
    directory, corner, tiles, sums, _, _ = table
    n = sx = sy = sxx = sxy = syy = 0.0
    for reach in range(WIDEST_PATCH + 1):
        for dv in range(-reach, reach + 1):
            stride = 1 if abs(dv) == reach else 2 * reach
            for du in range(-reach, reach + 1, stride):
                slot = slot_of(directory, corner, tiles, u + du, v + dv)
                if slot == 0:
                    continue
                x, y = du * cell, dv * cell
                m, mx, my = sums[slot, 0], sums[slot, 1], sums[slot, 2]
                n += m
                sx += mx + m * x
                sy += my + m * y
                sxx += sums[slot, 3] + 2 * x * mx + m * x * x
                sxy += sums[slot, 4] + x * my + y * mx + m * x * y
                syy += sums[slot, 5] + 2 * y * my + m * y * y
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

    0 where there is none, or no wall can be told from the points.
    """
    best, states = nearest_cell(table, x, y, cell), table[5]
    if best and states[best] == STALE:
        renew(table, best, cell, thickness)
    return best if states[best] == FRESH else 0


@kernel
def renew(table: Table, slot: int, cell: float, thickness: float) -> None:
    """Make the surfel of a cell from the points that are there by now."""
    sums, surfels, states = table[3], table[4], table[5]
    u, v = floor(sums[slot, 6] / cell), floor(sums[slot, 7] / cell)
    centre = ((u + 0.5) * cell, (v + 0.5) * cell)
    states[slot] = make_surfel(patch(table, u, v, cell), centre, thickness, surfels, slot)


@kernel
def renew_all(table: Table, used: int, cell: float, thickness: float) -> None:
    """Make the surfels of all cells in use, so that fitting only reads."""
    for slot in range(1, used):
        if table[5][slot] == STALE:
            renew(table, slot, cell, thickness)


@kernel
def nearest_cell(table: Table, x: float, y: float, cell: float) -> int:
    """The slot of the cell whose points' mean is nearest to a point, 0 where none are near. (It
    does not branch on what it compares, since no processor could tell beforehand.)"""
    directory, corner, tiles, sums, _, _ = table
    u, v = floor(x / cell), floor(y / cell)
    best, nearest = 0, NOWHERE
    if not is_within(directory, corner, u, v, 1):
        return best
    for ring in range(FARTHEST_PARTNER + 1):
        # Nothing farther out can be nearer than what was found.
        if (ring - 1) * cell * (ring - 1) * cell >= nearest:
            break
        for dv in range(-ring, ring + 1):
            stride = 1 if abs(dv) == ring else 2 * ring
            for du in range(-ring, ring + 1, stride):
                slot = slot_of(directory, corner, tiles, u + du, v + dv)
                square = (sums[slot, 6] - x) ** 2 + (sums[slot, 7] - y) ** 2
                best = slot if square < nearest else best
                nearest = min(nearest, square)
    return best
