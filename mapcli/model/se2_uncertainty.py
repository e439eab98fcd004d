"""Uncertainty of poses in the plane, SE(2): covariance, information, standard deviations.

THE place where they are made, inverted and moved from frame to frame. Everywhere in mapcli:

- A row or column is x, y (metres), theta (radians).
- An uncertain pose is `pose * Exp(error)`: the error is a small motion in the pose's OWN frame,
  ahead, to the left and in turning (Barfoot 2017, State Estimation for Robotics, Sect. 7.3; GTSAM
  does the same). A matrix in another frame says so.
- What moves an error from one frame into another is the adjoint of the pose between them.

Matrices are small and often made, so they are written out where that is faster than numpy, and
their arithmetic is kept to the last bit: poses of whole logs depend on it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.model.pose import Pose2D

Covariance = NDArray[np.float64]
"""Shape (3, 3), symmetric, of (x, y, theta): m^2, m rad, rad^2; in the pose's own frame."""

InformationMatrix = NDArray[np.float64]
"""The inverse of a covariance, shape (3, 3); it may be singular: nothing known in a direction."""

InformationTriangle = tuple[float, float, float, float, float, float]
"""The upper triangle of an information matrix by rows, (xx, xy, xt, yy, yt, tt)."""

PositionCovariance = NDArray[np.float64]
"""Shape (2, 2), symmetric, of (x, y): m^2."""

LEAST_INFORMATION = 1e-4
"""Of (x, y, theta) each, that is there anyway: nothing is more uncertain than 100 m or rad."""


class StandardDeviations(NamedTuple):
    """How far off a pose may be, alike in every direction.

    Attributes:
        xy: metres, of x and of y.
        theta: radians.
    """

    xy: float
    theta: float

    def covariance(self) -> Covariance:
        """Diagonal: the same in every frame that has the pose's origin."""
        return np.diag([self.xy**2, self.xy**2, self.theta**2])

    def information(self) -> InformationMatrix:
        """The inverse of `covariance`."""
        return np.diag([self.xy**-2, self.xy**-2, self.theta**-2])

    def scaled(self, factor: float) -> StandardDeviations:
        """So many times as large."""
        return StandardDeviations(factor * self.xy, factor * self.theta)

    def after(self, metres: float, step: StandardDeviations) -> StandardDeviations:
        """Of the pose after a step of so many metres, whose error is independent: a heading that
        is off leads aside."""
        xy = math.sqrt(self.xy**2 + (self.theta * metres) ** 2 + step.xy**2)
        return StandardDeviations(xy, math.hypot(self.theta, step.theta))

    def along_axes(self, sideways: float = 1.0) -> AxisDeviations:
        """In the pose's own frame, with that to the left so many times as large."""
        return AxisDeviations(self.xy, sideways * self.xy, self.theta)


class AxisDeviations(NamedTuple):
    """How far off a pose may be, in its own frame.

    Attributes:
        ahead, left: metres.
        theta: radians.
    """

    ahead: float
    left: float
    theta: float

    def weights(self, strength: float = 1.0) -> tuple[float, float, float]:
        """The diagonal of the information matrix, so many times as large."""
        return strength / self.ahead**2, strength / self.left**2, strength / self.theta**2


CERTAIN = StandardDeviations(0.0, 0.0)

UNKNOWN = StandardDeviations(math.inf, math.inf)
"""Of a pose that is not known at all; its information is 0."""


def covariance_from_information(
    information: InformationMatrix, least: float = LEAST_INFORMATION
) -> Covariance:
    """The inverse of an information matrix, in the same frame.

    `least` is added to the diagonal, so that nothing is infinitely uncertain. (The adjugate over
    the determinant: a fifth of the time of a general inverse.)
    """
    (a, b, c), (_, d, e), (_, _, f) = information.tolist()
    a, d, f = a + least, d + least, f + least
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    bb, bc, cc = a * f - c * c, b * c - a * e, a * d - b * b
    inverse = np.array([[aa, ab, ac], [ab, bb, bc], [ac, bc, cc]])
    inverse /= a * aa + b * ab + c * ac
    return inverse


