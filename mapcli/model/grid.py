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

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapcli.errors import DataError
from mapcli.model.pose import FARTHEST_M, Pose2D

UNKNOWN = np.float32(np.nan)
"""The content of a cell that has not been explored (`?` in text, 205 in a trinary PGM)."""

FAR = 2.0**40
"""Cells; no map reaches as far."""

OCCUPIED_THRESHOLD = 0.5
"""Known cells are occupied from this probability on, and free below it (Sect. 9.2)."""

UNKNOWN_PERCENT = 255
"""The same in a map that is kept as percents."""

PROBABILITIES = np.where(np.arange(256) <= 100, np.arange(256), np.nan).astype(np.float32) / (
    np.float32(100)
)
"""Percent -> probability, shape (256,); unknown from 101 on."""

BAND_CELLS = 4_000_000
"""Cells that large maps are worked through at a time."""

FINEST_M = 1e-9
"""Cells that are smaller are taken for damage, as are those beyond `FARTHEST_M`."""


@dataclass(frozen=True, eq=False)
class GridMap:
    """Obstacle probabilities in [0, 1], or NaN where unknown, with their place in the world.

    Maps from images are kept as whole percents, a byte a cell as in ROS's OccupancyGrid, so that
    maps of 20,000 x 20,000 cells fit into memory. `cells` are the probabilities in either case;
    what shall work on such maps asks `part`, `tally`, `each` instead.

    Attributes:
        stored: shape (rows, columns), float32 probabilities or uint8 percents, of which
            UNKNOWN_PERCENT is unknown. Treated as read-only.
        resolution: metres per cell, positive.
        origin: pose of the outer corner of the bottom-left cell.

    Raises:
        DataError: not two-dimensional, empty, a probability outside [0, 1], a resolution that
            is not positive or an origin that is not finite.
    """

    stored: NDArray[Any]
    resolution: float = 1.0
    origin: Pose2D = field(default_factory=Pose2D)

    def __post_init__(self) -> None:
        stored = np.asarray(self.stored)
        stored = stored if stored.dtype == np.uint8 else np.asarray(stored, dtype=np.float32)
        object.__setattr__(self, "stored", stored)
        if stored.ndim != 2 or stored.size == 0:
            raise DataError(f"a map of shape {stored.shape}", expected="rows and columns of cells")
        bad = _no_percent(stored) if stored.dtype == np.uint8 else _no_probability(stored)
        if bad is not None:
            raise DataError(
                f"a cell holds {bad:g}", expected="an obstacle probability from 0 to 1, or unknown"
            )
        if not (np.isfinite(self.resolution) and self.resolution > 0):
            raise DataError(
                f"resolution {self.resolution:g}", expected="metres per cell, more than 0"
            )
        if not FINEST_M <= self.resolution <= FARTHEST_M:
            raise DataError(
                f"resolution {self.resolution:g}",
                expected=f"{FINEST_M:g} to {FARTHEST_M:g} metres per cell",
            )
        place = np.array([self.origin.x, self.origin.y, self.origin.theta])
        if not np.isfinite(place).all():
            raise DataError("origin is not finite", expected="x, y, yaw")
        if not (np.abs(place) <= FARTHEST_M).all():
            raise DataError(
                f"origin is {self.origin.x:g}, {self.origin.y:g}, {self.origin.theta:g}",
                expected=f"x, y, yaw of at most {FARTHEST_M:g}",
            )

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

    @cached_property
    def cells(self) -> NDArray[np.float32]:
        """The probabilities, shape (rows, columns), float32. Treated as read-only."""
        percents = self.stored.dtype == np.uint8
        cells: NDArray[np.float32] = PROBABILITIES[self.stored] if percents else self.stored
        return cells

    @property
    def rows(self) -> int:
        return int(self.stored.shape[0])

    @property
    def columns(self) -> int:
        return int(self.stored.shape[1])

    @property
    def known(self) -> NDArray[np.bool_]:
        """Where something is known, shape (rows, columns)."""
        return self.each(lambda cells: ~np.isnan(cells))

    def each(self, function: Callable[[NDArray[np.float32]], NDArray[Any]]) -> NDArray[Any]:
        """`function` of every cell, shape (rows, columns).

        Args:
            function: takes probabilities of any shape and gives something for each of them.
        """
        if self.stored.dtype == np.uint8:
            values: NDArray[Any] = function(PROBABILITIES)[self.stored]
            return values
        return function(self.stored)

    def bands(self) -> Iterator[GridMap]:
        """The map in bands of some rows, from the top."""
        for rows in bands(self.rows, self.columns):
            yield replace(self, stored=self.stored[rows])

    @cached_property
    def _percents(self) -> NDArray[np.int64]:
        """How many cells have each percent, shape (256,)."""
        return sum(
            (histogram(self.stored[rows]) for rows in bands(self.rows, self.columns)),
            start=np.zeros(256, dtype=np.int64),
        )

    def tally(self) -> Iterator[tuple[NDArray[np.float32], NDArray[np.int64]]]:
        """Probabilities, and how many cells have each, in arrays of the same length."""
        if self.stored.dtype == np.uint8:
            yield PROBABILITIES, self._percents
            return
        for rows in bands(self.rows, self.columns):
            band = self.stored[rows].ravel()
            yield band, np.ones(band.size, dtype=np.int64)

    def count(self, function: Callable[[NDArray[np.float32]], NDArray[np.bool_]]) -> int:
        """How many cells `function` is true of (see `each`)."""
        return sum(int(counts[function(cells)].sum()) for cells, counts in self.tally())

    def replaced(self, cells: NDArray[np.float32] | NDArray[np.uint8]) -> GridMap:
        """The same place with other cells, probabilities or percents."""
        return replace(self, stored=cells)

    def part(self, top: int, left: int, bottom: int, right: int) -> GridMap:
        """The rows from `top` to before `bottom` and the columns from `left` to before `right`,
        each cell where it was in the world."""
        corner = Pose2D(left * self.resolution, (self.rows - bottom) * self.resolution)
        placed = self.origin.compose(corner)
        # Less than a nanometre is rounding noise: people read -0.8, not -0.8000000000000007.
        origin = Pose2D(round(placed.x, 9), round(placed.y, 9), self.origin.theta)
        return GridMap(self.stored[top:bottom, left:right], self.resolution, origin)

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


