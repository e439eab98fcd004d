"""After the last frontier cell: the robots go home, or stay where they are."""

from __future__ import annotations

from mapcli.algorithms.exploration.exploration_state import Cells, ExplorationState
from mapcli.algorithms.exploration.frontier import Planner, sense
from mapcli.algorithms.exploration.path_search import PathSearch, expand, moves_to, start_search
from mapcli.algorithms.exploration.robots import assign_goal, has_arrived, move
from mapcli.algorithms.exploration.trace_columns import (
    BLOCKED,
    HOME,
    NOWHERE,
    STOP,
    TIME,
    Goal,
    Robots,
    Trace,
    may_go_on,
    record,
    under_way,
)


def return_home(
    state: ExplorationState, planner: Planner, robots: Robots, trace: Trace, homes: Cells
) -> bool:
    """All robots go home on shortest paths, or to the nearest place where they fit.

    A start can turn out to be too close to an obstacle. A robot whose way is blocked by an
    obstacle that was believed to be open senses it and searches for another path; one that has
    none stays. Returns whether all are at rest; if not, it goes on when it is called again.
    """
    while may_go_on(state, planner.fov, robots, trace):
        for robot in range(len(homes)):
            if robots.goal[robot] == NOWHERE:
                goal = find_way_home(state, planner.search, robots.cell[robot], homes[robot])
                if goal.cell not in (NOWHERE, robots.cell[robot]):
                    assign_goal(state, planner.search, robots, trace, robot, goal)
        if under_way(robots) == 0:
            return True
        move(state, robots, trace)
        for robot in range(len(homes)):
            if has_arrived(robots, robot):
                if robots.kind[robot] == BLOCKED:
                    sense(state, planner, robots, trace, robot)
                else:
                    record(robots, trace, robot, HOME, trace.counts[TIME], 0)
    return False


def find_way_home(state: ExplorationState, search: PathSearch, cell: int, home: int) -> Goal:
    """The way from a cell to a robot's home; cell NOWHERE when there is none."""
    place = nearest_free_cell(state, search, home)
    begin, end, moves = 0, start_search(state, search, cell), 0
    while begin < end and moves_to(search, place) < 0:
        moves += 1
        begin, end = expand(state, search, begin, end, moves)
    moves = moves_to(search, place)
    return Goal(HOME, place if moves >= 0 else NOWHERE, 0, max(moves, 0))


def nearest_free_cell(state: ExplorationState, search: PathSearch, home: int) -> int:
    """The home, or the cell nearest to it where the robot fits (ties: smallest row, then
    column); its home again when there is none."""
    begin, end, moves = 0, start_search(state, search, home), 0
    while begin < end:
        best = NOWHERE
        for k in range(begin, end):
            cell = search.queue[k]
            if not state.inflated[cell] and (best == NOWHERE or cell < best):
                best = cell
        if best != NOWHERE:
            return best
        moves += 1
        begin, end = expand(state, search, begin, end, moves)
    return home


def record_stops(robots: Robots, trace: Trace) -> None:
    """Write down the way that robots have come since their last steps. (There is room for it:
    `has_room` asks for one step of each robot before each round.)"""
    for robot in range(len(robots.cell)):
        if robots.at[robot] > robots.begin[robot]:
            robots.utility[robot], robots.moves[robot] = 0, 0
            record(robots, trace, robot, STOP, trace.counts[TIME], 0)
