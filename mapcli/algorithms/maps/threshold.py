"""From probabilities to a binary map (Sect. 9.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.model.grid import UNKNOWN_PERCENT, GridMap


def binary_map(grid: GridMap, threshold: float) -> GridMap:
    """Known cells become 1 from `threshold` on and 0 below it; unknown cells stay unknown.

    With 0.7 the probabilities of Fig. 9.2 become the object of Fig. 9.1.
    """
    if grid.stored.dtype == np.uint8:
        return grid.replaced(grid.each(lambda cells: _percents(cells, threshold)))
    solid = (grid.cells >= np.float32(threshold)).astype(np.float32)
    return grid.replaced(np.where(grid.known, solid, np.float32(np.nan)))


def _percents(cells: NDArray[np.float32], threshold: float) -> NDArray[np.uint8]:
    solid = np.where(cells >= np.float32(threshold), np.uint8(100), np.uint8(0))
    return np.where(np.isnan(cells), np.uint8(UNKNOWN_PERCENT), solid)
