"""Global registration: the motion that lays one map onto another, without an initial guess.

Both maps are reduced to about a hundred cells a side and cross-correlated by FFT at every angle,
all translations at once, occupied against occupied and free against free. The best few candidates,
and the identity, are refined by ICP (iterative closest point) on the occupied cells, with a
shrinking correspondence distance. The candidate with most evidence wins: occupied cells that
coincide with those of the other map, by their closeness, less those in free space of the other map.
At last the robust sum of squared distances is minimised.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from mapcli.algorithms.maps.transform import bake_yaw, merge, move, resample
from mapcli.algorithms.maps.wall_direction import occupied_points
from mapcli.errors import DataError
from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap, crop_to_known
from mapcli.model.pose import Pose2D, wrap_angle

_COARSE_SIDE = 96
"""Cells of the longer side in the correlation."""

_CANDIDATES = 12
"""Local maxima of the correlation that are refined."""

_MOST_POINTS = 20_000
"""Occupied cells used for ICP and evidence; of more, some are left out at even intervals."""

_MINIMISATION_POINTS = 4_000
"""The same for the final minimisation, which evaluates the cost hundreds of times."""

_INLIER_CELLS = 1.5
"""An occupied cell is an inlier when one of the other map is within so many cells."""

_OUTLIER_EVIDENCE = 0.5
"""What an occupied cell in free space of the other map counts against a motion; an inlier at
distance 0 counts 1 for it."""


RELIABLE_SCORE = 0.6
"""Maps of different places were seen to reach a score of 0.5."""


@dataclass(frozen=True, slots=True)
class Registration:
    """The motion that lays one map onto another.

    Attributes:
        motion: takes the second map's world into the first one's.
        score: share of inliers among the occupied cells of either map that lie in known space of
            the other; 1 is perfect.
        overlap_m2: square metres where both are known.
        evidence_m2: closeness of inliers less outliers, in square metres of occupied cells.
    """

    motion: Pose2D
    score: float
    overlap_m2: float
    evidence_m2: float

    @property
    def is_reliable(self) -> bool:
        """Whether a motion that was searched for can be trusted without a look at the result."""
        return self.score >= RELIABLE_SCORE


class MergedMap(NamedTuple):
    """Two maps in one, and how the second was laid onto the first."""

    grid: GridMap
    registration: Registration


def register(a: GridMap, b: GridMap, threshold: float = OCCUPIED_THRESHOLD) -> Registration:
    """Find the motion of `b` that lays it onto `a`.

    Raises:
        DataError: a map without walls, or nothing in common.
    """
    walls_a, walls_b = occupied_points(a, threshold), _subsampled(occupied_points(b, threshold))
    if not (len(walls_a) and len(walls_b)):
        raise DataError("a map without occupied cells", expected="walls in both maps")
    tree = cKDTree(walls_a)
    cell = max(a.resolution, b.resolution)
    best, most = None, -math.inf
    for candidate, coarse in [(Pose2D(), cell), *_candidates(a, b, threshold)]:
        motion = _icp(candidate, tree, walls_b, 2 * coarse, cell)
        found = score_motion(a, b, motion, threshold)
        if found.evidence_m2 > most:
            best, most = found, found.evidence_m2
    if best is None or best.overlap_m2 == 0 or most <= 0:
        raise DataError(
            "no place was found where one map fits the other",
            expected="maps that overlap by a quarter or more, with walls in it",
        )
    minimised = score_motion(a, b, _minimised(best.motion, walls_a, walls_b, cell), threshold)
    return minimised if minimised.evidence_m2 >= most else best


def merge_maps(grid: GridMap, other: GridMap, motion: Pose2D | None = None) -> MergedMap:
    """Both maps in one, on the cells of the first, after moving the world of the other.

    Args:
        motion: of the other map's world; None searches for it (`register`).

    Raises:
        DataError: as of `register`, or a result that is too large.
    """
    found = register(grid, other) if motion is None else score_motion(grid, other, motion)
    return MergedMap(merge(grid, move(crop_to_known(other), found.motion).grid), found)


def score_motion(
    a: GridMap, b: GridMap, motion: Pose2D, threshold: float = OCCUPIED_THRESHOLD
) -> Registration:
    """How well `b`, moved by a motion, lies on `a`."""
    moved, _ = move(b, motion)
    reach = _INLIER_CELLS * max(a.resolution, b.resolution)
    met = compared = evidence = 0.0
    for mine, other in ((a, moved), (moved, a)):
        all_walls = _points_near(other, occupied_points(mine, threshold), reach)
        walls = _subsampled(all_walls)
        targets = _points_near(mine, occupied_points(other, threshold), reach)
        weight = len(all_walls) / max(len(walls), 1) * mine.resolution**2
        distance = _nearest_distances(walls, targets, reach)
        meets = np.isfinite(distance)
        misses = ~meets & _is_known(other, walls)
        met += weight * int(meets.sum())
        compared += weight * int((meets | misses).sum())
        closeness = float((1 - (distance[meets] / reach) ** 2).sum())
        evidence += weight * (closeness - _OUTLIER_EVIDENCE * int(misses.sum()))
    share = met / compared if compared else 0.0
    return Registration(motion, share, _overlap_m2(a, moved), evidence)


def _nearest_distances(
    walls: NDArray[np.float64], targets: NDArray[np.float64], reach: float
) -> NDArray[np.float64]:
    """From each occupied cell to the nearest target; infinite beyond the reach."""
    if not len(targets):
        return np.full(len(walls), np.inf)
    distance, _ = cKDTree(targets).query(walls, distance_upper_bound=reach)
    return np.asarray(distance)


def _points_near(grid: GridMap, points: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """The points on the map or within the reach of its edge."""
    row, column = grid.fractional_cells_of_world(points).T
    margin = reach / grid.resolution + 0.5
    inside = (row > -margin) & (row < grid.rows - 1 + margin)
    inside &= (column > -margin) & (column < grid.columns - 1 + margin)
    return np.asarray(points[inside])


def _subsampled(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return points[:: max(-(-len(points) // _MOST_POINTS), 1)]


def _is_known(grid: GridMap, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the cells of points are known."""
    rows, columns = grid.cells_of_world(points).T
    known = (rows >= 0) & (columns >= 0) & (rows < grid.rows) & (columns < grid.columns)
    if known.any():
        known[known] = GridMap(grid.stored[rows[known], columns[known]][None]).known[0]
    return np.asarray(known)


