"""Correlative scan matching: the pose in a window at which points fit a map best (Olson 2009).

Every position and heading of the window is compared with the likelihood field, by branch and bound:
scans (`scan_matcher`), submaps (`submap_matcher`) and a robot that may be anywhere
(`global_localization`) are all found with it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels import branch_and_bound as kernels
from mapcli.algorithms.slam._kernels.branch_and_bound import NOTHING_YET as NOTHING_YET
from mapcli.algorithms.slam._kernels.branch_and_bound import BestPose as BestPose
from mapcli.algorithms.slam._kernels.window_scores import PoseGrid as PoseGrid
from mapcli.algorithms.slam._kernels.window_scores import Prior as Prior
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.model.se2_uncertainty import StandardDeviations

HALF_AT = 9.0
"""Squared standard deviations, three of them, that cost half of what the prior costs at most."""

NO_PRIOR = Prior(0.0, 1.0, 0.0, 0.0)
"""Every pose of the window is as likely."""


class SearchWindow(NamedTuple):
    """Half-widths of a window around a predicted pose: metres in x and y, radians."""

    xy: float
    theta: float

    def poses(self, cell: float, turn_step: float, stride: int = 1) -> PoseGrid:
        """The poses in it, every `stride` cells, at headings so many radians apart."""
        reach, turns = math.ceil(self.xy / cell), math.ceil(self.theta / turn_step)
        return PoseGrid(reach, turns, stride, turn_step)

    def deviations(self, sigmas: float) -> StandardDeviations:
        """Of a pose that is searched so many of them to either side."""
        return StandardDeviations(self.xy / sigmas, self.theta / sigmas)


def prediction_prior(
    most: float, deviations: StandardDeviations, cell: float, turn_step: float
) -> Prior:
    """The prior of a predicted pose; its cost levels off, so that a prediction that is plainly
    wrong costs no more than `most`, in units of the likelihood field.

    Args:
        deviations: of the predicted pose; cell: metres; turn_step: radians.
    """
    per_cell, per_turn = (cell / deviations.xy) ** 2, (turn_step / deviations.theta) ** 2
    return Prior(most, HALF_AT, per_cell, per_turn)


def best_in_window(
    grid: OccupancyGrid,
    points: NDArray[np.float64],
    middle: NDArray[np.float64],
    poses: PoseGrid,
    prior: Prior = NO_PRIOR,
    known: BestPose | None = None,
) -> BestPose:
    """The pose whose points have the largest sum of the likelihood field, less the prior.

    Args:
        grid: the map; it holds the points at all poses and `LEVEL_WIDTHS[-1]` cells more.
        points: shape (n, 2), in the robot's frame, in cells.
        middle: (u, v, theta) of the window's middle, in cells of the map and radians; poses: of
            the window, relative to it.
        known: what this returned for a smaller window within this one, which saves time.
    """
    levels, _, columns = grid.pyramid.shape
    top = 2 if poses.reach < 8 else 3  # larger nodes pay in larger windows only
    pyramid = kernels.Pyramid(grid.pyramid.reshape(levels, -1), LEVEL_WIDTHS, columns, top)
    return kernels.search(pyramid, points, middle, poses, prior, known)
