"""Which cells scans saw, and which of them one scan contradicts: the loops of `contradictions`."""

from __future__ import annotations

from math import cos, floor, hypot, sin, tau
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel

CLEARED = 2
"""Scans that must have seen through a cell for it to be open: one may have erred."""

DIRECTIONS = 16
"""In which a scan is moved: one of them is along a corridor, to within a cell or so."""


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
        contradicted: others saw through the place, and through all that is next to it, more often
            than they hit something there: of a wall that is in the map twice, each visit shows one
            and sees through the other.
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
def compare_view(
    counts: ViewCounts, ends: NDArray[np.float32], move_u: float = 0.0, move_v: float = 0.0
) -> Compared:
    """Compare the ends of a scan's beams, as of `count_view`, with what the counts hold.

    Args:
        move_u, move_v: where the ends are moved to first, cells; inside the grid.
    """
    confirmed = contradicted = 0
    for i in range(len(ends)):
        u, v = floor(ends[i, 0] + move_u), floor(ends[i, 1] + move_v)
        hits = sum_around(counts.hits, u, v)
        # Beams that graze a wall pass through the cells beside it, and some of its own.
        passes = least_around(counts.passes, u, v) if counts.passes[v, u] > hits else 0
        if passes >= CLEARED and passes > hits:
            contradicted += 1
        elif hits > 0:
            confirmed += 1
    return Compared(confirmed, contradicted)


@kernel
def least_loss(counts: ViewCounts, ends: NDArray[np.float32], cells: float) -> int:
    """How much worse a scan agrees with the counts so many cells away, in the direction in which
    it does least: ends that are confirmed, less those contradicted, fewer than here."""
    here = compare_view(counts, ends)
    most = -len(ends)
    for k in range(DIRECTIONS):
        angle = k * tau / DIRECTIONS
        there = compare_view(counts, ends, cells * cos(angle), cells * sin(angle))
        most = max(most, there.confirmed - there.contradicted)
    return here.confirmed - here.contradicted - most


@kernel
def sum_around(counts: NDArray[np.int16], u: int, v: int) -> int:
    """Of a cell and the eight next to it."""
    total = 0
    for row in range(v - 1, v + 2):
        for column in range(u - 1, u + 2):
            total += counts[row, column]
    return total


@kernel
def least_around(counts: NDArray[np.int16], u: int, v: int) -> int:
    """Of a cell and the eight next to it."""
    least = int(counts[v, u])
    for row in range(v - 1, v + 2):
        for column in range(u - 1, u + 2):
            least = min(least, counts[row, column])
    return least
