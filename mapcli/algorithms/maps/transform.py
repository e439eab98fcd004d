"""Map algebra: parts, turns, mirrors, other cell sizes, several maps in one.

Some operations leave the world where it is: a wall has the same coordinates before and after, and
only the cells that hold it change. Others move the world; they come with the isometry that took
every point to its new place. Where cells are turned by other than quarter turns, each new cell
takes what the old map holds at its centre (nearest neighbour).
"""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.maps.wall_direction import wall_direction
from mapcli.errors import DataError
from mapcli.memory import require
from mapcli.model.grid import UNKNOWN_PERCENT, GridMap, bands
from mapcli.model.isometry import Isometry
from mapcli.model.pose import Pose2D, wrap_angle

Side = Literal["left-right", "up-down"]

MAX_CELLS = 1_000_000_000
"""Of a map that an operation would make."""

MOST_JOINT_CELLS, MOST_JOINT_SHARE = 100_000_000, 10
"""Of two maps in one: cells, or how many times as many as they have themselves. Where even two
squares a whole side apart need but 4.5 times as many, more are two maps that have no place in
common, or an origin that is wrong."""

_ROUNDING = 1e-6
"""Of a cell; boxes and corners that miss a grid line by less are meant to lie on it."""

_ROUNDING_RAD = 1e-9
"""Radians; turns that differ by less from quarter turns are meant to be quarter turns."""


class MovedMap(NamedTuple):
    """A map whose world was moved, and the motion that moved it."""

    grid: GridMap
    motion: Isometry


class AlignedMap(NamedTuple):
    """A map whose world was turned until its walls lie along the axes.

    Attributes:
        grid: the map, its origin without yaw.
        motion: that moved the world.
        walls: the angle of the walls before, radians from the world's axes.
    """

    grid: GridMap
    motion: Isometry
    walls: float


class CellFrame(NamedTuple):
    """Where the cells of a map lie: its origin, metres per cell, how many."""

    origin: Pose2D
    resolution: float
    rows: int
    columns: int


def crop_to_box(grid: GridMap, left: float, bottom: float, right: float, top: float) -> GridMap:
    """The part of the map that a box in the world touches. The world stays.

    Raises:
        DataError: the box does not touch the map.
    """
    corners = np.array([(left, bottom), (left, top), (right, bottom), (right, top)])
    rows, columns = (grid.fractional_cells_of_world(corners) + 0.5).T
    first_row, first_column = _from(rows, grid.rows), _from(columns, grid.columns)
    last_row, last_column = _until(rows, grid.rows), _until(columns, grid.columns)
    if first_row >= last_row or first_column >= last_column:
        raise DataError("the box to crop to lies outside the map", expected=_extent(grid))
    return grid.part(first_row, first_column, last_row, last_column)


def _from(edges: NDArray[np.float64], count: int) -> int:
    return int(np.clip(math.floor(edges.min() + _ROUNDING), 0, count))


def _until(edges: NDArray[np.float64], count: int) -> int:
    return int(np.clip(math.ceil(edges.max() - _ROUNDING), 0, count))


def _extent(grid: GridMap) -> str:
    corners = grid.world_of_cells(
        [-0.5, grid.rows - 0.5] * 2, [-0.5, -0.5, *[grid.columns - 0.5] * 2]
    )
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return f"a box in x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m"


def shift(grid: GridMap, x: float, y: float) -> MovedMap:
    """Move the world by x, y metres. The cells stay as they are."""
    return move(grid, Pose2D(x, y))


def set_origin(grid: GridMap, origin: Pose2D) -> MovedMap:
    """Move the world so that the map's origin becomes `origin`. The cells stay as they are."""
    moved, motion = move(grid, origin.compose(grid.origin.inverse()))
    return MovedMap(GridMap(moved.stored, grid.resolution, origin), motion)


def move(grid: GridMap, motion: Pose2D) -> MovedMap:
    """Move the world by a motion. The cells stay as they are, the origin moves."""
    moved = _placed(grid.stored, grid.resolution, motion.compose(grid.origin))
    return MovedMap(moved, Isometry(motion))


def rotate(grid: GridMap, angle: float) -> MovedMap:
    """Turn the world about its origin by `angle`, radians; the origin's yaw stays as it was."""
    moved, motion = move(grid, Pose2D(0, 0, angle))
    return MovedMap(bake_yaw(moved, grid.origin.theta), motion)