def information_from_covariance(covariance: Covariance) -> InformationTriangle:
    """The inverse of a covariance that is not singular, in the same frame: its upper triangle by
    rows, as a trace keeps it."""
    upper = np.linalg.inv(covariance)[np.triu_indices(3)].tolist()
    xx, xy, xt, yy, yt, tt = (float(value) for value in upper)
    return xx, xy, xt, yy, yt, tt


def information_in_own_frame(information: InformationMatrix, theta: float) -> InformationMatrix:
    """Information on a pose of heading `theta`, from the axes of its parent frame to its own.

    R^T I R, with R the rotation by theta of (x, y): the errors of position are the same, along
    the robot's axes instead of the map's.
    """
    c, s = math.cos(theta), math.sin(theta)
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = information.tolist()
    ahead = c * c * xx + 2 * c * s * xy + s * s * yy
    left = s * s * xx - 2 * c * s * xy + c * c * yy
    both = c * s * (yy - xx) + (c * c - s * s) * xy
    ahead_turn, left_turn = c * xt + s * yt, c * yt - s * xt
    return np.array(
        [[ahead, both, ahead_turn], [both, left, left_turn], [ahead_turn, left_turn, tt]]
    )


def moved_covariance(covariance: Covariance, seen: Pose2D) -> Covariance:
    """What an error of pose a does to a pose b that is rigidly fixed to it.

    Args:
        covariance: of a, in a's own frame.
        seen: a as b sees it, `T_b_a`.

    Returns:
        Of b, in b's own frame: A C A^T, where A is the adjoint of `T_b_a`,
        [[cos, -sin, y], [sin, cos, -x], [0, 0, 1]].
    """
    cos, sin = math.cos(seen.theta), math.sin(seen.theta)
    adjoint = np.array([[cos, -sin, seen.y], [sin, cos, -seen.x], [0.0, 0.0, 1.0]])
    moved: Covariance = adjoint @ covariance @ adjoint.T
    return moved


def turned_covariance(covariance: PositionCovariance, theta: float) -> Covariance:
    """A covariance of positions after a turn by `theta` about the origin: R C R^T, as part of a
    covariance whose heading is certain.

    From the axes of a map to those of a pose in it, `theta` is minus the pose's heading.
    """
    cos, sin = math.cos(theta), math.sin(theta)
    turn = np.array([[cos, -sin], [sin, cos]])
    full = np.zeros((3, 3))
    full[:2, :2] = turn @ covariance @ turn.T
    return full


def largest_position_variance(covariance: Covariance) -> float:
    """Of the position, in its most uncertain direction: the larger eigenvalue, m^2."""
    (xx, both, _), (_, yy, _), _ = covariance.tolist()
    return _eigenvalues(xx, both, yy)[1]


def least_position_deviation(covariance: Covariance) -> float:
    """Standard deviation of the position in its most certain direction, metres."""
    least, _ = np.linalg.eigvalsh(covariance[:2, :2]).tolist()
    return math.sqrt(least)


def mahalanobis_distance(error: Pose2D, covariance: Covariance) -> float:
    """How many standard deviations an error is: sqrt(e^T C^-1 e), e = (x, y, theta).

    Args:
        error: the true pose as the uncertain one sees it; covariance: in the same frame.
    """
    vector = np.array([error.x, error.y, error.theta])
    return math.sqrt(float(vector @ np.linalg.solve(covariance, vector)))


def _eigenvalues(xx: float, xy: float, yy: float) -> tuple[float, float]:
    """The smaller and the larger one of a symmetric 2 x 2 matrix."""
    middle, away = (xx + yy) / 2, math.hypot((xx - yy) / 2, xy)
    return middle - away, middle + away