def _overlap_m2(a: GridMap, b: GridMap) -> float:
    """Square metres known in both, counted in the cells of the map with fewer cells."""
    small, large = (a, b) if a.stored.size < b.stored.size else (b, a)
    cells, first = 0, 0
    for band in small.bands():
        rows, columns = np.nonzero(band.known)
        cells += int(_is_known(large, small.world_of_cells(rows + first, columns)).sum())
        first += band.rows
    return cells * small.resolution**2


def _candidates(a: GridMap, b: GridMap, threshold: float) -> list[tuple[Pose2D, float]]:
    """Maxima of the cross-correlation, best first, and the size of the cells in it."""
    longest = max(max(g.rows, g.columns) * g.resolution for g in (a, b))
    coarse = max(longest / _COARSE_SIDE, a.resolution, b.resolution)
    signal_a, corner = _correlation_signal(resample(a, coarse), threshold)
    small_b = resample(b, coarse)
    side = 2 * math.ceil(1.5 * max(*small_b.stored.shape, *signal_a.shape))
    spectrum = np.fft.rfft2(signal_a, (side, side))
    radius = math.hypot(*small_b.stored.shape) / 2
    turns = math.ceil(math.tau * radius)  # the farthest cell moves by one cell
    found = []
    for k in range(turns):
        turned, _ = move(small_b, Pose2D(0, 0, k * math.tau / turns))
        signal, place = _correlation_signal(turned, threshold)
        product = np.fft.irfft2(spectrum * np.fft.rfft2(signal, (side, side)).conj(), (side, side))
        at = int(np.argmax(product))
        v, u = (d - side if d > side // 2 else d for d in divmod(at, side))
        x = corner[0] + u * coarse - place[0]
        y = corner[1] + v * coarse - place[1]
        found.append((float(product.flat[at]), Pose2D(x, y, wrap_angle(k * math.tau / turns))))
    found.sort(key=lambda item: -item[0])
    return [(pose, coarse) for _, pose in found[:_CANDIDATES]]


def _correlation_signal(
    grid: GridMap, threshold: float
) -> tuple[NDArray[np.float64], tuple[float, float]]:
    """The signal to correlate: occupied above and free below a mean of 0, unknown 0, the lowest y
    in row 0; and the world point of its corner."""
    upright = bake_yaw(grid)
    cells = upright.bottom_up()
    known = ~np.isnan(cells)
    signal = np.where(known, np.where(cells >= np.float32(threshold), 1.0, 0.0), 0.0)
    if known.any():
        signal[known] -= signal[known].mean()
    return signal, (upright.origin.x, upright.origin.y)


def _icp(
    motion: Pose2D, tree: cKDTree, points: NDArray[np.float64], reach: float, cell: float
) -> Pose2D:
    """ICP, point to point, with a correspondence distance that shrinks to two cells."""
    while True:
        for _ in range(15):
            moved = motion.apply(points)
            distance, index = tree.query(moved, distance_upper_bound=reach)
            pairs = np.isfinite(distance)
            if pairs.sum() < 3:
                return motion
            step = _rigid_fit(moved[pairs], tree.data[index[pairs]])
            motion = step.compose(motion)
            if math.hypot(step.x, step.y) < 1e-4 * cell and abs(step.theta) < 1e-6:
                break
        if reach <= 2 * cell:
            return motion
        reach = max(reach / 2, 2 * cell)


def _minimised(
    motion: Pose2D, a: NDArray[np.float64], b: NDArray[np.float64], cell: float
) -> Pose2D:
    """The motion nearby with the least mean squared distance, both ways, truncated at two cells.

    ICP alone stalls where walls are several cells thick: every cell has a correspondence at hand.
    """
    a, b = (points[:: max(len(points) // _MINIMISATION_POINTS, 1)] for points in (a, b))
    trees, centre = (cKDTree(a), cKDTree(b)), b.mean(axis=0)
    reach = max(float(np.hypot(*(b - centre).T).max()), cell)

    def moved(change: NDArray[np.float64]) -> Pose2D:
        x, y, turn = change * cell
        about = Pose2D(centre[0], centre[1], float(turn) / reach)
        return motion.compose(Pose2D(x, y)).compose(about).compose(Pose2D(-centre[0], -centre[1]))

    def cost(change: NDArray[np.float64]) -> float:
        there = moved(change)
        d, _ = trees[0].query(there.apply(b))
        e, _ = trees[1].query(there.inverse().apply(a))
        return sum(float(np.mean(np.minimum(x / cell, 2.0) ** 2)) for x in (d, e))

    start = np.vstack([np.zeros(3), np.eye(3)])
    found = minimize(cost, np.zeros(3), method="Nelder-Mead",
                     options={"initial_simplex": start, "xatol": 1e-3, "fatol": 1e-9})  # fmt: skip
    return moved(found.x)


def _rigid_fit(points: NDArray[np.float64], targets: NDArray[np.float64]) -> Pose2D:
    """The rigid motion with the least sum of squared distances of points to their targets."""
    centre, goal = points.mean(axis=0), targets.mean(axis=0)
    (px, py), (tx, ty) = (points - centre).T, (targets - goal).T
    angle = math.atan2(float((px * ty - py * tx).sum()), float((px * tx + py * ty).sum()))
    turn = Pose2D(0, 0, angle)
    (shifted,) = turn.apply(centre[None])
    return Pose2D(float(goal[0] - shifted[0]), float(goal[1] - shifted[1]), angle)
