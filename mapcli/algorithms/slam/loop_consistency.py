"""Do two loops say the same? Pairwise consistency, by the cycle that they make with tracking."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam.loop_candidates import APART_M
from mapcli.algorithms.slam.pose_graph import Edge
from mapcli.model.pose import Pose2D

CONSISTENT_M, CONSISTENT_DEG = 0.15, 1.0
"""Metres and degrees by which two loops may contradict each other: what two matches are off."""

CONSISTENT_M_PER_M, CONSISTENT_DEG_PER_M = 0.01, 0.05
"""The same for each metre of trajectory between them: what tracking drifts by."""


class TrackedOrigins(NamedTuple):
    """The origins of all submaps, as tracked.

    Attributes:
        poses: of each; metres: driven until it, shape (submaps,).
        pieces: the number of the piece of the trajectory that each belongs to.
    """

    poses: list[Pose2D]
    metres: NDArray[np.float64]
    pieces: list[int]


def are_consistent(one: Edge, other: Edge, tracked: TrackedOrigins) -> bool:
    """Whether two loops say the same, going round the cycle that they make: back by the one, along
    the old trajectory, and by the other one again to the new trajectory must lead where the new
    trajectory leads by itself."""
    poses, metres, pieces = tracked
    new, old = abs(metres[one.to] - metres[other.to]), abs(metres[one.from_] - metres[other.from_])
    is_alongside = (pieces[one.from_], pieces[one.to]) == (pieces[other.from_], pieces[other.to])
    if old > 2 * APART_M or not is_alongside:
        return False
    before = poses[one.from_].between(poses[other.from_])
    around = one.measured.inverse().compose(before).compose(other.measured)
    error = poses[one.to].between(poses[other.to]).between(around)
    is_near = math.hypot(error.x, error.y) <= CONSISTENT_M + CONSISTENT_M_PER_M * (new + old)
    turn = math.radians(CONSISTENT_DEG + CONSISTENT_DEG_PER_M * (new + old))
    return bool(is_near and abs(error.theta) <= turn)
