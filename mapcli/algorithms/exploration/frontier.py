"""Algorithm 9.1: exploration of the frontier, by one robot or several that share their map.

An open cell is a known one whose obstacle probability is below `low`. A FRONTIER CELL is an open
cell of which a neighbour (left, right, up, down) may be learned yet: the neighbour is unknown and
lies on the map, and it has not been sensed before. A cell that was sensed and stayed unknown,
because the world itself does not know it, is UNKNOWABLE: it is no longer of interest, and a cell
whose unknown neighbours are all of that kind is no frontier cell. Neither is a cell because of
what lies beyond the edge of the map. So whenever a robot senses on a frontier cell, that cell
leaves the frontier for good, something has become known or unknowable, and the exploration ends
after no more steps than the map has cells.

The book recomputes the frontier at each step "for simplicity". Here cells join and leave it only
around those that have changed (Sect. 9.3.2); `tests/literal_frontier.py` is the book's way, and
both take the same steps on every map.
"""

from __future__ import annotations

from typing import NamedTuple

from mapcli.algorithms.exploration.exploration_state import (
    FRONTIER_SIZE,
    KNOWN_EXPLORABLE,
    OPEN,
    UNKNOWABLE,
    Field,
    block_of,
    learn,
    unknown_neighbours,
)
from mapcli.algorithms.exploration.field_of_view import THROUGH_OPEN, Sight, look
from mapcli.algorithms.exploration.goal_selection import (
    FRONTIER,
    NEAREST,
    NOWHERE,
    Chooser,
    Goal,
    find_goal,
)
from mapcli.algorithms.exploration.path_search import Search
from mapcli.algorithms.exploration.robots import (
    HELD_BACK,
    PATHS,
    SENSED,
    STEPS,
    TIME,
    Robots,
    Trace,
    give_up,
    has_arrived,
    is_worth_going,
    move,
    record,
    set_out,
)
from mapcli.algorithms.exploration.viewpoints import Lookouts, find_lookout, has_looked
from mapcli.algorithms.exploration.voronoi_partition import Parts

ENDED, MORE, ROOM = range(3)
"""What `explore` returns: there is nothing more to do, there is, or there is but the trace's
columns must grow first."""

MAX_STEPS, MAX_DISTANCE, COVERAGE = 1, 2, 3
"""What held the robots back, in the trace's HELD_BACK."""


class Planner(NamedTuple):
    """What the robots sense and plan with: scratch memory, apart from the parameters in it."""

    search: Search
    parts: Parts
    sight: Sight
    chooser: Chooser
    lookouts: Lookouts


class Limits(NamedTuple):
    """Where an exploration ends before its frontier does.

    Attributes:
        steps: of all robots together.
        distance: of all robots together, in cells, diagonal moves counted with their length.
        explorable: known cells among the explorable ones.
    """

    steps: int
    distance: float
    explorable: int


def explore(
    field: Field,
    planner: Planner,
    limits: Limits,
    robots: Robots,
    trace: Trace,
    rounds: int,
) -> int:
    """Algorithm 9.1, with the line numbers of the book.

    Returns ENDED when no robot has anywhere to go, MORE after so many rounds, ROOM when the
    trace is full; called again it goes on where it was.
    """
    for _ in range(rounds):  # 1: loop
        # 2-6: the frontier needs no recomputing, `sense` keeps it
        if not has_room(planner.sight, robots, trace):
            return ROOM
        if not choose_goals(field, planner, limits, robots, trace):  # 8: closest <- ...
            return ROOM
        if on_the_way(robots) == 0:  # 7: exit if frontier empty
            return ENDED
        move(field, robots, trace)  # 9: robot <- closest
        for robot in range(len(robots.cell)):
            if has_arrived(robots, robot):
                if is_worth_going(field, planner.sight, planner.lookouts, robots, robot):
                    sense(field, planner, robots, trace, robot)  # 10-12
                else:
                    give_up(field, robots, trace, robot)
    return MORE


