"""m <- update(m, p, n): the best perception written into the map (Fig. 9.22).

This is line 10 of the discrete Algorithm 9.2, Sect. 9.5 to 9.7, as `mapcli similarity-table
--update` runs it. `slam` never comes here: there line 10 is `OccupancyGrid.integrate`, which adds
log-odds.
"""

from __future__ import annotations

import numpy as np

from mapcli.algorithms.similarity.perception_map import MAX_CELLS, PerceptionMap
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
    if (top - bottom) * (right - left) > MAX_CELLS + grid.cells.size:
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
