"""What a range sensor sees, exactly: beams against the edges of obstacles.

Polygons and the occupied cells of a grid map both become edges, straight pieces of boundary of
shape (k, 2, 2): edge, end (a, b), coordinate (x, y), in metres. A beam is only tried against
the edges whose bearings it lies between, so the cost grows with what can be seen from where the
sensor stands, not with the product of beams and edges.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap
from mapcli.model.pose import Pose2D
from mapcli.model.world import World

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

SLACK = 1e-6
"""Fraction of a beam's spacing by which edges are widened, so that no beam slips between two
edges that share a corner."""


def edges_of(world: World | GridMap) -> Floats:
    """The boundary of everything solid, shape (k, 2, 2).

    In a grid map, unknown cells and everything outside are not solid: beams pass through.
    """
    if isinstance(world, GridMap):
        return _edges_of_cells(world)
    sides = [np.stack([p, np.roll(p, -1, axis=0)], axis=1) for p in world.polygons]
    return np.concatenate(sides) if sides else np.empty((0, 2, 2))


def _edges_of_cells(grid: GridMap) -> Floats:
    solid = np.pad(grid.cells >= OCCUPIED_THRESHOLD, 1)  # NaN >= 0.5 is False: unknown is not solid
    rows, left, right = _runs(solid)
    horizontal = np.stack([rows, left, rows, right], axis=1).reshape(-1, 2, 2)
    columns, top, bottom = _runs(solid.T)
    vertical = np.stack([top, columns, bottom, columns], axis=1).reshape(-1, 2, 2)
    corners = np.concatenate([horizontal, vertical]) - 1.0  # the padding
    # A corner at row r, column c is half a cell up and left of that cell's centre.
    flat = corners.reshape(-1, 2)
    return grid.world_of_cells(flat[:, 0] - 0.5, flat[:, 1] - 0.5).reshape(-1, 2, 2)


def _runs(solid: NDArray[np.bool_]) -> tuple[Indices, Indices, Indices]:
    """Boundaries between a row and the one above, joined into runs: row, first and end column."""
    boundary = np.pad(solid[1:] != solid[:-1], ((0, 0), (1, 1))).astype(np.int8)
    change = np.diff(boundary, axis=1)
    rows, first = np.nonzero(change == 1)
    _, end = np.nonzero(change == -1)
    return rows + 1, first, end


def is_inside(world: World | GridMap, x: float, y: float) -> bool:
    """Whether a point lies in something solid."""
    if isinstance(world, GridMap):
        row, column = world.cells_of_world([[x, y]])[0]
        return world.contains(row, column) and bool(world.cells[row, column] >= OCCUPIED_THRESHOLD)
    return any(_encloses(polygon, x, y) for polygon in world.polygons)


def _encloses(polygon: Floats, x: float, y: float) -> bool:
    """The even-odd rule: a ray to the right crosses the boundary an odd number of times."""
    (ax, ay), (bx, by) = polygon.T, np.roll(polygon, -1, axis=0).T
    crossing = (ay > y) != (by > y)
    rise = np.where(crossing, by - ay, 1.0)
    return bool(np.count_nonzero(crossing & (x < ax + (y - ay) / rise * (bx - ax))) % 2)


def edges_near(edges: Floats, low: Floats, high: Floats) -> Floats:
    """The edges whose bounding boxes touch the box from `low` to `high`, each (x, y)."""
    a, b = edges[:, 0], edges[:, 1]
    near = (np.minimum(a, b) <= high) & (np.maximum(a, b) >= low)
    return edges[near.all(axis=1)]


@np.errstate(over="ignore", invalid="ignore")
def clearance(edges: Floats, points: Floats, reach: float) -> Floats:
    """Distance of each point, shape (n, 2), to the nearest edge; inf when beyond `reach`."""
    edges = edges_near(edges, points.min(axis=0) - reach, points.max(axis=0) + reach)
    if len(edges) == 0:
        return np.full(len(points), np.inf)
    start, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    square = np.maximum((along**2).sum(axis=1), np.finfo(np.float64).tiny)
    offset = points[:, None] - start
    fraction = ((offset * along).sum(axis=2) / square).clip(0, 1)
    gap = np.linalg.norm(offset - fraction[..., None] * along, axis=2).min(axis=1)
    return np.asarray(np.where(gap <= reach, gap, np.inf), dtype=np.float64)


@np.errstate(all="ignore")  # parallel to an edge, or a world of astronomic size: no return
def cast(
    edges: Floats, laser: Pose2D, angle_min: float, increment: float, beams: int, reach: float,
    squareness: float = 0.0,
) -> Floats:  # fmt: skip
    """Distance along each beam to the first edge, shape (beams,), inf where none is in reach.

    Args:
        edges: shape (k, 2, 2), from `edges_of`.
        laser: pose of the sensor in the world.
        angle_min, increment: bearing of the first beam and from one to the next (positive),
            counter-clockwise in the sensor's frame, radians; at most one turn altogether.
        reach: metres.
        squareness: cosine of the flattest angle to an edge's normal under which a beam returns.
    """
    ranges = np.full(beams, np.inf)
    position = np.array([laser.x, laser.y])
    near = edges_near(edges, position - reach, position + reach)
    seen = laser.inverse().apply(near.reshape(-1, 2)).reshape(-1, 2, 2)
    edge, beam = _candidates(seen, angle_min, increment, beams)
    bearings = angle_min + increment * beam.astype(np.float64)
    length = _distances(seen[edge], bearings)
    hit = (length <= reach) & (_squareness(seen[edge], bearings) >= squareness)
    np.minimum.at(ranges, beam[hit], length[hit])
    return ranges


def _squareness(edges: Floats, bearings: Floats) -> Floats:
    """Cosine of the angle between each beam and its edge's normal: 1 is straight on."""
    along = edges[..., 1, :] - edges[..., 0, :]
    across = np.abs(np.cos(bearings) * along[..., 1] - np.sin(bearings) * along[..., 0])
    return np.asarray(across / np.linalg.norm(along, axis=-1))


