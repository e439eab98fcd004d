"""The occupancy grid of Algorithm 9.2: log-odds that grow with what the robot sees.

Log-odds are kept in whole counts (`log_odds`), 0 meaning unknown. Beside them live the map's
likelihood field with its upper bounds (`likelihood_field`), for scan matching, and its surfels
(`surfel_map`), which are finer than cells.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam._kernels.likelihood_field import (
    interpolate_gaps,
    update_likelihood_field,
)
from mapcli.algorithms.slam._kernels.pose import Pose
from mapcli.algorithms.slam._kernels.ray_tracing import (
    NO_CELLS,
    Beams,
    CellBox,
    CellLists,
    GridFrame,
    ListLengths,
    MapLayers,
    integrate_beams,
    place_beams,
)
from mapcli.algorithms.slam.growing_array import grow_interval, map_too_large
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS, build_pyramid
from mapcli.algorithms.slam.log_odds import (
    log_odds_from_probabilities,
    probabilities_from_log_odds,
)
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.surfel_map import SurfelMap
from mapcli.errors import DataError
from mapcli.memory import require
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D, wrap_angle

BLOCK = 256
"""The array grows by whole blocks of cells."""

MARGIN = 32
"""Cells around everything that is covered, for the Gaussians and the pyramid's coarsest level."""

CELL_BYTES = 2 + len(LEVEL_WIDTHS)
"""Of log-odds and likelihood fields; surfels take memory where there are walls only."""

MAX_CELLS = 400_000_000
"""2 GB of map: 1 km x 1 km at 5 cm. Beyond that something is wrong with the log."""


class WrittenCells(NamedTuple):
    """The cells that a scan has hit, and those that it has passed, which were not open for certain
    before: indices, row * columns + column."""

    hit: NDArray[np.int64]
    passed: NDArray[np.int64]


