"""The perception map p of Sect. 9.5: what a scan, taken at a pose, says about the cells of a map.

The scan is drawn as two outlines around the laser. The *face* runs along what the beams hit (or
along the end of their range), the *back* one cell behind it, since any wall is taken to be one
cell thick. Between neighbouring beams that hit, the wall is the straight line between their ends.
Where that line would be grazed by more than 75 degrees it is no wall but a jump from one thing to
another, and each beam answers for half of the gap. Beams with a wide gap between them (more than
one and a half times the usual one) answer for half the usual spacing, at most MAX_CONE / 2, to
either side; what lies between them is hidden.

With the exact areas of a cell in front of the face (free), between face and back (wall) and the
rest (hidden), **the majority rule** is:

- obstacle (+1) when at least half of the cell is wall, and more is wall than hidden;
- empty (-1) when more than half of it is free;
- unknown (0) otherwise. Cells beyond the range, behind the wall or between beams are hidden.

So a wall that runs along the middle of a row makes that row the obstacle, and not the next one.

Maps that are drawn from beams, as `slam-replay` does, have their walls where the beams end, half a
cell nearer on average. For them there is **the rule of ends**: the cells in which beams end are
obstacles, and of the others those are empty that would be more than half free if all walls were
CLEAR cells nearer. What lies between may hold the wall in the map, and is left unknown.

Coordinates are (u, v) in cells of the map, u along x and v along y; arrays are bottom-up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.errors import DataError
from mapcli.model.perception import Walls

Floats = NDArray[np.float64]
Box = tuple[int, int, int, int]
"""Left, bottom, right, top in cells, the latter two one past the last."""

GRAZING_COSINE = math.cos(math.radians(75))
MAX_CONE = math.radians(30)
"""The cone of a lone range sensor, such as an ultrasonic one."""

MAX_CELLS = 20_000_000
"""Cells of a perception map; more means that range and map have different units."""

CLEAR, CLEAR_M = 0.5, 0.0125
"""Cells from a wall to the middles of cells that are empty for certain, and metres more: the middle
of the cell in which a wall is drawn lies up to half a cell before it, and ranges err by a
centimetre."""

TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class PerceptionMap:
    """A piece of a map as perceived.

    Attributes:
        values: shape (rows, columns), int8, bottom-up: -1 empty, +1 obstacle, 0 unknown.
        left, bottom: the map's column u and row v (from below) of `values[0, 0]`.
    """

    values: NDArray[np.int8]
    left: int
    bottom: int


@dataclass(frozen=True, eq=False)
class ScanOutline:
    """A scan as closed paths in the robot's frame, in cells; all of shape (n, 2).

    Attributes:
        face, back: see the module; the same where walls have no thickness.
        ends: where beams end in obstacles, for the rule of ends; else empty.
    """

    face: Floats
    back: Floats
    ends: Floats


def scan_outline(perception: Perception, cell: float, walls: Walls = "thick") -> ScanOutline:
    """Face and back of a scan; `cell` is the size of a cell in the unit of the ranges.

    `walls` chooses the majority rule (`thick`) or the rule of ends.
    """
    bearing, length, ends, hit = _beams_by_bearing(perception, cell)
    laser, none = perception.laser / cell, np.empty((0, 2))
    if not len(ends):
        return ScanOutline(none, none, none)
    gap = np.diff(bearing, append=bearing[0] + math.tau)
    usual = min(MAX_CONE, float(np.sort(gap)[(len(gap) - 1) // 2]))
    joined = gap <= 1.5 * usual + TOLERANCE
    half = np.where(joined, gap, usual) / 2
    after = np.roll(np.arange(len(ends)), -1)
    middle, distance, wall = _walls(ends, ends[after], hit & hit[after] & joined)
    open_ = joined & ~hit & ~hit[after]
    whole = wall | open_
    # Five points from each beam to the next: its end, the middle twice with the laser in between
    # where there is a gap, and the next beam's end.
    mids = np.arctan2(middle[:, 1], middle[:, 0])
    bearings = np.stack([bearing, np.where(whole, mids, bearing + half), bearing,
                         np.where(whole, mids, bearing[after] - half), bearing[after]])  # fmt: skip
    far = np.hypot(middle[:, 0], middle[:, 1])
    face = np.stack([length, np.where(whole, far, length), length,
                     np.where(whole, far, length[after]), length[after]])  # fmt: skip
    own, next_ = hit & ~wall, hit[after] & ~wall
    alone = np.stack([own, own, own, next_, next_])

    def moved_back(cells: float) -> Floats:
        """The face, moved away from the laser along the normals of the walls."""
        scale = np.where(wall, 1 + cells / np.where(wall, distance, 1.0), 1.0)
        moved: Floats = np.maximum(face * scale + cells * alone, 0.0)
        return moved

    if walls == "ends":
        back = face = moved_back(-(CLEAR + CLEAR_M / cell))
    else:
        back = moved_back(1.0)
    bearings[2] = bearings[1]
    face[2] = np.where(joined, face[1], 0.0)
    back[2] = np.where(joined, back[1], 0.0)
    rays = np.stack([np.cos(bearings), np.sin(bearings)], axis=2)
    paths = [(rays * radii[..., None]).swapaxes(0, 1).reshape(-1, 2) for radii in (face, back)]
    if walls == "ends":
        return ScanOutline(paths[0] + laser, paths[0] + laser, perception.hits / cell)
    return ScanOutline(paths[0] + laser, paths[1] + laser, none)


def _beams_by_bearing(
    perception: Perception, cell: float
) -> tuple[Floats, Floats, Floats, NDArray[np.bool_]]:
    """Bearings, lengths and ends of the beams as seen from the laser, in cells, counter-clockwise,
    and which of them hit something."""
    ends = (np.concatenate([perception.hits, perception.open_ends]) - perception.laser) / cell
    bearing, length = np.arctan2(ends[:, 1], ends[:, 0]), np.hypot(ends[:, 0], ends[:, 1])
    order = np.argsort(bearing, kind="stable")
    hit = (np.arange(len(ends)) < len(perception.hits))[order]
    return bearing[order], length[order], ends[order], hit


def _walls(
    a: Floats, b: Floats, candidates: NDArray[np.bool_]
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Middles of the lines from a to b, their distances from the laser, and which are walls."""
    middle, along = (a + b) / 2, b - a
    length = np.hypot(along[:, 0], along[:, 1])
    area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    distance = area / np.where(length > TOLERANCE, length, 1.0)
    faces = distance >= GRAZING_COSINE * np.hypot(middle[:, 0], middle[:, 1])
    return middle, distance, candidates & faces & (distance > TOLERANCE) & (length > TOLERANCE)


