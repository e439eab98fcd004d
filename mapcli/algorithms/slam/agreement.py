"""How well the points of a scan or submap agree with a map at a pose: the score of a match."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels.agreement import FULL_SCORE as FULL_SCORE
from mapcli.algorithms.slam._kernels.agreement import Agreement as Agreement
from mapcli.algorithms.slam._kernels.agreement import count_agreement
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid


def agreement(
    grid: OccupancyGrid, points: NDArray[np.float64], pose: NDArray[np.float64]
) -> Agreement:
    """Score, known points and free-space conflicts of points at a pose, without a search.

    Args:
        grid: the map, large enough to hold every point (`OccupancyGrid.extend_to`).
        points: shape (n, 2), in the robot's frame, in cells.
        pose: (u, v, theta) of the robot in the map, in cells and radians (`pose_to_cells`).
    """
    return count_agreement(grid.log_odds, grid.pyramid[0], points, pose)
