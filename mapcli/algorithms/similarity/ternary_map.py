"""The map m of Sect. 9.5 as a matrix of -1 (empty), +1 (obstacle) and 0 (unknown), and how many of
its cells agree with a perception."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.perception_map import PerceptionMap
from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap

Ints = NDArray[np.int64]

LOOKUPS_AT_ONCE = 2_000_000
"""Look-ups of `TernaryMap.pair_counts` in one array, which bounds the memory."""


class Runs(NamedTuple):
    """Equal known cells side by side, in cells of the map; all of shape (n,).

    Attributes:
        row: from below; start, end: the first column, and the one after the last.
        obstacle: True for obstacles, False for empty cells.
    """

    row: Ints
    start: Ints
    end: Ints
    obstacle: NDArray[np.bool_]


def ternary_cells(grid: GridMap, low: float = OCCUPIED_THRESHOLD) -> NDArray[np.int8]:
    """The cells of a map, bottom-up: -1 empty (known and less than `low`), +1 obstacle, 0
    unknown."""
    cells = grid.bottom_up()
    ternary = np.where(cells < np.float32(low), -1, 1).astype(np.int8)
    ternary[np.isnan(cells)] = 0
    return ternary


class TernaryMap:
    """The map m of Sect. 9.5: cells of -1, 0 and +1, with running sums along its rows.

    A run of equal cells of a perception is compared with the map by two look-ups, however long.

    Attributes:
        rows, columns: its size.
    """

    def __init__(self, signs: NDArray[np.int8]) -> None:
        """From cells of -1, 0 and +1, shape (rows, columns), bottom-up."""
        self.rows, self.columns = signs.shape
        # Obstacles so far in a row are counted in the upper half of a number, empty cells in the
        # lower one. The last row is for everything above and below the map.
        steps = np.zeros((self.rows + 1, self.columns + 1), np.int64)
        steps[:-1, 1:] = (signs == 1) * np.int64(1 << 32) + (signs == -1)
        self._sums = np.cumsum(steps, axis=1)

    def pair_counts(
        self, perceived: PerceptionMap, offsets: Ints, *, compiled: bool = False
    ) -> Ints:
        """Compare a perception with the map when it is moved by whole cells.

        Args:
            offsets: shape (k, 2), cells to the right and up.
            compiled: sum with a loop compiled by numba, which takes longer to load.

        Returns:
            shape (k, 2, 2), how many cells of each kind both know: [:, p, m] with p and m 0 for
            empty and 1 for obstacle in the perception and in the map.
        """
        if compiled:
            from mapcli.algorithms.similarity._kernels import pair_counts as kernels

            runs = _place_runs(kernels.find_runs(perceived.values), perceived)
            counted: Ints = kernels.count_pairs(self._sums, runs, offsets)
            return counted
        runs = _place_runs(find_runs(perceived.values), perceived)
        result = np.zeros((len(offsets), 2, 2), np.int64)
        chunk = max(LOOKUPS_AT_ONCE // max(len(runs.row), 1), 1)
        for first in range(0, len(offsets), chunk):
            part = slice(first, first + chunk)
            sums = self._run_sums(runs, offsets[part])
            for p, of in enumerate((~runs.obstacle, runs.obstacle)):
                total = sums[:, of].sum(axis=1)
                result[part, p, 0] = total & 0xFFFFFFFF
                result[part, p, 1] = total >> 32
        return result

    def _run_sums(self, runs: Runs, offsets: Ints) -> Ints:
        """What the map holds under each run at each offset, shape (k, runs): obstacles * 2^32 +
        empty cells."""
        rows = runs.row + offsets[:, 1:]
        rows[(rows < 0) | (rows >= self.rows)] = self.rows
        rows *= self.columns + 1
        flat = self._sums.ravel()
        right = np.clip(runs.end + offsets[:, :1], 0, self.columns)
        left = np.clip(runs.start + offsets[:, :1], 0, self.columns)
        sums: Ints = flat[rows + right] - flat[rows + left]
        return sums


def find_runs(values: NDArray[np.int8]) -> Ints:
    """Row, first and end column, and content of equal known cells side by side, shape (n, 4)."""
    framed = np.pad(values, ((0, 0), (1, 1)))
    row, column = np.nonzero(framed[:, 1:] != framed[:, :-1])
    begins, ends = framed[row, column + 1] != 0, framed[row, column] != 0
    row, start = row[begins], column[begins]
    return np.column_stack([row, start, column[ends], framed[row, start + 1]]).astype(np.int64)


def _place_runs(found: Ints, perceived: PerceptionMap) -> Runs:
    """The runs of a perception map, in cells of the map."""
    row, start, end, value = found.T
    left = perceived.left
    return Runs(row + perceived.bottom, start + left, end + left, value == 1)
