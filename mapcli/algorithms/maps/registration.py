"""Finds where one map lies in another, with no guess to start from.

Both maps are reduced to about a hundred cells a side and correlated by FFT at every angle, all
shifts at once, walls against walls and open against open. The best few candidates, and the one
that both origins are right already, are refined on the walls' points (iterated closest points,
with an ever smaller reach). The one with most evidence wins: walls that lie on a wall of the other
map, the closer the more, less those that lie where the other map knows to be no wall. At last its
misfit is minimised.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from mapcli.algorithms.maps.transform import bake_yaw, move, resample
from mapcli.algorithms.maps.wall_direction import OCCUPIED_THRESHOLD, occupied_points
from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D, wrap_angle

_COARSE_SIDE = 96
"""Cells of the longer side, for the search over everything."""

_CANDIDATES = 12
_MOST_POINTS = 20_000
_POLISHING_POINTS = 4_000
_NEAR_CELLS = 1.5
"""A wall cell meets a wall of the other map within so many cells."""

_MISS = 0.5
"""What a wall cell counts against a place, where the other map knows that there is no wall; one
that lies right on a wall counts 1 for it."""


@dataclass(frozen=True, slots=True)
class Registration:
    """Where a map lies in another.

    Attributes:
        motion: takes the second map's world into the first one's.
        score: of the wall cells of either map, where the other one knows something, the share
            that meets a wall of the other; 1 is perfect.
        overlap_m2: square metres where both know something.
    """

    motion: Pose2D
    score: float
    overlap_m2: float


def register(a: GridMap, b: GridMap, low: float = OCCUPIED_THRESHOLD) -> Registration:
    """Find the motion of `b` that lays it onto `a`.

    Raises:
        DataError: a map without walls, or nothing in common.
    """
    walls_a, walls_b = occupied_points(a, low), _some(occupied_points(b, low))
    if not (len(walls_a) and len(walls_b)):
        raise DataError("a map without occupied cells", expected="walls in both maps")
    tree = cKDTree(walls_a)
    cell = max(a.resolution, b.resolution)
    best, most = None, -math.inf
    for candidate, coarse in [(Pose2D(), cell), *_candidates(a, b, low)]:
        motion = _refined(candidate, tree, walls_b, 2 * coarse, cell)
        found, evidence = score(a, b, motion, low)
        if evidence > most:
            best, most = found, evidence
    if best is None or best.overlap_m2 == 0 or most <= 0:
        raise DataError(
            "no place was found where one map fits the other",
            expected="maps that overlap by a quarter or more, with walls in it",
        )
    polished, evidence = score(a, b, _polished(best.motion, walls_a, walls_b, cell), low)
    return polished if evidence >= most else best


def score(
    a: GridMap, b: GridMap, motion: Pose2D, low: float = OCCUPIED_THRESHOLD
) -> tuple[Registration, float]:
    """How well `b`, moved, lies on `a`; and the evidence for it, in square metres of walls."""
    moved, _ = move(b, motion)
    near = _NEAR_CELLS * max(a.resolution, b.resolution)
    met = compared = evidence = 0.0
    for mine, other in ((a, moved), (moved, a)):
        everything = _close_to(other, occupied_points(mine, low), near)
        walls, targets = _some(everything), _close_to(mine, occupied_points(other, low), near)
        weight = len(everything) / max(len(walls), 1) * mine.resolution**2
        distance = _distances(walls, targets, near)
        meets = np.isfinite(distance)
        misses = ~meets & _knows(other, walls)
        met += weight * int(meets.sum())
        compared += weight * int((meets | misses).sum())
        closeness = float((1 - (distance[meets] / near) ** 2).sum())
        evidence += weight * (closeness - _MISS * int(misses.sum()))
    share = met / compared if compared else 0.0
    return Registration(motion, share, _overlap(a, moved)), evidence


def _distances(
    walls: NDArray[np.float64], targets: NDArray[np.float64], near: float
) -> NDArray[np.float64]:
    """From each wall cell to the nearest target; infinite where none is near."""
    if not len(targets):
        return np.full(len(walls), np.inf)
    distance, _ = cKDTree(targets).query(walls, distance_upper_bound=near)
    return np.asarray(distance)


def _close_to(grid: GridMap, points: NDArray[np.float64], near: float) -> NDArray[np.float64]:
    """The points that lie on the map or near its edge."""
    row, column = grid.fractional_cells_of_world(points).T
    margin = near / grid.resolution + 0.5
    inside = (row > -margin) & (row < grid.rows - 1 + margin)
    inside &= (column > -margin) & (column < grid.columns - 1 + margin)
    return np.asarray(points[inside])


def _some(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return points[:: max(-(-len(points) // _MOST_POINTS), 1)]


def _knows(grid: GridMap, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the map knows the cells of points."""
    rows, columns = grid.cells_of_world(points).T
    known = (rows >= 0) & (columns >= 0) & (rows < grid.rows) & (columns < grid.columns)
    if known.any():
        known[known] = GridMap(grid.stored[rows[known], columns[known]][None]).known[0]
    return np.asarray(known)