def perception_map(
    scan: ScanOutline, pose: Floats, within: Box | None = None, *, compiled: bool = False
) -> PerceptionMap:
    """What a scan says about the cells of the map if it was taken at a pose.

    Args:
        scan: from `scan_outline`, with the map's cell size.
        pose: (u, v, theta) of the robot, in cells and radians.
        within: only these cells are written out.
        compiled: draw it with loops compiled by numba, which takes longer to load.

    Raises:
        DataError: the perception covers an absurd number of cells.
    """
    if not len(scan.face):
        return PerceptionMap(np.zeros((0, 0), np.int8), 0, 0)
    face, back = _transformed(scan.face, pose), _transformed(scan.back, pose)
    box = _bounding_box(np.concatenate([back, _transformed(scan.ends, pose)]), within)
    if compiled:
        from mapcli.algorithms.similarity._kernels.perception_map import draw_perception_map

        rows, columns = box[3] - box[1], box[2] - box[0]
        values = draw_perception_map(face, back, box[0], box[1], rows, columns, TOLERANCE)
    else:
        values = _majority_rule(face, back, box)
    if len(scan.ends):
        u, v = (np.floor(_transformed(scan.ends, pose)).astype(np.int64) - box[:2]).T
        inside = (u >= 0) & (v >= 0) & (u < values.shape[1]) & (v < values.shape[0])
        values[v[inside], u[inside]] = 1
    return PerceptionMap(values, box[0], box[1])


