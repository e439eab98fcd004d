"""The pose of a sensor on a robot, from how both move (hand-eye calibration in the plane).

Between two moments, be l the motion of the laser, t its turn, r the way of the robot's centre by
odometry, m where the laser sits and y its yaw, in the complex plane. Then

    r + exp(i t) m = m + exp(i y) l,    or    l = (exp(i t) - 1) a + b r

with a = exp(-i y) m and b = s exp(-i y), where odometry counts 1 / s metres for one. That is linear
in a and b, and solved by least squares over many motions. The turn is the laser's, since wheels
slip when they turn (compare Censi et al. 2013, "Simultaneous calibration of odometry and sensor
parameters for mobile robots").
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

BLOCKS = 16
"""Parts of the drive, each of which is left out once to see what the result hangs on."""

REWEIGHTED, SQUARED_ERROR_SCALE = 20, 9.0
"""Times that pairs are weighted anew, by their errors; of this many variances, to a quarter."""

START_M, LEAST_ERROR_M, MAD_TO_SIGMA = 0.05, 0.002, 1.4826
"""Metres: what pairs err by beyond what their scans tell, before that is known; and at least. The
last makes the median error of a normal distribution its standard deviation."""

Complex = NDArray[np.complex128]
Floats = NDArray[np.float64]


class Motions(NamedTuple):
    """Of laser and robot, in time order.

    Attributes:
        laser, robot: shape (n,), metres, in the frame before; the robot's by odometry.
        turns, counted: shape (n,), radians, by the scans and by odometry.
        variances: shape (n, 2, 2), of `laser`, square metres.
    """

    laser: Complex
    robot: Complex
    turns: Floats
    counted: Floats
    variances: Floats

    def agreeing_turns(self) -> float:
        """Share of all turns in which scans and odometry turn the same way."""
        both = self.turns * self.counted
        return float(both[both > 0].sum() / max(np.abs(both).sum(), 1e-9))


class Solution(NamedTuple):
    """Where the laser sits.

    Attributes:
        pose: shape (3,), x, y and yaw.
        scale: s.
        unexplained: what is left of the laser's motions, as a share of them, in the middle.
    """

    pose: Floats
    scale: float
    unexplained: float


def solve(motions: Motions) -> Solution:
    """The robust least squares solution. Motions that fit badly count less, those of slipping
    wheels above all."""
    # A turn that wheels miscount bends the way by half of it.
    robot = motions.robot * np.exp(0.5j * (motions.turns - motions.counted))
    jacobians = np.concatenate(
        [_multiplying(np.exp(1j * motions.turns) - 1), _multiplying(robot)], axis=2
    )
    laser = np.column_stack([motions.laser.real, motions.laser.imag])
    deviation, weights = START_M, np.ones(len(laser))
    for _ in range(REWEIGHTED):
        information = np.linalg.inv(motions.variances + deviation**2 * np.eye(2))
        weighted = jacobians.transpose(0, 2, 1) @ (information * weights[:, None, None])
        normal = (weighted @ jacobians).sum(axis=0)
        right = (weighted @ laser[:, :, None]).sum(axis=0)[:, 0]
        unknown = np.linalg.lstsq(normal, right, rcond=None)[0]
        errors = laser - jacobians @ unknown
        deviation = max(MAD_TO_SIGMA * float(np.median(np.abs(errors))), LEAST_ERROR_M)
        squares = np.einsum("ni,nij,nj->n", errors, information, errors)
        weights = (1 + squares / SQUARED_ERROR_SCALE) ** -2
    left = float(np.median(np.hypot(*errors.T))) / max(
        float(np.median(np.abs(motions.laser))), 1e-9
    )
    return Solution(*_pose(unknown), left)


def jackknife(motions: Motions) -> Floats:
    """Standard deviations of x, y and yaw, shape (3,), by the scatter of what is found without
    each of `BLOCKS` parts of the drive, which so knows of errors that last for a while."""
    parts = np.arange(len(motions.turns)) * BLOCKS // len(motions.turns)
    some = (Motions(*(each[parts != part] for each in motions)) for part in range(BLOCKS))
    found = np.array([solve(one).pose for one in some])
    found[:, 2] = np.unwrap(found[:, 2])
    return np.asarray(np.sqrt(BLOCKS - 1) * found.std(axis=0))


def _pose(unknown: Floats) -> tuple[Floats, float]:
    """x, y and yaw, and s, of a and b."""
    ax, ay, bx, by = (float(number) for number in unknown)
    yaw = -math.atan2(by, bx)
    middle = complex(ax, ay) * cmath.exp(1j * yaw)
    return np.array([middle.real, middle.imag, yaw]), math.hypot(bx, by)


def _multiplying(numbers: Complex) -> Floats:
    """Matrices that multiply a complex number, as a vector, by each of these: shape (n, 2, 2)."""
    rows = np.array([[numbers.real, -numbers.imag], [numbers.imag, numbers.real]])
    return np.moveaxis(rows, 2, 0)
