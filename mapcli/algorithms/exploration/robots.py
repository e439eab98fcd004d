"""How robots move: on the path to their goal, together, until the first one arrives (line 9).

Robots are points to each other: they pass where another one stands.
"""

from __future__ import annotations

from mapcli.algorithms.exploration.exploration_state import (
    FRONTIER_SIZE,
    KIND,
    OBSTACLE,
    OPEN,
    ExplorationState,
    is_on_frontier,
)
from mapcli.algorithms.exploration.field_of_view import FieldOfView
from mapcli.algorithms.exploration.path_search import (
    PathSearch,
    beside_diagonal,
    can_move,
    is_diagonal,
    write_path,
)
from mapcli.algorithms.exploration.trace_columns import (
    BLOCKED,
    FRONTIER,
    NOWHERE,
    PATHS,
    TIME,
    VIEWPOINT,
    Goal,
    Robots,
    Trace,
)
from mapcli.algorithms.exploration.viewpoints import Viewpoints, is_viewpoint

DIAGONAL = 2**0.5
"""Length of a diagonal move, in cells."""


def assign_goal(
    state: ExplorationState,
    search: PathSearch,
    robots: Robots,
    trace: Trace,
    robot: int,
    goal: Goal,
) -> None:
    """Put a robot on the canonical path to a goal.

    A path walked towards an earlier goal, which was given up on the way, stays at its front.
    """
    walked = robots.at[robot] - robots.begin[robot]
    begin = trace.counts[PATHS]
    end = begin + walked + goal.moves
    for k in range(walked):
        trace.paths[begin + k] = trace.paths[robots.begin[robot] + k]
    write_path(state, search, goal.cell, trace.paths, end)
    robots.begin[robot], robots.at[robot], robots.end[robot] = begin, begin + walked, end
    robots.goal[robot], robots.kind[robot] = goal.cell, goal.kind
    robots.utility[robot] = goal.utility
    robots.moves[robot] = goal.moves if goal.kind == FRONTIER else 0
    robots.frontier[robot] = state.counts[FRONTIER_SIZE]
    stop_before_collision(state, robots, trace, robot)
    trace.counts[PATHS] = robots.end[robot]
    trace.length[0] += length_ahead(state, robots, trace, robot)


def stop_before_collision(
    state: ExplorationState, robots: Robots, trace: Trace, robot: int
) -> None:
    """Cut a path where the world has an obstacle on it, or beside a diagonal move, that is
    believed to be open: nothing but the world can tell the robot, once it is there."""
    cell = robots.cell[robot]
    for k in range(robots.at[robot], robots.end[robot]):
        there = trace.paths[k]
        collision = collision_between(state, cell, there)
        if collision != NOWHERE:
            robots.end[robot], robots.goal[robot] = k, cell
            robots.kind[robot], robots.collision[robot] = BLOCKED, collision
            return
        cell = there


def collision_between(state: ExplorationState, cell: int, there: int) -> int:
    """The obstacle of the world that makes a move impossible, or NOWHERE."""
    if state.world[there] & KIND == OBSTACLE:
        return there
    if is_diagonal(state, cell, there):
        beside = beside_diagonal(state, cell, there)
        for side in (beside, cell + there - beside):
            if state.world[side] & KIND == OBSTACLE:
                return side
    return NOWHERE


def length_ahead(state: ExplorationState, robots: Robots, trace: Trace, robot: int) -> float:
    """What is left of a robot's path, in cells; a diagonal move has the length of a diagonal."""
    length, cell = 0.0, robots.cell[robot]
    for k in range(robots.at[robot], robots.end[robot]):
        there = trace.paths[k]
        length += DIAGONAL if is_diagonal(state, cell, there) else 1.0
        cell = there
    return length


def drop_goal(state: ExplorationState, robots: Robots, trace: Trace, robot: int) -> None:
    """Let a robot stop where it is, without a goal."""
    trace.length[0] -= length_ahead(state, robots, trace, robot)
    robots.end[robot] = robots.at[robot]
    robots.goal[robot] = NOWHERE


def move(state: ExplorationState, robots: Robots, trace: Trace) -> None:
    """Line 9: all robots move on together until the first one arrives, or comes to a cell that
    it can no longer enter, since others have learned about it; then it gives up its goal."""
    for robot in range(len(robots.cell)):
        if robots.at[robot] < robots.end[robot] and free_moves(state, robots, trace, robot, 1) == 0:
            drop_goal(state, robots, trace, robot)
            return
    together = -1
    for robot in range(len(robots.cell)):
        ahead = robots.end[robot] - robots.at[robot]
        if robots.goal[robot] != NOWHERE and (together < 0 or ahead < together):
            together = ahead
    for robot in range(len(robots.cell)):
        if robots.goal[robot] != NOWHERE:
            together = free_moves(state, robots, trace, robot, together)
    trace.counts[TIME] += max(together, 0)
    for robot in range(len(robots.cell)):
        if robots.goal[robot] != NOWHERE:
            robots.at[robot] += together
            if together > 0:
                robots.cell[robot] = trace.paths[robots.at[robot] - 1]


def free_moves(
    state: ExplorationState, robots: Robots, trace: Trace, robot: int, limit: int
) -> int:
    """How many of its next moves a robot can make, counting up to `limit`."""
    cell, at = robots.cell[robot], robots.at[robot]
    for k in range(limit):
        there = trace.paths[at + k]
        if not can_move(state, cell, there):
            return k
        cell = there
    return limit


def has_arrived(robots: Robots, robot: int) -> bool:
    return robots.goal[robot] != NOWHERE and robots.at[robot] == robots.end[robot]


def is_goal_valid(
    state: ExplorationState, fov: FieldOfView, viewpoints: Viewpoints, robots: Robots, robot: int
) -> bool:
    """Whether a goal is still what it was chosen for, after all that others have sensed."""
    goal, kind = robots.goal[robot], robots.kind[robot]
    fits = not state.inflated[goal] or robots.cell[robot] == goal
    if kind == FRONTIER:
        return fits and is_on_frontier(state, goal)
    if kind == VIEWPOINT:
        return fits and is_viewpoint(state, fov, viewpoints, goal)
    return kind != BLOCKED or state.known[robots.collision[robot]] == OPEN
