"""Whether there is anything unknown to be seen from a cell, without listing what is seen.

The answer is that of a look over known open cells (`sensing.look`), and so is the way to it: rows
and sectors. But of a row of open cells, which may be wide and of which nothing needs to be written
down, only the end matters. It is remembered, so that looks from the cells around find it at once:
a hundred cells of open floor cost a step instead of a hundred.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mapcli.algorithms.field import CONTRADICTED, OPEN, UNKNOWN, Cells, Field
from mapcli.algorithms.sensing import (
    Octant,
    Sight,
    count_unknown,
    look_around,
    octant_of,
    push,
)

LONGEST = 2**15 - 1


class Runs(NamedTuple):
    """What is remembered of rows of open cells (mutable).

    Attributes:
        right, left, down, up: for each cell, so many cells from there on that way are known to be
            open, itself included; at least so many, or 0 where nobody has counted (int16). Open
            cells stay open, unless a contradiction is found.
        contradicted: the field's count of those when the counting began, shape (1,) (int64).
    """

    right: Cells
    left: Cells
    down: Cells
    up: Cells
    contradicted: Cells


def make_runs(size: int) -> Runs:
    """Nothing is remembered of so many cells."""
    right, left, down, up = np.zeros((4, size), np.int16)
    return Runs(right, left, down, up, np.zeros(1, np.int64))


def shows_unknown(field: Field, sight: Sight, runs: Runs, cell: int) -> bool:
    """Whether a look from a cell over known open cells would show an unknown one."""
    if sight.range == 1:
        return count_unknown(field, sight, look_around(field, sight, cell)) > 0
    forget_if_wrong(field, runs)
    for vertical in (-1, 1):
        for horizontal in (-1, 1):
            for steep in (True, False):
                if steep:
                    run = runs.right if horizontal > 0 else runs.left
                else:
                    run = runs.down if vertical > 0 else runs.up
                octant = octant_of(field, sight, cell, vertical, horizontal, steep)
                if octant_shows_unknown(field, sight, run, cell, octant):
                    return True
    return False


def forget_if_wrong(field: Field, runs: Runs) -> None:
    """Forget all when a contradiction was found since the counting began."""
    if runs.contradicted[0] != field.counts[CONTRADICTED]:
        runs.contradicted[0] = field.counts[CONTRADICTED]
        for run in (runs.right, runs.left, runs.down, runs.up):
            for cell in range(len(run)):
                run[cell] = 0


def octant_shows_unknown(
    field: Field, sight: Sight, run: Cells, origin: int, octant: Octant
) -> bool:
    """The same for one octant; sectors are narrowed and split as in `sensing.look_in_octant`."""
    sectors, waiting = sight.sectors, push(sight.sectors, 0, 1, 0, 1, 1, 1)
    while waiting:
        waiting -= 5
        depth = sectors[waiting]
        low, low_by = sectors[waiting + 1], sectors[waiting + 2]
        high, high_by = sectors[waiting + 3], sectors[waiting + 4]
        while depth <= octant.far and low * high_by < high * low_by:
            near_edge, far_edge = 2 * depth - 1, 2 * depth + 1
            reach = min(octant.wide, int(math.sqrt(sight.range * sight.range - depth * depth)))
            row = origin + depth * octant.down
            aside = (low * near_edge - low_by) // (2 * low_by) + 1
            last = min(reach, (high * far_edge + high_by - 1) // (2 * high_by))
            aside += open_run(
                field, run, row + aside * octant.right, octant.right, last - aside + 1
            )
            while aside <= last and low * high_by < high * low_by:
                if field.known[row + aside * octant.right] == UNKNOWN:
                    return True
                left, right = 2 * aside - 1, 2 * aside + 1
                if low * far_edge < left * low_by:
                    waiting = push(sectors, waiting, depth + 1, low, low_by, left, far_edge)
                if low * near_edge < right * low_by:
                    low, low_by = right, near_edge
                aside += 1
                beyond = row + aside * octant.right
                aside += open_run(field, run, beyond, octant.right, last - aside + 1)
            if (2 * reach + 1) * high_by < high * far_edge:
                high, high_by = 2 * reach + 1, far_edge  # the rays from there on have ended
            depth += 1
    return False


def open_run(field: Field, run: Cells, cell: int, step: int, enough: int) -> int:
    """How many cells from a cell on are known to be open, one step after the other; it may stop
    counting when there are enough."""
    count, counted = 0, 0
    while count < enough and field.known[cell + count * step] == OPEN:
        known = run[cell + count * step]
        if known == 0 and counted == count:
            counted += 1
        count += max(known, 1)
    for k in range(counted):
        run[cell + k * step] = min(count - k, LONGEST)
    return count
