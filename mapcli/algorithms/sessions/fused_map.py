"""One map of the maps of several drives, where things may have changed from one to the next."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam.log_odds import (
    MAX_COUNTS,
    MIN_COUNTS,
    log_odds_from_probabilities,
    probabilities_from_log_odds,
)
from mapcli.model.changed_cells import States, changed_cells
from mapcli.model.grid import GridMap


def fuse(maps: Sequence[GridMap], *, static: bool) -> GridMap:
    """What several drives saw, in one map.

    Where drives agree, their evidence adds up. A drive that found an obstacle where another saw
    through disagrees, unless the other has one in the next cell: there the newest is right, or with
    `static` the cell is unknown.

    Args:
        maps: the oldest first, of the same resolution, in the same frame; the corners are whole
            cells apart.
    """
    frame = _Frame(maps)
    fused = frame.counts(maps[0])
    changed = np.zeros(fused.shape, np.bool_)
    for one in maps[1:]:
        newer = frame.counts(one)
        differ = _disagree(fused, newer)
        changed |= differ
        fused = np.where(differ, newer, _added(fused, newer))
    if static:
        fused[changed] = 0
    cells = probabilities_from_log_odds(fused)
    return GridMap.from_bottom_up(cells, maps[0].resolution, frame.corner)


def _disagree(one: NDArray[np.int16], other: NDArray[np.int16]) -> NDArray[np.bool_]:
    """Where one has an obstacle, and the other is open with no obstacle next to it."""
    changed = changed_cells(States(one > 0, one < 0), States(other > 0, other < 0))
    return np.asarray(changed.vanished | changed.appeared)


def _added(one: NDArray[np.int16], other: NDArray[np.int16]) -> NDArray[np.int16]:
    """Evidence added up, within the limits of a cell; where it is even, what the other one has."""
    total = np.clip(one.astype(np.int32) + other, MIN_COUNTS, MAX_COUNTS)
    return np.where(total == 0, other, total).astype(np.int16)


class _Frame:
    """The rectangle that holds several maps.

    Attributes:
        corner: x, y of its lower left corner, metres.
    """

    def __init__(self, maps: Sequence[GridMap]) -> None:
        self._cell = maps[0].resolution
        low = np.array([self._first(one) for one in maps])
        size = np.array([(one.columns, one.rows) for one in maps])
        self._low = low.min(axis=0)
        self._size = (low + size).max(axis=0) - self._low
        x, y = (self._low * self._cell).tolist()
        self.corner = round(x, 9), round(y, 9)

    def _first(self, one: GridMap) -> NDArray[np.int64]:
        """The number of a map's first cell, along x and y."""
        corner = np.array([one.origin.x, one.origin.y]) / self._cell
        return np.rint(corner).astype(np.int64)

    def counts(self, one: GridMap) -> NDArray[np.int16]:
        """The log-odds of a map in the rectangle, bottom-up."""
        counts = np.zeros(self._size[::-1], np.int16)
        u, v = (self._first(one) - self._low).tolist()
        counts[v : v + one.rows, u : u + one.columns] = log_odds_from_probabilities(one.bottom_up())
        return counts
