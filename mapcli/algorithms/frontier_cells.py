"""The frontier of a map as it is: open cells that touch an unknown cell (Sect. 9.3.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.model.grid import GridMap


def frontier_cells(grid: GridMap, low: float = 0.5) -> NDArray[np.bool_]:
    """Where the frontier is, shape (rows, columns).

    A frontier cell is known, has a probability below `low`, and is left, right, above or below
    of an unknown cell. The edge of the map is no frontier.
    """
    unknown = np.pad(~grid.known, 1, constant_values=False)
    touches = unknown[:-2, 1:-1] | unknown[2:, 1:-1] | unknown[1:-1, :-2] | unknown[1:-1, 2:]
    frontier: NDArray[np.bool_] = (grid.cells < np.float32(low)) & touches
    return frontier
