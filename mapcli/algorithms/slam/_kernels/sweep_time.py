"""What a scan says about the time that a turn of its laser takes.

A beam that is taken t seconds after the stamp ends at (v + w x r) t beside where it would end at
once, r the beam's end from the robot, v and w its velocities. Of a turn that takes T seconds, t is
the beam's share of the turn times T; so the end moves with T as with the pose, and T is fitted
beside it, as a fourth unknown.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.gauss_newton import weighted_information
from mapcli.algorithms.slam._kernels.surfel_map import (
    SURFEL_X,
    SURFEL_Y,
    SurfelTable,
    nearest_surfel,
)


class TimeEquations(NamedTuple):
    """Normal equations of small changes of (x, y, theta, T), in the map's axes.

    Attributes:
        matrix: shape (4, 4); right: shape (4,).
    """

    matrix: NDArray[np.float64]
    right: NDArray[np.float64]


@kernel
def add_scan(
    table: SurfelTable,
    points: NDArray[np.float64],
    shares: NDArray[np.float64],
    pose: NDArray[np.float64],
    velocity: NDArray[np.float64],
    bearing_variance: float,
    equations: TimeEquations,
) -> None:
    """Add what the points say that have a surfel near them; see `gauss_newton.linearise`.

    Args:
        points: shape (n, 2), metres in the robot's frame.
        shares: shape (n,), of a turn, from the stamp to each point.
        pose: shape (3,), of the robot in the map; velocity: shape (3,), in its own frame, per
            second.
    """
    surfels = table.surfels
    c, s = cos(pose[2]), sin(pose[2])
    v_x, v_y = c * velocity[0] - s * velocity[1], s * velocity[0] + c * velocity[1]
    for p in range(len(points)):
        rx, ry = c * points[p, 0] - s * points[p, 1], s * points[p, 0] + c * points[p, 1]
        at = nearest_surfel(table, pose[0] + rx, pose[1] + ry, rx, ry)
        if at == 0:
            continue
        ex, ey = surfels[at, SURFEL_X] - pose[0] - rx, surfels[at, SURFEL_Y] - pose[1] - ry
        xx, xy, yy = weighted_information(surfels, at, (ex, ey), (rx, ry), bearing_variance)
        along_x = (1.0, 0.0, -ry, shares[p] * (v_x - velocity[2] * ry))
        along_y = (0.0, 1.0, rx, shares[p] * (v_y + velocity[2] * rx))
        for a in range(4):
            u, v = xx * along_x[a] + xy * along_y[a], xy * along_x[a] + yy * along_y[a]
            for b in range(4):
                equations.matrix[a, b] += u * along_x[b] + v * along_y[b]
            equations.right[a] += u * ex + v * ey
