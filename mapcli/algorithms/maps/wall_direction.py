"""The main direction of a map's walls: the angle at which their projections are sharpest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import DataError
from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap

_MOST_CELLS = 40_000
"""Occupied cells that are used; of more, some are left out at even intervals."""

_FEWEST_CELLS = 10
"""Fewer occupied cells have no direction."""

_STEPS_DEG = (0.5, 0.1)
"""Angles are tried at the first step over a quarter turn, then finer around the best."""

_FITS = 4
_LINES = 30
_LINE_REACH = 2.5
"""Then straight lines are fitted, so often, to so many of the fullest bins along either axis, and
to the points within so many cells of them."""


def occupied_points(grid: GridMap, threshold: float = OCCUPIED_THRESHOLD) -> NDArray[np.float64]:
    """World points of the centres of occupied cells, shape (n, 2), row by row."""
    found = []
    for first, band in _numbered(grid):
        rows, columns = np.nonzero(band.each(lambda cells: cells >= np.float32(threshold)))
        found.append(grid.world_of_cells(rows + first, columns))
    return np.concatenate(found)


def _numbered(grid: GridMap) -> list[tuple[int, GridMap]]:
    parts, first = [], 0
    for band in grid.bands():
        parts.append((first, band))
        first += band.rows
    return parts


def wall_direction(grid: GridMap, threshold: float = OCCUPIED_THRESHOLD) -> float:
    """The angle, radians from -pi/4 to pi/4, by which walls are turned against the world's axes.

    At that angle the projections of the walls on both axes are sharpest: the sum of the squares of
    the histogram, in bins one cell wide, is largest. It is refined by the slope of lines fitted to
    the fullest bins. A map whose outermost wall would not move by half a cell gives 0.

    Raises:
        DataError: hardly any walls.
    """
    points = occupied_points(grid, threshold)
    if len(points) < _FEWEST_CELLS:
        raise DataError(
            f"the map has {len(points)} occupied cells", expected="walls, to find their direction"
        )
    points = points[:: -(-len(points) // _MOST_CELLS)] - points.mean(axis=0)
    points = points / grid.resolution
    best, reach = 0.0, 45.0
    for step in _STEPS_DEG:
        tries = best + np.arange(-round(reach / step), round(reach / step) + 1) * step
        scores = [_sharpness(points, math.radians(angle)) for angle in tries]
        best, reach = float(tries[_middle_of_best(np.array(scores))]), 2 * step
    angle = math.radians(best)
    for _ in range(_FITS):
        angle += _slope(points, angle)
    quarter = math.pi / 2
    slope = (angle + quarter / 2) % quarter - quarter / 2
    reach = float(np.hypot(*points.T).max())
    return 0.0 if abs(slope) * reach < 0.5 else slope


def _middle_of_best(scores: NDArray[np.float64]) -> int:
    """Of several best ones, such as of walls along the cells, the middle one."""
    best = np.flatnonzero(scores >= scores.max() * (1 - 1e-12))
    return int(best[len(best) // 2])


def _turned(points: NDArray[np.float64], angle: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Coordinates x and y of the points along axes turned by `angle`."""
    cos, sin = math.cos(angle), math.sin(angle)
    x, y = points.T
    return cos * x + sin * y, cos * y - sin * x


def _slope(points: NDArray[np.float64], angle: float) -> float:
    """The slope of the fullest lines against axes turned by `angle`, radians."""
    x, y = _turned(points, angle)
    moments = np.sum([_line_moments(x, y), _line_moments(y, -x)], axis=0)
    return math.atan2(moments[0], moments[1])


def _line_moments(along: NDArray[np.float64], across: NDArray[np.float64]) -> tuple[float, float]:
    """Sums over lines of along * across and of along ** 2, each about the line's middle."""
    product = square = 0.0
    left = np.ones(len(across), dtype=np.bool_)
    bins = np.rint(across - across.min()).astype(np.int64)
    for _ in range(_LINES):
        counts = np.bincount(bins[left], minlength=1)
        if counts.max() < _FEWEST_CELLS:
            break
        line = left & (np.abs(bins - int(np.argmax(counts))) <= _LINE_REACH)
        a, b = along[line] - along[line].mean(), across[line] - across[line].mean()
        product += float((a * b).sum())
        square += float((a * a).sum())
        left &= ~line
    return product, square


def _sharpness(points: NDArray[np.float64], angle: float) -> float:
    """Sum of squares of the projections' histograms on both axes."""
    return sum(_squared_histogram(places) for places in _turned(points, angle))


def _squared_histogram(places: NDArray[np.float64]) -> float:
    """Sum of squares of a histogram in bins one wide; each point counts in the two nearest bins,
    by its distance, so that no result depends on where the bins begin."""
    places = places - places.min()
    bins = np.floor(places).astype(np.int64)
    share = places - bins
    counts = np.bincount(bins, 1 - share, minlength=int(bins.max()) + 2)
    counts[1:] += np.bincount(bins, share, minlength=len(counts) - 1)[: len(counts) - 1]
    return float((counts**2).sum())
