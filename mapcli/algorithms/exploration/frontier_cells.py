"""The frontier of a map as it is: open cells that touch an unknown cell (Sect. 9.3.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap


def frontier_cells(grid: GridMap, low: float = OCCUPIED_THRESHOLD) -> NDArray[np.bool_]:
    """Where the frontier is, shape (rows, columns).

    A frontier cell is known, has a probability below `low`, and is left, right, above or below
    of an unknown cell. The edge of the map is no frontier.
    """
    unknown = grid.each(np.isnan)
    frontier = np.zeros(unknown.shape, dtype=np.bool_)
    frontier[1:] |= unknown[:-1]
    frontier[:-1] |= unknown[1:]
    frontier[:, 1:] |= unknown[:, :-1]
    frontier[:, :-1] |= unknown[:, 1:]
    frontier &= grid.each(lambda cells: cells < np.float32(low))
    return frontier
