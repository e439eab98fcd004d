"""The robots of an exploration: who is where, on the way to what, and the trace they leave.

Time is counted in steps in which every robot that is on its way moves by one cell. Robots are
points to each other: they pass where another one stands.
"""

from __future__ import annotations

from typing import NamedTuple

from mapcli.algorithms.exploration.exploration_state import (
    FRONTIER_SIZE,
    OBSTACLE,
    OPEN,
    Cells,
    Field,
    Reals,
)
from mapcli.algorithms.exploration.field_of_view import Sight
from mapcli.algorithms.exploration.goal_selection import BLOCKED, FRONTIER, LOOKOUT, NOWHERE, Goal
from mapcli.algorithms.exploration.path_search import (
    Search,
    beside_diagonal,
    can_move,
    is_diagonal,
    write_path,
)
from mapcli.algorithms.exploration.viewpoints import Lookouts, is_lookout

STEPS, PATHS, SENSED, TIME, HELD_BACK = range(5)
"""Places in `Trace.counts`: used lengths of the columns, the time, and the limit that held a
robot back when goals were last chosen (0: none did)."""

DIAGONAL = 2**0.5
"""Length of a diagonal move, in cells."""


class Robots(NamedTuple):
    """One entry per robot (int64).

    Attributes:
        cell, origin: where it is, and where its last step ended.
        goal, kind: where it goes, or NOWHERE, and why.
        begin, at, end: its path in `Trace.paths` since its last step, and how far it has come.
        bump: the cell that will turn out to be an obstacle, when the kind is BLOCKED.
        frontier, worth, moves: size of the frontier when the goal was chosen, and the choice.
    """

    cell: Cells
    origin: Cells
    goal: Cells
    kind: Cells
    begin: Cells
    at: Cells
    end: Cells
    bump: Cells
    frontier: Cells
    worth: Cells
    moves: Cells


class Trace(NamedTuple):
    """What happened, in columns: one entry per step (int32), and the cells of all paths and of
    everything sensed, one after the other (int32), with a minus where a cell stayed unknown.

    Attributes:
        robot, kind, time, origin, goal, frontier, worth, moves: of each step.
        path_begin, path_end: its part of `paths`.
        sensed_end: where its part of `sensed` ends; it begins where that of the step before ends.
        counts: used lengths (int64).
        length: of all paths driven or begun, in cells, a diagonal move being longer (float64).
    """

    robot: Cells
    kind: Cells
    time: Cells
    origin: Cells
    goal: Cells
    frontier: Cells
    worth: Cells
    moves: Cells
    path_begin: Cells
    path_end: Cells
    sensed_end: Cells
    paths: Cells
    sensed: Cells
    counts: Cells
    length: Reals


def set_out(
    field: Field, search: Search, robots: Robots, trace: Trace, robot: int, goal: Goal
) -> bool:
    """Put a robot on the canonical path to a goal; False when the trace has no room for it.

    A path walked towards an earlier goal, which was given up on the way, stays at its front.
    """
    walked = robots.at[robot] - robots.begin[robot]
    begin = trace.counts[PATHS]
    end = begin + walked + goal.moves
    if end > len(trace.paths):
        return False
    for k in range(walked):
        trace.paths[begin + k] = trace.paths[robots.begin[robot] + k]
    write_path(field, search, goal.cell, trace.paths, end)
    robots.begin[robot], robots.at[robot], robots.end[robot] = begin, begin + walked, end
    robots.goal[robot], robots.kind[robot] = goal.cell, goal.kind
    robots.worth[robot] = goal.worth
    robots.moves[robot] = goal.moves if goal.kind == FRONTIER else 0
    robots.frontier[robot] = field.counts[FRONTIER_SIZE]
    stop_before_bump(field, robots, trace, robot)
    trace.counts[PATHS] = robots.end[robot]
    trace.length[0] += length_ahead(field, robots, trace, robot)
    return True


def stop_before_bump(field: Field, robots: Robots, trace: Trace, robot: int) -> None:
    """Cut a path where the world has an obstacle on it, or beside a diagonal move, that is
    believed to be open: nothing but the world can tell the robot, once it is there."""
    cell = robots.cell[robot]
    for k in range(robots.at[robot], robots.end[robot]):
        there = trace.paths[k]
        bump = bump_between(field, cell, there)
        if bump != NOWHERE:
            robots.end[robot], robots.goal[robot] = k, cell
            robots.kind[robot], robots.bump[robot] = BLOCKED, bump
            return
        cell = there


