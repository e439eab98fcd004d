"""Surfels: the points that fell into each cell, and the lines through them.

A surfel map keeps the MOMENTS of the points in each cell: how many, and the sums of x, y, xx, xy,
yy, taken from the cell's centre (Biber and Strasser 2003, the normal distributions transform). A
SURFEL is the line through the points of a cell and its neighbours: their mean, and an information
matrix that is large across the line and zero along it, so that a scan in a corridor says nothing
about how far along the robot is.

Points and means are (x, y) in metres, in the map's frame.
"""

from __future__ import annotations

from math import floor, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.sparse_grid import SparseGrid, Used, enter, is_within, slot_of

MOST_ROUND = 0.15
"""Ratio of the smaller to the larger variance of points above which they are no line but a blob,
which constrains a scan in both directions, if weakly."""
FARTHEST_CORRESPONDENCE = 3
"""Cells from a point to the surfel that it may belong to."""
WIDEST_NEIGHBOURHOOD = 5
"""Cells around a cell that may lend it their points when it has few."""
FEWEST = 4
"""Points that make a surfel."""
NOWHERE = 1e150
"""The mean of no points: farther than everything, even when it is squared."""

COUNT, X, Y, XX, XY, YY, MEAN_X, MEAN_Y = range(8)
"""Columns of `SurfelTable.moments`: how many points; sums of their coordinates and of products
of these, from the centre of the cell (m, m^2); their mean in the map (m)."""

SURFEL_X, SURFEL_Y, INFORMATION_XX, INFORMATION_XY, INFORMATION_YY = range(5)
"""Columns of `SurfelTable.surfels`: the mean in the map (m), and the information of a point at
the surfel on where it is, a symmetric 2 x 2 matrix (m^-2)."""

STALE, NONE, FRESH = 0, 1, 2
"""States of a surfel: points came since it was made; there are too few points; as of now."""


class SurfelTable(NamedTuple):
    """A surfel map, as kernels take it; a row of `moments` and of `surfels` is a slot of `grid`.

    Attributes:
        grid: the cells with points in them.
        moments: shape (slots, 8), see `COUNT`; row 0 is no cell, its mean is `NOWHERE`.
        surfels: shape (slots, 5), see `SURFEL_X`; valid where the state is FRESH.
        states: shape (slots,), int8.
        cell: metres along a side of a cell.
        thickness: metres; how well a point tells where a line is, at best.
    """

    grid: SparseGrid
    moments: NDArray[np.float64]
    surfels: NDArray[np.float64]
    states: NDArray[np.int8]
    cell: float
    thickness: float


class Moments(NamedTuple):
    """Of points: how many, and the sums of x, y, xx, xy, yy from the centre of a cell, metres."""

    n: float
    x: float
    y: float
    xx: float
    xy: float
    yy: float


@kernel
def add_points(
    table: SurfelTable, used: Used, points: NDArray[np.float64], first: int
) -> tuple[int, Used]:
    """Add points of the map, shape (n, 2), from the first on, up to one that there is no room for.

    Returns:
        The number of that one, or of all; and how many tiles and slots are used.
    """
    cell, moments = table.cell, table.moments
    for p in range(first, len(points)):
        u, v = floor(points[p, 0] / cell), floor(points[p, 1] / cell)
        slot, used = enter(table.grid, used, len(moments), u, v)
        if slot == 0:
            return p, used
        centre_x, centre_y = (u + 0.5) * cell, (v + 0.5) * cell
        x, y = points[p, 0] - centre_x, points[p, 1] - centre_y
        moments[slot, COUNT] += 1.0
        moments[slot, X] += x
        moments[slot, Y] += y
        moments[slot, XX] += x * x
        moments[slot, XY] += x * y
        moments[slot, YY] += y * y
        moments[slot, MEAN_X] = centre_x + moments[slot, X] / moments[slot, COUNT]
        moments[slot, MEAN_Y] = centre_y + moments[slot, Y] / moments[slot, COUNT]
    return len(points), used


