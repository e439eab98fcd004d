"""What a robot senses from where it stands.

A range of one cell is the book's robot: its own cell and the eight around it, whatever is in
between. Beyond that it sees as a range finder with rays in every direction: a ray leaves the
centre of the robot's cell, shows each cell that it enters, and ends in the first that it cannot
pass, which it still shows, or where the range ends (centre to centre, in cells). A single ray is
too thin to count: a cell is seen when a bundle of rays gets there, so nothing is seen between two
obstacles that touch at a corner.

All rays are followed at once, octant by octant and row by row: a sector of slopes is narrowed and
split by what stands in it (recursive shadow casting, here with whole squares and exact fractions).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapcli.algorithms.field import OPEN, UNKNOWN, Cells, Field

THROUGH_OPEN = 1 << OPEN
THROUGH_UNKNOWN = 1 << OPEN | 1 << UNKNOWN
"""Which kinds of cells a ray passes, as bits."""


class Sight(NamedTuple):
    """A sensor and its scratch memory (mutable).

    Attributes:
        range: in cells; 1 means the eight neighbours.
        reach: of the window, in rows and columns: the range or the map's size.
        seen: the cells of the last look (int64).
        window: when each cell around the robot was last seen, shape ((2 reach + 1) ** 2,) (int32).
        looks: how many looks there were, shape (1,) (int64).
        sectors: stack of sectors that wait, five numbers each (int64).
    """

    range: int
    reach: int
    seen: Cells
    window: Cells
    looks: Cells
    sectors: Cells


def make_sight(field: Field, sensor_range: int) -> Sight:
    """A sensor that reaches `sensor_range` cells, for this field."""
    reach = min(sensor_range, max(field.rows, field.columns))
    side = 2 * reach + 1
    waiting = 5 * (reach + 1) * (reach + 2) if sensor_range > 1 else 0
    return Sight(
        min(sensor_range, field.rows + field.columns),
        reach,
        np.zeros(min(side * side, len(field.known)), np.int64),
        np.zeros(side * side if sensor_range > 1 else 0, np.int32),
        np.zeros(1, np.int64),
        np.zeros(waiting, np.int64),
    )


def cells_in_range(sight: Sight) -> int:
    """How many cells besides its own a robot could see at most."""
    if sight.range == 1:
        return 8
    rows = np.arange(-sight.range, sight.range + 1)
    return int((2 * np.floor(np.sqrt(sight.range**2 - rows**2)) + 1).sum()) - 1


def look(field: Field, sight: Sight, kinds: Cells, passed: int, cell: int) -> int:
    """See from a cell: how many cells of `sight.seen` hold the answer.

    Args:
        kinds: what each cell is, `field.world` or `field.known`.
        passed: the kinds that rays pass, THROUGH_OPEN or THROUGH_UNKNOWN.
    """
    if sight.range == 1:
        return look_around(field, sight, cell)
    sight.looks[0] += 1
    sight.seen[0] = cell
    sight.window[sight.reach * (2 * sight.reach + 2)] = sight.looks[0]
    row, column = cell // field.stride, cell % field.stride
    seen = 1
    for vertical in (-1, 1):
        height = row - 1 if vertical < 0 else field.rows - row
        for horizontal in (-1, 1):
            width = column - 1 if horizontal < 0 else field.columns - column
            for steep in (True, False):
                octant = (vertical, horizontal, steep, height, width)
                seen = look_in_octant(field, sight, kinds, passed, cell, octant, seen)
    return seen


def look_around(field: Field, sight: Sight, cell: int) -> int:
    """The robot's cell and the eight around it, as far as the map goes."""
    row, column = cell // field.stride, cell % field.stride
    seen = 0
    for r in range(max(row - 1, 1), min(row + 1, field.rows) + 1):
        for c in range(max(column - 1, 1), min(column + 1, field.columns) + 1):
            sight.seen[seen] = r * field.stride + c
            seen += 1
    return seen


def look_in_octant(
    field: Field,
    sight: Sight,
    kinds: Cells,
    passed: int,
    origin: int,
    octant: tuple[int, int, bool, int, int],
    seen: int,
) -> int:
    """Follow the rays of one octant; returns the new number of cells in `sight.seen`.

    An octant has rows in its own sense, at depth 1, 2, ... away from the robot, and in them cells
    0, 1, ... away from its axis; rays have slopes (cells aside per row) from 0 to 1. A cell at
    (depth, aside) is entered by rays of slope (2 aside - 1) / (2 depth + 1) to
    (2 aside + 1) / (2 depth - 1). A sector holds the slopes between two such fractions.
    """
    vertical, horizontal, steep, height, width = octant
    reach, window_side = sight.reach, 2 * sight.reach + 1
    down, right, far, wide = vertical * field.stride, horizontal, height, width
    down_here, right_here = vertical * window_side, horizontal
    if not steep:
        down, right, far, wide = right, down, width, height
        down_here, right_here = right_here, down_here
    centre = reach * (window_side + 1)
    far, limit = min(far, reach), sight.range * sight.range
    sectors, now = sight.sectors, sight.looks[0]
    waiting = push(sectors, 0, 1, 0, 1, 1, 1)
    while waiting:
        waiting -= 5
        depth = sectors[waiting]
        low, low_by = sectors[waiting + 1], sectors[waiting + 2]
        high, high_by = sectors[waiting + 3], sectors[waiting + 4]
        while depth <= far and low * high_by < high * low_by:
            near_edge, far_edge = 2 * depth - 1, 2 * depth + 1
            # The first cell that the lowest ray has not yet passed at the row's near edge.
            aside = (low * near_edge - low_by) // (2 * low_by) + 1
            while (2 * aside - 1) * high_by < high * far_edge and low * high_by < high * low_by:
                if aside > wide or depth * depth + aside * aside > limit:
                    high, high_by = 2 * aside - 1, far_edge  # the rays from here on have ended
                    break
                here = centre + depth * down_here + aside * right_here
                cell = origin + depth * down + aside * right
                if sight.window[here] != now:
                    sight.window[here] = now
                    sight.seen[seen] = cell
                    seen += 1
                if not (passed >> kinds[cell]) & 1:
                    if low * far_edge < (2 * aside - 1) * low_by:
                        waiting = push(
                            sectors, waiting, depth + 1, low, low_by, 2 * aside - 1, far_edge
                        )
                    if low * near_edge < (2 * aside + 1) * low_by:
                        low, low_by = 2 * aside + 1, near_edge
                aside += 1
            depth += 1
    return seen


def push(
    sectors: Cells, waiting: int, depth: int, low: int, low_by: int, high: int, high_by: int
) -> int:
    """Let the sector of slopes low / low_by to high / high_by wait for its turn at a row."""
    sectors[waiting] = depth
    sectors[waiting + 1] = low
    sectors[waiting + 2] = low_by
    sectors[waiting + 3] = high
    sectors[waiting + 4] = high_by
    return waiting + 5


def expected(field: Field, sight: Sight, cell: int) -> int:
    """Cells expected to be seen from a cell: those unknown ones that rays would show if nothing
    but the known obstacles (and cells known to be unknowable) stood in their way."""
    count = 0
    for k in range(look(field, sight, field.known, THROUGH_UNKNOWN, cell)):
        count += field.known[sight.seen[k]] == UNKNOWN
    return count
