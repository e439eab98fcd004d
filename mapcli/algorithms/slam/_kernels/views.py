"""Which cells scans saw, and which of them one scan contradicts: the loops of `contradictions`."""

from __future__ import annotations

from math import floor, hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel

CLEARED = 2
"""Scans that must have seen through a cell for it to be open: one may have erred."""


class ViewCounts(NamedTuple):
    """How many scans saw each cell of a grid, bottom-up: `[v, u]`, int16.

    Attributes:
        hits: beams that ended in the cell; passes: that went through it, well before their end.
    """

    hits: NDArray[np.int16]
    passes: NDArray[np.int16]


class Compared(NamedTuple):
    """Ends of a scan's beams, compared with what other scans saw there.

    Attributes:
        confirmed: others hit something within a cell of them, and seldom saw through.
        contradicted: others saw through the place more often than they hit something near it: of
            a wall that is in the map twice, each visit shows one and sees through the other.
    """

    confirmed: int
    contradicted: int


@kernel
def count_view(
    counts: ViewCounts, ends: NDArray[np.float32], start: NDArray[np.float64], sign: int
) -> None:
    """Add a scan to the counts, or take it away (sign -1).

    Args:
        ends: shape (n, 2), (u, v) in cells, inside the grid; start: of the beams.
    """
    for i in range(len(ends)):
        du, dv = ends[i, 0] - start[0], ends[i, 1] - start[1]
        length = hypot(du, dv)
        # The last cell and a half may belong to the wall.
        for k in range(int(length) - 1):
            share = (k + 0.5) / length
            counts.passes[floor(start[1] + share * dv), floor(start[0] + share * du)] += sign
        counts.hits[floor(ends[i, 1]), floor(ends[i, 0])] += sign


@kernel
def compare_view(counts: ViewCounts, ends: NDArray[np.float32]) -> Compared:
    """Compare the ends of a scan's beams, as of `count_view`, with what the counts hold."""
    confirmed = contradicted = 0
    for i in range(len(ends)):
        u, v = floor(ends[i, 0]), floor(ends[i, 1])
        hits, passes = counts.hits[v - 1 : v + 2, u - 1 : u + 2].sum(), counts.passes[v, u]
        if passes >= CLEARED and passes > hits:
            contradicted += 1
        elif hits > 0:
            confirmed += 1
    return Compared(confirmed, contradicted)
