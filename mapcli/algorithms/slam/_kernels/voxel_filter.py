"""A voxel grid filter in the plane: one point of each square cell."""

from __future__ import annotations

from math import floor

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel


def first_of_each_cell(points: NDArray[np.float64], cell: float) -> NDArray[np.int64]:
    """Indices, ascending, of the first point in each square of side `cell`; points: (n, 2)."""
    kept = np.empty(len(points), np.int64)
    # A hash table that stays at least three quarters empty.
    firsts = np.full(4 << len(points).bit_length(), -1, np.int64)
    return kept[: keep_firsts(points, cell, firsts, kept)]


@kernel
def keep_firsts(
    points: NDArray[np.float64], cell: float, firsts: NDArray[np.int64], kept: NDArray[np.int64]
) -> int:
    """Fill `kept` with what `first_of_each_cell` returns, and return how many they are.

    `firsts` is a hash table of so far -1: the first point in each square.
    """
    mask, count = len(firsts) - 1, 0
    for i in range(len(points)):
        u, v = floor(points[i, 0] / cell), floor(points[i, 1] / cell)
        at = ((u * 4000037 + v) * 40503) & mask
        while firsts[at] >= 0:
            first = firsts[at]
            if floor(points[first, 0] / cell) == u and floor(points[first, 1] / cell) == v:
                break
            at = (at + 1) & mask
        if firsts[at] < 0:
            firsts[at] = i
            kept[count] = i
            count += 1
    return count
