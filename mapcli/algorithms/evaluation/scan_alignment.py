"""Scan-to-scan matching, with nothing of the map between, that says when it is not certain."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.evaluation.self_check_parameters import SelfCheckParameters
from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.agreement import agreement
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.match import MIN_POINTS, MatchParameters
from mapcli.algorithms.slam.motion_model import OdometryUncertainty
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.scan_matcher import match_scan
from mapcli.algorithms.slam.scan_points import voxel_filtered
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import StandardDeviations

MAP = MapParameters(blur=0.1)
"""The map of one scan is thin; a wider likelihood field lets the refinement find its walls."""


def align_scans(
    base: Perception, scan: Perception, guess: Pose2D, p: SelfCheckParameters
) -> Pose2D | None:
    """Scan-to-scan matching: the pose of `scan` in the frame of `base`; None if uncertain."""
    points = voxel_filtered(scan.hits, MAP.resolution)
    if len(points) < MIN_POINTS or len(base.hits) < MIN_POINTS:
        return None
    grid = OccupancyGrid(MAP)
    grid.integrate(Pose2D(), replace(base, hits=densified(base.hits, MAP.resolution), readings=()))
    # No prior: the guess is only the centre of the search window.
    search = MatchParameters(
        window_xy=p.window_m, window_theta_deg=p.window_deg, odometry_prior=0.0, relocalise=False
    )
    match = match_scan(
        grid,
        scan,
        guess,
        OdometryUncertainty(StandardDeviations(1.0, 1.0), 0.0, window_sigmas=0.0),
        search,
    )
    enough = match.known_points >= p.shared * len(points) and match.score >= p.agreement
    inside = guess.distance(match.pose) < p.window_m
    if not (match.found and enough and inside and _is_constrained(grid, points, match.pose, p)):
        return None
    return match.pose


def _is_constrained(
    grid: OccupancyGrid, points: NDArray[np.float64], pose: Pose2D, p: SelfCheckParameters
) -> bool:
    """Whether the agreement falls in every direction in which the scan is shifted."""
    cell, start = grid.parameters.resolution, grid.pose_to_cells(pose)
    best = agreement(grid, points / cell, start).score
    for direction in np.arange(8) * (math.tau / 8):
        shift = np.array([math.cos(direction), math.sin(direction), 0.0]) * (p.slide_m / cell)
        if agreement(grid, points / cell, start + shift).score > best - p.slide_loss:
            return False
    return True


def densified(points: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Points with others put between neighbours that are on the same wall, `step` apart.

    Far walls are hit at intervals larger than a cell; the other scan hits them in between.
    """
    gaps = np.hypot(*np.diff(points, axis=0).T)
    filled = [points]
    for share in np.arange(1, 8) / 8:
        # Beyond eight steps it may be another wall.
        between = (gaps > step) & (gaps <= 8 * step)
        filled.append(points[:-1][between] * (1 - share) + points[1:][between] * share)
    return np.concatenate(filled)
