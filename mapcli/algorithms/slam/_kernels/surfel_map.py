"""Surfels: the points that fell into each cell, and the lines through them.

A surfel map keeps the MOMENTS of the points in each cell: how many, and the sums of x, y, xx, xy,
yy, taken from the cell's centre (Biber and Strasser 2003, the normal distributions transform). A
SURFEL is the line through the points of a cell and its neighbours: their mean, and an information
matrix that is large across the line and zero along it, so that a scan in a corridor says nothing
about how far along the robot is.

A wall has two sides, a thickness apart that is seldom more than a few cells. Points that are seen
from opposite sides are of different surfaces: one line through both would lie inside the wall, and
draw the scans of each side towards those of the other, so that the whole map shrinks. So each cell
keeps from where its points were seen and takes no points from neighbours on the other side, and a
surfel's normal looks along the rays (Rusu 2009), so that it is no correspondence of a point behind.

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
SQUARED_COSINE = 0.5 * 0.5
"""Of 120 degrees: mean rays that are farther apart are to opposite sides of a wall. Those to the
same side are as far apart only where it was seen from far ahead and from far behind alone."""
LEAST_ACROSS = 0.2
"""Of unit rays, on the mean, that must be across a line for it to have a side: less is of a thing
thinner than a cell, which was seen from both."""
NOWHERE = 1e150
"""The mean of no points: farther than everything, even when it is squared."""

COUNT, X, Y, XX, XY, YY, MEAN_X, MEAN_Y, RAY_X, RAY_Y = range(10)
"""Columns of `SurfelTable.moments`: how many points; sums of their coordinates and of products
of these, from the centre of the cell (m, m^2); their mean in the map (m); the sum of unit vectors
to them from where they were seen, 0 if they may be seen from anywhere."""

SURFEL_X, SURFEL_Y, INFORMATION_XX, INFORMATION_XY, INFORMATION_YY, NORMAL_X, NORMAL_Y = range(7)
"""Columns of `SurfelTable.surfels`: the mean in the map (m); the information of a point at the
surfel on where it is, a symmetric 2 x 2 matrix (m^-2); and a vector across the line, away from
where its points were seen, 0 for what is seen from all sides."""

STALE, NONE, FRESH = 0, 1, 2
"""States of a surfel: points came since it was made; there are too few points; as of now."""


class SurfelTable(NamedTuple):
    """A surfel map, as kernels take it; a row of `moments` and of `surfels` is a slot of `grid`.

    Attributes:
        grid: the cells with points in them.
        moments: shape (slots, 10), see `COUNT`; row 0 is no cell, its mean is `NOWHERE`.
        surfels: shape (slots, 7), see `SURFEL_X`; valid where the state is FRESH.
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
    """Of points: how many, the sums of x, y, xx, xy, yy from the centre of a cell, metres, and that
    of the rays to them."""

    n: float
    x: float
    y: float
    xx: float
    xy: float
    yy: float
    ray_x: float
    ray_y: float


@kernel
def add_points(
    table: SurfelTable,
    used: Used,
    points: NDArray[np.float64],
    rays: NDArray[np.float64],
    first: int,
) -> tuple[int, Used]:
    """Add points of the map, shape (n, 2), from the first on, up to one that there is no room for.

    Args:
        rays: shape (n, 2), unit vectors to the points from where they were seen, or 0.

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
        moments[slot, RAY_X] += rays[p, 0]
        moments[slot, RAY_Y] += rays[p, 1]
        moments[slot, MEAN_X] = centre_x + moments[slot, X] / moments[slot, COUNT]
        moments[slot, MEAN_Y] = centre_y + moments[slot, Y] / moments[slot, COUNT]
    return len(points), used


@kernel
def are_opposite(x: float, y: float, other_x: float, other_y: float) -> bool:
    """Whether two vectors are more than 120 degrees apart; not if one of them is 0."""
    product = x * other_x + y * other_y
    if product >= 0.0:
        return False
    squares = (x * x + y * y) * (other_x * other_x + other_y * other_y)
    opposite: bool = product * product > SQUARED_COSINE * squares
    return opposite


@kernel
def neighbourhood(table: SurfelTable, u: int, v: int, ray: tuple[float, float]) -> Moments:
    """Moments of the points around a cell, from its centre, but for those that were seen from the
    side opposite to where a ray comes from: of the smallest square of cells, 3 x 3 at least, that
    has enough."""
    cell, moments = table.cell, table.moments
    n = sx = sy = sxx = sxy = syy = rx = ry = 0.0
    for reach in range(WIDEST_NEIGHBOURHOOD + 1):
        for dv in range(-reach, reach + 1):
            stride = 1 if abs(dv) == reach else 2 * reach
            for du in range(-reach, reach + 1, stride):
                slot = slot_of(table.grid, u + du, v + dv)
                if slot == 0:
                    continue
                if are_opposite(moments[slot, RAY_X], moments[slot, RAY_Y], ray[0], ray[1]):
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
                rx += moments[slot, RAY_X]
                ry += moments[slot, RAY_Y]
        if reach > 0 and n >= FEWEST:
            break
    return Moments(n, sx, sy, sxx, sxy, syy, rx, ry)


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
    # Twice the part of the rays that is across the line: what mirroring in it changes.
    normal_x = points.ray_x - (cos2 * points.ray_x + sin2 * points.ray_y)
    normal_y = points.ray_y - (sin2 * points.ray_x - cos2 * points.ray_y)
    least = 2 * LEAST_ACROSS * n
    is_sided = along == 0.0 and normal_x * normal_x + normal_y * normal_y > least * least
    surfels[slot, NORMAL_X] = normal_x if is_sided else 0.0
    surfels[slot, NORMAL_Y] = normal_y if is_sided else 0.0
    return FRESH


@kernel
def nearest_surfel(table: SurfelTable, x: float, y: float, ray_x: float, ray_y: float) -> int:
    """The slot of the surfel whose points' mean is nearest to a point of the map, to which there
    is a ray.

    0 where none is near, there are too few points to make one, or these were seen from the other
    side.
    """
    best, states, surfels = nearest_cell(table, x, y), table.states, table.surfels
    if best and states[best] == STALE:
        update_surfel(table, best)
    same_side = surfels[best, NORMAL_X] * ray_x + surfels[best, NORMAL_Y] * ray_y >= 0.0
    return best if states[best] == FRESH and same_side else 0


@kernel
def update_surfel(table: SurfelTable, slot: int) -> None:
    """Make the surfel of a cell from the points that are there by now."""
    moments, cell = table.moments, table.cell
    u, v = floor(moments[slot, MEAN_X] / cell), floor(moments[slot, MEAN_Y] / cell)
    centre = ((u + 0.5) * cell, (v + 0.5) * cell)
    around = neighbourhood(table, u, v, (moments[slot, RAY_X], moments[slot, RAY_Y]))
    table.states[slot] = make_surfel(table, slot, around, centre)


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
