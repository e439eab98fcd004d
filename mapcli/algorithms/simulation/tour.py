"""A robot that finds its own way: waypoints of a tour through the open cells of a grid map."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from mapcli.algorithms.simulation.drive import MotionLimits
from mapcli.algorithms.simulation.drive_plan import SHARP
from mapcli.errors import DataError
from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap
from mapcli.model.waypoint import Waypoint

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.int64]

MOVES = (0, 1), (1, 0), (1, 1), (1, -1)
"""To half of the neighbours of a cell, row and column; the others move back."""

FINENESS = 7
"""Cells are at most as wide as a seventh of the distance that the robot keeps."""

MOST_CELLS = 4_000_000
"""That a search goes through; a larger map keeps its cells, and wider passages are needed."""

LINE_STEP = 0.25
"""Cells between the points of a straight way that are looked at."""


def plan_tour(
    grid: GridMap, places: int, radius: float, limits: MotionLimits | None = None, seed: int = 0
) -> list[Waypoint]:
    """Waypoints of a robot that finds its way to places drawn at random, and back to the first.

    The places are cells that it can reach; it takes the shortest ways, straight on where it can,
    and keeps its radius from everything that is not known to be open, also where arcs cut corners.

    Args:
        places: 1 or more.
        radius: of the robot, metres.
        limits: of its drive; None for the defaults.

    Raises:
        DataError: fewer than one place, or a map without three cells that
            the robot can be in.
    """
    if places < 1:
        raise DataError(f"a tour of {places} places", expected="1 or more")
    limits = limits or MotionLimits()
    distance = radius + limits.corner_cut * math.tan(SHARP / 4)  # of an arc's middle from its legs
    parts = _parts(grid, distance)
    room = _largest(_with_room(grid, distance, parts))
    cells = np.flatnonzero(room)
    if len(cells) < 3:
        raise DataError(
            f"has no three cells from which everything is {distance:.2f} m away",
            expected="a wider map, or a smaller robot (--robot-radius, --corner-cut)",
        )
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed).spawn(6)[5]))
    stops = _drawn(cells, places + 1, rng)
    corners = _way(room, [*stops, stops[0]])
    rows, columns = (corners.T + 0.5) / parts - 0.5
    points = grid.world_of_cells(rows, columns)
    return [Waypoint(float(x), float(y)) for x, y in points]


def _parts(grid: GridMap, distance: float) -> int:
    """Into how many parts each side of a cell is cut, so that coarse cells leave room for ways."""
    wanted = math.ceil(FINENESS * grid.resolution / distance)
    return max(min(wanted, math.isqrt(MOST_CELLS // grid.cells.size)), 1)


def _with_room(grid: GridMap, distance: float, parts: int) -> Mask:
    """The parts of cells whose every point is so far from what is not known to be open."""
    is_open = grid.cells < OCCUPIED_THRESHOLD  # NaN < 0.5 is False: unknown is not open
    is_open = np.pad(is_open.repeat(parts, axis=0).repeat(parts, axis=1), 1)
    resolution = grid.resolution / parts
    away = np.asarray(distance_transform_edt(is_open))[1:-1, 1:-1] * resolution
    # Both centres stand for their cells, whose corners are half a diagonal away; and straight
    # ways are looked at in steps.
    room: Mask = away >= distance + (math.sqrt(2) + LINE_STEP) * resolution
    return room


def _largest(room: Mask) -> Mask:
    """The largest part that hangs together."""
    parts, count = label(room)
    sizes = np.bincount(parts.ravel(), minlength=count + 1)
    sizes[0] = 0
    return np.asarray((parts == sizes.argmax()) & room)


def _drawn(cells: Indices, count: int, rng: np.random.Generator) -> list[int]:
    """Cells drawn at random, none twice in a row, nor the first as the last."""
    stops: list[int] = []
    while len(stops) < count:
        cell = int(rng.choice(cells))
        if not stops or (cell != stops[-1] and cell != stops[0]):
            stops.append(cell)
    return stops


def _way(room: Mask, stops: list[int]) -> Indices:
    """Row and column of each corner of the shortest ways from stop to stop, shape (n, 2)."""
    graph = _graph(room)
    corners = [stops[0]]
    for start, goal in pairwise(stops):
        before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)[1]
        path = [goal]
        while path[-1] != start:
            path.append(int(before[path[-1]]))
        corners += _straightened(room, path[::-1])[1:]
    return np.column_stack(np.unravel_index(corners, room.shape)).astype(np.int64)


def _graph(room: Mask) -> csr_matrix:
    """Moves between neighbouring cells with their lengths."""
    rows, columns = room.shape
    number = np.arange(room.size).reshape(room.shape)
    begins, ends, lengths = [], [], []
    for down, right in MOVES:
        here = slice(0, rows - down), slice(max(-right, 0), columns - max(right, 0))
        there = slice(down, rows), slice(max(right, 0), columns - max(-right, 0))
        free = room[here] & room[there]
        begins.append(number[here][free])
        ends.append(number[there][free])
        lengths.append(np.full(np.count_nonzero(free), math.hypot(down, right)))
    data = np.concatenate(lengths), (np.concatenate(begins), np.concatenate(ends))
    return csr_matrix(data, shape=(room.size, room.size))


def _straightened(room: Mask, path: list[int]) -> list[int]:
    """The cells of a path at which it must turn: from each straight to the farthest it can."""
    kept, here = [path[0]], 0
    while here < len(path) - 1:
        step = 1  # doubled while the way is straight, then halved
        while here + 2 * step < len(path) and _is_straight(room, path[here], path[here + 2 * step]):
            step *= 2
        ahead, more = here + step, step
        while more := more // 2:
            if ahead + more < len(path) and _is_straight(room, path[here], path[ahead + more]):
                ahead += more
        kept.append(path[ahead])
        here = ahead
    return kept


def _is_straight(room: Mask, a: int, b: int) -> bool:
    """Whether the robot can drive straight from one cell to another."""
    start, end = (np.array(np.unravel_index(cell, room.shape)) for cell in (a, b))
    count = math.ceil(float(np.abs(end - start).max()) / LINE_STEP) + 1
    line = np.linspace(start, end, count)
    rows, columns = np.rint(line).astype(np.int64).T
    return bool(room[rows, columns].all())
