"""Map refinement: all scans fitted anew to the surfel map of the whole trajectory.

While the robot drove, a scan was fitted to the local map only. When loops are closed, the scans of
all visits to a place share one surfel map, and fitting every scan to it brings walls that were
seen twice together, to the millimetre. All poses are fitted at once, since where a scan sees a
single pillar it leaves its pose open, and odometry tells how it hangs on the poses before and
after. It works only from within a few cells: what is torn by more is for loop closure.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam._kernels import pose_chain
from mapcli.algorithms.slam._kernels.pose_chain import BAND, ChainEquations, OdometrySteps
from mapcli.algorithms.slam.ghosts import Ghosts
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.surfel_map import INDEPENDENT_SHARE, SurfelMap
from mapcli.model.pose import Pose2D, wrap_angle

ROUNDS, STEPS, STILL_M = 2, 4, 5e-4
"""How often the surfel map is made, and Gauss-Newton steps with each at most; a step that moves
poses by less, metres on average, is the last."""

SCANS_IN_MEMORY = 4096
"""Scans whose points are taken from the store together."""


def refine(
    trajectory: TrackedTrajectory, poses: list[Pose2D], cell: float, odometry: MotionModel
) -> list[Pose2D]:
    """Fit all scans to the surfels that the keyframes show.

    Args:
        poses: of every scan, loops closed; cell: metres along a side of a surfel's cell.
    """
    steps, path = believed_steps(trajectory, odometry), _path_of(poses)
    for _ in range(ROUNDS):
        surfels = surfel_map_of(trajectory, _poses_of(path), cell)
        for _ in range(STEPS):
            moved = _gauss_newton_step(trajectory, path, surfels, steps)
            path += moved
            if np.hypot(moved[:, 0], moved[:, 1]).mean() < STILL_M:
                break
    return _poses_of(path)


def believed_steps(trajectory: TrackedTrajectory, model: MotionModel) -> OdometrySteps:
    """From each scan to the next, as odometry was believed, or else as tracked, with the
    information of that beside what points say."""
    poses, n = trajectory.poses, max(len(trajectory.poses) - 1, 0)
    counted, information = np.zeros((n, 3)), np.zeros((n, 3))
    for k, (before, after) in enumerate(pairwise(poses)):
        believed = trajectory.steps[k + 1]
        step = believed or before.between(after)
        counted[k] = step.x, step.y, step.theta
        information[k] = model.uncertainty(believed).along_axes().weights()
    information[trajectory.gaps()] = 0.0
    return OdometrySteps(counted, information / INDEPENDENT_SHARE)


def _gauss_newton_step(
    trajectory: TrackedTrajectory,
    path: NDArray[np.float64],
    surfels: SurfelMap,
    steps: OdometrySteps,
) -> NDArray[np.float64]:
    """By how much all poses are to move, shape (n, 3)."""
    n = len(path)
    equations = ChainEquations(np.zeros((3 * n, BAND)), np.zeros(3 * n))
    for first in range(0, n, SCANS_IN_MEMORY):
        some = slice(first, min(first + SCANS_IN_MEMORY, n))
        rows = slice(3 * some.start, 3 * some.stop)
        part = ChainEquations(equations.matrix[rows], equations.right[rows])
        surfels.add_scans(trajectory.points[some], path[some], part)
    pose_chain.add_odometry(steps, path, equations)
    pose_chain.solve_banded(equations)
    return equations.right.reshape(-1, 3)


def _path_of(poses: list[Pose2D]) -> NDArray[np.float64]:
    """Poses as an array, shape (n, 3); headings go on over the half turn."""
    path = np.array([(pose.x, pose.y, pose.theta) for pose in poses])
    path[:, 2] = np.unwrap(path[:, 2])
    return path


def _poses_of(path: NDArray[np.float64]) -> list[Pose2D]:
    return [Pose2D(x, y, wrap_angle(theta)) for x, y, theta in path.tolist()]


def surfel_map_of(trajectory: TrackedTrajectory, poses: list[Pose2D], cell: float) -> SurfelMap:
    """The surfels that the keyframes make at these poses (one for each scan)."""
    surfels = SurfelMap(cell)
    for keyframe in trajectory.keyframes:
        points, pose = trajectory.points[keyframe.scan].astype(np.float64), poses[keyframe.scan]
        surfels.add(pose.apply(points), pose.apply(keyframe.perception.laser[None])[0])
    return surfels


def map_from_keyframes(
    trajectory: TrackedTrajectory, poses: list[Pose2D], map_: MapParameters
) -> OccupancyGrid:
    """The map that the keyframes make at these poses, without the ghosts of what is gone; it has
    no likelihood field. Keyframes of scans beyond the poses are left out."""
    grid, seen = OccupancyGrid(map_), list[tuple[Pose2D, Perception]]()
    for keyframe in trajectory.keyframes:
        if keyframe.scan < len(poses):
            seen.append((poses[keyframe.scan], keyframe.perception))
            beams = np.concatenate([part.beams() for part in keyframe.perception.parts()])
            ends = seen[-1][0].apply(beams)
            grid.extend_to(ends.min(axis=0), ends.max(axis=0))
    ghosts = Ghosts(grid)
    for pose, perception in seen:
        ghosts.add(grid.integrate(pose, perception, update_field=False))
    ghosts.open_passed(-map_.log_odds_rules().miss)
    return grid
