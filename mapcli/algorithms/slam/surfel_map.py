"""The surfel map: lines through points, finer than cells, that poses are refined against.

Cells are too coarse for the last centimetre: their likelihood field knows a wall to half a cell
only. A `SurfelMap` keeps the mean and the spread of the points in each cell instead (Biber and
Strasser 2003), and fits a scan by the distances of its points to the lines through them
(point-to-line ICP, Censi 2008; see `_kernels.point_to_line_icp`).
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels import point_to_line_icp as icp
from mapcli.algorithms.slam._kernels import surfel_map as kernels
from mapcli.algorithms.slam._kernels.pose_chain import ChainEquations
from mapcli.algorithms.slam._kernels.sparse_grid import BORDER, SHIFT, SIDE, SparseGrid, Used
from mapcli.algorithms.slam.growing_array import grow_interval, map_too_large
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.se2_uncertainty import (
    UNKNOWN,
    AxisDeviations,
    InformationMatrix,
    information_in_own_frame,
)

START, START_TILES = 1 << 10, 1 << 7
"""Cells, and tiles of cells, that a new map has room for."""

SCANS_AT_ONCE = 200
"""Scans that one processor fits before it looks for more."""

SHORTEST_RAY = 1e-6
"""Metres; a point that is where the laser is is seen from anywhere."""

MOST_TILES = 1 << 22
"""16 MB of directory: what 1 km x 1 km at 3 cm would take."""

THICKNESS = 0.015
"""Metres: how well a point tells where a wall is, at best. It is what lasers err by, and
keeps the information of few points on a line finite."""

BEAM_WIDTH = 0.007
"""Radians: lasers on robots send beams of 0.25 to 0.75 degrees."""

BEARING_VARIANCE = BEAM_WIDTH**2 / 12
"""Squared radians: of where in its width a beam was reflected, as likely here as there. It makes
ends uncertain across a wall by 2 mm for each metre that the beam runs along it."""

INDEPENDENT_SHARE = 0.3
"""Of a scan's points, those that count as evidence of their own: errors of neighbouring beams are
alike, so information would be too large if every point counted."""

SQUARED_PREDICTION_SCALE = 9.0
"""Squared standard deviations at which the weight of the prediction has fallen to a quarter: at
three of them odometry is likely to have failed."""

NOT_KNOWN = UNKNOWN.along_axes()


class ScanFit(NamedTuple):
    """A scan's pose, fitted to surfels.

    Attributes:
        pose: of the robot in the map.
        information: on it, in the map's axes, from the scan's points alone.
        matched: how many points have a surfel near them.
    """

    pose: Pose2D
    information: InformationMatrix
    matched: int

    def information_in_own_frame(self) -> InformationMatrix:
        """The same ahead, to the left and in turning, of the fitted pose itself."""
        return information_in_own_frame(self.information, self.pose.theta)


class SurfelMap:
    """Surfels of the points that were added (stateful: `add` changes it).

    Attributes:
        cell: metres along a side of a cell.
    """

    def __init__(self, cell: float) -> None:
        self.cell = cell
        self._used: Used = 1, 1  # the first tile and the first slot are the empty ones
        tiles = np.zeros((START_TILES, SIDE, SIDE), np.int32)
        grid = SparseGrid(np.zeros((0, 0), np.int32), (0, 0), tiles)
        moments = np.zeros((START, 10))
        moments[0, [kernels.MEAN_X, kernels.MEAN_Y]] = kernels.NOWHERE
        self._table = _table_of(grid, moments, cell)

    @property
    def table(self) -> kernels.SurfelTable:
        """The surfels as kernels take them, until more points are added."""
        return self._table

    def add(self, points: NDArray[np.float64], laser: NDArray[np.float64] | None = None) -> None:
        """Add ends of beams, shape (n, 2), metres in the map.

        Args:
            laser: shape (2,), where the beams start; None if walls are known without a scan, and
                may be seen from either side.

        Raises:
            DataError: they are absurdly far apart.
        """
        done, rays = 0, np.zeros_like(points) if laser is None else points - laser
        rays /= np.maximum(np.hypot(rays[:, 0], rays[:, 1]), SHORTEST_RAY)[:, None]
        while done < len(points):
            done, self._used = kernels.add_points(self._table, self._used, points, rays, done)
            if done < len(points):
                self._make_room(points[done:])
        self._table.states[: self._used[1]] = kernels.STALE

    def _make_room(self, points: NDArray[np.float64]) -> None:
        """Have room for points, the first of which there is no room for."""
        grid, moments = self._table.grid, self._table.moments
        tiles, slots = self._used
        if tiles == len(grid.tiles):
            self._table = self._table._replace(grid=grid._replace(tiles=_twice(grid.tiles)))
        if slots == len(moments):
            self._table = _table_of(self._table.grid, _twice(moments), self.cell)
        cells = np.floor([points.min(axis=0) / self.cell, points.max(axis=0) / self.cell])
        low, high = ([int(end) >> SHIFT for end in ends] for ends in cells.tolist())
        self._hold(low, high)

    def _hold(self, low: list[int], high: list[int]) -> None:
        """Make the directory hold the tiles from `low` to `high`, each (u, v), and its border."""
        grid = self._table.grid
        (rows, columns), (u, v) = grid.directory.shape, grid.corner
        left, right = grow_interval(low[0] - BORDER, high[0] + BORDER, u, columns, BORDER)
        bottom, top = grow_interval(low[1] - BORDER, high[1] + BORDER, v, rows, BORDER)
        shape = top - bottom + 1, right - left + 1
        if shape == (rows, columns):
            return
        if shape[0] * shape[1] > MOST_TILES:
            raise map_too_large(SIDE * self.cell * np.array([shape[1], shape[0]]))
        directory = np.zeros(shape, np.int32)
        held = np.s_[v - bottom : v - bottom + rows, u - left : u - left + columns]
        directory[held] = grid.directory
        grid = grid._replace(directory=directory, corner=(left, bottom))
        self._table = self._table._replace(grid=grid)

    def fit(
        self,
        points: NDArray[np.float64],
        start: Pose2D,
        predicted: Pose2D | None = None,
        deviations: AxisDeviations = NOT_KNOWN,
        bearing_variance: float = 0.0,
    ) -> ScanFit:
        """The pose near `start` at which points lie on surfels.

        Args:
            points: shape (n, 2), metres in the robot's frame.
            predicted: the pose that odometry says; it decides where the surfels do not.
            deviations: how far off that may be, in its own frame.
            bearing_variance: of a point seen from the robot, rad^2.
        """
        guess = predicted or start
        # Headings on the same turn of the circle.
        heading = start.theta + wrap_angle(guess.theta - start.theta)
        strength = 1 / INDEPENDENT_SHARE  # of the prediction beside points that are weaker by it
        weights = (*deviations.weights(strength), SQUARED_PREDICTION_SCALE * strength)
        (x, y, theta), upper, matched = icp.fit_scan(
            self._table,
            points,
            np.empty(len(points), np.int64),
            (float(start.x), float(start.y), float(start.theta)),
            (float(guess.x), float(guess.y), heading),
            weights,
            bearing_variance,
        )
        xx, xy, xt, yy, yt, tt = (INDEPENDENT_SHARE * entry for entry in upper)
        information = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
        return ScanFit(Pose2D(x, y, wrap_angle(theta)), information, matched)

    def add_scans(
        self,
        scans: list[NDArray[np.float32]],
        poses: NDArray[np.float64],
        equations: ChainEquations,
    ) -> None:
        """Add what scans, points of shape (n, 2) each, say of their poses, shape (scans, 3), to the
        normal equations of these.

        It is done on all processors, each scan by itself, so that the result is always the same.
        """
        kernels.update_all(self._table, self._used[1])
        bounds = np.cumsum([0, *(len(scan) for scan in scans)])
        points = np.concatenate(scans).astype(np.float64)
        correspondences = np.empty(len(points), np.int64)

        def add(first: int) -> None:
            end = min(first + SCANS_AT_ONCE, len(scans))
            rows = slice(3 * first, 3 * end)
            part = ChainEquations(equations.matrix[rows], equations.right[rows])
            some, own = bounds[first : end + 1], poses[first:end]
            icp.add_scans(self._table, points, some, correspondences, BEARING_VARIANCE, own, part)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(add, range(0, len(scans), SCANS_AT_ONCE)))


def _table_of(grid: SparseGrid, moments: NDArray[np.float64], cell: float) -> kernels.SurfelTable:
    """A table with these cells, whose surfels are all still to be made."""
    slots = len(moments)
    return kernels.SurfelTable(
        grid, moments, np.zeros((slots, 7)), np.zeros(slots, np.int8), cell, THICKNESS
    )


def _twice(table: NDArray[Any]) -> NDArray[Any]:
    """A table with twice as many rows, the new ones 0."""
    longer = np.zeros((2 * len(table), *table.shape[1:]), table.dtype)
    longer[: len(table)] = table
    return longer