def flip(grid: GridMap, side: Side) -> MovedMap:
    """Mirror the world: x becomes -x (`left-right`) or y becomes -y (`up-down`)."""
    across = side == "left-right"
    mirror = Isometry(Pose2D(0, 0, math.pi if across else 0), mirrored=True)
    far = (
        Pose2D(grid.columns * grid.resolution, 0)
        if across
        else Pose2D(0, grid.rows * grid.resolution)
    )
    (corner,) = mirror.apply(grid.origin.apply(np.array([[far.x, far.y]])))
    origin = Pose2D(corner[0], corner[1], wrap_angle(-grid.origin.theta))
    cells = grid.stored[:, ::-1] if across else grid.stored[::-1]
    return MovedMap(_placed(cells, grid.resolution, origin), mirror)


def align_walls(grid: GridMap) -> AlignedMap:
    """Turn the world so that most walls lie along its axes.

    Raises:
        DataError: hardly any walls.
    """
    angle = wall_direction(grid)
    moved, motion = move(grid, Pose2D(0, 0, -angle))
    return AlignedMap(bake_yaw(moved), motion, angle)


def bake_yaw(grid: GridMap, yaw: float = 0.0) -> GridMap:
    """Turn the cells so that the origin's yaw becomes `yaw`. The world stays."""
    turn = wrap_angle(grid.origin.theta - yaw)
    quarters = round(turn / (math.pi / 2))
    if abs(turn - quarters * math.pi / 2) < _ROUNDING_RAD:
        return _quarter_turned(grid, quarters % 4, yaw)
    frame = Pose2D(0, 0, yaw)
    x0, y0, x1, y1 = _bounds(grid, frame)
    size = grid.resolution
    columns, rows = (math.ceil((b - a) / size - _ROUNDING) for a, b in ((x0, x1), (y0, y1)))
    return sampled(grid, CellFrame(frame.compose(Pose2D(x0, y0)), size, rows, columns))


def _quarter_turned(grid: GridMap, quarters: int, yaw: float) -> GridMap:
    """The same cells under a yaw that is so many quarter turns less."""
    width, height = grid.columns * grid.resolution, grid.rows * grid.resolution
    corner = [(0.0, 0.0), (0.0, height), (width, height), (width, 0.0)][quarters]
    ((x, y),) = grid.origin.apply(np.array([corner]))
    return _placed(np.rot90(grid.stored, quarters), grid.resolution, Pose2D(x, y, yaw))


def resample(grid: GridMap, resolution: float) -> GridMap:
    """Cells of another size, from the same corner. The world stays.

    A larger cell takes the highest probability that is known in it, so that thin walls stay; a
    smaller one takes the cell that it lies in. Each old cell counts where its centre is.
    """
    ratio = grid.resolution / resolution
    if ratio >= 1:
        rows, columns = (math.ceil(count * ratio - _ROUNDING) for count in grid.stored.shape)
        return sampled(grid, CellFrame(grid.origin, resolution, rows, columns))
    pooled = _highest(grid.stored[::-1], _starts(grid.rows, ratio), axis=0)
    pooled = _highest(pooled, _starts(grid.columns, ratio), axis=1)
    return GridMap(pooled[::-1], resolution, grid.origin)


def _starts(count: int, ratio: float) -> NDArray[np.intp]:
    """For each new, larger cell the first old one with its centre in it."""
    centres = (np.arange(count) + 0.5) * ratio
    return np.searchsorted(centres, np.arange(math.floor(centres[-1]) + 1))


def _highest(cells: NDArray[Any], starts: NDArray[np.intp], axis: int) -> NDArray[Any]:
    """The highest known cell of each group along an axis, unknown where none is known."""
    if cells.dtype == np.uint8:  # one more turns unknown into 0, the lowest
        shifted = np.maximum.reduceat(cells + np.uint8(1), starts, axis=axis)
        return np.asarray(shifted - np.uint8(1))
    return np.asarray(np.fmax.reduceat(cells, starts, axis=axis))


def sampled(grid: GridMap, frame: CellFrame) -> GridMap:
    """What the map holds at the centres of other cells. The world stays.

    Raises:
        DataError: more than MAX_CELLS cells.
    """
    origin, resolution, rows, columns = frame
    _refuse_size(rows, columns)
    # Where the new cells' centres lie in the old map, in old cells from its lower left corner.
    corner = grid.origin.between(origin)
    cos, sin = math.cos(corner.theta), math.sin(corner.theta)
    along = (np.arange(columns) + 0.5) * resolution
    up = (rows - np.arange(rows) - 0.5) * resolution
    unknown = UNKNOWN_PERCENT if grid.stored.dtype == np.uint8 else np.nan
    cells = np.full((rows, columns), unknown, dtype=grid.stored.dtype)
    for band in bands(rows, columns):
        u = (corner.x + cos * along[None, :] - sin * up[band, None]) / grid.resolution
        v = (corner.y + sin * along[None, :] + cos * up[band, None]) / grid.resolution
        inside = (u >= 0) & (v >= 0) & (u < grid.columns) & (v < grid.rows)
        found = grid.rows - 1 - v[inside].astype(np.int64), u[inside].astype(np.int64)
        cells[band][inside] = grid.stored[found]
    return _placed(cells, resolution, origin)


