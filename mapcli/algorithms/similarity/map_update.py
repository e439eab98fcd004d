"""Line 10 of Algorithm 9.2, m <- update(m, p, n), for maps of the kind of Sect. 9.5 (Fig. 9.22)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.perception_map import LARGEST, PerceptionMap
from mapcli.errors import DataError
from mapcli.model.grid import UNKNOWN, GridMap
from mapcli.model.pose import Pose2D


def update_map(grid: GridMap, perceived: PerceptionMap, low: float) -> GridMap:
    """The map with a perception written into it.

    Cells that the perception knows become 0 or 1; where the map says the same already, its
    probability stays. Where the perception reaches beyond the map, the map grows (Sect. 9.7).

    Raises:
        DataError: it would grow absurdly large.
    """
    row, column = np.nonzero(perceived.values)
    if not len(row):
        return grid
    values = perceived.values[row, column]
    row, column = row + perceived.bottom, column + perceived.left
    bottom, left = min(0, int(row.min())), min(0, int(column.min()))
    top = max(grid.rows, int(row.max()) + 1)
    right = max(grid.columns, int(column.max()) + 1)
    if (top - bottom) * (right - left) > LARGEST + grid.cells.size:
        raise DataError(
            f"the map would grow to {top - bottom:,} rows of {right - left:,} cells",
            expected="a perception in the unit of the map",
        )
    cells = np.full((top - bottom, right - left), UNKNOWN, np.float32)
    cells[-bottom : grid.rows - bottom, -left : grid.columns - left] = grid.bottom_up()
    place = row - bottom, column - left
    before = cells[place]
    agrees = np.where(values < 0, before < np.float32(low), before >= np.float32(low))
    cells[place] = np.where(agrees, before, (values > 0).astype(np.float32))
    corner = Pose2D(left * grid.resolution, bottom * grid.resolution)
    moved = grid.origin.compose(corner) if (left, bottom) != (0, 0) else grid.origin
    return GridMap(cells[::-1], grid.resolution, moved)


BOOK_SIDE = 64
"""Maps up to this many rows and columns are shown as a whole."""


def crop_to_perception(
    signs: NDArray[np.int8], perceived: PerceptionMap
) -> tuple[NDArray[np.int8], NDArray[np.int8], tuple[int, int]]:
    """The same cells of map and perception, top row first, and their column and row (from below).

    A small map is shown whole, of a large one the part that the perception knows.
    """
    row, column = np.nonzero(perceived.values)
    row, column = row + perceived.bottom, column + perceived.left
    if max(signs.shape) <= BOOK_SIDE or not len(row):
        row, column = (
            np.append(row, [0, signs.shape[0] - 1]),
            np.append(column, [0, signs.shape[1] - 1]),
        )
    bottom, left = int(row.min()), int(column.min())
    shape = int(row.max()) + 1 - bottom, int(column.max()) + 1 - left
    parts = (
        _part(signs, (0, 0), (bottom, left), shape),
        _part(perceived.values, (perceived.bottom, perceived.left), (bottom, left), shape),
    )
    return parts[0][::-1], parts[1][::-1], (left, bottom)


def _part(
    values: NDArray[np.int8], at: tuple[int, int], corner: tuple[int, int], shape: tuple[int, int]
) -> NDArray[np.int8]:
    """Cells of a matrix that lies at `at`, from `corner` on; 0 outside."""
    part = np.zeros(shape, np.int8)
    (a, b), (rows, columns) = (at[0] - corner[0], at[1] - corner[1]), values.shape
    v0, v1 = max(a, 0), min(a + rows, shape[0])
    u0, u1 = max(b, 0), min(b + columns, shape[1])
    if v1 > v0 and u1 > u0:
        part[v0:v1, u0:u1] = values[v0 - a : v1 - a, u0 - b : u1 - b]
    return part
