"""The part of a map that a robot has really seen, without glimpses.

Single beams through doors, windows and glass reach as far again as the building; what they tell is
a ray here and there and the point where it ends.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.model.grid import GridMap

SEEN_SQUARE_M = 0.5
"""Of squares this wide, metres, a robot has seen at least half where it looked, and not merely
through a gap."""

MARGIN = 2
"""Unknown cells around what was seen."""


def seen_part(grid: GridMap, path: NDArray[np.float64]) -> GridMap:
    """The smallest part of a map that holds what was really seen and the robot's path, as far as it
    is in the map; all of it if nothing is known.

    Args:
        path: shape (n, 2), metres in the map's frame.
    """
    if not grid.known.any():
        return grid
    limits = np.array([grid.rows, grid.columns]) - 1
    cells = np.floor(grid.fractional_cells_of_world(path) + 0.5).astype(int)
    inside = cells[((cells >= 0) & (cells <= limits)).all(axis=1)]
    seen = np.column_stack(seen_edges(grid.known, grid.resolution))
    corners = np.concatenate([seen, inside])
    top, left = np.maximum(corners.min(axis=0) - MARGIN, 0)
    bottom, right = np.minimum(corners.max(axis=0) + MARGIN, limits) + 1
    return grid.part(int(top), int(left), int(bottom), int(right))


def seen_edges(
    known: NDArray[np.bool_], resolution: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last row, and column, of the squares of which half is known, where there are any;
    else of what is known. The squares overlap by half.

    Args:
        known: shape (rows, columns), of which some are.
    """
    half = max(round(SEEN_SQUARE_M / 2 / resolution), 1)
    counts = np.min_scalar_type(4 * half * half)  # of coarse maps there are as many as cells
    strips = np.add.reduceat(known, range(0, len(known), half), axis=0, dtype=counts)
    blocks = np.add.reduceat(strips, range(0, known.shape[1], half), axis=1, dtype=counts)
    blocks = np.pad(blocks, ((0, 1), (0, 1)))
    squares = blocks[:-1, :-1] + blocks[1:, :-1] + blocks[:-1, 1:] + blocks[1:, 1:]
    seen = squares >= 2 * half * half
    if not seen.any():
        seen = squares > 0
    edges = []
    for axis in (1, 0):
        first, *_, last = np.flatnonzero(seen.any(axis=axis)).repeat(2)
        there = np.flatnonzero(known.any(axis=axis))
        inside = there[(there >= first * half) & (there < (last + 2) * half)]
        edges.append(inside[[0, -1]])
    return edges[0], edges[1]