def all_unknown(grid: GridMap) -> GridMap:
    """A map of the same place of which nothing is known; it takes no memory."""
    nothing = np.uint8(UNKNOWN_PERCENT) if grid.stored.dtype == np.uint8 else UNKNOWN
    return replace(grid, stored=np.broadcast_to(nothing, grid.stored.shape))


def crop_to_known(grid: GridMap, margin: int = 0) -> GridMap:
    """The smallest part of the map that holds every known cell, with `margin` unknown cells
    around it where the map has them. A map without known cells stays as it is."""
    known = grid.known
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if rows.size == 0:
        return grid
    return grid.part(
        max(int(rows[0]) - margin, 0),
        max(int(columns[0]) - margin, 0),
        min(int(rows[-1]) + margin + 1, grid.rows),
        min(int(columns[-1]) + margin + 1, grid.columns),
    )


def bands(rows: int, columns: int) -> Iterator[slice]:
    """Slices of rows that together are all of them, with about BAND_CELLS cells in each."""
    step = max(BAND_CELLS // max(columns, 1), 1)
    for first in range(0, rows, step):
        yield slice(first, min(first + step, rows))


def histogram(values: NDArray[np.uint8]) -> NDArray[np.int64]:
    """How often each byte occurs, shape (256,). Two at a time: that is twice as fast."""
    flat = values.ravel()
    pairs = np.bincount(flat[: flat.size // 2 * 2].view(np.uint16), minlength=1 << 16)
    both = pairs.reshape(256, 256)
    counts: NDArray[np.int64] = both.sum(axis=0) + both.sum(axis=1)
    if flat.size % 2:
        counts[flat[-1]] += 1
    return counts


def _no_probability(cells: NDArray[np.float32]) -> float | None:
    """A cell that is no probability, or None."""
    low, high = np.fmin.reduce(cells, axis=None), np.fmax.reduce(cells, axis=None)
    return float(low) if low < 0 else float(high) if high > 1 else None


def _no_percent(percents: NDArray[np.uint8]) -> float | None:
    """A cell, as a probability, that is neither a percent nor unknown, or None."""
    for rows in bands(*percents.shape):
        # One more turns unknown into 0, so that the largest one tells.
        if (percents[rows] + np.uint8(1)).max() > 101:
            return float(percents[(percents > 100) & (percents < UNKNOWN_PERCENT)][0]) / 100
    return None
