"""After the last frontier cell: the robots go home, or stay where they are."""

from __future__ import annotations

from mapcli.algorithms.exploration.exploration_state import Cells, Field
from mapcli.algorithms.exploration.frontier import ENDED, ROOM, Planner, has_room, on_the_way, sense
from mapcli.algorithms.exploration.goal_selection import BLOCKED, HOME, NOWHERE, STOP, Goal
from mapcli.algorithms.exploration.path_search import Search, moves_to, spread, start_search
from mapcli.algorithms.exploration.robots import (
    TIME,
    Robots,
    Trace,
    has_arrived,
    move,
    record,
    set_out,
)


def go_home(field: Field, planner: Planner, robots: Robots, trace: Trace, homes: Cells) -> int:
    """All robots go home on shortest paths, or to the nearest place where they fit.

    A start can turn out to be too close to an obstacle. A robot whose way is blocked by an
    obstacle that was believed to be open senses it and looks for another way; one that has no
    way stays. Returns ROOM when the trace is full, ENDED when all are at rest.
    """
    while True:
        if not has_room(planner.sight, robots, trace):
            return ROOM
        for robot in range(len(homes)):
            if robots.goal[robot] == NOWHERE:
                goal = find_way_home(field, planner.search, robots.cell[robot], homes[robot])
                if goal.cell in (NOWHERE, robots.cell[robot]):
                    continue
                if not set_out(field, planner.search, robots, trace, robot, goal):
                    return ROOM
        if on_the_way(robots) == 0:
            return ENDED
        move(field, robots, trace)
        for robot in range(len(homes)):
            if has_arrived(robots, robot):
                if robots.kind[robot] == BLOCKED:
                    sense(field, planner, robots, trace, robot)
                else:
                    record(robots, trace, robot, HOME, trace.counts[TIME], 0)


def find_way_home(field: Field, search: Search, cell: int, home: int) -> Goal:
    """The way from a cell to a robot's home; cell NOWHERE when there is none."""
    place = nearest_place(field, search, home)
    begin, end, moves = 0, start_search(field, search, cell), 0
    while begin < end and moves_to(search, place) < 0:
        moves += 1
        begin, end = end, spread(field, search, begin, end, moves)
    moves = moves_to(search, place)
    return Goal(HOME, place if moves >= 0 else NOWHERE, 0, max(moves, 0))


def nearest_place(field: Field, search: Search, home: int) -> int:
    """The home, or the cell nearest to it where the robot fits (ties: smallest row, then
    column); its home again when there is none."""
    begin, end, moves = 0, start_search(field, search, home), 0
    while begin < end:
        best = NOWHERE
        for k in range(begin, end):
            cell = search.queue[k]
            if not field.crowded[cell] and (best == NOWHERE or cell < best):
                best = cell
        if best != NOWHERE:
            return best
        moves += 1
        begin, end = end, spread(field, search, begin, end, moves)
    return home


def stay(robots: Robots, trace: Trace) -> None:
    """Write down the way that robots have come since their last steps. (There is room for it:
    `has_room` asks for one step of each robot before each round.)"""
    for robot in range(len(robots.cell)):
        if robots.at[robot] > robots.begin[robot]:
            robots.worth[robot], robots.moves[robot] = 0, 0
            record(robots, trace, robot, STOP, trace.counts[TIME], 0)
