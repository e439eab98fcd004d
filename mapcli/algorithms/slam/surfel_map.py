"""Where walls are, finer than cells: what poses are refined against.

Cells are too coarse for the last centimetre: their likelihood field knows a wall to half a cell
only. A `SurfelMap` keeps the mean and the spread of the points in each cell instead, and fits a
scan by the distances of its points to the lines through them (point-to-line matching, Censi 2008;
cells with their distributions, Biber and Strasser 2003).
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels import surfel_map as kernels
from mapcli.algorithms.slam._kernels.point_to_line_icp import fit_scans
from mapcli.algorithms.slam._kernels.sparse_grid import BORDER, SHIFT, SIDE
from mapcli.algorithms.slam.growing_array import grown, too_large
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.se2_uncertainty import (
    UNKNOWN,
    InformationMatrix,
    StandardDeviations,
    information_in_own_frame,
)

START, START_TILES = 1 << 10, 1 << 7
"""Cells, and tiles of cells, that a new map has room for."""

SCANS_AT_ONCE = 200
"""Scans that one processor fits before it looks for more."""

MOST_TILES = 1 << 22
"""16 MB of directory: what 1 km x 1 km at 3 cm would take."""


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
    information: InformationMatrix
    fitted: int

    def in_own_frame(self) -> InformationMatrix:
        """The information ahead, to the left and in turning, of the fitted pose itself."""
        return information_in_own_frame(self.information, self.pose.theta)


class SurfelMap:
    """The walls as points left them (stateful: `add` changes it)."""

    def __init__(self, cell: float, parameters: SurfelParameters | None = None) -> None:
        self.cell, self.parameters = cell, parameters or SurfelParameters()
        self._used = 1, 1  # of tiles and slots; the first of both are the empty ones
        self._directory, self._corner = np.zeros((0, 0), np.int32), (0, 0)
        self._tiles = np.zeros((START_TILES, SIDE, SIDE), np.int32)
        self._sums = np.zeros((START, 8))
        self._sums[0, 6:] = kernels.NOWHERE
        self._surfels = np.zeros((START, 5))
        self._states = np.zeros(START, np.int8)

    def add(self, points: NDArray[np.float64]) -> None:
        """Add ends of beams, shape (n, 2), metres in the world.

        Raises:
            DataError: they are absurdly far apart.
        """
        done = 0
        while done < len(points):
            done, self._used = kernels.add_points(
                self._table(), self._used, points, done, self.cell
            )
            if done < len(points):
                self._make_room(points[done:])
        self._states[: self._used[1]] = kernels.STALE

    def _make_room(self, points: NDArray[np.float64]) -> None:
        """Have room for points, the first of which there is no room for."""
        n_tiles, n_slots = self._used
        if n_tiles == len(self._tiles):
            self._tiles = _twice(self._tiles)
        if n_slots == len(self._sums):
            self._sums = _twice(self._sums)
            self._surfels = np.zeros((len(self._sums), 5))
            self._states = np.zeros(len(self._sums), np.int8)
        cells = np.floor([points.min(axis=0) / self.cell, points.max(axis=0) / self.cell])
        low, high = ([int(end) >> SHIFT for end in ends] for ends in cells.tolist())
        self._hold(low, high)

    def _hold(self, low: list[int], high: list[int]) -> None:
        """Make the directory hold the tiles from `low` to `high`, each (u, v), and its border."""
        (rows, columns), (u, v) = self._directory.shape, self._corner
        left, right = grown(low[0] - BORDER, high[0] + BORDER, u, columns, BORDER)
        bottom, top = grown(low[1] - BORDER, high[1] + BORDER, v, rows, BORDER)
        shape = top - bottom + 1, right - left + 1
        if shape == (rows, columns):
            return
        if shape[0] * shape[1] > MOST_TILES:
            raise too_large(SIDE * self.cell * np.array([shape[1], shape[0]]))
        directory = np.zeros(shape, np.int32)
        held = np.s_[v - bottom : v - bottom + rows, u - left : u - left + columns]
        directory[held] = self._directory
        self._directory, self._corner = directory, (left, bottom)

    def fit(
        self,
        points: NDArray[np.float64],
        start: Pose2D,
        predicted: Pose2D | None = None,
        deviations: StandardDeviations = UNKNOWN,
    ) -> Fit:
        """The pose near `start` at which points lie on the walls.

        Args:
            points: shape (n, 2), metres in the robot's frame.
            predicted: what odometry says; it decides where the walls do not.
            deviations: how far off that may be: metres, radians.
        """
        guess = predicted or start
        # Headings on the same turn of the circle.
        heading = start.theta + wrap_angle(guess.theta - start.theta)
        pose, matrix, fitted = self._fit(
            points,
            np.array([0, len(points)]),
            np.array([[start.x, start.y, start.theta]], np.float64),
            np.array([[guess.x, guess.y, heading]], np.float64),
            deviations,
        )
        ((x, y, theta),) = pose.tolist()
        ((xx, xy, xt, yy, yt, tt),) = matrix.tolist()
        information = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
        return Fit(Pose2D(x, y, wrap_angle(theta)), information, int(fitted[0]))

    def fit_each(
        self, scans: list[NDArray[np.float32]], starts: list[Pose2D]
    ) -> list[tuple[Pose2D, int]]:
        """What `fit` finds for each of many scans, without a prediction: pose and `fitted`.

        Scans are fitted on all processors, each by itself, so that the result is always the same.
        """
        kernels.renew_all(self._table(), self._used[1], self.cell, self.parameters.thickness)
        n = SCANS_AT_ONCE
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            fits = pool.map(
                lambda first: self._fit_some(scans[first : first + n], starts[first : first + n]),
                range(0, len(scans), n),
            )
            return [fit for some in fits for fit in some]

    def _fit_some(
        self, scans: list[NDArray[np.float32]], starts: list[Pose2D]
    ) -> list[tuple[Pose2D, int]]:
        begin = np.array([(pose.x, pose.y, pose.theta) for pose in starts], np.float64)
        points = np.concatenate(scans).astype(np.float64)
        bounds = np.cumsum([0, *(len(scan) for scan in scans)])
        poses, _, fitted = self._fit(points, bounds, begin, begin.copy(), UNKNOWN)
        return [
            (Pose2D(x, y, wrap_angle(theta)), n)
            for (x, y, theta), n in zip(poses.tolist(), fitted.tolist(), strict=True)
        ]

    def _table(self) -> kernels.Table:
        return (
            self._directory, self._corner, self._tiles,
            self._sums, self._surfels, self._states,
        )  # fmt: skip

    def _fit(
        self,
        points: NDArray[np.float64],
        bounds: NDArray[np.int64],
        poses: NDArray[np.float64],
        predicted: NDArray[np.float64],
        deviations: StandardDeviations,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
        """Fit scans, see `fit_scans`: poses, upper triangles of information, points at walls."""
        p, scans = self.parameters, len(poses)
        share = 1 / p.independent
        systems, fitted = np.empty((scans, 6)), np.empty(scans, np.int64)
        fit_scans(
            self._table(),
            points,
            bounds,
            poses,
            predicted,
            (share / deviations.xy**2, share / deviations.theta**2, p.knee * share),
            (self.cell, p.thickness, p.doubt),
            p.rounds,
            np.empty(len(points), np.int64),
            systems,
            fitted,
        )
        return poses, p.independent * systems, fitted


def _twice(table: NDArray[Any]) -> NDArray[Any]:
    """A table with twice as many rows, the new ones 0."""
    longer = np.zeros((2 * len(table), *table.shape[1:]), table.dtype)
    longer[: len(table)] = table
    return longer
