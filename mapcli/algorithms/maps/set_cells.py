"""Obstacles added to a grid map and taken away, by hand."""

from __future__ import annotations

import numpy as np

from mapcli.errors import DataError
from mapcli.model.grid import GridMap

Corner = tuple[int, int]


def set_cells(
    grid: GridMap, first: Corner, last: Corner, probability: float
) -> tuple[GridMap, int]:
    """A map in which the cells between two corners, both with them, have this probability (NaN:
    are unknown), and how many of them had another before.

    Raises:
        DataError: a corner outside the map.
    """
    for row, column in (first, last):
        if not grid.contains(row, column):
            raise DataError(
                f"cell {row},{column} is outside the map",
                expected=f"a cell of its {grid.rows} rows and {grid.columns} columns",
            )
    (top, bottom), (left, right) = (sorted(ends) for ends in zip(first, last, strict=True))
    cells = grid.cells.copy()
    box = cells[top : bottom + 1, left : right + 1]
    value = np.float32(probability)
    changed = box.size - int(np.count_nonzero((box == value) | (np.isnan(box) & np.isnan(value))))
    box[...] = value
    return grid.replaced(cells), changed
