"""Two maps of the same place compared: cell by cell, and by the distances of their walls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mapcli.algorithms.maps.changes import cells_changed, changes, place_of
from mapcli.algorithms.maps.registration import register
from mapcli.algorithms.maps.transform import joint_frame, move, sampled
from mapcli.algorithms.maps.wall_direction import occupied_points
from mapcli.model.comparison import FREE, OCCUPIED, UNKNOWN, Comparison
from mapcli.model.grid import OCCUPIED_THRESHOLD, PROBABILITIES, GridMap, histogram


def compare(
    a: GridMap, b: GridMap, *, align: bool = False, threshold: float = OCCUPIED_THRESHOLD
) -> Comparison:
    """Compare two maps on the cells of the first, which go on as far as the second reaches.

    Args:
        align: find the motion that lays `b` onto `a` first.
        threshold: known cells are occupied from this probability on.

    Raises:
        DataError: as of `register`.
    """
    found = register(a, b, threshold) if align else None
    if found is not None:
        b, _ = move(b, found.motion)
    frame = joint_frame(a, b)
    pairs = _states(sampled(a, frame), threshold)
    pairs *= np.uint8(3)
    pairs += _states(sampled(b, frame), threshold)
    cells = histogram(pairs)[:9].reshape(3, 3)
    cells[UNKNOWN, UNKNOWN] = 0
    changed = cells_changed(pairs)
    return Comparison(
        cells,
        pairs,
        a.resolution**2,
        *_wall_distances(a, b, threshold),
        alignment=None if found is None else found.motion,
        score=None if found is None else found.score,
        changed=changed,
        changes=changes(changed, frame),
        place=place_of(frame),
    )


def _states(grid: GridMap, threshold: float) -> NDArray[np.uint8]:
    def state(cells: NDArray[np.float32]) -> NDArray[np.uint8]:
        states = np.where(cells >= np.float32(threshold), np.uint8(OCCUPIED), np.uint8(FREE))
        return np.where(np.isnan(cells), np.uint8(UNKNOWN), states)

    return grid.each(state)


def _wall_distances(
    a: GridMap, b: GridMap, threshold: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Metres from each wall of the one that the other knows something about to the nearest of the
    other, and back."""
    walls_a, walls_b = (occupied_points(one, threshold) for one in (a, b))
    if not (len(walls_a) and len(walls_b)):
        return np.empty(0), np.empty(0)
    there, _ = cKDTree(walls_b).query(walls_a[_known(b, walls_a)])
    back, _ = cKDTree(walls_a).query(walls_b[_known(a, walls_b)])
    return there, back


def _known(grid: GridMap, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether a map knows something about each point."""
    rows, columns = grid.cells_of_world(points).T
    inside = (rows >= 0) & (columns >= 0) & (rows < grid.rows) & (columns < grid.columns)
    known = np.zeros(len(points), np.bool_)
    there = grid.stored[rows[inside], columns[inside]]
    known[inside] = ~np.isnan(PROBABILITIES[there] if there.dtype == np.uint8 else there)
    return known