def bump_between(field: Field, cell: int, there: int) -> int:
    """The obstacle of the world that makes a move impossible, or NOWHERE."""
    if field.world[there] == OBSTACLE:
        return there
    if is_diagonal(field, cell, there):
        beside = beside_diagonal(field, cell, there)
        for side in (beside, cell + there - beside):
            if field.world[side] == OBSTACLE:
                return side
    return NOWHERE


def length_ahead(field: Field, robots: Robots, trace: Trace, robot: int) -> float:
    """What is left of a robot's path, in cells; a diagonal move has the length of a diagonal."""
    length, cell = 0.0, robots.cell[robot]
    for k in range(robots.at[robot], robots.end[robot]):
        there = trace.paths[k]
        length += DIAGONAL if is_diagonal(field, cell, there) else 1.0
        cell = there
    return length


def give_up(field: Field, robots: Robots, trace: Trace, robot: int) -> None:
    """Let a robot stop where it is, without a goal."""
    trace.length[0] -= length_ahead(field, robots, trace, robot)
    robots.end[robot] = robots.at[robot]
    robots.goal[robot] = NOWHERE


def move(field: Field, robots: Robots, trace: Trace) -> None:
    """Line 9: all robots move on together until the first one arrives, or comes to a cell that
    it can no longer enter, since others have learned about it; then it gives up its goal."""
    for robot in range(len(robots.cell)):
        if robots.at[robot] < robots.end[robot] and free_moves(field, robots, trace, robot, 1) == 0:
            give_up(field, robots, trace, robot)
            return
    together = -1
    for robot in range(len(robots.cell)):
        ahead = robots.end[robot] - robots.at[robot]
        if robots.goal[robot] != NOWHERE and (together < 0 or ahead < together):
            together = ahead
    for robot in range(len(robots.cell)):
        if robots.goal[robot] != NOWHERE:
            together = free_moves(field, robots, trace, robot, together)
    trace.counts[TIME] += max(together, 0)
    for robot in range(len(robots.cell)):
        if robots.goal[robot] != NOWHERE:
            robots.at[robot] += together
            if together > 0:
                robots.cell[robot] = trace.paths[robots.at[robot] - 1]


def free_moves(field: Field, robots: Robots, trace: Trace, robot: int, most: int) -> int:
    """How many of its next moves a robot can make, counting up to `most`."""
    cell, at = robots.cell[robot], robots.at[robot]
    for k in range(most):
        there = trace.paths[at + k]
        if not can_move(field, cell, there):
            return k
        cell = there
    return most


def has_arrived(robots: Robots, robot: int) -> bool:
    return robots.goal[robot] != NOWHERE and robots.at[robot] == robots.end[robot]


def is_worth_going(
    field: Field, sight: Sight, lookouts: Lookouts, robots: Robots, robot: int
) -> bool:
    """Whether a goal is still what it was chosen for, after all that others have sensed."""
    goal, kind = robots.goal[robot], robots.kind[robot]
    fits = not field.crowded[goal] or robots.cell[robot] == goal
    if kind == FRONTIER:
        return fits and field.frontier[goal] == 1
    if kind == LOOKOUT:
        return fits and is_lookout(field, sight, lookouts, goal)
    return kind != BLOCKED or field.known[robots.bump[robot]] == OPEN


def record(robots: Robots, trace: Trace, robot: int, kind: int, time: int, sensed: int) -> None:
    """Write a robot's step, which ends where it is and for which `sensed` cells were written;
    its next one begins here."""
    step = trace.counts[STEPS]
    begin, at = robots.begin[robot], robots.at[robot]
    trace.robot[step], trace.kind[step], trace.time[step] = robot, kind, time
    trace.origin[step], trace.goal[step] = robots.origin[robot], robots.cell[robot]
    trace.frontier[step], trace.worth[step] = robots.frontier[robot], robots.worth[robot]
    trace.moves[step] = robots.moves[robot]
    trace.path_begin[step], trace.path_end[step] = begin, at
    trace.counts[SENSED] += sensed
    trace.sensed_end[step] = trace.counts[SENSED]
    trace.counts[STEPS] += 1
    robots.begin[robot] = at
    robots.origin[robot] = robots.cell[robot]
    robots.goal[robot] = NOWHERE
