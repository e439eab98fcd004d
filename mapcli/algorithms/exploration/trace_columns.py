"""Robots, and the trace that they leave, as columns of numbers.

The loops of Algorithm 9.1 do not allocate: they write into columns that are made before
(`loop_arrays`) and that the runner makes longer when the next round might not fit.

Time is counted in steps in which every robot that is under way moves by one cell.
"""

from __future__ import annotations

from typing import NamedTuple

from mapcli.algorithms.exploration.exploration_state import (
    KNOWN_CELLS,
    Cells,
    ExplorationState,
    Reals,
)
from mapcli.algorithms.exploration.field_of_view import FieldOfView

NOWHERE = -1
"""The goal of a robot that has none."""

START, FRONTIER, VIEWPOINT, BLOCKED, STOP, HOME = range(6)
"""Why a robot goes to a cell. START: it senses where it stands at first; FRONTIER: it goes to a
frontier cell; VIEWPOINT: see `viewpoints`; BLOCKED: on its way there is an obstacle that was
believed to be open; STOP: its goal is outdated and no other is left; HOME: it returns home."""

STEPS, PATHS, SENSED, TIME, HELD_BACK, ROUNDS = range(6)
"""Places in `Trace.counts`: used lengths of the columns, the time, the limit that held a robot back
when goals were last chosen (`limits`), and how many rounds are left until the runner's turn."""


class Goal(NamedTuple):
    """A cell to go to (NOWHERE when there is none), why, its utility and the path length to it."""

    kind: int
    cell: int
    utility: int
    moves: int


class Robots(NamedTuple):
    """One entry per robot (int64).

    Attributes:
        cell, origin: where it is, and where its last step ended.
        goal, kind: where it goes, or NOWHERE, and why.
        begin, at, end: its path in `Trace.paths` since its last step, and how far it has come.
        collision: the cell that will turn out to be an obstacle, when the kind is BLOCKED.
        frontier, utility, moves: of the goal when it was chosen; `frontier` is the size of it.
    """

    cell: Cells
    origin: Cells
    goal: Cells
    kind: Cells
    begin: Cells
    at: Cells
    end: Cells
    collision: Cells
    frontier: Cells
    utility: Cells
    moves: Cells


class Trace(NamedTuple):
    """What happened, in columns: one entry per step (int32), and the cells of all paths and of
    everything sensed, one after the other (int32), with a minus where a cell stayed unknown.

    Attributes:
        robot, kind, time, origin, goal, frontier, utility, moves: of each step.
        path_begin, path_end: its part of `paths`.
        sensed_end: where its part of `sensed` ends; it begins where that of the step before ends.
            (`sensed` is empty when it is not kept.)
        counts: used lengths (int64).
        length: of all paths driven or begun, in cells, a diagonal move being longer (float64).
    """

    robot: Cells
    kind: Cells
    time: Cells
    origin: Cells
    goal: Cells
    frontier: Cells
    utility: Cells
    moves: Cells
    path_begin: Cells
    path_end: Cells
    sensed_end: Cells
    paths: Cells
    sensed: Cells
    counts: Cells
    length: Reals


class ColumnLengths(NamedTuple):
    """Of the columns of a `Trace`: those of steps, `paths` and `sensed`."""

    steps: int
    paths: int
    sensed: int


def may_go_on(state: ExplorationState, fov: FieldOfView, robots: Robots, trace: Trace) -> bool:
    """Whether another round may be done before the runner looks at progress and memory."""
    trace.counts[ROUNDS] -= 1
    return trace.counts[ROUNDS] >= 0 and has_room(state, fov, robots, trace)


def has_room(state: ExplorationState, fov: FieldOfView, robots: Robots, trace: Trace) -> bool:
    """Whether the columns can hold whatever one round may add."""
    need = room_needed(state, fov, robots, trace)
    fits = len(trace.robot) >= need.steps and len(trace.paths) >= need.paths
    return fits and (len(trace.sensed) >= need.sensed or not keeps_cells(trace))


def room_needed(
    state: ExplorationState, fov: FieldOfView, robots: Robots, trace: Trace
) -> ColumnLengths:
    """How long the columns must be for one more round: a step of each robot, all cells in its
    field of view, and a path over all known cells, behind what it has walked already."""
    count, paths = len(robots.cell), 0
    for robot in range(count):
        paths += robots.at[robot] - robots.begin[robot] + state.counts[KNOWN_CELLS]
    return ColumnLengths(
        trace.counts[STEPS] + count,
        trace.counts[PATHS] + paths,
        trace.counts[SENSED] + count * len(fov.seen),
    )


def keeps_cells(trace: Trace) -> bool:
    """Whether what was sensed is kept; where nobody asks for it, its number will do."""
    return len(trace.sensed) > 0


def under_way(robots: Robots) -> int:
    """How many robots have a goal."""
    count = 0
    for robot in range(len(robots.cell)):
        count += robots.goal[robot] != NOWHERE
    return count


def record(robots: Robots, trace: Trace, robot: int, kind: int, time: int, sensed: int) -> None:
    """Write a robot's step, which ends where it is and for which `sensed` cells were written;
    its next one begins here."""
    step = trace.counts[STEPS]
    begin, at = robots.begin[robot], robots.at[robot]
    trace.robot[step], trace.kind[step], trace.time[step] = robot, kind, time
    trace.origin[step], trace.goal[step] = robots.origin[robot], robots.cell[robot]
    trace.frontier[step], trace.utility[step] = robots.frontier[robot], robots.utility[robot]
    trace.moves[step] = robots.moves[robot]
    trace.path_begin[step], trace.path_end[step] = begin, at
    trace.counts[SENSED] += sensed
    trace.sensed_end[step] = trace.counts[SENSED]
    trace.counts[STEPS] += 1
    robots.begin[robot] = at
    robots.origin[robot] = robots.cell[robot]
    robots.goal[robot] = NOWHERE
