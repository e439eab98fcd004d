"""The current map of Algorithm 9.2: log-odds that grow with what the robot sees.

Log-odds are kept in whole counts (`log_odds`), 0 meaning unknown. A hit is worth more than three
passes: a laser seldom reports a wall that is not there, while beams that graze a wall pass through
its cells again and again. The limits keep a cell from being so sure that it can never change.

Beside the map live its likelihood field (`likelihood`) and the walls finer than cells (`surfels`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam._kernels.likelihood_field import (
    interpolate_gaps,
    update_likelihood_field,
)
from mapcli.algorithms.slam._kernels.ray_tracing import FAR, integrate_beams, place_beams
from mapcli.algorithms.slam.growing_array import grow_interval, map_too_large
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS, build_pyramid, gaussian_kernel
from mapcli.algorithms.slam.log_odds import log_odds_from_probabilities, probability_by_count
from mapcli.algorithms.slam.surfel_map import SurfelMap
from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D, wrap_angle

BLOCK = 256
"""The array grows by whole blocks of cells."""

MARGIN = 32
"""Cells around everything that is covered, for the field's Gaussians and the coarsest level."""

NOTHING = FAR, FAR, -FAR, -FAR
"""A box that holds no cell."""

MAX_CELLS = 400_000_000
"""2 GB of map: 1 km x 1 km at 5 cm. Beyond that something is wrong with the log."""


@dataclass(frozen=True)
class MapParameters:
    """How the map is made.

    Attributes:
        resolution: metres per cell.
        hit, miss: what a beam's end adds, what a beam passing takes, in units of log-odds.
        highest, lowest: the limits of a cell.
        blur: standard deviation of the likelihood field around a wall, metres; at least a cell.

    Raises:
        DataError: a resolution finer than a millimetre or coarser than 100 m.
    """

    resolution: float = 0.05
    hit: int = 85
    miss: int = 25
    highest: int = 1000
    lowest: int = -500
    blur: float = 0.05

    def __post_init__(self) -> None:
        if not 0.001 <= self.resolution <= 100:
            raise DataError(
                f"resolution {self.resolution:g}", expected="0.001 to 100 metres per cell"
            )

    def gaussian_kernel(self) -> NDArray[np.uint8]:
        """The likelihood field around one wall cell, shape (2 r + 1, 2 r + 1)."""
        return gaussian_kernel(max(self.blur / self.resolution, 1.0))


