"""Obstacles that are gone: people who walked through, doors that were opened, stray readings.

Their cells were hit a few times, and beams passed through since then; too few perhaps to outweigh
the hits, but nothing was hit there any more. Beams that graze a wall pass through its cells as
well, so only such cells are opened that have no lasting obstacle next to them.
"""

from __future__ import annotations

import numpy as np

from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid, WrittenCells

FEWEST_PASSES = 2
"""Scans whose beams passed through a cell since it was hit last; one alone may have been beside
it, by what a pose errs."""

LASTING_CELLS = 2
"""Cells around an obstacle in which another one that lasts makes it part of a wall."""


class Ghosts:
    """Counts for each occupied cell of a map how many scans have passed through it since it was
    hit last (stateful).

    The map's arrays must not grow meanwhile.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
        self._log_odds = grid.log_odds
        self._passes = np.zeros(self._log_odds.size, dtype=np.uint8)

    def add(self, written: WrittenCells) -> None:
        """A scan was written into the map."""
        still = written.passed[self._log_odds.reshape(-1)[written.passed] > 0]
        self._passes[still] += 1  # at most 40 times: then the cell is open
        self._passes[written.hit] = 0

    def open_passed(self, open_counts: int) -> int:
        """Open the cells of obstacles that are gone; how many they are.

        Args:
            open_counts: the log-odds they get, counts.
        """
        log_odds, passes = self._log_odds, self._passes.reshape(self._log_odds.shape)
        passed = np.argwhere((passes >= FEWEST_PASSES) & (log_odds > 0))
        r = LASTING_CELLS
        gone = []
        for v, u in passed.tolist():
            around = np.s_[max(v - r, 0) : v + r + 1, max(u - r, 0) : u + r + 1]
            if not ((log_odds[around] > 0) & (passes[around] < FEWEST_PASSES)).any():
                gone.append((v, u))
        for v, u in gone:
            log_odds[v, u] = open_counts
        return len(gone)
