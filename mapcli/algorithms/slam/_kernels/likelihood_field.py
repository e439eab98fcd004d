"""Keep the likelihood field around the occupied cells of a map, and its max-pooled pyramid, up to
date (see `slam/likelihood_field.py`).

Grids here are bottom-up: `[v, u]` with u along x and v along y, in cells. Callers see to it that
every occupied cell's surroundings lie inside the arrays.
"""

from __future__ import annotations

from math import floor, sqrt

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel

MAX_LIKELIHOOD = 255
"""The likelihood field's value in an occupied cell."""


@kernel
def update_likelihood_field(
    pyramid: NDArray[np.uint8],
    widths: NDArray[np.int64],
    log_odds: NDArray[np.int16],
    changed: NDArray[np.int64],
    gaussian: NDArray[np.uint8],
) -> None:
    """Bring the likelihood field and its bounds up to date around cells that changed.

    `pyramid[0]` holds, for every cell, the maximum of the Gaussians of the occupied cells around
    it; `pyramid[k][v, u]` bounds `pyramid[0]` over the `widths[k]` x `widths[k]` cells from (v, u)
    up and right. Where an obstacle vanishes the bounds stay: still bounds, only less tight, and
    obstacles vanish seldom.

    Args:
        pyramid: shape (levels, rows, columns), changed in place.
        widths: shape (levels,), the first is 1; levels beyond them are left as they are.
        log_odds: the map, already changed.
        changed: indices of the cells, row * columns + column.
        gaussian: shape (2 r + 1, 2 r + 1), falling from its centre outward.
    """
    columns = log_odds.shape[1]
    for k in range(len(changed)):
        v, u = changed[k] // columns, changed[k] % columns
        if log_odds[v, u] > 0:
            stamp_gaussian(pyramid, widths, v, u, gaussian)
    for k in range(len(changed)):
        v, u = changed[k] // columns, changed[k] % columns
        if log_odds[v, u] <= 0:
            recompute_field(pyramid[0], log_odds, v, u, gaussian)


@kernel
def recompute_field(
    field: NDArray[np.uint8],
    log_odds: NDArray[np.int16],
    v: int,
    u: int,
    gaussian: NDArray[np.uint8],
) -> None:
    """Compute the field around one cell anew, as far as a Gaussian reaches, from the occupied
    cells near it."""
    r = len(gaussian) // 2
    for y in range(v - r, v + r + 1):
        for x in range(u - r, u + r + 1):
            field[y, x] = 0
    for dv in range(-2 * r, 2 * r + 1):
        for du in range(-2 * r, 2 * r + 1):
            if log_odds[v + dv, u + du] <= 0:
                continue
            for y in range(max(dv, 0) - r, min(dv, 0) + r + 1):
                for x in range(max(du, 0) - r, min(du, 0) + r + 1):
                    value = gaussian[y - dv + r, x - du + r]
                    field[v + y, u + x] = max(field[v + y, u + x], value)


@kernel
def stamp_gaussian(
    pyramid: NDArray[np.uint8],
    widths: NDArray[np.int64],
    v: int,
    u: int,
    gaussian: NDArray[np.uint8],
) -> None:
    """Raise the field, and each of its bounds, to at least the Gaussian of one occupied cell; in a
    bound, its peak is as wide as the squares over which that is the maximum."""
    r = len(gaussian) // 2
    for level in range(len(widths)):
        width = widths[level]
        for dv in range(-r - width + 1, r + 1):
            near_v = min(max(dv, 0), dv + width - 1)
            stamp_row(pyramid[level, v + dv], u, width, gaussian[near_v + r])


@kernel
def stamp_row(row: NDArray[np.uint8], u: int, width: int, gaussian: NDArray[np.uint8]) -> None:
    """Raise one row of a level to at least one row of a Gaussian, its peak repeated over `width`
    cells, the last of them at u. (Loops so plain that they compile to many cells at a time.)"""
    r, first = len(gaussian) // 2, u - width + 1
    for k in range(r):
        row[first - r + k] = max(row[first - r + k], gaussian[k])
    for k in range(width):
        row[first + k] = max(row[first + k], gaussian[r])
    for k in range(1, r + 1):
        row[u + k] = max(row[u + k], gaussian[r + k])


MIN_GAP = 1.5
"""Cells between two beams' ends, below which there is no cell between them."""
MAX_GAP = 12.0
"""Cells between two beams' ends that may lie on one wall."""
STRAIGHT_COSINE = 0.97
"""Cosine of the largest turn that a wall makes from one beam's end to the next."""


@kernel
def interpolate_gaps(
    pyramid: NDArray[np.uint8],
    widths: NDArray[np.int64],
    log_odds: NDArray[np.int16],
    ends: NDArray[np.float64],
    gaussian: NDArray[np.uint8],
) -> None:
    """Raise the field along the gaps between neighbouring ends of beams on a straight wall.

    Far walls are hit here and there only. In a field of isolated points a scan fits best where its
    own points fall on those of the scan before, that is where the robot has not moved. Only unknown
    cells are raised, and a beam that passes through one undoes it (see `ray_tracing`).

    Args:
        pyramid, widths, log_odds, gaussian: see `update_likelihood_field`.
        ends: shape (n, 2), the (u, v) of hits, in the order of the beams.
    """
    n = len(ends)
    for k in range(n - 1):
        du, dv = ends[k + 1, 0] - ends[k, 0], ends[k + 1, 1] - ends[k, 1]
        gap = sqrt(du * du + dv * dv)
        if gap < MIN_GAP or gap > MAX_GAP:
            continue
        if not (is_collinear(ends, k - 1, du, dv, gap) or is_collinear(ends, k + 1, du, dv, gap)):
            continue
        steps = floor(gap)
        for i in range(1, steps + 1):
            share = i / (steps + 1)
            u, v = floor(ends[k, 0] + share * du), floor(ends[k, 1] + share * dv)
            if log_odds[v, u] == 0 and pyramid[0, v, u] < MAX_LIKELIHOOD:
                stamp_gaussian(pyramid, widths, v, u, gaussian)


@kernel
def is_collinear(ends: NDArray[np.float64], k: int, du: float, dv: float, gap: float) -> bool:
    """Whether the line from end k to the next has the direction of (du, dv), and is half to twice
    as long as that, which is `gap`."""
    if k < 0 or k + 1 >= len(ends):
        return False
    on_u, on_v = ends[k + 1, 0] - ends[k, 0], ends[k + 1, 1] - ends[k, 1]
    on = sqrt(on_u * on_u + on_v * on_v)
    alike = on <= 2 * gap and gap <= 2 * on
    return alike and on_u * du + on_v * dv >= STRAIGHT_COSINE * on * gap
