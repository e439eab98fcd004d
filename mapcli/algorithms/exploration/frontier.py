"""Algorithm 9.1: exploration of the frontier, by one robot or several that share their map.

A known cell is open when its obstacle probability is below `low`. A frontier cell is an open cell
with an unknown neighbour (left, right, up, down) that lies on the map and has not been sensed
before. A cell that was sensed and stayed unknown, because the world itself does not know it, is
UNKNOWABLE and makes no frontier. So when a robot senses on a frontier cell, that cell leaves the
frontier for good, and the exploration ends after no more steps than the map has cells.

The book recomputes the frontier at each step "for simplicity". Here it is updated around the cells
that changed (Sect. 9.3.2). The tests hold the book's twelve lines as they are
(`tests/support/book_frontier.py`) and a slow generalisation of them to several robots with bodies
and far sight (`tests/support/literal_frontier.py`); all take the same steps on every map.

What the lines do is in `path_search` and `goal_selection` (8), `robots` (9), `field_of_view` and
`exploration_state` (10-12).
"""

from __future__ import annotations

from typing import NamedTuple

from mapcli.algorithms.exploration.exploration_state import (
    FRONTIER_SIZE,
    ON_FRONTIER,
    OPEN,
    UNKNOWABLE,
    ExplorationState,
    block_of,
    is_on_frontier,
    mark_sensed_cell,
    unknown_neighbours,
)
from mapcli.algorithms.exploration.field_of_view import THROUGH_OPEN, FieldOfView, visible_cells
from mapcli.algorithms.exploration.goal_selection import Chooser, find_goal, shows_unknown
from mapcli.algorithms.exploration.limits import Limits, exceeds_distance, is_held_back
from mapcli.algorithms.exploration.path_search import PathSearch
from mapcli.algorithms.exploration.robots import (
    assign_goal,
    drop_goal,
    has_arrived,
    is_goal_valid,
    move,
)
from mapcli.algorithms.exploration.trace_columns import (
    FRONTIER,
    HELD_BACK,
    NOWHERE,
    SENSED,
    TIME,
    Goal,
    Robots,
    Trace,
    keeps_cells,
    may_go_on,
    record,
    under_way,
)
from mapcli.algorithms.exploration.viewpoints import Viewpoints, find_viewpoint, mark_sensed
from mapcli.algorithms.exploration.voronoi_partition import VoronoiPartition


class Planner(NamedTuple):
    """What the robots sense and plan with: scratch memory, apart from the parameters in it."""

    search: PathSearch
    partition: VoronoiPartition
    fov: FieldOfView
    chooser: Chooser
    viewpoints: Viewpoints


def explore_frontier(
    state: ExplorationState, planner: Planner, limits: Limits, robots: Robots, trace: Trace
) -> bool:
    """Algorithm 9.1, with the line numbers of the book. Returns whether it has come to its end;
    if not, it goes on where it was when it is called again."""
    while may_go_on(state, planner.fov, robots, trace):  # 1: loop
        # 2-6: frontier <- open cells with an unknown neighbour; `sense` keeps it up to date
        drop_outdated_goals(state, planner, robots, trace)
        if is_explored(state, planner, robots):  # 7: exit if frontier empty
            return True
        choose_goals(state, planner, limits, robots, trace)  # 8: closest <- nearest frontier cell
        if under_way(robots) == 0:  # nobody can reach the frontier, or a limit holds all back
            return True
        move(state, robots, trace)  # 9: robot <- closest
        for robot in range(len(robots.cell)):
            if has_arrived(robots, robot):
                sense_at_goal(state, planner, robots, trace, robot)  # 10-12
    return False


def is_explored(state: ExplorationState, planner: Planner, robots: Robots) -> bool:
    """Line 7. Robots with a body may still see something from where they fit (`viewpoints`)."""
    are_points = len(planner.viewpoints.rejected) == 0
    return state.counts[FRONTIER_SIZE] == 0 and are_points and under_way(robots) == 0