class OccupancyGrid:
    """The map while it is being made (stateful: `extend_to` and `integrate` change it).

    Attributes:
        log_odds: shape (rows, columns), int16, bottom-up: `[v, u]`, u along x and v along y.
        pyramid: shape (levels, rows, columns), uint8, the likelihood field and its bounds.
    """

    def __init__(self, parameters: MapParameters | None = None) -> None:
        self.parameters = parameters or MapParameters()
        self.log_odds = np.zeros((0, 0), dtype=np.int16)
        self.pyramid = np.zeros((len(LEVEL_WIDTHS), 0, 0), dtype=np.uint8)
        self.surfels = SurfelMap(self.parameters.resolution)
        self._gaussian = self.parameters.gaussian_kernel()
        self._u0 = self._v0 = 0
        self._base = np.zeros(2)  # where cell (0, 0) would be, in the world
        self._edge = MARGIN + len(self._gaussian)
        self._written = NOTHING  # lowest and highest (u, v); cell (0, 0) is at the base
        self._touched = self._changed = np.empty(0, dtype=np.int64)

    @classmethod
    def from_grid_map(cls, known: GridMap, parameters: MapParameters) -> OccupancyGrid:
        """A map to go on from.

        Raises:
            DataError: a map whose origin has a yaw, or one without a wall.
        """
        if known.origin.theta:
            raise DataError(
                f"the origin's yaw is {math.degrees(known.origin.theta):g} deg",
                expected="0, which `mapcli transform --bake-yaw` makes it",
            )
        grid = cls(replace(parameters, resolution=known.resolution))
        grid._base = np.array([known.origin.x, known.origin.y])
        size = np.array([known.columns, known.rows]) * known.resolution
        grid.extend_to(grid._base, grid._base + size)
        rows, columns = (
            slice(-grid._v0, known.rows - grid._v0),
            slice(-grid._u0, known.columns - grid._u0),
        )
        grid.log_odds[rows, columns] = log_odds_from_probabilities(
            known.cells[::-1], parameters.lowest, parameters.highest
        )
        grid._written = 0, 0, known.columns - 1, known.rows - 1
        walls = np.argwhere(grid.log_odds > 0)
        if not len(walls):
            raise DataError("no occupied cell", expected="a map with walls")
        grid.build_likelihood_field()
        corner = np.array([grid._u0, grid._v0]) + 0.5
        grid.surfels.add((walls[:, ::-1] + corner) * known.resolution + grid._base)
        return grid

    def to_cells(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """World points, shape (n, 2), as (u, v) in cells of the array."""
        corner = np.array([self._u0, self._v0], np.float64)
        return (points - self._base) / self.parameters.resolution - corner

    def pose_to_cells(self, pose: Pose2D) -> NDArray[np.float64]:
        """(u, v, theta) of a world pose."""
        return np.array([*self._at(pose), pose.theta])

    def _at(self, pose: Pose2D) -> tuple[float, float]:
        scale, (x, y) = self.parameters.resolution, self._base.tolist()
        return (pose.x - x) / scale - self._u0, (pose.y - y) / scale - self._v0

    def pose_from_cells(self, cells: NDArray[np.float64]) -> Pose2D:
        """The world pose of (u, v, theta)."""
        scale, (x, y) = self.parameters.resolution, self._base.tolist()
        u, v, theta = (float(value) for value in cells)
        return Pose2D((u + self._u0) * scale + x, (v + self._v0) * scale + y, wrap_angle(theta))

    def contains_circle(self, centre: Pose2D, radius: float) -> bool:
        """Whether the array holds a circle, metres, as `extend_to` would have it."""
        edge, reach = self._edge + 1, radius / self.parameters.resolution
        (u, v), (rows, columns) = self._at(centre), self.log_odds.shape
        return min(u, v) - reach >= edge and u + reach < columns - edge and v + reach < rows - edge

    def extend_to(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
        """Make the array hold the world rectangle from `low` to `high`, each (x, y), metres.

        Raises:
            DataError: the map would become absurdly large.
        """
        scale = self.parameters.resolution
        if max(high - low) / scale > MAX_CELLS:
            raise map_too_large(high - low)
        self._extend_to_cells(
            [math.floor(value / scale) for value in low - self._base],
            [math.floor(value / scale) for value in high - self._base],
        )

    def _extend_to_cells(self, low: list[int], high: list[int]) -> None:
        """Make the array hold the cells from `low` to `high`, each (u, v) from the base."""
        (rows, columns), edge = self.log_odds.shape, self._edge
        first_u, last_u = grow_interval(low[0] - edge, high[0] + edge, self._u0, columns, BLOCK)
        first_v, last_v = grow_interval(low[1] - edge, high[1] + edge, self._v0, rows, BLOCK)
        u, v = first_u // BLOCK * BLOCK, first_v // BLOCK * BLOCK
        blocks = (last_u - u) // BLOCK + 1, (last_v - v) // BLOCK + 1
        if (u, v, blocks) != (self._u0, self._v0, (columns // BLOCK, rows // BLOCK)):
            self._move_to(u, v, blocks[0] * BLOCK, blocks[1] * BLOCK)

    def _move_to(self, u0: int, v0: int, columns: int, rows: int) -> None:
        if rows * columns > MAX_CELLS:
            raise map_too_large(np.array([columns, rows]) * self.parameters.resolution)
        log_odds = np.zeros((rows, columns), dtype=np.int16)
        pyramid = np.zeros((len(LEVEL_WIDTHS), rows, columns), dtype=np.uint8)
        # Memory that is never touched costs nothing, so no more is copied than has been written.
        old = self._written_part(self._u0, self._v0)
        new = self._written_part(u0, v0)
        log_odds[new], pyramid[:, *new] = self.log_odds[old], self.pyramid[:, *old]
        self.log_odds, self.pyramid = log_odds, pyramid
        self._u0, self._v0 = u0, v0

    def _written_part(self, u0: int, v0: int) -> tuple[slice, slice]:
        """The rows and columns, in an array that begins at a cell, that may have been written."""
        if self._written == NOTHING:
            return slice(0), slice(0)
        low_u, low_v, high_u, high_v = self._written
        edge = self._edge
        return (
            slice(low_v - edge - v0, high_v + edge + 1 - v0),
            slice(low_u - edge - u0, high_u + edge + 1 - u0),
        )

    def integrate(self, pose: Pose2D, perception: Perception, *, update_field: bool = True) -> None:
        """Line 10 of Algorithm 9.2: write what was perceived at a world pose into the map.

        Without `update_field`, the likelihood field stays behind until `build_likelihood_field`
        and `interpolate_gaps` are called, which is cheaper for a map that is made first and
        searched afterwards, or never.
        """
        beams, hits = perception.beams(), len(perception.hits)
        if len(beams) == 1:
            return
        ends, cells, touched = self._place(pose, beams)
        self.surfels.add(ends[:hits])
        changed = self._write(cells, hits, touched)
        if update_field:
            update_likelihood_field(
                self.pyramid, LEVEL_WIDTHS, self.log_odds, changed, self._gaussian
            )
            self._interpolate_gaps(cells[:hits])

    def interpolate_gaps(self, pose: Pose2D, perception: Perception) -> None:
        """Raise the field along walls that a scan shows with gaps, see `interpolate_gaps`."""
        self._interpolate_gaps(self.to_cells(pose.apply(perception.hits)))

    def _interpolate_gaps(self, ends: NDArray[np.float64]) -> None:
        interpolate_gaps(self.pyramid, LEVEL_WIDTHS, self.log_odds, ends, self._gaussian)

    def _place(
        self, pose: Pose2D, beams: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
        """Beams in the world and in cells of the array, which is made to hold them, and how many
        cells they touch at most."""
        ends, cells, box = np.empty_like(beams), np.empty_like(beams), np.empty(4, np.int64)
        x, y = self._base.tolist()
        at, frame = (pose.x, pose.y, pose.theta), (x, y, self.parameters.resolution)
        touched = place_beams(beams, at, frame, ends, cells, box)
        self._write_within(*box.tolist())
        cells -= (self._u0, self._v0)
        return ends, cells, touched

    def _write_within(self, low_u: int, low_v: int, high_u: int, high_v: int) -> None:
        """Make the array hold cells that will be written; most often they are not the first."""
        was = self._written
        if low_u < was[0] or low_v < was[1] or high_u > was[2] or high_v > was[3]:
            self._extend_to_cells([low_u, low_v], [high_u, high_v])
            low = min(was[0], low_u), min(was[1], low_v)
            self._written = *low, max(was[2], high_u), max(was[3], high_v)

    def _write(self, beams: NDArray[np.float64], hits: int, touched: int) -> NDArray[np.int64]:
        """Write beams into the log-odds; the numbers of the cells that matter to the field."""
        p = self.parameters
        if len(self._changed) < touched:
            self._touched, self._changed = (np.empty(2 * touched, np.int64) for _ in range(2))
        rules = p.hit, p.miss, p.highest, p.lowest
        count = integrate_beams(
            self.log_odds.reshape(-1), self.pyramid[0].reshape(-1), self.log_odds.shape[1],
            beams, hits, rules, self._touched, self._changed,
        )  # fmt: skip
        return self._changed[:count]

    def build_likelihood_field(self) -> None:
        """Make the likelihood field of all walls at once, where there is none yet."""
        build_pyramid(self.pyramid, self.log_odds, self._gaussian)

    def to_grid_map(self) -> GridMap:
        """The obstacle probabilities, cropped to what is known and two cells around it."""
        p = self.parameters
        known = self.log_odds != 0
        rows, columns = (np.flatnonzero(known.any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            return GridMap(np.full((1, 1), np.nan, dtype=np.float32), p.resolution)
        # MARGIN cells around everything known are in the array, so two always are.
        v, u = int(rows[0]) - 2, int(columns[0]) - 2
        part = self.log_odds[v : rows[-1] + 3, u : columns[-1] + 3]
        table = probability_by_count(p.lowest, p.highest)
        # Whole cells times the resolution, without the last bit's noise.
        corner = (
            round((self._u0 + u) * p.resolution + float(self._base[0]), 9),
            round((self._v0 + v) * p.resolution + float(self._base[1]), 9),
        )
        return GridMap.from_bottom_up(table[part - p.lowest], p.resolution, corner)
