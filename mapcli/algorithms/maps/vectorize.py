"""From a grid map to a continuous map (Sect. 9.1): the outlines of its obstacles."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from mapcli.algorithms.maps.polygons import Area, world_of_area
from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap
from mapcli.model.world import World

TOLERANCE_CELLS = 0.5
"""Default tolerance, in cells: a lone cell and a wall one cell thick keep their shape."""


def vectorize(
    grid: GridMap, tolerance: float | None = None, threshold: float = OCCUPIED_THRESHOLD
) -> World:
    """The obstacles of a map as polygons, simplified (Douglas and Peucker 1973).

    Args:
        tolerance: how far an outline may move, metres, more than 0; None: `default_tolerance`.
        threshold: cells from this probability on are obstacles.
    """
    tolerance = default_tolerance(grid) if tolerance is None else tolerance
    solid = area_of_cells(grid.cells >= np.float32(threshold))
    # Part by part: as a whole they would be kept from touching each other, which takes long.
    parts = shapely.simplify(shapely.get_parts(solid), tolerance / grid.resolution)
    world = world_of_area(parts)
    return World(tuple(_placed(grid, polygon) for polygon in world.polygons))


def default_tolerance(grid: GridMap) -> float:
    """Half a cell, metres."""
    return TOLERANCE_CELLS * grid.resolution


def area_of_cells(chosen: NDArray[np.bool_]) -> Area:
    """The chosen cells, shape (rows, columns), as an area: x is the column, y the row, a cell is
    1 x 1."""
    change = np.diff(np.pad(chosen, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, first = np.nonzero(change == 1)
    _, end = np.nonzero(change == -1)
    # Much faster than a plain union where there are many small obstacles.
    whole = shapely.disjoint_subset_union_all(shapely.box(first, rows, end, rows + 1))
    corners = shapely.simplify(shapely.get_parts(whole), 0)
    return shapely.multipolygons(corners)


def _placed(grid: GridMap, polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners of cells as world points, without the last bit's noise."""
    return grid.world_of_cells(polygon[:, 1] - 0.5, polygon[:, 0] - 0.5).round(9) + 0.0
