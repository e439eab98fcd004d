"""The robot's way between two scans: a cubic through their poses beside what odometry counted, each
weighed by how far it is seen to be off (`sweep_refinement`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels.pose_chain import OdometrySteps
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.surfel_map import INDEPENDENT_SHARE
from mapcli.algorithms.slam.tracked_sweeps import TrackedSweeps

BETWEEN, FINER = 2.0, 8.0
"""How much better the way between two scans is known than what shows: half way between them
odometry is off by half of what it is off at the end; and a cubic through poses that are twice as
far apart is off eight times as much, where speeds change by and by."""

FEWEST_STEPS = 10
"""Steps that must have shown how far odometry is off."""

Floats = NDArray[np.float64]


def odometry_steps(sweeps: TrackedSweeps, model: MotionModel) -> OdometrySteps:
    """The motions that odometry counted from each scan to the next, with their information beside
    that of points."""
    n = len(sweeps.odometry)
    counted, information = np.zeros((max(n - 1, 0), 3)), np.zeros((max(n - 1, 0), 3))
    for k in range(n - 1):
        a, b = sweeps.odometry[k], sweeps.odometry[k + 1]
        if a is not None and b is not None:
            motion = a.between(b)
            counted[k] = motion.x, motion.y, motion.theta
            information[k] = model.uncertainty(motion).along_axes().weights()
    return OdometrySteps(counted, information / INDEPENDENT_SHARE)


def shares_of_odometry(
    poses: Floats, follows: NDArray[np.bool_], odometry: OdometrySteps
) -> Floats:
    """How much of the way between two scans is taken as odometry has it, beside the cubic through
    the poses, shape (m - 1, 3): by the inverse of their mean squared errors.

    Args:
        poses: shape (m, 3), in the map; follows: shape (m - 1,), which steps lie between sweeps
            that follow each other.
    """
    if len(poses) <= FEWEST_STEPS:
        return np.zeros((len(follows), 3))
    known = odometry.information[:, 0] > 0
    cos, sin = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    x, y, theta = odometry.counted.T
    counted = np.column_stack([cos * x - sin * y, sin * x + cos * y, theta])
    off = (np.diff(poses, axis=0) - counted)[known & follows] / BETWEEN
    # A pose and what the cubic through those beside it would have it be.
    left_out = 9 * (poses[2:-4] + poses[4:-2]) - (poses[:-6] + poses[6:])
    six = np.convolve(follows, np.ones(6), "valid") == 6
    bent = (poses[3:-3] - left_out / 16)[six] / FINER
    if len(off) < FEWEST_STEPS or len(bent) < FEWEST_STEPS:
        return np.zeros((len(follows), 3))
    by_odometry, by_cubic = (np.mean(errors**2, axis=0) for errors in (off, bent))
    # Ahead and to the left are not told apart.
    for squares in (by_odometry, by_cubic):
        squares[:2] = squares[:2].mean()
    share = by_cubic / np.maximum(by_cubic + by_odometry, np.finfo(float).tiny)
    return np.outer(known & follows, share)


def velocities_at(poses: Floats, seconds: Floats, follows: NDArray[np.bool_]) -> Floats:
    """At each scan, shape (m, 3), per second: the mean of those on both sides, the shorter step
    weighing more; of steps to sweeps that follow only."""
    known = np.where(follows, 1.0, 0.0)
    safe = np.where(follows, seconds, 1.0)
    slopes = np.diff(poses, axis=0) / safe[:, None]
    weights = known / safe
    total, weighted = np.zeros(len(poses)), np.zeros_like(poses)
    for part in (slice(0, -1), slice(1, None)):
        total[part] += weights
        weighted[part] += weights[:, None] * slopes
    return weighted / np.maximum(total, np.finfo(float).tiny)[:, None]
