"""Two maps of the same place compared: cell by cell, and by the distances of their walls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mapcli.algorithms.maps.registration import register
from mapcli.algorithms.maps.transform import joint_frame, move, sampled
from mapcli.algorithms.maps.wall_direction import occupied_points
from mapcli.model.comparison import FREE, OCCUPIED, UNKNOWN, Comparison
from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap, histogram


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
    return Comparison(
        cells,
        pairs,
        a.resolution**2,
        *_wall_distances(occupied_points(a, threshold), occupied_points(b, threshold)),
        alignment=None if found is None else found.motion,
        score=None if found is None else found.score,
    )


def _states(grid: GridMap, threshold: float) -> NDArray[np.uint8]:
    def state(cells: NDArray[np.float32]) -> NDArray[np.uint8]:
        states = np.where(cells >= np.float32(threshold), np.uint8(OCCUPIED), np.uint8(FREE))
        return np.where(np.isnan(cells), np.uint8(UNKNOWN), states)

    return grid.each(state)


def _wall_distances(
    a: NDArray[np.float64], b: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Metres from each point of the one to the nearest of the other, and back."""
    if not (len(a) and len(b)):
        return np.empty(0), np.empty(0)
    there, _ = cKDTree(b).query(a)
    back, _ = cKDTree(a).query(b)
    return there, back
