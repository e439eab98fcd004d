"""Where walls are, finer than cells: what poses are refined against.

Cells are too coarse for the last centimetre: their likelihood field knows a wall to half a cell
only. A `SurfelMap` keeps the mean and the spread of the points in each cell instead, and fits a
scan by the distances of its points to the lines through them (point-to-line matching, Censi 2008;
cells with their distributions, Biber and Strasser 2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms._kernels import surfels as kernels
from mapcli.algorithms._kernels.surfel_fit import refine
from mapcli.model.pose import Pose2D, wrap_angle

START = 1 << 10
"""Cells that a new map has room for."""


@dataclass(frozen=True)
class SurfelParameters:
    """How points are fitted to walls.

    Attributes:
        thickness: metres; how well a point tells where a wall is, at best.
        doubt: standard deviations at which a point's say has fallen to a quarter.
        independent: the share of a scan's points that count as evidence of their own: errors of
            neighbouring beams are alike.
        knee: squared standard deviations at which the prediction's say has fallen to a quarter.
        rounds: how often at most each point looks for its wall anew.
    """

    thickness: float = 0.015
    doubt: float = 3.0
    independent: float = 0.3
    knee: float = 9.0
    rounds: int = 2


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A pose fitted to walls.

    Attributes:
        pose: in the world.
        information: shape (3, 3), of (x, y, theta) in the world, from the points alone: metres
            and radians to the power of -2.
        fitted: points that have a wall near them.
    """

    pose: Pose2D
    information: NDArray[np.float64]
    fitted: int

    def in_own_frame(self) -> NDArray[np.float64]:
        """The information ahead, to the left and in turning, of the fitted pose itself."""
        cos, sin = math.cos(self.pose.theta), math.sin(self.pose.theta)
        turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        moved: NDArray[np.float64] = turn @ self.information @ turn.T
        return moved


def covariance_of(information: NDArray[np.float64], least: float = 1e-4) -> NDArray[np.float64]:
    """The inverse of a symmetric information matrix, shape (3, 3).

    `least` is information that is there anyway, so that nothing is infinitely uncertain. (Written
    out, it takes a fifth of the time of a general inverse.)
    """
    (a, b, c), (_, d, e), (_, _, f) = (information + least * np.eye(3)).tolist()
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    bb, bc, cc = a * f - c * c, b * c - a * e, a * d - b * b
    determinant = a * aa + b * ab + c * ac
    inverse: NDArray[np.float64] = np.array([[aa, ab, ac], [ab, bb, bc], [ac, bc, cc]])
    inverse /= determinant
    return inverse


class SurfelMap:
    """The walls as points left them (stateful: `add` changes it)."""

    def __init__(self, cell: float, parameters: SurfelParameters | None = None) -> None:
        self.cell, self.parameters = cell, parameters or SurfelParameters()
        self._used = 0
        self._keys = np.full(4 * START, kernels.EMPTY, np.int64)
        self._slots = np.zeros(4 * START, np.int64)
        self._moments = np.zeros((START, 6))
        self._surfels = np.zeros((START, 5))
        self._states = np.zeros(START, np.int8)

    def add(self, points: NDArray[np.float64]) -> None:
        """Add ends of beams, shape (n, 2), metres in the world."""
        self._make_room(self._used + len(points))
        self._used = kernels.add_points(
            self._keys, self._slots, self._moments, self._used, points, self.cell
        )
        self._states[: self._used] = kernels.STALE

    def _make_room(self, needed: int) -> None:
        room = len(self._moments)
        if needed <= room:
            return
        while room < needed:
            room *= 2
        keys = np.full(4 * room, kernels.EMPTY, np.int64)
        slots = np.zeros(4 * room, np.int64)
        kernels.rehash(self._keys, self._slots, keys, slots)
        self._keys, self._slots = keys, slots
        moments = np.zeros((room, 6))
        moments[: self._used] = self._moments[: self._used]
        self._moments = moments
        self._surfels, self._states = np.zeros((room, 5)), np.zeros(room, np.int8)

    def fit(
        self,
        points: NDArray[np.float64],
        start: Pose2D,
        predicted: Pose2D | None = None,
        deviations: tuple[float, float] = (np.inf, np.inf),
    ) -> Fit:
        """The pose near `start` at which points lie on the walls.

        Args:
            points: shape (n, 2), metres in the robot's frame.
            predicted: what odometry says; it decides where the walls do not.
            deviations: how far off that may be: metres, radians.
        """
        p = self.parameters
        predicted = predicted or start
        begin = np.array([start.x, start.y, start.theta], np.float64)
        # Headings on the same turn of the circle.
        heading = start.theta + wrap_angle(predicted.theta - start.theta)
        share = 1 / p.independent
        pose, normal, fitted = refine(
            (self._keys, self._slots, self._moments, self._surfels, self._states),
            points,
            begin,
            np.array([predicted.x, predicted.y, heading], np.float64),
            (share / deviations[0] ** 2, share / deviations[1] ** 2, p.knee * share),
            (self.cell, p.thickness, p.doubt),
            p.rounds,
        )
        normal = p.independent * (normal + np.triu(normal, 1).T)
        x, y, theta = (float(value) for value in pose)
        return Fit(Pose2D(x, y, wrap_angle(theta)), normal, fitted)
