"""Where a robot goes whose body does not fit on the frontier cells that are left.

A VIEWPOINT is a cell where it fits (or is already), where no robot has sensed yet, and from which
an unknown cell is visible if all is as is known. The nearest one is the next goal, whatever the
strategy (ties: smallest row, then smallest column).

So it ends: no robot senses twice from the same cell. And nothing is missed: as long as a robot can
reach a cell from which there is something to see, it goes on.

A cell from which nothing is to be seen stays so: its rays end at known obstacles. It is tested
again only when an obstacle proves to be none, so each cell is tested about once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapcli.algorithms.exploration.exploration_state import CONTRADICTED, Cells, ExplorationState
from mapcli.algorithms.exploration.field_of_view import FieldOfView
from mapcli.algorithms.exploration.goal_selection import assigned_robots
from mapcli.algorithms.exploration.path_search import NEVER, PathSearch, expand, start_search
from mapcli.algorithms.exploration.trace_columns import NOWHERE, VIEWPOINT, Goal, Robots
from mapcli.algorithms.exploration.visibility import shows_unknown


class Viewpoints(NamedTuple):
    """What is known of cells as viewpoints (mutable).

    Attributes:
        rejected: for each cell, up to how many contradicted cells of the map it is known to be no
            viewpoint (int32): NEVER where a robot has sensed, 0 where that was not tested. Empty
            for robots that are points: those fit everywhere.
    """

    rejected: Cells


def make_viewpoints(state: ExplorationState) -> Viewpoints:
    """No cell has been judged yet."""
    size = len(state.known) if len(state.disc_rows) else 0
    return Viewpoints(np.zeros(size, np.int32))


def find_viewpoint(
    state: ExplorationState,
    search: PathSearch,
    fov: FieldOfView,
    viewpoints: Viewpoints,
    robots: Robots,
    robot: int,
) -> Goal:
    """The nearest viewpoint of a robot, to which nobody else goes; as for `find_goal`,
    the path to it can then be read from `search`."""
    best, moves = NOWHERE, 0
    begin, end = (
        0,
        start_search(state, search, robots.cell[robot]) if len(viewpoints.rejected) else 0,
    )
    while begin < end and best == NOWHERE:
        for k in range(begin, end):
            there = search.queue[k]
            fits = not state.inflated[there] or moves == 0
            is_better = best == NOWHERE or there < best
            is_free = fits and is_better and assigned_robots(robots.goal, robot, there) == 0
            if is_free and is_viewpoint(state, fov, viewpoints, there):
                best = there
        if best == NOWHERE:
            moves += 1
            begin, end = expand(state, search, begin, end, moves)
    return Goal(VIEWPOINT, best, 0, moves)


def is_viewpoint(
    state: ExplorationState, fov: FieldOfView, viewpoints: Viewpoints, cell: int
) -> bool:
    """Whether sensing on a cell would show something; where a robot fits is not asked here."""
    contradicted = state.counts[CONTRADICTED]
    if viewpoints.rejected[cell] > contradicted:
        return False
    if shows_unknown(state, fov, cell):
        return True
    viewpoints.rejected[cell] = contradicted + 1
    return False


def mark_sensed(viewpoints: Viewpoints, cell: int) -> None:
    """A robot has sensed on a cell, which is no viewpoint any longer."""
    if len(viewpoints.rejected):
        viewpoints.rejected[cell] = NEVER
