"""Map refinement: every scan fitted anew to the surfel map of the whole trajectory.

While the robot drove, a scan was fitted to the local map only. When loops are closed, the scans of
all visits to a place share one surfel map, and fitting every scan to it brings walls that were
seen twice together, to the millimetre. It works only from within a few cells: what is torn by
more is for loop closure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.ghosts import Ghosts
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.surfel_map import SurfelMap
from mapcli.model.pose import Pose2D

STILL_M = 0.005
"""Metres; keyframes that move less on average have found their places, and another round would
change nothing that can be seen on a map of 5 cm."""

SCANS_IN_MEMORY = 4096
"""Scans that are fitted at a time, on all processors."""


@dataclass(frozen=True)
class RefineParameters:
    """How scans are fitted to the surfel map that all of them show.

    Attributes:
        rounds: of fitting the keyframes and making the surfel map anew, at most.
        fewest: a scan of which fewer points have a surfel stays where it is.
        farthest_m: so does one that would go farther, metres: it was led astray.
    """

    rounds: int = 2
    fewest: int = 5
    farthest_m: float = 0.3


def refine(
    trajectory: TrackedTrajectory, poses: list[Pose2D], cell: float, parameters: RefineParameters
) -> list[Pose2D]:
    """Fit every scan to the surfels that all keyframes show: the keyframes again and again, until
    they hardly move, and then all scans.

    Args:
        poses: of every scan, loops closed; cell: metres along a side of a surfel's cell.
    """
    poses, keys = list(poses), [keyframe.scan for keyframe in trajectory.keyframes]
    for _ in range(parameters.rounds):
        surfels = surfel_map_of(trajectory, poses, cell)
        fitted = refit(surfels, trajectory, poses, keys, parameters)
        moved = [poses[scan].distance(pose) for scan, pose in zip(keys, fitted, strict=True)]
        for scan, pose in zip(keys, fitted, strict=True):
            poses[scan] = pose
        if sum(moved) < STILL_M * len(moved):
            break
    surfels = surfel_map_of(trajectory, poses, cell)
    return refit(surfels, trajectory, poses, list(range(len(poses))), parameters)


def surfel_map_of(trajectory: TrackedTrajectory, poses: list[Pose2D], cell: float) -> SurfelMap:
    """The surfels that the keyframes make at these poses (one for each scan)."""
    surfels = SurfelMap(cell)
    for keyframe in trajectory.keyframes:
        points = trajectory.points[keyframe.scan].astype(np.float64)
        surfels.add(poses[keyframe.scan].apply(points))
    return surfels


def refit(
    surfels: SurfelMap,
    trajectory: TrackedTrajectory,
    poses: list[Pose2D],
    scans: list[int],
    parameters: RefineParameters,
) -> list[Pose2D]:
    """Poses of these scans fitted to surfels, unless these say too little or lead astray."""
    refitted = []
    for first in range(0, len(scans), SCANS_IN_MEMORY):
        some = scans[first : first + SCANS_IN_MEMORY]
        starts = [poses[scan] for scan in some]
        fits = surfels.fit_each([trajectory.points[scan] for scan in some], starts)
        for start, (pose, matched) in zip(starts, fits, strict=True):
            near = start.distance(pose) <= parameters.farthest_m
            refitted.append(pose if near and matched >= parameters.fewest else start)
    return refitted


def map_from_keyframes(
    trajectory: TrackedTrajectory, poses: list[Pose2D], map_: MapParameters
) -> OccupancyGrid:
    """The map that the keyframes make at these poses, without the ghosts of what is gone; it has
    no likelihood field. Keyframes of scans beyond the poses are left out."""
    grid, seen = OccupancyGrid(map_), list[tuple[Pose2D, Perception]]()
    for keyframe in trajectory.keyframes:
        if keyframe.scan < len(poses):
            seen.append((poses[keyframe.scan], keyframe.perception))
            ends = seen[-1][0].apply(keyframe.perception.beams())
            grid.extend_to(ends.min(axis=0), ends.max(axis=0))
    ghosts = Ghosts(grid)
    for pose, perception in seen:
        ghosts.add(grid.integrate(pose, perception, update_field=False))
    ghosts.open_passed(-map_.log_odds_rules().miss)
    return grid