def choose_goals(
    field: Field,
    planner: Planner,
    limits: Limits,
    robots: Robots,
    trace: Trace,
) -> bool:
    """Line 8, for each robot that has no goal, or none that is of interest any longer.

    Returns False when the trace has no room for a path.
    """
    trace.counts[HELD_BACK] = 0
    for robot in range(len(robots.cell)):
        on_its_way = robots.goal[robot] != NOWHERE
        if on_its_way and not is_worth_going(field, planner.sight, planner.lookouts, robots, robot):
            give_up(field, robots, trace, robot)
    for robot in range(len(robots.cell)):
        if is_held_back(field, limits, robots, trace) or robots.goal[robot] != NOWHERE:
            continue
        goal = choose_goal(field, planner, robots, robot)
        if goal.cell == NOWHERE:
            continue
        if not set_out(field, planner.search, robots, trace, robot, goal):
            return False
        if planner.chooser.strategy == NEAREST and goal.kind == FRONTIER:
            # The trace shows the priority of Sect. 9.3.3.
            robots.worth[robot] = unknown_neighbours(field, goal.cell)
        if trace.length[0] > limits.distance:
            trace.counts[HELD_BACK] = MAX_DISTANCE
            give_up(field, robots, trace, robot)
            trace.counts[PATHS] = robots.at[robot]
    return True


def choose_goal(field: Field, planner: Planner, robots: Robots, robot: int) -> Goal:
    """The best frontier cell of a robot, or the nearest lookout when none fits it."""
    search, sight = planner.search, planner.sight
    goal = find_goal(
        field, search, planner.parts, sight, planner.chooser, robots.cell, robots.goal, robot
    )
    if goal.cell != NOWHERE:
        return goal
    cell = robots.cell[robot]
    return find_lookout(field, search, sight, planner.lookouts, robots.goal, robot, cell)


def is_held_back(field: Field, limits: Limits, robots: Robots, trace: Trace) -> bool:
    """Whether a limit keeps robots from setting out; at the coverage wanted, all stop at once."""
    if field.counts[KNOWN_EXPLORABLE] >= limits.explorable:
        trace.counts[HELD_BACK] = COVERAGE
        for robot in range(len(robots.cell)):
            if robots.goal[robot] != NOWHERE:
                give_up(field, robots, trace, robot)
        return True
    enough = trace.counts[STEPS] + on_the_way(robots) >= limits.steps
    if enough:
        trace.counts[HELD_BACK] = MAX_STEPS
    return enough


def sense(field: Field, planner: Planner, robots: Robots, trace: Trace, robot: int) -> None:
    """Lines 10-12: sense around a robot, mark the grid, and keep the frontier up to date."""
    sight, sensed, free = planner.sight, 0, trace.counts[SENSED]
    for k in range(look(field, sight, field.world, THROUGH_OPEN, robots.cell[robot])):
        cell = sight.seen[k]
        before = field.known[cell]
        has_changed = learn(field, cell)
        if has_changed:
            # A minus says that the cell stayed unknown.
            trace.sensed[free + sensed] = -cell if field.known[cell] == UNKNOWABLE else cell
            sensed += 1
        if field.known[cell] != before:
            refresh_around(field, cell)
    has_looked(planner.lookouts, robots.cell[robot])
    record(robots, trace, robot, robots.kind[robot], trace.counts[TIME], sensed)


def refresh_around(field: Field, cell: int) -> None:
    """A cell changed: it and its neighbours may have joined or left the frontier."""
    refresh(field, cell)
    refresh(field, cell - field.stride)
    refresh(field, cell - 1)
    refresh(field, cell + 1)
    refresh(field, cell + field.stride)


def refresh(field: Field, cell: int) -> None:
    """Lines 4-6 for one cell."""
    is_frontier = field.known[cell] == OPEN and unknown_neighbours(field, cell) > 0
    if is_frontier != field.frontier[cell]:
        change = 1 if is_frontier else -1
        field.counts[FRONTIER_SIZE] += change
        field.blocks[block_of(field, cell)] += change
        field.frontier[cell] = is_frontier


def has_room(sight: Sight, robots: Robots, trace: Trace) -> bool:
    """Whether the trace can hold what one round may add to it, paths aside."""
    count = len(robots.cell)
    steps = len(trace.robot) - trace.counts[STEPS]
    return steps >= count and len(trace.sensed) - trace.counts[SENSED] >= count * len(sight.seen)


def on_the_way(robots: Robots) -> int:
    """How many robots have a goal."""
    count = 0
    for robot in range(len(robots.cell)):
        count += robots.goal[robot] != NOWHERE
    return count
