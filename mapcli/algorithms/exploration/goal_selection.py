"""Which frontier cell comes next: line 8 of Algorithm 9.1, and Sect. 9.3.3.

All strategies choose the largest worth / path length, the path counted in cells:

    nearest    every frontier cell is worth 1
    priority   the number of its unknown neighbours (left, right, up, down): p = a / d
    gain       the number of cells expected to be seen from it (`sensing.expected`)

Ties: the shorter path, then the smaller row, then the smaller column. A frontier cell under the
robot itself, at distance 0, comes before all others.

A robot takes its goal from its own part of the frontier, to which no other robot is nearer
(`parts.py`); when there is none in it, from all of it. Nobody takes a goal that another holds.

The search goes out from the robot, breadth first, and stops as soon as no cell further on can
beat the best one, because no cell is worth more than `most`. So it costs what lies around the
robot, and nothing for the rest of the map.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapcli.algorithms.exploration.exploration_state import (
    FRONTIER_SIZE,
    Cells,
    Field,
    unknown_neighbours,
)
from mapcli.algorithms.exploration.field_of_view import Sight, cells_in_range, expected
from mapcli.algorithms.exploration.path_search import Search, spread, start_search
from mapcli.algorithms.exploration.voronoi_partition import (
    Parts,
    is_in_part,
    owned,
    spread_waves,
    start_waves,
)

NEAREST, PRIORITY, GAIN = range(3)
"""The strategies."""

START, FRONTIER, LOOKOUT, BLOCKED, STOP, HOME = range(6)
"""Why a robot goes to a cell, and what its step is called in the trace. It senses where it stands
at first; it goes to a frontier cell; it goes to a lookout (`lookouts.py`); it will be blocked on
its way by an obstacle that was believed to be open; it stops, because its goal has lost its
interest while it was on its way and no other is left; it goes home."""

OWN, ANY = 0, 3
"""Places in `Chooser.best`."""

NOWHERE = -1


class Chooser(NamedTuple):
    """How goals are chosen.

    Attributes:
        strategy: NEAREST, PRIORITY or GAIN.
        most: more than this no cell is worth that is one move or more away.
        seen: with GAIN, for each cell 1 + the number of cells expected to be seen when that was
            last worked out, 0 where never (int32). As the map gets known this only shrinks, so
            what it was bounds what it is.
        best: scratch: cell, worth and moves of the best goal in the robot's own part, and of the
            best one anywhere (int64).
    """

    strategy: int
    most: int
    seen: Cells
    best: Cells


class Goal(NamedTuple):
    """A cell to go to (NOWHERE when there is none), why, its worth and the path length to it."""

    kind: int
    cell: int
    worth: int
    moves: int


def make_chooser(strategy: str, field: Field, sight: Sight) -> Chooser:
    """A chooser for `nearest`, `priority` or `gain`."""
    code = {"nearest": NEAREST, "priority": PRIORITY, "gain": GAIN}[strategy]
    # Of a cell that a path leads to, one neighbour is known: the one where the path comes from.
    most = {NEAREST: 1, PRIORITY: 3, GAIN: cells_in_range(sight)}[code]
    return Chooser(
        code,
        most,
        np.zeros(len(field.known) if code == GAIN else 0, np.int32),
        np.zeros(6, np.int64),
    )


def find_goal(
    field: Field,
    search: Search,
    parts: Parts,
    sight: Sight,
    chooser: Chooser,
    cells: Cells,
    goals: Cells,
    robot: int,
) -> Goal:
    """The best goal of a robot. Until the next search, the path to it can be read from `search`.

    Args:
        cells, goals: of all robots (NOWHERE: no goal).
    """
    alone = len(cells) == 1
    chooser.best[OWN] = chooser.best[ANY] = NOWHERE
    if field.counts[FRONTIER_SIZE] == 0:
        return goal_at(chooser, OWN)
    begin, end, moves = 0, start_search(field, search, cells[robot]), 0
    # The waves go ahead of the search: where it gets in some moves, they have got in as many.
    wave_begin, wave_end = 0, 0 if alone else start_waves(parts, cells)
    growing, left = 0, 0
    if not alone:
        growing = left = owned(parts, robot, 0, wave_end)
    while begin < end:
        for k in range(begin, end):
            cell = search.queue[k]
            mine = alone or is_in_part(parts, robot, cell)
            left -= mine
            if is_candidate(field, goals, robot, cell, moves):
                if mine:
                    consider(field, sight, chooser, OWN, cell, moves)
                elif chooser.best[OWN] == NOWHERE:
                    consider(field, sight, chooser, ANY, cell, moves)
        moves += 1
        if is_beaten(chooser, OWN, moves):
            break
        if not alone and growing == 0 and left == 0 and is_beaten(chooser, ANY, moves):
            break
        begin, end = end, spread(field, search, begin, end, moves)
        if growing > 0:
            wave_begin, wave_end = wave_end, spread_waves(field, parts, wave_begin, wave_end)
            growing = owned(parts, robot, wave_begin, wave_end)
            left += growing
    return goal_at(chooser, OWN if chooser.best[OWN] != NOWHERE else ANY)


def is_candidate(field: Field, goals: Cells, robot: int, cell: int, moves: int) -> bool:
    """A frontier cell where the robot fits (or is already), and to which nobody else goes."""
    fits = not field.crowded[cell] or moves == 0
    return field.frontier[cell] == 1 and fits and takers(goals, robot, cell) == 0


def consider(
    field: Field, sight: Sight, chooser: Chooser, place: int, cell: int, moves: int
) -> None:
    """Remember a cell when it is better than the best one so far."""
    if beats(chooser, place, bound(chooser, cell), moves, cell):
        worth = worth_of(field, sight, chooser, cell)
        if beats(chooser, place, worth, moves, cell):
            best = chooser.best
            best[place], best[place + 1], best[place + 2] = cell, worth, moves


def beats(chooser: Chooser, place: int, worth: int, moves: int, cell: int) -> bool:
    """Whether worth / moves at a cell is more than the best so far; ties as said above."""
    best = goal_at(chooser, place)
    if best.cell == NOWHERE:
        return True
    ours, theirs = worth * best.moves, best.worth * moves
    if ours != theirs:
        return ours > theirs
    return moves < best.moves or (moves == best.moves and cell < best.cell)


def is_beaten(chooser: Chooser, place: int, moves: int) -> bool:
    """Whether nothing that is so many moves away or more can be better than the best so far."""
    best = goal_at(chooser, place)
    return best.cell != NOWHERE and chooser.most * best.moves <= best.worth * moves


def goal_at(chooser: Chooser, place: int) -> Goal:
    best = chooser.best
    return Goal(FRONTIER, best[place], best[place + 1], best[place + 2])


def takers(goals: Cells, robot: int, cell: int) -> int:
    """How many other robots go to a cell."""
    count = 0
    for other in range(len(goals)):
        count += other != robot and goals[other] == cell
    return count


def bound(chooser: Chooser, cell: int) -> int:
    """A worth that the cell does not exceed, known without looking."""
    if chooser.strategy == GAIN and chooser.seen[cell]:
        return chooser.seen[cell] - 1
    return chooser.most + 1


def worth_of(field: Field, sight: Sight, chooser: Chooser, cell: int) -> int:
    """What the strategy divides by the path length."""
    if chooser.strategy == NEAREST:
        return 1
    if chooser.strategy == PRIORITY:
        return unknown_neighbours(field, cell)
    worth = expected(field, sight, cell)
    chooser.seen[cell] = worth + 1
    return worth


def shown_worth(field: Field, sight: Sight, chooser: Chooser, cell: int) -> int:
    """The worth that people are shown: with `nearest` it is that of Sect. 9.3.3."""
    if chooser.strategy == NEAREST:
        return unknown_neighbours(field, cell)
    return worth_of(field, sight, chooser, cell)
