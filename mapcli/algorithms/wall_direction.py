"""The main direction of a map's walls."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import DataError
from mapcli.model.grid import GridMap

OCCUPIED_FROM = 0.5

_MOST_CELLS = 40_000
"""Wall cells that are looked at; of more, some are left out at even intervals."""

_FEWEST_CELLS = 10

_STEPS_DEG = (0.5, 0.05, 0.005)
"""Angles are tried at the first step over a quarter turn, then finer around the best."""


def wall_points(grid: GridMap, low: float = OCCUPIED_FROM) -> NDArray[np.float64]:
    """World points of the centres of occupied cells, shape (n, 2), row by row."""
    found = []
    for first, band in _numbered(grid):
        rows, columns = np.nonzero(band.each(lambda cells: cells >= np.float32(low)))
        found.append(grid.world_of_cells(rows + first, columns))
    return np.concatenate(found)


def _numbered(grid: GridMap) -> list[tuple[int, GridMap]]:
    parts, first = [], 0
    for band in grid.bands():
        parts.append((first, band))
        first += band.rows
    return parts


def wall_direction(grid: GridMap, low: float = OCCUPIED_FROM) -> float:
    """The angle, radians from -pi/4 to pi/4, by which walls are turned against the world's axes.

    At that angle the walls, seen along themselves, fall into the fewest and fullest lines: the sum
    of the squares of the counts in stripes one cell wide, along both axes, is largest.

    Raises:
        DataError: hardly any walls.
    """
    points = wall_points(grid, low)
    if len(points) < _FEWEST_CELLS:
        raise DataError(
            f"the map has {len(points)} occupied cells", expected="walls, to find their direction"
        )
    points = points[:: -(-len(points) // _MOST_CELLS)] - points.mean(axis=0)
    best, reach = 0.0, 45.0
    for step in _STEPS_DEG:
        tries = best + np.arange(-round(reach / step), round(reach / step) + 1) * step
        scores = [_sharpness(points / grid.resolution, math.radians(angle)) for angle in tries]
        best, reach = float(tries[_middle_of_best(np.array(scores))]), 2 * step
    return math.radians((best + 45.0) % 90.0 - 45.0)


def _middle_of_best(scores: NDArray[np.float64]) -> int:
    """Of several best ones, such as of walls along the cells, the middle one."""
    best = np.flatnonzero(scores >= scores.max() * (1 - 1e-12))
    return int(best[len(best) // 2])


def _sharpness(points: NDArray[np.float64], angle: float) -> float:
    cos, sin = math.cos(angle), math.sin(angle)
    x, y = points.T
    return _fullness(cos * x + sin * y) + _fullness(cos * y - sin * x)


def _fullness(places: NDArray[np.float64]) -> float:
    """Sum of squares of the counts in stripes one wide; each point counts in the two nearest, by
    its distance, so that no result depends on where the stripes begin."""
    places = places - places.min()
    stripe = np.floor(places).astype(np.int64)
    share = places - stripe
    counts = np.bincount(stripe, 1 - share, minlength=int(stripe.max()) + 2)
    counts[1:] += np.bincount(stripe, share, minlength=len(counts) - 1)[: len(counts) - 1]
    return float((counts**2).sum())
