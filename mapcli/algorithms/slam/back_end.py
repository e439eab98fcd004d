"""What is done when the log has ended: loops closed, every pose refined, the map made anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mapcli.algorithms.slam.keyframes import TrackedTrajectory, apply_corrections
from mapcli.algorithms.slam.loop_closure import LoopCloser, LoopParameters
from mapcli.algorithms.slam.occupancy_grid import MapParameters, OccupancyGrid
from mapcli.algorithms.slam.surfel_map import SurfelMap
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import information_from_covariance
from mapcli.model.trace import Loop


@dataclass(frozen=True)
class RefineParameters:
    """How often all poses are fitted to the walls that all of them show.

    Attributes:
        rounds: of the keyframes, at most; still_m: metres that they move on average when they
            move no longer.
        fewest: a scan with fewer points at walls stays where it is, and so does one that would
            go farther than `farthest_m`.
    """

    rounds: int = 2
    still_m: float = 0.005
    fewest: int = 5
    farthest_m: float = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class BackEndResult:
    """The result of a run.

    Attributes:
        poses: of every scan; grid: the map from them; loops: between scans.
    """

    poses: list[Pose2D]
    grid: OccupancyGrid
    loops: tuple[Loop, ...] = ()


def finalise(
    trajectory: TrackedTrajectory,
    map_: MapParameters,
    loops: LoopParameters,
    refining: RefineParameters,
    progress: Callable[[int], None] = lambda step: None,
) -> BackEndResult:
    """Close the loops of a trajectory, refine its poses, make the map."""
    closed = LoopCloser(trajectory.keyframes, map_, loops).run(progress)
    poses = apply_corrections(trajectory, closed.submaps, closed.origins)
    poses = refine(trajectory, poses, map_.resolution, refining)
    start = trajectory.poses[0].compose(poses[0].inverse())
    poses = [trajectory.poses[0], *(start.compose(pose) for pose in poses[1:])]
    grid = rebuild(trajectory, poses, map_)
    scans = [trajectory.keyframes[submap.origin].scan for submap in closed.submaps]
    found = tuple(
        Loop(
            scans[edge.from_],
            scans[edge.to],
            edge.measured,
            score,
            information_from_covariance(edge.covariance),
        )
        for edge, score in zip(closed.loops, closed.scores, strict=True)
    )
    return BackEndResult(poses, grid, found)


def rebuild(
    trajectory: TrackedTrajectory, poses: list[Pose2D], map_: MapParameters
) -> OccupancyGrid:
    """The map that the keyframes make at these poses; it has no likelihood field."""
    grid = OccupancyGrid(map_)
    for keyframe in trajectory.keyframes:
        grid.integrate(poses[keyframe.scan], keyframe.perception, field=False)
    return grid


def refine(
    trajectory: TrackedTrajectory, poses: list[Pose2D], cell: float, parameters: RefineParameters
) -> list[Pose2D]:
    """Fit every scan to the walls that all keyframes show; the keyframes again and again, until
    they move no longer, and then all scans."""
    poses, keys = list(poses), [keyframe.scan for keyframe in trajectory.keyframes]
    for _ in range(parameters.rounds):
        walls = surfel_map_of(trajectory, poses, cell)
        fitted = refit(walls, trajectory, poses, keys, parameters)
        moved = [poses[scan].distance(pose) for scan, pose in zip(keys, fitted, strict=True)]
        for scan, pose in zip(keys, fitted, strict=True):
            poses[scan] = pose
        if sum(moved) < parameters.still_m * len(moved):
            break
    walls = surfel_map_of(trajectory, poses, cell)
    return refit(walls, trajectory, poses, list(range(len(poses))), parameters)


def surfel_map_of(trajectory: TrackedTrajectory, poses: list[Pose2D], cell: float) -> SurfelMap:
    """The walls as the keyframes show them."""
    walls = SurfelMap(cell)
    for keyframe in trajectory.keyframes:
        points = trajectory.points[keyframe.scan].astype(np.float64)
        walls.add(poses[keyframe.scan].apply(points))
    return walls


def refit(
    walls: SurfelMap,
    trajectory: TrackedTrajectory,
    poses: list[Pose2D],
    scans: list[int],
    parameters: RefineParameters,
) -> list[Pose2D]:
    """Poses of scans fitted to the walls, unless these say too little or lead astray."""
    starts = [poses[scan] for scan in scans]
    refitted = []
    fits = walls.fit_each([trajectory.points[scan] for scan in scans], starts)
    for start, (pose, fitted) in zip(starts, fits, strict=True):
        near = start.distance(pose) <= parameters.farthest_m
        refitted.append(pose if near and fitted >= parameters.fewest else start)
    return refitted
