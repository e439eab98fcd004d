"""The grid map of Sect. 9.1 and 9.2, and THE place where its axes are defined.

Cells are printed and stored as in the book and in images: `cells[row, column]`, row 0 at the
top, column 0 at the left. The world has x to the right and y up. `origin = (x, y, yaw)` is the
pose of the outer corner of the bottom-left cell (ROS and Nav2), so with R(yaw) the rotation by
yaw, `n` the number of rows and `s` the resolution in metres per cell,

    centre of a cell   p     = R(yaw) . s . (column + 1/2,  n - row - 1/2)  +  (x, y)
    cell of a point    (u, v) = R(-yaw) . (p - (x, y)) / s
                       column = floor(u),   row = n - 1 - floor(v)

Nothing else in mapcli flips rows or rotates by yaw; everybody calls the functions below.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapcli.errors import DataError
from mapcli.model.pose import Pose2D

UNKNOWN = np.float32(np.nan)
"""The content of a cell that has not been explored (`?` in text, 205 in a trinary PGM)."""

FAR = 2.0**40
"""Cells; no map reaches as far."""


@dataclass(frozen=True, eq=False)
class GridMap:
    """Obstacle probabilities in [0, 1], or NaN where unknown, with their place in the world.

    Attributes:
        cells: shape (rows, columns), float32. Treated as read-only.
        resolution: metres per cell, positive.
        origin: pose of the outer corner of the bottom-left cell.

    Raises:
        DataError: not two-dimensional, empty, a probability outside [0, 1], a resolution that
            is not positive or an origin that is not finite.
    """

    cells: NDArray[np.float32]
    resolution: float = 1.0
    origin: Pose2D = field(default_factory=Pose2D)

    def __post_init__(self) -> None:
        cells = np.asarray(self.cells, dtype=np.float32)
        object.__setattr__(self, "cells", cells)
        if cells.ndim != 2 or cells.size == 0:
            raise DataError(f"a map of shape {cells.shape}", expected="rows and columns of cells")
        low, high = np.fmin.reduce(cells, axis=None), np.fmax.reduce(cells, axis=None)
        if low < 0 or high > 1:
            bad = low if low < 0 else high
            raise DataError(
                f"a cell holds {bad:g}", expected="an obstacle probability from 0 to 1, or unknown"
            )
        if not (np.isfinite(self.resolution) and self.resolution > 0):
            raise DataError(
                f"resolution {self.resolution:g}", expected="metres per cell, more than 0"
            )
        if not np.isfinite([self.origin.x, self.origin.y, self.origin.theta]).all():
            raise DataError("origin is not finite", expected="x, y, yaw")

    @classmethod
    def from_bottom_up(
        cls, cells: NDArray[np.float32], resolution: float, corner: tuple[float, float]
    ) -> GridMap:
        """A map from an array whose row 0 is the lowest y, as algorithms find handy.

        Args:
            cells: shape (rows, columns), `[v, u]` with u along x and v along y.
            corner: world x, y of the outer corner of `cells[0, 0]`.
        """
        return cls(cells[::-1], resolution, Pose2D(*corner))

    def bottom_up(self) -> NDArray[np.float32]:
        """The cells with the lowest y in row 0, as ROS's OccupancyGrid has them."""
        return self.cells[::-1]

    @property
    def rows(self) -> int:
        return int(self.cells.shape[0])

    @property
    def columns(self) -> int:
        return int(self.cells.shape[1])

    @property
    def known(self) -> NDArray[np.bool_]:
        """Where something is known, shape (rows, columns)."""
        return ~np.isnan(self.cells)

    def replaced(self, cells: NDArray[np.float32]) -> GridMap:
        """The same place with other cells."""
        return replace(self, cells=cells)

    def contains(self, row: int, column: int) -> bool:
        return 0 <= row < self.rows and 0 <= column < self.columns

    def world_of_cells(self, rows: ArrayLike, columns: ArrayLike) -> NDArray[np.float64]:
        """World points of the centres of cells, shape (n, 2), from arrays of n rows and columns.

        Fractions are allowed: row -0.5 is the upper edge of the top row.
        """
        u = np.asarray(columns, dtype=np.float64) + 0.5
        v = self.rows - np.asarray(rows, dtype=np.float64) - 0.5
        return self.origin.apply(np.column_stack([u, v]).reshape(-1, 2) * self.resolution)

    def fractional_cells_of_world(self, points: ArrayLike) -> NDArray[np.float64]:
        """(row, column) of world points, shape (n, 2), where whole numbers are cell centres."""
        local = self.origin.inverse().apply(np.asarray(points, dtype=np.float64).reshape(-1, 2))
        u, v = (local / self.resolution).T
        return np.column_stack([self.rows - v - 0.5, u - 0.5])

    def cells_of_world(self, points: ArrayLike) -> NDArray[np.int64]:
        """(row, column) of the cells that hold world points, shape (n, 2); may lie outside."""
        local = self.origin.inverse().apply(np.asarray(points, dtype=np.float64).reshape(-1, 2))
        # What is too far away for a whole number is outside all the same.
        u, v = np.floor(np.clip(local / self.resolution, -FAR, FAR)).astype(np.int64).T
        return np.column_stack([self.rows - 1 - v, u])


def crop_to_known(grid: GridMap, margin: int = 0) -> GridMap:
    """The smallest part of the map that holds every known cell, with `margin` unknown cells
    around it where the map has them. A map without known cells stays as it is."""
    known = grid.known
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if rows.size == 0:
        return grid
    top, bottom = max(rows[0] - margin, 0), min(rows[-1] + margin + 1, grid.rows)
    left, right = max(columns[0] - margin, 0), min(columns[-1] + margin + 1, grid.columns)
    corner = Pose2D(left * grid.resolution, (grid.rows - bottom) * grid.resolution)
    placed = grid.origin.compose(corner)
    # Less than a nanometre is rounding noise: people read -0.8, not -0.8000000000000007.
    origin = Pose2D(round(placed.x, 9), round(placed.y, 9), grid.origin.theta)
    return GridMap(grid.cells[top:bottom, left:right], grid.resolution, origin)
