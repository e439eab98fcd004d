"""Global localisation: a robot of which nobody knows where it is, in a known map.

One correlative search over every cell and heading of the whole map, without a prior.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.agreement import agreement
from mapcli.algorithms.slam.correlative_search import PoseGrid, best_in_window
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS
from mapcli.algorithms.slam.match import MIN_OVERLAP, MIN_POINTS, Match, MatchParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.scan_points import voxel_filtered
from mapcli.errors import DataError
from mapcli.model.pose import Pose2D

MOST_NODES = 60_000_000
"""Squares times headings that are looked into: some seconds, and 1 GB."""

CERTAIN_SCORE = 0.8
"""The score that tells the right place: somewhere in a map, any scan finds walls for up to three
quarters of its points (scans of one building in the maps of others), where it belongs for 0.86 of
them and more (`benchmarks/RESULTS.md`)."""

SEARCH_CELLS = 4.0
"""Cells between the points that are searched for: walls make themselves known with fewer."""


def localize_globally(
    grid: OccupancyGrid, perception: Perception, parameters: MatchParameters
) -> Match:
    """The best pose of a scan anywhere in a map, by branch and bound, then refined.

    It is not found when the scan has too few points, or fits nowhere.

    Raises:
        DataError: a map too large to be searched.
    """
    cell = grid.parameters.resolution
    points = voxel_filtered(perception.hits, cell)
    if len(points) < MIN_POINTS:
        return Match(Pose2D(), 0.0, 0, found=False)
    middle, poses = _whole_map(grid, math.radians(parameters.step_theta_deg))
    _cover(grid, middle, poses, points)
    searched = voxel_filtered(points, SEARCH_CELLS * cell) / cell
    start = grid.pose_to_cells(middle)
    best = best_in_window(grid, searched, start, poses).cells(start, poses.turn_step)
    fit = grid.surfels.fit(points, grid.pose_from_cells(best))
    score, known_points, _ = agreement(grid, points / cell, grid.pose_to_cells(fit.pose))
    found = score >= CERTAIN_SCORE and known_points >= MIN_OVERLAP * len(points)
    match = Match(fit.pose, score, known_points, found)
    return match if found else replace(match, pose=Pose2D())


def _whole_map(grid: OccupancyGrid, turn_step: float) -> tuple[Pose2D, PoseGrid]:
    """The middle of all that is known, and the poses around it: every cell and heading.

    Raises:
        DataError: a map too large to be searched.
    """
    cell, known = grid.parameters.resolution, np.argwhere(grid.log_odds)
    low, high = known.min(axis=0)[::-1], known.max(axis=0)[::-1] + 1
    middle = grid.pose_from_cells(np.array([*((low + high) / 2), 0.0]))
    reach, turns = int((high - low).max()) // 2 + 1, math.ceil(math.pi / turn_step)
    if (2 * reach / LEVEL_WIDTHS[-1] + 1) ** 2 * (2 * turns + 1) > MOST_NODES:
        raise DataError(
            f"too large to look everywhere: {2 * reach * cell:.0f} m across",
            expected="a start pose, or a map of coarser cells",
        )
    return middle, PoseGrid(reach, turns, 1, turn_step)


def _cover(
    grid: OccupancyGrid, middle: Pose2D, poses: PoseGrid, points: NDArray[np.float64]
) -> None:
    """Make the map hold every pose of the window, and the bounds of the field beyond."""
    cell = grid.parameters.resolution
    slack = poses.reach * cell + float(np.hypot(*points.T).max()) + max(LEVEL_WIDTHS) * cell
    centre = np.array([middle.x, middle.y])
    grid.extend_to(centre - slack, centre + slack)
