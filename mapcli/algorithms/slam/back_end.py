"""What is done when the log has ended: loops closed, every pose refined, the map made anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mapcli.algorithms.slam.keyframes import Track, bend
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
class Finished:
    """The result of a run.

    Attributes:
        poses: of every scan; grid: the map from them; loops: between scans.
    """

    poses: list[Pose2D]
    grid: OccupancyGrid
    loops: tuple[Loop, ...] = ()


def finish(
    track: Track,
    map_: MapParameters,
    loops: LoopParameters,
    refining: RefineParameters,
    progress: Callable[[int], None] = lambda step: None,
) -> Finished:
    """Close the loops of a track, refine its poses, make the map."""
    closed = LoopCloser(track.keyframes, map_, loops).run(progress)
    poses = bend(track, closed.stretches, closed.anchors)
    poses = refine(track, poses, map_.resolution, refining)
    start = track.poses[0].compose(poses[0].inverse())
    poses = [track.poses[0], *(start.compose(pose) for pose in poses[1:])]
    grid = rebuild(track, poses, map_)
    scans = [track.keyframes[stretch.anchor].scan for stretch in closed.stretches]
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
    return Finished(poses, grid, found)


def rebuild(track: Track, poses: list[Pose2D], map_: MapParameters) -> OccupancyGrid:
    """The map that the keyframes make at these poses; it has no likelihood field."""
    grid = OccupancyGrid(map_)
    for keyframe in track.keyframes:
        grid.integrate(poses[keyframe.scan], keyframe.perception, field=False)
    return grid


def refine(
    track: Track, poses: list[Pose2D], cell: float, parameters: RefineParameters
) -> list[Pose2D]:
    """Fit every scan to the walls that all keyframes show; the keyframes again and again, until
    they move no longer, and then all scans."""
    poses, keys = list(poses), [keyframe.scan for keyframe in track.keyframes]
    for _ in range(parameters.rounds):
        walls = walls_of(track, poses, cell)
        fitted = refit(walls, track, poses, keys, parameters)
        moved = [poses[scan].distance(pose) for scan, pose in zip(keys, fitted, strict=True)]
        for scan, pose in zip(keys, fitted, strict=True):
            poses[scan] = pose
        if sum(moved) < parameters.still_m * len(moved):
            break
    walls = walls_of(track, poses, cell)
    return refit(walls, track, poses, list(range(len(poses))), parameters)


def walls_of(track: Track, poses: list[Pose2D], cell: float) -> SurfelMap:
    """The walls as the keyframes show them."""
    walls = SurfelMap(cell)
    for keyframe in track.keyframes:
        points = track.points[keyframe.scan].astype(np.float64)
        walls.add(poses[keyframe.scan].apply(points))
    return walls


def refit(
    walls: SurfelMap,
    track: Track,
    poses: list[Pose2D],
    scans: list[int],
    parameters: RefineParameters,
) -> list[Pose2D]:
    """Poses of scans fitted to the walls, unless these say too little or lead astray."""
    starts = [poses[scan] for scan in scans]
    refitted = []
    fits = walls.fit_each([track.points[scan] for scan in scans], starts)
    for start, (pose, fitted) in zip(starts, fits, strict=True):
        near = start.distance(pose) <= parameters.farthest_m
        refitted.append(pose if near and fitted >= parameters.fewest else start)
    return refitted