def merge(grid: GridMap, other: GridMap) -> GridMap:
    """Both maps in one, on the first one's cells, which go on as far as the other knows something.

    Where both know a cell the higher probability counts, so that walls stay. The world stays.
    """
    if other.resolution < grid.resolution * (1 - _ROUNDING):
        other = resample(other, grid.resolution)
    frame = joint_frame(grid, other)
    mine, yours = _alike(sampled(grid, frame).stored, sampled(other, frame).stored)
    for rows in bands(*mine.shape):
        yours[rows] = _higher(mine[rows], yours[rows])
    both = _placed(yours, grid.resolution, frame.origin)
    return _without_margin(both, grid)


def _without_margin(both: GridMap, grid: GridMap) -> GridMap:
    """The part with known cells or with `grid`, whose cells are among those of `both`: a map that
    was turned has empty corners."""
    known = both.known
    ((top, left),) = both.cells_of_world(grid.world_of_cells([0], [0]))
    known[top, left] = known[top + grid.rows - 1, left + grid.columns - 1] = True
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    return both.part(int(rows[0]), int(columns[0]), int(rows[-1]) + 1, int(columns[-1]) + 1)


def joint_frame(grid: GridMap, other: GridMap) -> CellFrame:
    """The cells of `grid`, going on as far as both maps reach.

    Raises:
        DataError: the maps lie so far apart that hardly any of the cells would be theirs.
    """
    size = grid.resolution
    x0, y0, x1, y1 = (edge / size for edge in _bounds(other, grid.origin))
    left, below = min(math.floor(x0 + _ROUNDING), 0), min(math.floor(y0 + _ROUNDING), 0)
    right = max(math.ceil(x1 - _ROUNDING), grid.columns)
    above = max(math.ceil(y1 - _ROUNDING), grid.rows)
    rows, columns = above - below, right - left
    theirs = grid.stored.size + other.stored.size * (other.resolution / size) ** 2
    if rows * columns > max(MOST_JOINT_CELLS, MOST_JOINT_SHARE * theirs):
        raise DataError(
            f"the maps lie far apart: together they would have {rows:,} rows and {columns:,} "
            f"columns, and cells of their own {theirs:,.0f}",
            expected="maps of one place",
        )
    corner = Pose2D(left * size, below * size)
    origin = grid.origin.compose(corner) if left or below else grid.origin
    return CellFrame(origin, size, rows, columns)


def _alike(mine: NDArray[Any], yours: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Both as percents, or both as probabilities; the second may be written to."""
    if mine.dtype == yours.dtype:
        return mine, yours
    return GridMap(mine).cells, GridMap(yours).cells


def _higher(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    if a.dtype == np.uint8:
        return np.asarray(np.maximum(a + np.uint8(1), b + np.uint8(1)) - np.uint8(1))
    return np.asarray(np.fmax(a, b))


def _bounds(grid: GridMap, frame: Pose2D) -> tuple[float, float, float, float]:
    """Left, bottom, right, top of the map as seen in a frame, metres."""
    width, height = grid.columns * grid.resolution, grid.rows * grid.resolution
    corners = np.array([(0, 0), (width, 0), (0, height), (width, height)], dtype=np.float64)
    seen = frame.between(grid.origin).apply(corners)
    (x0, y0), (x1, y1) = seen.min(axis=0), seen.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)


def _placed(cells: NDArray[Any], resolution: float, origin: Pose2D) -> GridMap:
    """A map whose origin is free of rounding noise: less than a nanometre."""
    x, y = (round(value, 9) + 0.0 for value in (origin.x, origin.y))
    theta = 0.0 if abs(origin.theta) < _ROUNDING_RAD else origin.theta
    return GridMap(cells, resolution, Pose2D(x, y, theta))


def _refuse_size(rows: int, columns: int) -> None:
    if rows * columns > MAX_CELLS or min(rows, columns) < 1:
        raise DataError(
            f"the result would have {rows:,} rows and {columns:,} columns",
            expected=f"1 to {MAX_CELLS:,} cells",
        )
    require(3 * rows * columns, f"a map of {columns:,} x {rows:,} cells")