@kernel
def neighbourhood(table: SurfelTable, u: int, v: int) -> Moments:
    """Moments of the points around a cell, from its centre: of the smallest square of cells, 3 x 3
    at least, that has enough."""
    cell, moments = table.cell, table.moments
    n = sx = sy = sxx = sxy = syy = 0.0
    for reach in range(WIDEST_NEIGHBOURHOOD + 1):
        for dv in range(-reach, reach + 1):
            stride = 1 if abs(dv) == reach else 2 * reach
            for du in range(-reach, reach + 1, stride):
                slot = slot_of(table.grid, u + du, v + dv)
                if slot == 0:
                    continue
                # Sums from the neighbour's centre, moved to this cell's.
                x, y = du * cell, dv * cell
                m, mx, my = moments[slot, COUNT], moments[slot, X], moments[slot, Y]
                n += m
                sx += mx + m * x
                sy += my + m * y
                sxx += moments[slot, XX] + 2 * x * mx + m * x * x
                sxy += moments[slot, XY] + x * my + y * mx + m * x * y
                syy += moments[slot, YY] + 2 * y * my + m * y * y
        if reach > 0 and n >= FEWEST:
            break
    return Moments(n, sx, sy, sxx, sxy, syy)


@kernel
def make_surfel(table: SurfelTable, slot: int, points: Moments, centre: tuple[float, float]) -> int:
    """Fit a line to points by the eigenvalues of their covariance: fills the surfel of a slot.

    Args:
        points: from `centre`, (x, y) in the map.

    Returns:
        The surfel's state: FRESH, or NONE when there are too few points.
    """
    n = points.n
    if n < FEWEST:
        return NONE
    x, y = points.x / n, points.y / n
    cxx, cxy, cyy = points.xx / n - x * x, points.xy / n - x * y, points.yy / n - y * y
    # The eigenvalues: the variance along the line, and that across it.
    half, difference = (cxx + cyy) / 2, (cxx - cyy) / 2
    root = sqrt(difference * difference + cxy * cxy)
    wide, narrow = half + root, max(half - root, 0.0)
    thickness, surfels = table.thickness, table.surfels
    across = 1.0 / (narrow + thickness * thickness)
    along = 1.0 / (wide + thickness * thickness) if narrow > MOST_ROUND * wide else 0.0
    # Cosine and sine of twice the line's direction.
    cos2, sin2 = (difference / root, cxy / root) if root > 0 else (0.0, 0.0)
    mean, gap = (along + across) / 2, (along - across) / 2
    surfels[slot, SURFEL_X], surfels[slot, SURFEL_Y] = centre[0] + x, centre[1] + y
    surfels[slot, INFORMATION_XX], surfels[slot, INFORMATION_XY] = mean + gap * cos2, gap * sin2
    surfels[slot, INFORMATION_YY] = mean - gap * cos2
    return FRESH


@kernel
def nearest_surfel(table: SurfelTable, x: float, y: float) -> int:
    """The slot of the surfel whose points' mean is nearest to a point of the map, if any is near.

    0 where there is none, or too few points to make one.
    """
    best, states = nearest_cell(table, x, y), table.states
    if best and states[best] == STALE:
        update_surfel(table, best)
    return best if states[best] == FRESH else 0


@kernel
def update_surfel(table: SurfelTable, slot: int) -> None:
    """Make the surfel of a cell from the points that are there by now."""
    moments, cell = table.moments, table.cell
    u, v = floor(moments[slot, MEAN_X] / cell), floor(moments[slot, MEAN_Y] / cell)
    centre = ((u + 0.5) * cell, (v + 0.5) * cell)
    table.states[slot] = make_surfel(table, slot, neighbourhood(table, u, v), centre)


@kernel
def update_all(table: SurfelTable, used: int) -> None:
    """Make the surfels of all cells in use, so that fitting only reads (from many threads)."""
    for slot in range(1, used):
        if table.states[slot] == STALE:
            update_surfel(table, slot)


@kernel
def nearest_cell(table: SurfelTable, x: float, y: float) -> int:
    """The slot of the cell whose points' mean is nearest to a point, 0 where none are near. (It
    does not branch on what it compares, since no processor could tell beforehand.)"""
    cell, moments = table.cell, table.moments
    u, v = floor(x / cell), floor(y / cell)
    best, nearest = 0, NOWHERE
    if not is_within(table.grid, u, v, 1):
        return best
    for ring in range(FARTHEST_CORRESPONDENCE + 1):
        # Nothing farther out can be nearer than what was found.
        if (ring - 1) * cell * (ring - 1) * cell >= nearest:
            break
        for dv in range(-ring, ring + 1):
            stride = 1 if abs(dv) == ring else 2 * ring
            for du in range(-ring, ring + 1, stride):
                slot = slot_of(table.grid, u + du, v + dv)
                square = (moments[slot, MEAN_X] - x) ** 2 + (moments[slot, MEAN_Y] - y) ** 2
                best = slot if square < nearest else best
                nearest = min(nearest, square)
    return best
