"""Finding a robot of which nobody knows where it is: every cell and heading of a known map."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam._kernels import branch_and_bound as kernels
from mapcli.algorithms.slam.agreement import agreement
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS
from mapcli.algorithms.slam.match import Match, MatchParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.scan_points import thinned
from mapcli.errors import DataError
from mapcli.model.pose import Pose2D

MOST_NODES = 60_000_000
"""Squares times headings that are looked into: some seconds, and 1 GB."""

CERTAIN = 0.8
"""The agreement that tells the right place: somewhere in a map, any scan finds walls for up to
three quarters of its points (scans of one building in the maps of others), where it belongs for
0.86 of them and more (`benchmarks/RESULTS.md`)."""

SEARCH_CELLS = 4.0
"""Cells between the points that are searched for: walls make themselves known with fewer."""


def locate(grid: OccupancyGrid, perception: Perception, parameters: MatchParameters) -> Match:
    """The best pose of a scan anywhere in a map, by branch and bound, then refined.

    It is not found when the scan has too few points, or fits nowhere.

    Raises:
        DataError: a map too large to be searched.
    """
    points = thinned(perception.hits, grid.parameters.resolution)
    if len(points) < parameters.fewest:
        return Match(Pose2D(), 0.0, 0, found=False)
    cell, step = grid.parameters.resolution, math.radians(parameters.step_theta_deg)
    known = np.argwhere(grid.log_odds)
    low, high = known.min(axis=0)[::-1], known.max(axis=0)[::-1] + 1
    middle = grid.pose_from_cells(np.array([*((low + high) / 2), 0.0]))
    reach, turns = int((high - low).max()) // 2 + 1, math.ceil(math.pi / step)
    if (2 * reach / LEVEL_WIDTHS[-1] + 1) ** 2 * (2 * turns + 1) > MOST_NODES:
        raise DataError(
            f"too large to look everywhere: {2 * reach * cell:.0f} m across",
            expected="an --initial-pose, or a map of coarser cells",
        )
    slack = reach * cell + float(np.hypot(*points.T).max()) + max(LEVEL_WIDTHS) * cell
    centre = np.array([middle.x, middle.y])
    grid.cover(centre - slack, centre + slack)
    du, dv, turn, _, _ = kernels.search(
        grid.fields, LEVEL_WIDTHS, thinned(points, SEARCH_CELLS * cell) / cell,
        grid.pose_to_cells(middle), (reach, turns), (1, step), (0.0, 1.0, 0.0, 0.0),
        kernels.top_level(reach),
    )  # fmt: skip
    best = grid.pose_to_cells(middle) + np.array([du, dv, turn * step])
    fit = grid.surfels.fit(points, grid.pose_from_cells(best))
    score, known_points, _ = agreement(grid, points / cell, grid.pose_to_cells(fit.pose))
    found = score >= CERTAIN and known_points >= parameters.lost_overlap * len(points)
    match = Match(fit.pose, score, known_points, found)
    return match if found else replace(match, pose=Pose2D())
