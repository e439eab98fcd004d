"""From a continuous map to a grid map (Sect. 9.1): the share of each cell that objects cover."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from mapcli.algorithms.maps.polygons import Area, solid_area
from mapcli.errors import DataError
from mapcli.memory import require
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D
from mapcli.model.world import World

Box = tuple[float, float, float, float]
"""x and y of the lower left, x and y of the upper right corner, metres."""

MOST_CELLS = 100_000_000
"""Of a map; more is a slip in the resolution or the box."""

MOST_OUTLINE_CELLS = 2_000_000
"""The covered share of each of these is computed: some ten seconds."""

SWEPT_CELLS = 128
"""Side of the largest block that is swept as a whole: halving it costs more."""

NOISE = 1e-9
"""Cells, and shares of a cell: what rounding may add or take."""


def empty_map(box: Box, resolution: float, *, from_top: bool = False) -> GridMap:
    """An unknown map whose cells fill a box, beginning in its lower (or upper) left corner.

    Raises:
        DataError: a box without area, or more than a hundred million cells.
    """
    x0, y0, x1, y1 = box
    width, height = (x1 - x0) / resolution, (y1 - y0) / resolution
    if not (width > 0 and height > 0):
        raise DataError(f"the box {x0:g},{y0:g} to {x1:g},{y1:g} is empty", expected="x0<x1, y0<y1")
    if not width * height <= MOST_CELLS or not max(width, height) <= MOST_CELLS:
        raise DataError(
            f"the map would have {width:,.0f} x {height:,.0f} cells",
            expected=f"at most {MOST_CELLS:,}; larger cells or a smaller box",
        )
    columns, rows = (max(math.ceil(side - NOISE), 1) for side in (width, height))
    require(20 * rows * columns, f"a map of {columns:,} x {rows:,} cells")
    bottom = y1 - rows * resolution if from_top else y0
    cells = np.broadcast_to(np.float32(np.nan), (rows, columns))  # of no memory
    return GridMap(cells, resolution, Pose2D(round(x0, 9), round(bottom, 9)))


def box_around(world: World, resolution: float) -> Box:
    """The box around everything, out to whole multiples of the resolution.

    Raises:
        DataError: the world is empty.
    """
    x0, y0, x1, y1 = (value / resolution for value in world.bounds())
    low = (math.floor(value + NOISE) for value in (x0, y0))
    high = (math.ceil(value - NOISE) for value in (x1, y1))
    (u0, v0), (u1, v1) = low, high
    # Points alone may have no extent.
    u1, v1 = max(u1, u0 + 1), max(v1, v0 + 1)
    return u0 * resolution, v0 * resolution, u1 * resolution, v1 * resolution


def frame_of(
    world: World, resolution: float, corners: Sequence[float] | None = None, *, y_down: bool = False
) -> GridMap:
    """An unknown map for a world: around everything, or in the box between two opposite corners.

    Args:
        corners: x0, y0, x1, y1, metres.
        y_down: y of the corners grows downwards, and cells begin at the upper left corner.

    Raises:
        DataError: an empty world or box, or more than a hundred million cells.
    """
    if corners is None:
        return empty_map(box_around(world, resolution), resolution)
    (x0, x1), (y0, y1) = sorted(corners[::2]), sorted(-y if y_down else y for y in corners[1::2])
    return empty_map((x0, y0, x1, y1), resolution, from_top=y_down)


def rasterize(world: World, frame: GridMap, min_cover: float = 0.5) -> GridMap:
    """A map with 1 where the polygons cover at least `min_cover` of a cell's area, else 0.

    Args:
        frame: the map whose place is used; its cells are not looked at.
        min_cover: share in (0, 1]; 0.5 is the majority rule of Sect. 9.5.

    Raises:
        DataError: a polygon that is no area.
    """
    return covered_map(covered_shares(solid_area(world), frame), frame, min_cover)


def covered_map(shares: NDArray[np.float64], frame: GridMap, min_cover: float = 0.5) -> GridMap:
    """The same from the covered shares, shape (rows, columns)."""
    percents = (shares >= min_cover - NOISE).view(np.uint8)
    percents *= np.uint8(100)
    return frame.replaced(percents)


def covered_cells_listed(grid: GridMap, *, y_down: bool = False) -> list[tuple[int, int]]:
    """x, y of the covered cells, in cells from the world's origin, sorted by y, then x, as the book
    lists them."""
    rows, columns = np.nonzero(grid.cells >= 0.5)
    centres = grid.world_of_cells(rows, columns) / grid.resolution
    x, y = np.floor(centres * (1, -1 if y_down else 1)).astype(int).T
    return [(int(x[k]), int(y[k])) for k in np.lexsort((x, y))]


def covered_shares(area: Area, frame: GridMap) -> NDArray[np.float64]:
    """The share of each cell's area that is covered, exact but for rounding, (rows, columns)."""

    def to_cells(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return frame.fractional_cells_of_world(points)[:, ::-1] + 0.5

    if area.is_empty:  # no boundary either
        return np.zeros((frame.rows, frame.columns))
    in_cells = shapely.transform(area, to_cells)
    inside = shapely.box(0, 0, frame.columns, frame.rows)
    passed = float(shapely.intersection(shapely.boundary(in_cells), inside).length)
    if passed > MOST_OUTLINE_CELLS:
        raise DataError(
            f"the outlines pass through {passed:,.0f} of {frame.rows:,} x {frame.columns:,} cells",
            expected=f"at most {MOST_OUTLINE_CELLS:,}; larger cells or a smaller box",
        )
    return covered_cells(in_cells, frame.rows, frame.columns)


def covered_cells(area: Area, rows: int, columns: int) -> NDArray[np.float64]:
    """The same of an area in cells: x is the column, y the row, a cell is 1 x 1."""
    shares = np.zeros((rows, columns))
    _fill(shares, area, 0, 0)
    return shares


def _fill(shares: NDArray[np.float64], area: Area, top: int, left: int) -> None:
    """Halve a block of cells until it is covered wholly, not at all, or is small.

    Each half sees only its own piece of the area, so that the cost grows with the cells along
    the outlines, and not with the map.
    """
    rows, columns = shares.shape
    piece = shapely.intersection(area, shapely.box(left, top, left + columns, top + rows))
    covered = piece.area
    if covered == 0:
        return
    if covered >= shares.size - NOISE:
        shares[:] = 1.0
    elif max(rows, columns) <= SWEPT_CELLS:
        shares[:] = _swept(piece, top, left, rows, columns)
    elif rows >= columns:
        _fill(shares[: rows // 2], piece, top, left)
        _fill(shares[rows // 2 :], piece, top + rows // 2, left)
    else:
        _fill(shares[:, : columns // 2], piece, top, left)
        _fill(shares[:, columns // 2 :], piece, top, left + columns // 2)


def _swept(piece: Area, top: int, left: int, rows: int, columns: int) -> NDArray[np.float64]:
    """The covered shares of a block of cells around an area.

    Each edge, cut at the lines between cells, adds the area between itself and the right side of
    its cell, and what it spans of the row to all cells on the right; edges that go up count
    against those that go down (the signed areas by which fonts are drawn).
    """
    rings = shapely.get_rings(shapely.get_parts(shapely.orient_polygons(piece)))
    corners, ring = shapely.get_coordinates(rings, return_index=True)
    start = (corners - (left, top))[:-1][ring[1:] == ring[:-1]]
    step = np.diff(corners, axis=0)[ring[1:] == ring[:-1]]
    cuts = [np.zeros((len(start), 1)), np.ones((len(start), 1))]
    for axis, cells in enumerate((columns, rows)):
        ahead = np.arange(1, cells) - start[:, axis, None]
        along = step[:, axis, None]
        cuts.append(np.clip(np.divide(ahead, along, np.zeros_like(ahead), where=along != 0), 0, 1))
    at = np.sort(np.hstack(cuts), axis=1)
    x = start[:, 0, None] + step[:, 0, None] * (at[:, 1:] + at[:, :-1]) / 2
    y = start[:, 1, None] + step[:, 1, None] * (at[:, 1:] + at[:, :-1]) / 2
    down = -step[:, 1, None] * np.diff(at, axis=1)
    row = np.clip(np.floor(y).astype(int), 0, rows - 1)
    column = np.clip(np.floor(x).astype(int), 0, columns - 1)
    sums = np.zeros((rows, columns + 1))
    np.add.at(sums, (row, column), down * (column + 1 - x))
    np.add.at(sums, (row, column + 1), down * (x - column))
    shares = np.cumsum(sums, axis=1)[:, :columns].round(12)  # without what rounding leaves
    return np.clip(shares, 0.0, 1.0) + 0.0
