"""From probabilities to a binary map (Sect. 9.2)."""

from __future__ import annotations

import numpy as np

from mapcli.model.grid import GridMap


def binary_map(grid: GridMap, threshold: float) -> GridMap:
    """Known cells become 1 from `threshold` on and 0 below it; unknown cells stay unknown.

    With 0.7 the probabilities of Fig. 9.2 become the object of Fig. 9.1.
    """
    solid = (grid.cells >= np.float32(threshold)).astype(np.float32)
    return grid.replaced(np.where(grid.known, solid, np.float32(np.nan)))
