"""Point-to-line ICP: fitting a scan's pose to surfels (Censi 2008).

Each round finds the surfel of every point (the correspondences), then takes a few Gauss-Newton
steps with these (see `gauss_newton`). Poses (x, y, theta) are those of the robot in the map; metres
and radians.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.gauss_newton import (
    NormalEquations,
    Prediction,
    gauss_newton,
    is_still,
    linearise,
)
from mapcli.algorithms.slam._kernels.pose import Pose
from mapcli.algorithms.slam._kernels.pose_chain import ChainEquations, Symmetric, add_pose
from mapcli.algorithms.slam._kernels.surfel_map import SurfelTable, nearest_surfel

ROUNDS = 2
"""How often at most correspondences are searched: the second time few of them change."""


class Fit(NamedTuple):
    """A fitted pose.

    Attributes:
        equations: normal equations of the last step, from the points alone: their matrix is the
            information of the points on the pose, in the map's axes.
        matched: how many points have a surfel near them.
    """

    pose: Pose
    equations: NormalEquations
    matched: int


@kernel
def fit_scan(
    table: SurfelTable,
    points: NDArray[np.float64],
    correspondences: NDArray[np.int64],
    start: tuple[float, float, float],
    predicted: tuple[float, float, float],
    weights: tuple[float, float, float, float],
    bearing_variance: float,
) -> tuple[tuple[float, ...], tuple[float, ...], int]:
    """`fit_pose` for a call from Python, once or twice a scan: plain tuples get into compiled code
    and out of it in a third of the time of records (4 of 13 microseconds a call).

    Args:
        start, predicted: fields of a `Pose`; weights: the other fields of a `Prediction`.
        bearing_variance: see `fit_pose`.

    Returns:
        The pose's fields, the upper triangle of its information by rows, and how many points have
        a surfel.
    """
    prediction = Prediction(Pose(*predicted), *weights)
    fit = fit_pose(table, points, correspondences, Pose(*start), prediction, bearing_variance)
    return fit.pose[:3], fit.equations[:6], fit.matched


@kernel
def add_scans(
    table: SurfelTable,
    points: NDArray[np.float64],
    bounds: NDArray[np.int64],
    correspondences: NDArray[np.int64],
    bearing_variance: float,
    poses: NDArray[np.float64],
    equations: ChainEquations,
) -> None:
    """Add what scans say of their poses, each of its own.

    Args:
        points, correspondences: as for `fit_pose`, one scan after the other; those of scan k are
            from bounds[k] to bounds[k + 1] - 1.
        bearing_variance: see `fit_pose`.
        poses: shape (scans, 3), (x, y, theta).
    """
    for k in range(len(poses)):
        part = slice(bounds[k], bounds[k + 1])
        pose = Pose(poses[k, 0], poses[k, 1], poses[k, 2])
        associate(table, points[part], pose, correspondences[part])
        xx, xy, xt, yy, yt, tt, gx, gy, gt = linearise(
            table.surfels, points[part], correspondences[part], pose, bearing_variance
        )
        add_pose(equations, k, Symmetric(xx, xy, xt, yy, yt, tt), (gx, gy, gt), 1.0)


@kernel
def fit_pose(
    table: SurfelTable,
    points: NDArray[np.float64],
    correspondences: NDArray[np.int64],
    pose: Pose,
    prediction: Prediction,
    bearing_variance: float,
) -> Fit:
    """Fit a scan's pose to the surfels near its points, and to what is predicted.

    Args:
        points: shape (n, 2), metres in the robot's frame.
        correspondences: shape (n,), filled with the slot of each point's surfel, 0 for none.
        pose: where to start, less than three cells off.
        bearing_variance: of a point seen from the robot, rad^2.
    """
    for _ in range(ROUNDS):
        matched = associate(table, points, pose, correspondences)
        begun = pose
        pose, equations = gauss_newton(
            table.surfels, points, correspondences, pose, prediction, bearing_variance
        )
        if is_still(begun, pose, 1.0):
            break
    return Fit(pose, equations, matched)


@kernel
def associate(
    table: SurfelTable,
    points: NDArray[np.float64],
    pose: Pose,
    correspondences: NDArray[np.int64],
) -> int:
    """Find the surfel next to each point at a pose: fills `correspondences`, returns how many
    points have one."""
    c, s = cos(pose.theta), sin(pose.theta)
    matched = 0
    for p in range(len(points)):
        px, py = points[p, 0], points[p, 1]
        rx, ry = c * px - s * py, s * px + c * py
        at = nearest_surfel(table, pose.x + rx, pose.y + ry, rx, ry)
        correspondences[p] = at
        matched += at > 0
    return matched
