"""Where a robot goes that is too large to stand on the frontier cells that are left.

A LOOKOUT is a cell where it fits, from which it sees an unknown neighbour of a frontier cell over
known open cells, and which is seen from such a neighbour in the same way. The nearest one is the
next goal (ties: smallest row, then smallest column), whatever the strategy.

Possible lookouts are listed by looking back from the unknown cells. That is done anew only when
none of the last list is of use any longer and something has been learned in the meantime. A
search takes the cells on the list in order, looks out from each, and strikes it off when there is
nothing to see.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapcli.algorithms.field import CHANGES, OPEN, UNKNOWN, Cells, Field
from mapcli.algorithms.goals import LOOKOUT, NOWHERE, Goal, takers
from mapcli.algorithms.motion import Search, spread, start_search
from mapcli.algorithms.sensing import THROUGH_OPEN, Sight, look


class Lookouts(NamedTuple):
    """The list of possible lookouts (mutable).

    Attributes:
        possible: 1 where the cell is on the list (uint8); empty for robots that are points.
        listed: the field's CHANGES when the list was last made, shape (1,) (int64).
    """

    possible: Cells
    listed: Cells


def make_lookouts(field: Field) -> Lookouts:
    """An empty list."""
    size = len(field.known) if len(field.disc_rows) else 0
    return Lookouts(np.zeros(size, np.uint8), np.full(1, -1, np.int64))


def find_lookout(
    field: Field,
    search: Search,
    sight: Sight,
    lookouts: Lookouts,
    goals: Cells,
    robot: int,
    cell: int,
) -> Goal:
    """The nearest lookout of a robot at a cell; as for `find_goal`, the path can then be read."""
    if len(lookouts.possible) == 0:
        return Goal(LOOKOUT, NOWHERE, 0, 0)
    goal = find_listed(field, search, sight, lookouts, goals, robot, cell)
    if goal.cell == NOWHERE and lookouts.listed[0] != field.counts[CHANGES]:
        list_lookouts(field, sight, lookouts)
        goal = find_listed(field, search, sight, lookouts, goals, robot, cell)
    return goal


def find_listed(
    field: Field,
    search: Search,
    sight: Sight,
    lookouts: Lookouts,
    goals: Cells,
    robot: int,
    cell: int,
) -> Goal:
    """The nearest lookout among those on the list."""
    begin, end, moves = 0, start_search(field, search, cell), 0
    while begin < end:
        there = next_listed(field, search, lookouts, goals, robot, begin, end)
        if there == NOWHERE:
            moves += 1
            begin, end = end, spread(field, search, begin, end, moves)
        elif is_lookout(field, sight, there):
            return Goal(LOOKOUT, there, 0, moves)
        else:
            lookouts.possible[there] = 0
    return Goal(LOOKOUT, NOWHERE, 0, 0)


def next_listed(
    field: Field,
    search: Search,
    lookouts: Lookouts,
    goals: Cells,
    robot: int,
    begin: int,
    end: int,
) -> int:
    """The first cell, by row and column, of queue[begin:end] that is on the list and free."""
    first = NOWHERE
    for k in range(begin, end):
        cell = search.queue[k]
        listed = lookouts.possible[cell] == 1 and not field.crowded[cell]
        if listed and (first == NOWHERE or cell < first) and takers(goals, robot, cell) == 0:
            first = cell
    return first


def is_lookout(field: Field, sight: Sight, cell: int) -> bool:
    """Whether an unknown neighbour of a frontier cell is seen from a cell, for sure."""
    count = 0
    for k in range(look(field, sight, field.known, THROUGH_OPEN, cell)):
        seen = sight.seen[k]
        count += field.known[seen] == UNKNOWN and has_open_neighbour(field, seen)
    return count > 0


def has_open_neighbour(field: Field, cell: int) -> bool:
    known, stride = field.known, field.stride
    return (
        known[cell - stride] == OPEN
        or known[cell - 1] == OPEN
        or known[cell + 1] == OPEN
        or known[cell + stride] == OPEN
    )


def list_lookouts(field: Field, sight: Sight, lookouts: Lookouts) -> None:
    """List the cells that are seen from unknown neighbours of the frontier, and have room."""
    lookouts.listed[0] = field.counts[CHANGES]
    for cell in range(len(field.known)):
        if field.known[cell] == UNKNOWN and has_open_neighbour(field, cell):
            for k in range(look(field, sight, field.known, THROUGH_OPEN, cell)):
                seen = sight.seen[k]
                if field.known[seen] == OPEN and not field.crowded[seen]:
                    lookouts.possible[seen] = 1