def choose_goals(
    state: ExplorationState, planner: Planner, limits: Limits, robots: Robots, trace: Trace
) -> None:
    """Line 8, for each robot without a goal."""
    trace.counts[HELD_BACK] = 0
    for robot in range(len(robots.cell)):
        if is_held_back(state, limits, robots, trace) or robots.goal[robot] != NOWHERE:
            continue
        goal = choose_goal(state, planner, robots, robot)
        if goal.cell == NOWHERE:
            continue
        assign_goal(state, planner.search, robots, trace, robot, goal)
        if shows_unknown(planner.chooser) and goal.kind == FRONTIER:
            # The trace shows the priority of Sect. 9.3.3.
            robots.utility[robot] = unknown_neighbours(state, goal.cell)
        if exceeds_distance(state, limits, robots, trace, robot):
            return


def choose_goal(state: ExplorationState, planner: Planner, robots: Robots, robot: int) -> Goal:
    """The best frontier cell of a robot, or the nearest viewpoint when it fits on none."""
    goal = find_goal(
        state, planner.search, planner.partition, planner.fov, planner.chooser, robots, robot
    )
    if goal.cell != NOWHERE:
        return goal
    return find_viewpoint(state, planner.search, planner.fov, planner.viewpoints, robots, robot)


def drop_outdated_goals(
    state: ExplorationState, planner: Planner, robots: Robots, trace: Trace
) -> None:
    """Robots give up goals that have nothing more to show, after what others have sensed."""
    for robot in range(len(robots.cell)):
        has_goal = robots.goal[robot] != NOWHERE
        if has_goal and not is_goal_valid(state, planner.fov, planner.viewpoints, robots, robot):
            drop_goal(state, robots, trace, robot)


def sense_at_goal(
    state: ExplorationState, planner: Planner, robots: Robots, trace: Trace, robot: int
) -> None:
    """Lines 10-12, if another robot has not sensed there meanwhile."""
    if is_goal_valid(state, planner.fov, planner.viewpoints, robots, robot):
        sense(state, planner, robots, trace, robot)
    else:
        drop_goal(state, robots, trace, robot)


def sense(
    state: ExplorationState, planner: Planner, robots: Robots, trace: Trace, robot: int
) -> None:
    """Lines 10-12: sense around a robot, mark the grid, and keep the frontier up to date."""
    fov, sensed, free = planner.fov, 0, trace.counts[SENSED]
    for k in range(visible_cells(state, fov, state.world, THROUGH_OPEN, robots.cell[robot])):
        cell = fov.seen[k]
        before = state.known[cell]
        has_changed = mark_sensed_cell(state, cell)
        if has_changed:
            if keeps_cells(trace):
                # A minus says that the cell stayed unknown.
                trace.sensed[free + sensed] = -cell if state.known[cell] == UNKNOWABLE else cell
            sensed += 1
        if state.known[cell] != before:
            update_frontier_around(state, cell)
    mark_sensed(planner.viewpoints, robots.cell[robot])
    record(robots, trace, robot, robots.kind[robot], trace.counts[TIME], sensed)


def update_frontier_around(state: ExplorationState, cell: int) -> None:
    """A cell changed: it and its neighbours may have joined or left the frontier."""
    update_frontier(state, cell)
    update_frontier(state, cell - state.stride)
    update_frontier(state, cell - 1)
    update_frontier(state, cell + 1)
    update_frontier(state, cell + state.stride)


def update_frontier(state: ExplorationState, cell: int) -> None:
    """Lines 4-6 for one cell."""
    is_frontier = state.known[cell] == OPEN and unknown_neighbours(state, cell) > 0
    if is_frontier != is_on_frontier(state, cell):
        change = 1 if is_frontier else -1
        state.counts[FRONTIER_SIZE] += change
        state.blocks[block_of(state, cell)] += change
        state.world[cell] ^= ON_FRONTIER
