"""Finds where one map lies in another, with no guess to start from.

Both maps are reduced to about a hundred cells a side and correlated by FFT at every angle, all
shifts at once, walls against walls and open against open. The best few candidates are then refined
on the walls' points (iterated closest points, with an ever smaller reach), and the one with most
evidence wins: wall cells that meet a wall of the other map, less those that meet what the other
map knows to be no wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mapcli.algorithms.transform import move, resample
from mapcli.algorithms.wall_direction import OCCUPIED_FROM, wall_points
from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D, wrap_angle

_COARSE_SIDE = 96
"""Cells of the longer side, for the search over everything."""

_CANDIDATES = 12
_MOST_POINTS = 20_000
_NEAR_CELLS = 1.5
"""A wall cell meets a wall of the other map within so many cells."""


@dataclass(frozen=True, slots=True)
class Registration:
    """Where a map lies in another.

    Attributes:
        motion: takes the second map's world into the first one's.
        score: of the wall cells of either map, where the other one knows something, the share
            that meets a wall of the other; 1 is perfect.
        overlap: cells of the first map where both know something.
    """

    motion: Pose2D
    score: float
    overlap: int


def register(a: GridMap, b: GridMap, low: float = OCCUPIED_FROM) -> Registration:
    """Find the motion of `b` that lays it onto `a`.

    Raises:
        DataError: a map without walls, or nothing in common.
    """
    walls_a, walls_b = (_some(wall_points(grid, low)) for grid in (a, b))
    if not (len(walls_a) and len(walls_b)):
        raise DataError("a map without occupied cells", expected="walls in both maps")
    tree = cKDTree(walls_a)
    cell = max(a.resolution, b.resolution)
    best, most = None, -math.inf
    for candidate, coarse in _candidates(a, b, low):
        motion = _refined(candidate, tree, walls_b, 2 * coarse, cell)
        found, evidence = score(a, b, motion, low)
        if evidence > most:
            best, most = found, evidence
    if best is None or best.overlap == 0:
        raise DataError("the maps have nothing in common", expected="maps that overlap")
    return best


def score(
    a: GridMap, b: GridMap, motion: Pose2D, low: float = OCCUPIED_FROM
) -> tuple[Registration, float]:
    """How well `b`, moved, lies on `a`; and the evidence for it, in wall cells."""
    moved, _ = move(b, motion)
    walls_a, walls_b = _some(wall_points(a, low)), _some(wall_points(moved, low))
    near = _NEAR_CELLS * max(a.resolution, b.resolution)
    met = compared = 0
    for walls, others, grid in ((walls_a, walls_b, moved), (walls_b, walls_a, a)):
        distance, _ = cKDTree(others).query(walls, distance_upper_bound=near)
        meets = np.isfinite(distance)
        met += int(meets.sum())
        compared += int((meets | _knows(grid, walls)).sum())
    share = met / compared if compared else 0.0
    return Registration(motion, share, _overlap(a, moved)), 2.0 * met - compared


def _some(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return points[:: max(-(-len(points) // _MOST_POINTS), 1)]


def _knows(grid: GridMap, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the map knows the cells of points."""
    rows, columns = grid.cells_of_world(points).T
    inside = (rows >= 0) & (columns >= 0) & (rows < grid.rows) & (columns < grid.columns)
    known = np.zeros(len(points), dtype=np.bool_)
    known[inside] = GridMap(grid.stored[rows[inside], columns[inside]][None]).known[0] if (
        inside.any()
    ) else False  # fmt: skip
    return known


def _overlap(a: GridMap, b: GridMap) -> int:
    rows, columns = np.nonzero(a.known)
    return int(_knows(b, a.world_of_cells(rows, columns)).sum())


def _candidates(a: GridMap, b: GridMap, low: float) -> list[tuple[Pose2D, float]]:
    """Motions worth a closer look, best first, and the size of the cells they were found with."""
    longest = max(max(g.rows, g.columns) * g.resolution for g in (a, b))
    coarse = max(longest / _COARSE_SIDE, a.resolution, b.resolution)
    signal_a, corner = _signal(resample(a, coarse), low)
    small_b = resample(b, coarse)
    side = 2 * math.ceil(1.5 * max(*small_b.stored.shape, *signal_a.shape))
    spectrum = np.fft.rfft2(signal_a, (side, side))
    radius = math.hypot(*small_b.stored.shape) / 2
    turns = math.ceil(math.tau * radius)  # the rim moves by a cell
    found = []
    for k in range(turns):
        turned, _ = move(small_b, Pose2D(0, 0, k * math.tau / turns))
        signal, place = _signal(_upright(turned), low)
        product = np.fft.irfft2(spectrum * np.fft.rfft2(signal, (side, side)).conj(), (side, side))
        at = int(np.argmax(product))
        v, u = (d - side if d > side // 2 else d for d in divmod(at, side))
        x = corner[0] + u * coarse - place[0]
        y = corner[1] + v * coarse - place[1]
        found.append((float(product.flat[at]), Pose2D(x, y, wrap_angle(k * math.tau / turns))))
    found.sort(key=lambda item: -item[0])
    return [(pose, coarse) for _, pose in found[:_CANDIDATES]]


def _upright(grid: GridMap) -> GridMap:
    from mapcli.algorithms.transform import bake

    return bake(grid)


def _signal(grid: GridMap, low: float) -> tuple[NDArray[np.float64], tuple[float, float]]:
    """Walls above and open below a mean of 0, unknown 0; the lowest y in row 0. And its corner."""
    upright = _upright(grid)
    cells = upright.bottom_up()
    known = ~np.isnan(cells)
    signal = np.where(known, np.where(cells >= np.float32(low), 1.0, 0.0), 0.0)
    if known.any():
        signal[known] -= signal[known].mean()
    return signal, (upright.origin.x, upright.origin.y)


def _refined(
    motion: Pose2D, tree: cKDTree, points: NDArray[np.float64], reach: float, cell: float
) -> Pose2D:
    """Closest points, again and again, within a reach that shrinks to two cells."""
    while True:
        for _ in range(15):
            moved = motion.apply(points)
            distance, index = tree.query(moved, distance_upper_bound=reach)
            pairs = np.isfinite(distance)
            if pairs.sum() < 3:
                return motion
            step = _fitted(moved[pairs], tree.data[index[pairs]])
            motion = step.compose(motion)
            if math.hypot(step.x, step.y) < 1e-4 * cell and abs(step.theta) < 1e-6:
                break
        if reach <= 2 * cell:
            return motion
        reach = max(reach / 2, 2 * cell)


def _fitted(points: NDArray[np.float64], targets: NDArray[np.float64]) -> Pose2D:
    """The motion that takes points closest to their targets, in the sum of squares."""
    centre, goal = points.mean(axis=0), targets.mean(axis=0)
    (px, py), (tx, ty) = (points - centre).T, (targets - goal).T
    angle = math.atan2(float((px * ty - py * tx).sum()), float((px * tx + py * ty).sum()))
    turn = Pose2D(0, 0, angle)
    (shifted,) = turn.apply(centre[None])
    return Pose2D(float(goal[0] - shifted[0]), float(goal[1] - shifted[1]), angle)
