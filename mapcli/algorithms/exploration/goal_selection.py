"""Which frontier cell comes next: line 8 of Algorithm 9.1, and Sect. 9.3.3.

All strategies choose the largest utility / path length, the path counted in cells:

    nearest    the utility of every frontier cell is 1
    priority   the number of its unknown neighbours (left, right, up, down): p = a / d
    gain       the number of cells expected to be seen from it (`field_of_view.expected_gain`)
    random     a random number times the path length, so that any one comes next: the baseline

Ties: the shorter path, then the smaller row, then the smaller column. A frontier cell under the
robot itself, at distance 0, comes before all others.

A robot takes its goal from its own part of the frontier, to which no other robot is nearer
(`voronoi_partition`); when there is none in it, from all of it. Nobody takes a goal that another
holds.

The search goes out from the robot, breadth first, and stops as soon as no cell further on can
beat the best one, because no cell has a utility above `max_utility`. So it costs what lies around
the robot, and nothing for the rest of the map.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapcli.algorithms.exploration.exploration_parameters import LARGEST_SEED
from mapcli.algorithms.exploration.exploration_state import (
    FRONTIER_SIZE,
    KNOWN_CELLS,
    Cells,
    ExplorationState,
    is_on_frontier,
    unknown_neighbours,
)
from mapcli.algorithms.exploration.field_of_view import FieldOfView, cells_in_range, expected_gain
from mapcli.algorithms.exploration.path_search import PathSearch, expand, start_search
from mapcli.algorithms.exploration.trace_columns import FRONTIER, NOWHERE, Goal, Robots
from mapcli.algorithms.exploration.voronoi_partition import (
    VoronoiPartition,
    count_owned,
    grow_partition,
    is_owned,
    start_partition,
)

NEAREST, PRIORITY, GAIN, RANDOM = range(4)
"""The strategies."""

RANKS = 2**16
"""Random numbers; times the squared length of the longest path they still fit 64 bits."""

NO_GOAL = Goal(FRONTIER, NOWHERE, 0, 0)


class Chooser(NamedTuple):
    """How goals are chosen.

    Attributes:
        strategy: NEAREST, PRIORITY, GAIN or RANDOM.
        max_utility: no cell that is one move or more away has more.
        seen: with GAIN, for each cell 1 + the number of cells expected to be seen when that was
            last worked out, 0 where never (int32). As the map gets known this only shrinks, so
            what it was bounds what it is.
        seed: with RANDOM.
    """

    strategy: int
    max_utility: int
    seen: Cells
    seed: int


def make_chooser(
    strategy: str, state: ExplorationState, fov: FieldOfView, seed: int = 0
) -> Chooser:
    """A chooser for `nearest`, `priority`, `gain` or `random`."""
    code = {"nearest": NEAREST, "priority": PRIORITY, "gain": GAIN, "random": RANDOM}[strategy]
    # Of a cell that a path leads to, one neighbour is known: the one where the path comes from.
    max_utility = {
        NEAREST: 1, PRIORITY: 3, GAIN: cells_in_range(fov), RANDOM: RANKS * len(state.known),
    }[code]  # fmt: skip
    return Chooser(
        code,
        max_utility,
        np.zeros(len(state.known) if code == GAIN else 0, np.int32),
        seed,
    )


def find_goal(
    state: ExplorationState,
    search: PathSearch,
    partition: VoronoiPartition,
    fov: FieldOfView,
    chooser: Chooser,
    robots: Robots,
    robot: int,
) -> Goal:
    """The best goal of a robot. Until the next search, the path to it can be read from `search`."""
    alone = len(robots.cell) == 1
    own, other = NO_GOAL, NO_GOAL  # the best in the robot's own part, and elsewhere
    if state.counts[FRONTIER_SIZE] == 0:
        return own
    begin, end, moves = 0, start_search(state, search, robots.cell[robot]), 0
    # The partition grows as fast as the search: cells some moves away have their owner by then.
    wave_begin, wave_end = 0, 0 if alone else start_partition(partition, robots.cell)
    growing, left = 0, 0
    if not alone:
        growing = left = count_owned(partition, robot, 0, wave_end)
    while begin < end:
        for k in range(begin, end):
            cell = search.queue[k]
            mine = alone or is_owned(partition, robot, cell)
            left -= mine
            if is_candidate(state, robots, robot, cell, moves):
                if mine:
                    own = better_goal(state, fov, chooser, own, cell, moves)
                elif own.cell == NOWHERE:
                    other = better_goal(state, fov, chooser, other, cell, moves)
        moves += 1
        if is_unbeatable(chooser, own, moves):
            break
        if not alone and growing == 0 and left == 0 and is_unbeatable(chooser, other, moves):
            break
        begin, end = expand(state, search, begin, end, moves)
        if growing > 0:
            wave_begin, wave_end = grow_partition(state, partition, wave_begin, wave_end)
            growing = count_owned(partition, robot, wave_begin, wave_end)
            left += growing
    return own if own.cell != NOWHERE else other


def is_candidate(
    state: ExplorationState, robots: Robots, robot: int, cell: int, moves: int
) -> bool:
    """A frontier cell where the robot fits (or is already), and to which nobody else goes."""
    fits = not state.inflated[cell] or moves == 0
    if not is_on_frontier(state, cell) or not fits:
        return False
    return assigned_robots(robots.goal, robot, cell) == 0


def better_goal(
    state: ExplorationState, fov: FieldOfView, chooser: Chooser, best: Goal, cell: int, moves: int
) -> Goal:
    """A cell as the goal when it is better than the best one so far, else that one."""
    if beats(best, utility_bound(chooser, cell), moves, cell):
        utility = utility_of(state, fov, chooser, cell, moves)
        if beats(best, utility, moves, cell):
            # A sum is of the width that the other fields have, whatever that of the columns.
            return Goal(FRONTIER, 0 + cell, 0 + utility, 0 + moves)
    return best


def beats(best: Goal, utility: int, moves: int, cell: int) -> bool:
    """Whether utility / moves at a cell is more than the best so far; ties as said above."""
    if best.cell == NOWHERE:
        return True
    ours, theirs = utility * best.moves, best.utility * moves
    if ours != theirs:
        return ours > theirs
    return moves < best.moves or (moves == best.moves and cell < best.cell)


def is_unbeatable(chooser: Chooser, best: Goal, moves: int) -> bool:
    """Whether nothing that is so many moves away or more can be better than the best so far."""
    return best.cell != NOWHERE and chooser.max_utility * best.moves <= best.utility * moves


def assigned_robots(goals: Cells, robot: int, cell: int) -> int:
    """How many other robots go to a cell."""
    count = 0
    for other in range(len(goals)):
        count += other != robot and goals[other] == cell
    return count


def utility_bound(chooser: Chooser, cell: int) -> int:
    """A utility that the cell does not exceed, known without looking."""
    if chooser.strategy == GAIN and chooser.seen[cell]:
        return chooser.seen[cell] - 1
    return chooser.max_utility + 1


def utility_of(
    state: ExplorationState, fov: FieldOfView, chooser: Chooser, cell: int, moves: int
) -> int:
    """What the strategy divides by the path length."""
    if chooser.strategy == RANDOM:
        return random_rank(chooser.seed, state.counts[KNOWN_CELLS], cell) * moves
    if chooser.strategy == NEAREST:
        return 1
    if chooser.strategy == PRIORITY:
        return unknown_neighbours(state, cell)
    utility = expected_gain(state, fov, cell)
    chooser.seen[cell] = utility + 1
    return utility


def reported_utility(state: ExplorationState, fov: FieldOfView, chooser: Chooser, cell: int) -> int:
    """The utility that people are shown: with `nearest` and `random` that of Sect. 9.3.3."""
    if shows_unknown(chooser):
        return unknown_neighbours(state, cell)
    return utility_of(state, fov, chooser, cell, 1)


def shows_unknown(chooser: Chooser) -> bool:
    """Whether the trace has a / d of Sect. 9.3.3 for want of a priority of the strategy's own."""
    return chooser.strategy in (NEAREST, RANDOM)


def random_rank(seed: int, known_cells: int, cell: int) -> int:
    """A number from 1 to RANKS, drawn anew whenever something has become known.

    Squares modulo a prime below 2^31: the same in Python's integers and in 64 bits, on every
    machine, and without any state.
    """
    x = (seed + 48271 * known_cells) % LARGEST_SEED
    x = (x * x + 69621 * cell + 1) % LARGEST_SEED
    x = (x * x + 16807) % LARGEST_SEED
    x = (x * x + 40692) % LARGEST_SEED
    return 1 + x % RANKS
