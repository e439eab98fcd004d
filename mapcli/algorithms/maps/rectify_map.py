"""Straight and perpendicular walls in a map (Sect. 9.4): the outlines of its free space become
rectilinear polygons."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import affinity

from mapcli.algorithms.maps.polygons import Area
from mapcli.algorithms.maps.rasterize import covered_cells
from mapcli.algorithms.maps.vectorize import area_of_cells
from mapcli.errors import DataError
from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

TOLERANCE_CELLS = 2.0
"""Default tolerance, in cells."""

ALIGNED_SHARE, ALIGNED_ANGLE = 0.75, math.radians(20)
"""An outline is made rectilinear when at least this share of its length runs within this angle of
the axes: what is round or slanting by design stays as it is."""

MIN_OVERLAP = 0.5
"""A rectilinear outline must share so much of its area with what it replaces, or it is not used."""


@dataclass(frozen=True, eq=False)
class RectifiedMap:
    """A map whose free space has rectilinear outlines.

    Attributes:
        grid: the map, in the same place.
        direction: of the walls, radians from the map's x axis, in [-pi/4, pi/4).
        rectified, outlines: how many outlines of free space were made rectilinear, of how many.
        changed: cells whose state is another than before (free, occupied, unknown).
    """

    grid: GridMap
    direction: float
    rectified: int
    outlines: int
    changed: int


def rectify_map(
    grid: GridMap, tolerance: float | None = None, threshold: float = OCCUPIED_THRESHOLD
) -> RectifiedMap:
    """Make the walls of a map straight and perpendicular.

    The outline of the free space becomes segments along the main direction of the walls and
    across it, each in the mean place of what it replaces. Only what is within the tolerance (and
    a cell) of an obstacle changes: where the unknown begins there may be no wall. What is round
    or slanting, and small things without a rectilinear outline, stay as they are.

    Args:
        tolerance: how far an outline may be from a straight segment, metres; None for two cells.
        threshold: cells from this probability on are obstacles.

    Raises:
        DataError: no cell is open.
    """
    is_free = grid.known & (grid.cells < np.float32(threshold))
    if not is_free.any():
        raise DataError("no cell of the map is open", expected="rooms with walls")
    tolerance = TOLERANCE_CELLS * grid.resolution if tolerance is None else tolerance
    area, limit = area_of_cells(is_free), tolerance / grid.resolution
    direction = _main_direction(shapely.simplify(area, limit))
    if abs(direction) * max(grid.rows, grid.columns) < 0.5:
        direction = 0.0  # no cell would show it
    turned = affinity.rotate(area, -direction, origin=(0, 0), use_radians=True)
    rings = [ring for part in shapely.get_parts(turned) for ring in _rings(part)]
    rectilinear = [_rectilinear(ring, limit) for ring in rings]
    kept = [
        s if s is not None else shapely.Polygon(r) for r, s in zip(rings, rectilinear, strict=True)
    ]
    holes = [k for k, ring in enumerate(rings) if ring.is_ccw != rings[0].is_ccw]
    solid = shapely.union_all([kept[k] for k in holes])
    outer = shapely.union_all([s for k, s in enumerate(kept) if k not in set(holes)])
    room = affinity.rotate(
        shapely.difference(outer, solid), direction, origin=(0, 0), use_radians=True
    )
    freed = covered_cells(room, grid.rows, grid.columns) >= 0.5
    cells = _redrawn(grid, is_free, freed, math.ceil(limit) + 1, threshold)
    changed = _states(cells, threshold) != _states(grid.cells, threshold)
    # Rows count downwards, y upwards.
    return RectifiedMap(
        grid.replaced(cells), 0.0 - direction, sum(s is not None for s in rectilinear), len(rings),
        int(changed.sum()),
    )  # fmt: skip


def _rings(part: Area) -> list[Area]:
    """The outline of a free area, counter-clockwise, and those of its holes, clockwise."""
    simple = shapely.geometry.polygon.orient(part)
    return [simple.exterior, *simple.interiors]


def _main_direction(area: Area) -> float:
    """The direction modulo 90 degrees that long edges agree on, radians in [-pi/4, pi/4)."""
    vectors = []
    for part in shapely.get_parts(area):
        for ring in (part.exterior, *part.interiors):
            vectors.append(np.diff(shapely.get_coordinates(ring), axis=0))
    x, y = np.concatenate(vectors).T
    # Four times the angle makes all four directions one; long edges are surer of theirs. Then the
    # median, because what slants must not turn what is straight.
    phases, weights = np.exp(4j * np.arctan2(y, x)), x**2 + y**2
    mean = (phases * weights).sum()
    off = np.angle(phases * np.conj(mean))
    order = np.argsort(off)
    half = np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2)
    median = float(np.angle(mean) + off[order[half]])
    return ((median + math.pi) % math.tau - math.pi) / 4


def _rectilinear(ring: Area, tolerance: float) -> Area | None:
    """A polygon along the axes in the place of an outline; None when none is similar enough."""
    whole = shapely.Polygon(ring)
    if not _runs_along_axes(shapely.get_coordinates(shapely.simplify(ring, tolerance))):
        return None
    for limit in (tolerance, 0.5):
        corners = _square_corners(shapely.get_coordinates(shapely.simplify(ring, limit))[:-1])
        if corners is None:
            continue
        square = shapely.make_valid(shapely.Polygon(corners))
        both = shapely.intersection(square, whole).area
        if both >= MIN_OVERLAP * max(square.area, whole.area):
            return square
    return None


def _runs_along_axes(corners: Floats) -> bool:
    x, y = np.diff(corners, axis=0).T
    lengths, angles = np.hypot(x, y), np.arctan2(y, x)
    off = np.abs(angles - np.rint(angles / (math.pi / 2)) * (math.pi / 2))
    return bool(lengths[off <= ALIGNED_ANGLE].sum() >= ALIGNED_SHARE * lengths.sum())


def _square_corners(corners: Floats) -> Floats | None:
    """Corners of the polygon whose sides are the runs of edges of one direction."""
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*edges.T)
    quarters = np.rint(np.arctan2(edges[:, 1], edges[:, 0]) / (math.pi / 2)).astype(int) % 4
    first = np.flatnonzero(quarters != np.roll(quarters, 1))
    if len(first) < 4:
        return None
    start = int(first[0])
    order = (np.arange(len(corners)) + start) % len(corners)
    runs = np.split(order, (first[1:] - start))
    across = 1 - quarters % 2  # a side along x has one y, a side along y one x
    middles = corners + edges / 2
    places = [float(np.average(middles[run, across[run[0]]], weights=lengths[run])) for run in runs]
    square = []
    for k, run in enumerate(runs):
        following = runs[(k + 1) % len(runs)]
        a, b = across[run[0]], across[following[0]]
        joint = corners[following[0]].copy()
        joint[a] = places[k]
        if a == b:  # two sides back to back: a short one leads from the one to the other
            square.append(joint.copy())
        joint[b] = places[(k + 1) % len(runs)]
        square.append(joint)
    return np.array(square)


def _redrawn(
    grid: GridMap, was_free: Mask, freed: Mask, reach: int, threshold: float
) -> NDArray[np.float32]:
    """Cells for the new free space, with walls along it within `reach` cells of old walls."""
    obstacle = grid.cells >= np.float32(threshold)
    wall = was_free | _dilated(freed, 1)
    beyond = np.where(obstacle, grid.cells, np.where(wall, 1.0, np.nan))
    redrawn = np.where(freed, np.where(was_free, grid.cells, 0.0), beyond)
    return np.where(_dilated(obstacle, reach), redrawn, grid.cells).astype(np.float32)


def _dilated(mask: Mask, cells: int) -> Mask:
    """The binary dilation of a mask by a square of `2 * cells + 1` cells a side.

    The same as `scipy.ndimage.maximum_filter`, whose import takes longer than all the rest on a map
    of usual size.
    """
    for axis in range(2):
        padded = np.pad(mask, [(cells, cells) if a == axis else (0, 0) for a in range(2)])
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * cells + 1, axis=axis)
        mask = np.asarray(windows.any(axis=-1))
    return mask


def _states(cells: NDArray[np.float32], threshold: float) -> NDArray[np.int64]:
    """0 free, 1 occupied, 2 unknown."""
    return np.where(np.isnan(cells), 2, cells >= np.float32(threshold)).astype(np.int64)
