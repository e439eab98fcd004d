"""Where a robot goes that is too large to stand on the frontier cells that are left.

A LOOKOUT is a cell where it fits (or is already), where no robot has sensed yet, and from which a
look would show an unknown cell if all is as is known. The nearest one is the next goal, whatever
the strategy (ties: smallest row, then smallest column).

So it ends: nobody looks twice from the same cell. And nothing is missed: as long as a robot can
reach a cell from which there is something to see, it goes on.

A cell from which nothing is to be seen stays so: its rays end at known obstacles, and only where
an obstacle proves to be none is it worth looking at the cell again. So each cell is looked at
once, as far as searches for the nearest lookout get.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapcli.algorithms.exploration.exploration_state import CONTRADICTED, Cells, Field
from mapcli.algorithms.exploration.field_of_view import Sight
from mapcli.algorithms.exploration.goal_selection import LOOKOUT, NOWHERE, Goal, takers
from mapcli.algorithms.exploration.path_search import NEVER, Search, spread, start_search
from mapcli.algorithms.exploration.visibility import shows_unknown


class Lookouts(NamedTuple):
    """What is known of cells as lookouts (mutable).

    Attributes:
        blank: for each cell, up to how many contradictions in the field it is none (int32): NEVER
            where a robot has sensed, 0 where nobody has wondered. Empty for robots that are
            points: those fit everywhere.
    """

    blank: Cells


def make_lookouts(field: Field) -> Lookouts:
    """Nobody has wondered yet."""
    size = len(field.known) if len(field.disc_rows) else 0
    return Lookouts(np.zeros(size, np.int32))


def find_lookout(
    field: Field,
    search: Search,
    sight: Sight,
    lookouts: Lookouts,
    goals: Cells,
    robot: int,
    cell: int,
) -> Goal:
    """The nearest lookout of a robot at a cell, to which nobody else goes; as for `find_goal`,
    the path to it can then be read from `search`."""
    best, moves = NOWHERE, 0
    begin, end = 0, start_search(field, search, cell) if len(lookouts.blank) else 0
    while begin < end and best == NOWHERE:
        for k in range(begin, end):
            there = search.queue[k]
            fits = not field.crowded[there] or moves == 0
            is_better = best == NOWHERE or there < best
            is_free = fits and is_better and takers(goals, robot, there) == 0
            if is_free and is_lookout(field, sight, lookouts, there):
                best = there
        if best == NOWHERE:
            moves += 1
            begin, end = end, spread(field, search, begin, end, moves)
    return Goal(LOOKOUT, best, 0, moves)


def is_lookout(field: Field, sight: Sight, lookouts: Lookouts, cell: int) -> bool:
    """Whether a look from a cell would show something; where a robot fits is not asked here."""
    contradicted = field.counts[CONTRADICTED]
    if lookouts.blank[cell] > contradicted:
        return False
    if shows_unknown(field, sight, cell):
        return True
    lookouts.blank[cell] = contradicted + 1
    return False


def has_looked(lookouts: Lookouts, cell: int) -> None:
    """A robot has sensed on a cell, which is no lookout any longer."""
    if len(lookouts.blank):
        lookouts.blank[cell] = NEVER
