"""Where a robot goes that is too large to stand on the frontier cells that are left.

A LOOKOUT is a cell where it fits and from which it sees an unknown neighbour of a frontier cell,
for sure: a ray over known open cells gets to the edge between the two (`sensing.look_back` says
which ray; with a range of one cell, the unknown cell is one of the eight around the lookout). The
nearest one is the next goal (ties: smallest row, then smallest column), whatever the strategy.

Lookouts are listed by looking back from the frontier. That is done anew when the list is of no
use to a robot any longer and something has been learned in the meantime.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapcli.algorithms.field import CHANGES, OPEN, UNKNOWN, Cells, Field
from mapcli.algorithms.goals import LOOKOUT, NOWHERE, Goal, takers
from mapcli.algorithms.motion import Search, spread, start_search
from mapcli.algorithms.sensing import Sight, look_back


class Lookouts(NamedTuple):
    """The list of lookouts (mutable).

    Attributes:
        sees: for each cell on the list an unknown cell that is seen from there, else 0 (int64);
            empty for robots that are points. It is of use as long as that cell is unknown.
        listed: the field's CHANGES when the list was last made, shape (1,) (int64).
    """

    sees: Cells
    listed: Cells


def make_lookouts(field: Field) -> Lookouts:
    """An empty list."""
    size = len(field.known) if len(field.disc_rows) else 0
    return Lookouts(np.zeros(size, np.int64), np.full(1, -1, np.int64))


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
    if len(lookouts.sees) == 0:
        return Goal(LOOKOUT, NOWHERE, 0, 0)
    goal = find_listed(field, search, lookouts, goals, robot, cell)
    if goal.cell == NOWHERE and lookouts.listed[0] != field.counts[CHANGES]:
        list_lookouts(field, sight, lookouts)
        goal = find_listed(field, search, lookouts, goals, robot, cell)
    return goal


def find_listed(
    field: Field, search: Search, lookouts: Lookouts, goals: Cells, robot: int, cell: int
) -> Goal:
    """The nearest lookout on the list that is of use, and to which nobody else goes."""
    best, begin, end, moves = NOWHERE, 0, start_search(field, search, cell), 0
    while begin < end and best == NOWHERE:
        for k in range(begin, end):
            there = search.queue[k]
            if best != NOWHERE and best < there:
                continue
            if is_lookout(field, lookouts, there) and takers(goals, robot, there) == 0:
                best = there
        if best == NOWHERE:
            moves += 1
            begin, end = end, spread(field, search, begin, end, moves)
    return Goal(LOOKOUT, best, 0, moves)


def is_lookout(field: Field, lookouts: Lookouts, cell: int) -> bool:
    """Whether a cell is on the list and still of use."""
    seen = lookouts.sees[cell]
    return seen > 0 and field.known[seen] == UNKNOWN and not field.crowded[cell]


def list_lookouts(field: Field, sight: Sight, lookouts: Lookouts) -> None:
    """List all lookouts there are, and leave those on the list that are of use."""
    lookouts.listed[0] = field.counts[CHANGES]
    for cell in range(len(field.known)):
        if field.frontier[cell]:
            for m in range(4):  # the straight moves
                unknown = cell + field.moves[m]
                if field.known[unknown] == UNKNOWN:
                    list_one(field, sight, lookouts, cell, unknown)


def list_one(field: Field, sight: Sight, lookouts: Lookouts, cell: int, unknown: int) -> None:
    """List the cells from which an unknown cell is seen through a frontier cell."""
    for k in range(look_back(field, sight, cell, unknown)):
        place = sight.seen[k]
        fits = field.known[place] == OPEN and not field.crowded[place]
        if fits and not is_lookout(field, lookouts, place):
            lookouts.sees[place] = unknown