class OccupancyGrid:
    """The map while it is being made (stateful: `extend_to` and `integrate` change it).

    Its frame is the map's; (u, v) are coordinates in cells of the arrays, u along x and v along y,
    which change whenever the arrays grow to the left or downwards.

    Attributes:
        log_odds: shape (rows, columns), int16 counts, bottom-up: `[v, u]`.
        pyramid: shape (levels, rows, columns), uint8: the likelihood field, and its upper bounds
            over squares of `LEVEL_WIDTHS` cells.
        surfels: local line fits of all hits.
    """

    def __init__(self, parameters: MapParameters | None = None) -> None:
        self.parameters = parameters or MapParameters()
        self.log_odds = np.zeros((0, 0), dtype=np.int16)
        self.pyramid = np.zeros((len(LEVEL_WIDTHS), 0, 0), dtype=np.uint8)
        self.surfels = SurfelMap(self.parameters.resolution)
        self._gaussian = self.parameters.gaussian_kernel()
        self._rules = self.parameters.log_odds_rules()
        # Cells are numbered from a fixed one, whose lower left corner is at `_origin`, metres; the
        # first of the arrays is (_u0, _v0).
        self._origin, self._u0, self._v0 = np.zeros(2), 0, 0
        self._edge = MARGIN + len(self._gaussian)
        self._written = NO_CELLS  # counted from the fixed cell
        self._lists = CellLists(np.empty(0, np.int64), np.empty(0, np.int64))

    @classmethod
    def from_grid_map(cls, known: GridMap, parameters: MapParameters) -> OccupancyGrid:
        """A known map, to be localised in and updated.

        Args:
            parameters: of the map, but for the resolution, which is that of `known`.

        Raises:
            DataError: a map whose origin has a yaw, or one without an occupied cell.
        """
        if known.origin.theta:
            raise DataError(
                f"the origin's yaw is {math.degrees(known.origin.theta):g} deg",
                expected="0: a map along the axes of its frame",
            )
        grid = cls(replace(parameters, resolution=known.resolution))
        grid._origin = np.array([known.origin.x, known.origin.y])
        size = np.array([known.columns, known.rows]) * known.resolution
        grid.extend_to(grid._origin, grid._origin + size)
        rows = slice(-grid._v0, known.rows - grid._v0)
        columns = slice(-grid._u0, known.columns - grid._u0)
        grid.log_odds[rows, columns] = log_odds_from_probabilities(known.cells[::-1])
        grid._written = CellBox(0, 0, known.columns - 1, known.rows - 1)
        occupied = np.argwhere(grid.log_odds > 0)
        if not len(occupied):
            raise DataError("no occupied cell", expected="a map with walls")
        grid.build_likelihood_field()
        corner = np.array([grid._u0, grid._v0]) + 0.5
        grid.surfels.add((occupied[:, ::-1] + corner) * known.resolution + grid._origin)
        return grid

    def to_cells(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points in the map's frame, shape (n, 2), metres, as (u, v) in cells."""
        corner = np.array([self._u0, self._v0], np.float64)
        return (points - self._origin) / self.parameters.resolution - corner

    def pose_to_cells(self, pose: Pose2D) -> NDArray[np.float64]:
        """(u, v, theta) of a pose in the map: in cells and radians."""
        return np.array([*self._at(pose), pose.theta])

    def _at(self, pose: Pose2D) -> tuple[float, float]:
        scale, (x, y) = self.parameters.resolution, self._origin.tolist()
        return (pose.x - x) / scale - self._u0, (pose.y - y) / scale - self._v0

    def pose_from_cells(self, cells: NDArray[np.float64]) -> Pose2D:
        """The pose in the map that has these (u, v, theta)."""
        scale, (x, y) = self.parameters.resolution, self._origin.tolist()
        u, v, theta = (float(value) for value in cells)
        return Pose2D((u + self._u0) * scale + x, (v + self._v0) * scale + y, wrap_angle(theta))

    def contains_circle(self, centre: Pose2D, radius: float) -> bool:
        """Whether the arrays hold a circle, metres, with the room around it that `extend_to`
        leaves."""
        edge, reach = self._edge + 1, radius / self.parameters.resolution
        (u, v), (rows, columns) = self._at(centre), self.log_odds.shape
        return min(u, v) - reach >= edge and u + reach < columns - edge and v + reach < rows - edge

    @property
    def reach(self) -> float:
        """Metres from the middle of what was written to its farther sides."""
        w, cell = self._written, self.parameters.resolution
        return cell * max(w.high_u - w.low_u, w.high_v - w.low_v, 0) / 2

    def extend_to(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
        """Make the arrays hold the rectangle from `low` to `high`, each (x, y), metres.

        Raises:
            DataError: the map would become absurdly large.
        """
        scale = self.parameters.resolution
        if max(high - low) / scale > MAX_CELLS:
            raise map_too_large(high - low)
        self._extend_to_cells(
            [math.floor(value / scale) for value in low - self._origin],
            [math.floor(value / scale) for value in high - self._origin],
        )

    def _extend_to_cells(self, low: list[int], high: list[int]) -> None:
        """Make the arrays hold the cells from `low` to `high`, counted from the fixed cell."""
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
        require(CELL_BYTES * rows * columns, f"a map of {columns:,} x {rows:,} cells")
        log_odds = np.zeros((rows, columns), dtype=np.int16)
        pyramid = np.zeros((len(LEVEL_WIDTHS), rows, columns), dtype=np.uint8)
        # Memory that is never touched costs nothing, so no more is copied than has been written.
        old = self._written_part(self._u0, self._v0)
        new = self._written_part(u0, v0)
        log_odds[new], pyramid[:, *new] = self.log_odds[old], self.pyramid[:, *old]
        self.log_odds, self.pyramid = log_odds, pyramid
        self._u0, self._v0 = u0, v0

    def _written_part(self, u0: int, v0: int) -> tuple[slice, slice]:
        """The rows and columns that may have been written, in arrays that begin at (u0, v0)."""
        if self._written == NO_CELLS:
            return slice(0), slice(0)
        low_u, low_v, high_u, high_v = self._written
        edge = self._edge
        return (
            slice(low_v - edge - v0, high_v + edge + 1 - v0),
            slice(low_u - edge - u0, high_u + edge + 1 - u0),
        )

    def integrate(
        self, pose: Pose2D, perception: Perception, *, update_field: bool = True
    ) -> WrittenCells:
        """Line 10 of Algorithm 9.2: m <- update(m, p, n), p perceived at the pose n in the map.

        Without `update_field`, the likelihood field stays behind until `build_likelihood_field`
        and `interpolate_gaps` are called, which is cheaper for a map that is made first and
        searched afterwards, or never. Readings of several sensors are written one by one, each
        from where it was taken.

        Returns:
            What was written, until the next scan is.
        """
        if perception.readings:
            parts = [
                WrittenCells(*map(np.copy, self.integrate(pose, one, update_field=update_field)))
                for one in perception.readings
            ]
            return WrittenCells(*map(np.concatenate, zip(*parts, strict=True)))
        points, hits = perception.beams(), len(perception.hits)
        if len(points) == 1:
            return WrittenCells(*(np.empty(0, np.int64) for _ in range(2)))
        ends, beams, max_touched = self._place(pose, points, hits)
        self.surfels.add(ends[:hits], ends[-1])
        lengths = self._write(beams, max_touched)
        if update_field:
            changed = self._lists.changed[: lengths.changed]
            update_likelihood_field(
                self.pyramid, LEVEL_WIDTHS, self.log_odds, changed, self._gaussian
            )
            self._interpolate_gaps(beams.cells[:hits])
        touched = self._lists.touched[: lengths.touched]
        return WrittenCells(touched[: lengths.hit], touched[lengths.hit :])

    def interpolate_gaps(self, pose: Pose2D, perception: Perception) -> None:
        """Raise the likelihood field along walls that a scan shows with gaps."""
        self._interpolate_gaps(self.to_cells(pose.apply(perception.hits)))

    def _interpolate_gaps(self, ends: NDArray[np.float64]) -> None:
        interpolate_gaps(self.pyramid, LEVEL_WIDTHS, self.log_odds, ends, self._gaussian)

    def _place(
        self, pose: Pose2D, beams: NDArray[np.float64], hits: int
    ) -> tuple[NDArray[np.float64], Beams, int]:
        """Beams in the map's frame and in cells of the arrays, which are made to hold them, and
        how many cells they touch at most."""
        ends, cells = np.empty_like(beams), np.empty_like(beams)
        x, y = self._origin.tolist()
        frame = GridFrame(x, y, self.parameters.resolution)
        extent = place_beams(beams, Pose(pose.x, pose.y, pose.theta), frame, ends, cells)
        self._write_within(extent.box)
        cells -= (self._u0, self._v0)
        return ends, Beams(cells, hits), extent.max_touched

    def _write_within(self, box: CellBox) -> None:
        """Make the arrays hold cells that will be written; most often they do already."""
        was = self._written
        if (
            box.low_u < was.low_u
            or box.low_v < was.low_v
            or box.high_u > was.high_u
            or box.high_v > was.high_v
        ):
            self._extend_to_cells([box.low_u, box.low_v], [box.high_u, box.high_v])
            low = min(was.low_u, box.low_u), min(was.low_v, box.low_v)
            self._written = CellBox(*low, max(was.high_u, box.high_u), max(was.high_v, box.high_v))

    def _write(self, beams: Beams, max_touched: int) -> ListLengths:
        """Write beams into the log-odds; how many cells there are in `_lists` then."""
        if len(self._lists.changed) < max_touched:
            self._lists = CellLists(*(np.empty(2 * max_touched, np.int64) for _ in range(2)))
        log_odds, field = self.log_odds.reshape(-1), self.pyramid[0].reshape(-1)
        layers = MapLayers(log_odds, field, self.log_odds.shape[1])
        return integrate_beams(layers, beams, self._rules, self._lists)

    def build_likelihood_field(self) -> None:
        """Build the likelihood field of the whole map, and its bounds, where there is none yet."""
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
        # Whole cells times the resolution, without the last bit's noise.
        corner = (
            round((self._u0 + u) * p.resolution + float(self._origin[0]), 9),
            round((self._v0 + v) * p.resolution + float(self._origin[1]), 9),
        )
        return GridMap.from_bottom_up(probabilities_from_log_odds(part), p.resolution, corner)