def _overlap(a: GridMap, b: GridMap) -> float:
    """Square metres that both know, counted in the cells of the one with fewer cells."""
    small, large = (a, b) if a.stored.size < b.stored.size else (b, a)
    cells, first = 0, 0
    for band in small.bands():
        rows, columns = np.nonzero(band.known)
        cells += int(_knows(large, small.world_of_cells(rows + first, columns)).sum())
        first += band.rows
    return cells * small.resolution**2


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
        signal, place = _signal(turned, low)
        product = np.fft.irfft2(spectrum * np.fft.rfft2(signal, (side, side)).conj(), (side, side))
        at = int(np.argmax(product))
        v, u = (d - side if d > side // 2 else d for d in divmod(at, side))
        x = corner[0] + u * coarse - place[0]
        y = corner[1] + v * coarse - place[1]
        found.append((float(product.flat[at]), Pose2D(x, y, wrap_angle(k * math.tau / turns))))
    found.sort(key=lambda item: -item[0])
    return [(pose, coarse) for _, pose in found[:_CANDIDATES]]


def _signal(grid: GridMap, low: float) -> tuple[NDArray[np.float64], tuple[float, float]]:
    """Walls above and open below a mean of 0, unknown 0; the lowest y in row 0. And its corner."""
    upright = bake_yaw(grid)
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


def _polished(
    motion: Pose2D, a: NDArray[np.float64], b: NDArray[np.float64], cell: float
) -> Pose2D:
    """The motion nearby with the least squares of distances, both ways, each at most two cells.

    Closest points alone stall where walls are several cells thick: every cell has a wall at hand.
    """
    a, b = (points[:: max(len(points) // _POLISHING_POINTS, 1)] for points in (a, b))
    trees, centre = (cKDTree(a), cKDTree(b)), b.mean(axis=0)
    reach = max(float(np.hypot(*(b - centre).T).max()), cell)

    def moved(change: NDArray[np.float64]) -> Pose2D:
        x, y, turn = change * cell
        about = Pose2D(centre[0], centre[1], float(turn) / reach)
        return motion.compose(Pose2D(x, y)).compose(about).compose(Pose2D(-centre[0], -centre[1]))

    def misfit(change: NDArray[np.float64]) -> float:
        there = moved(change)
        d, _ = trees[0].query(there.apply(b))
        e, _ = trees[1].query(there.inverse().apply(a))
        return sum(float(np.mean(np.minimum(x / cell, 2.0) ** 2)) for x in (d, e))

    start = np.vstack([np.zeros(3), np.eye(3)])
    found = minimize(misfit, np.zeros(3), method="Nelder-Mead",
                     options={"initial_simplex": start, "xatol": 1e-3, "fatol": 1e-9})  # fmt: skip
    return moved(found.x)


def _fitted(points: NDArray[np.float64], targets: NDArray[np.float64]) -> Pose2D:
    """The motion that takes points closest to their targets, in the sum of squares."""
    centre, goal = points.mean(axis=0), targets.mean(axis=0)
    (px, py), (tx, ty) = (points - centre).T, (targets - goal).T
    angle = math.atan2(float((px * ty - py * tx).sum()), float((px * tx + py * ty).sum()))
    turn = Pose2D(0, 0, angle)
    (shifted,) = turn.apply(centre[None])
    return Pose2D(float(goal[0] - shifted[0]), float(goal[1] - shifted[1]), angle)
