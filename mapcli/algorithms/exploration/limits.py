"""Where an exploration ends before its frontier does."""

from __future__ import annotations

from typing import NamedTuple

from mapcli.algorithms.exploration.exploration_state import KNOWN_EXPLORABLE, ExplorationState
from mapcli.algorithms.exploration.robots import drop_goal
from mapcli.algorithms.exploration.trace_columns import (
    HELD_BACK,
    NOWHERE,
    PATHS,
    STEPS,
    Robots,
    Trace,
    under_way,
)

MAX_STEPS, MAX_DISTANCE, COVERAGE = 1, 2, 3
"""What held the robots back, in the trace's HELD_BACK; 0 where nothing did."""


class Limits(NamedTuple):
    """Attributes:
    steps: of all robots together.
    distance: of all robots together, in cells, diagonal moves counted with their length.
    explorable: known cells among the explorable ones.
    """

    steps: int
    distance: float
    explorable: int


def is_held_back(state: ExplorationState, limits: Limits, robots: Robots, trace: Trace) -> bool:
    """Whether a limit keeps robots from setting out; at the coverage wanted, all stop at once."""
    if state.counts[KNOWN_EXPLORABLE] >= limits.explorable:
        trace.counts[HELD_BACK] = COVERAGE
        for robot in range(len(robots.cell)):
            if robots.goal[robot] != NOWHERE:
                drop_goal(state, robots, trace, robot)
        return True
    enough = trace.counts[STEPS] + under_way(robots) >= limits.steps
    if enough:
        trace.counts[HELD_BACK] = MAX_STEPS
    return enough


def exceeds_distance(
    state: ExplorationState, limits: Limits, robots: Robots, trace: Trace, robot: int
) -> bool:
    """Whether the path that a robot was just given is too long; then it does not set out."""
    if trace.length[0] <= limits.distance:
        return False
    trace.counts[HELD_BACK] = MAX_DISTANCE
    drop_goal(state, robots, trace, robot)
    trace.counts[PATHS] = robots.at[robot]
    return True