def _majority_rule(face: Floats, back: Floats, box: Box) -> NDArray[np.int8]:
    """The majority rule for every cell of a box."""
    free = covered_area(face, box)
    wall = covered_area(back, box) - free
    values = np.zeros(free.shape, np.int8)
    values[free > 0.5 + TOLERANCE] = -1
    values[(wall >= 0.5 - TOLERANCE) & (wall > 1 - free - wall + TOLERANCE)] = 1
    return values


def _transformed(points: Floats, pose: Floats) -> Floats:
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    u, v = points[:, 0], points[:, 1]
    return np.column_stack([pose[0] + cos * u - sin * v, pose[1] + sin * u + cos * v])


def _bounding_box(points: Floats, within: Box | None) -> Box:
    low, high = points.min(axis=0), points.max(axis=0)
    if not (np.abs(points) < 1e9).all() or (high - low).sum() > MAX_CELLS / 10:
        raise _perception_too_large(high - low)
    left, bottom = (math.floor(value) for value in low)
    right, top = (math.floor(value) + 1 for value in high)
    if within is not None:
        left, right = max(left, within[0]), min(right, within[2])
        bottom, top = max(bottom, within[1]), min(top, within[3])
    right, top = max(left, right), max(bottom, top)
    if (right - left) * (top - bottom) > MAX_CELLS:
        raise _perception_too_large(high - low)
    return left, bottom, right, top


def _perception_too_large(size: Floats) -> DataError:
    return DataError(
        f"the perception is {size[0]:,.0f} cells wide",
        expected="ranges in the unit of the map, and a range_max that ends open beams",
    )


def covered_area(path: Floats, box: Box) -> Floats:
    """The share of each cell that lies inside a closed path, exactly: shape (rows, columns).

    Args:
        path: shape (n, 2), counter-clockwise; the last point is joined to the first.
        box: the cells asked for.

    Each edge is cut where it crosses from cell to cell. A piece takes from all cells to its right
    what lies beside it, so that a running sum along the row adds up to the areas (Green's
    theorem).
    """
    left, bottom, right, top = box
    rows, columns = top - bottom, right - left
    area = np.zeros((rows, columns + 2))
    if not rows or not columns:
        return area[:, :columns]
    a, b = _cut_at_cells(path, np.roll(path, -1, axis=0))
    middle = (a + b) / 2
    row = np.floor(middle[:, 1]).astype(np.int64) - bottom
    x = np.clip(middle[:, 0] - left, 0.0, columns)
    inside = (row >= 0) & (row < rows)
    row, x, rise = row[inside], x[inside], (b - a)[inside, 1]
    column = np.floor(x).astype(np.int64)
    place = row * (columns + 2) + column
    part = rise * (x - column)
    area -= np.bincount(place, rise - part, area.size).reshape(area.shape)
    area -= np.bincount(place + 1, part, area.size).reshape(area.shape)
    return np.cumsum(area, axis=1)[:, :columns]


def _cut_at_cells(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Edges from a to b, cut at every whole u and v."""
    along = b - a
    edges, shares = [np.arange(len(a))] * 2, [np.zeros(len(a)), np.ones(len(a))]
    for axis in (0, 1):
        low, high = np.minimum(a, b)[:, axis], np.maximum(a, b)[:, axis]
        first = np.floor(low).astype(np.int64) + 1
        count = np.maximum(np.ceil(high).astype(np.int64) - first, 0)
        edge = np.repeat(np.arange(len(a)), count)
        nth = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        edges.append(edge)
        shares.append((first[edge] + nth - a[edge, axis]) / along[edge, axis])
    edge, share = np.concatenate(edges), np.concatenate(shares)
    order = np.lexsort([share, edge])
    edge, share = edge[order], share[order]
    points = a[edge] + share[:, None] * along[edge]
    same = edge[1:] == edge[:-1]
    return points[:-1][same], points[1:][same]
