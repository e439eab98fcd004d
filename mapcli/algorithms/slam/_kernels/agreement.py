"""The compiled loop that counts how the points of a scan agree with a map at a pose."""

from __future__ import annotations

from math import cos, floor, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.likelihood_field import MAX_LIKELIHOOD

FULL_SCORE = float(MAX_LIKELIHOOD)
"""What a point on an occupied cell counts: the highest value of the likelihood field."""

CONFLICT = 0.2 * FULL_SCORE
"""A point on a known cell where the field is lower than this conflicts with free space: it is two
standard deviations from the nearest occupied cell, as a rule."""


class Agreement(NamedTuple):
    """How well the points of a scan agree with a map at a pose.

    Attributes:
        score: mean of the likelihood field at the known points, 0 to 1; 0 without any.
        known_points: points on cells that were observed, or next to an occupied one. Only these
            count (Sect. 9.7: where map and perception overlap).
        free_space_conflicts: points on observed cells far from every occupied one.
    """

    score: float
    known_points: int
    free_space_conflicts: int


@kernel
def count_agreement(
    log_odds: NDArray[np.int16],
    field: NDArray[np.uint8],
    points: NDArray[np.float64],
    pose: NDArray[np.float64],
) -> Agreement:
    """See `Agreement`; `points`, shape (n, 2), in the robot's frame and `pose` (u, v, theta) are in
    cells and radians, and every point lies in the arrays."""
    c, s = cos(pose[2]), sin(pose[2])
    known, total, conflicts = 0, 0.0, 0
    for p in range(len(points)):
        u = floor(pose[0] + c * points[p, 0] - s * points[p, 1])
        v = floor(pose[1] + s * points[p, 0] + c * points[p, 1])
        if log_odds[v, u] != 0 or field[v, u] > 0:
            known += 1
            total += field[v, u] / FULL_SCORE
            conflicts += log_odds[v, u] != 0 and field[v, u] < CONFLICT
    return Agreement(total / max(known, 1), known, conflicts)