def _candidates(
    seen: Floats, angle_min: float, increment: float, beams: int
) -> tuple[Indices, Indices]:
    """Every (edge, beam) where the beam lies between the bearings of the edge's two ends."""
    bearing = np.arctan2(seen[..., 1], seen[..., 0])
    span = (bearing[:, 1] - bearing[:, 0] + math.pi) % math.tau - math.pi
    right = np.where(span < 0, bearing[:, 1], bearing[:, 0])
    low = (right - angle_min) % math.tau / increment
    high = low + np.abs(span) / increment
    # An edge across the seam at angle_min goes on one full turn earlier.
    turn = math.tau / increment
    first = np.ceil(np.concatenate([low, low - turn]) - SLACK).clip(0).astype(np.int64)
    last = np.floor(np.concatenate([high, high - turn]) + SLACK).clip(-1, beams - 1)
    count = (last.astype(np.int64) - first + 1).clip(0)
    begin = np.cumsum(count) - count
    edge = np.repeat(np.tile(np.arange(len(seen)), 2), count)
    beam = np.arange(count.sum()) - np.repeat(begin - first, count)
    return edge, beam


def _distances(edges: Floats, bearings: Floats) -> Floats:
    """Distance from the origin to each edge along each bearing, shape (n,); inf when missed."""
    (ax, ay), (bx, by) = edges[:, 0].T, edges[:, 1].T
    ex, ey = bx - ax, by - ay
    length = (ax * ey - ay * ex) / (np.cos(bearings) * ey - np.sin(bearings) * ex)
    # A beam along an edge, or one let in by the slack beside a nearly edge-on edge, ends where
    # the neighbouring edges say.
    farthest = np.maximum(np.hypot(ax, ay), np.hypot(bx, by)) * (1 + SLACK)
    return np.where((length > 0) & (length <= farthest), length, np.inf)
