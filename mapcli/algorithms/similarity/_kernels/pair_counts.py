"""Compare a perception map with a map at many offsets, compiled: for large scans and windows.

The numpy versions in `ternary_map` do the same for small ones, for which numba is not loaded.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import allocating_kernel

if TYPE_CHECKING:
    from mapcli.algorithms.similarity.ternary_map import Runs

Ints = NDArray[np.int64]


@allocating_kernel
def find_runs(values: NDArray[np.int8]) -> Ints:
    """`ternary_map.find_runs`, compiled."""
    rows, columns = values.shape
    found = np.empty((1024, 4), np.int64)
    n = 0
    for row in range(rows):
        begin = 0
        for column in range(1, columns + 1):
            if column < columns and values[row, column] == values[row, begin]:
                continue
            if values[row, begin] != 0:
                if n == len(found):
                    found = np.concatenate((found, np.empty_like(found)))
                found[n, 0], found[n, 1], found[n, 2] = row, begin, column
                found[n, 3] = values[row, begin]
                n += 1
            begin = column
    return found[:n]


@allocating_kernel
def count_pairs(sums: Ints, runs: Runs, offsets: Ints) -> Ints:
    """Compare the runs of a perception map with a map at each offset; see
    `TernaryMap.pair_counts`.

    Args:
        sums: shape (rows + 1, columns + 1), obstacles * 2^32 + empty cells so far in each row.
        offsets: shape (k, 2), cells to the right and up.
    """
    row, start, end = runs.row, runs.start, runs.end
    rows, columns = sums.shape[0] - 1, sums.shape[1] - 1
    flat, width = sums.ravel(), columns + 1
    shifts = offsets[:, 1] * width + offsets[:, 0]
    left, right = offsets[:, 0].min(), offsets[:, 0].max()
    down, up = offsets[:, 1].min(), offsets[:, 1].max()
    totals = np.zeros((2, len(offsets)), np.int64)
    # Run by run, because the offsets of one run lie close together in memory.
    for i in range(len(row)):
        total = totals[1 if runs.obstacle[i] else 0]
        first, last = row[i] * width + start[i], row[i] * width + end[i]
        if (
            row[i] + down >= 0
            and row[i] + up < rows
            and start[i] + left >= 0
            and end[i] + right <= columns
        ):
            for k in range(len(shifts)):
                total[k] += flat[last + shifts[k]] - flat[first + shifts[k]]
            continue
        for k in range(len(shifts)):
            v = row[i] + offsets[k, 1]
            if 0 <= v < rows:
                a = min(max(start[i] + offsets[k, 0], 0), columns)
                b = min(max(end[i] + offsets[k, 0], 0), columns)
                total[k] += sums[v, b] - sums[v, a]
    result = np.empty((len(offsets), 2, 2), np.int64)
    for p in range(2):
        result[:, p, 0] = totals[p] & 0xFFFFFFFF
        result[:, p, 1] = totals[p] >> 32
    return result
