"""The trace of an exploration: what `mapcli frontier` returns (Algorithm 9.1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Literal, get_args, overload

import numpy as np
from numpy.typing import NDArray

from mapcli.model.grid import GridMap
from mapcli.model.limit import limit_fields

Cell = tuple[int, int]
"""(row, column)."""

Kind = Literal["start", "frontier", "lookout", "blocked", "stop", "home"]
KINDS: tuple[Kind, ...] = get_args(Kind)

Reason = Literal["complete", "unreachable", "max-steps", "max-distance", "coverage", "plan"]
"""Why it ended: no frontier was left, or none that a robot could reach, or a limit, or nobody
was to move."""

REASONS: tuple[Reason, ...] = get_args(Reason)


@dataclass(frozen=True, slots=True)
class Step:
    """A robot goes to a cell and senses there.

    Attributes:
        robot: counted from 0.
        kind: `start`: senses where it stands at first; `frontier`: goes to a frontier cell;
            `lookout`: is too large for those that are left, and goes where it can see something
            unknown; `blocked`: an obstacle believed to be open stopped it on the way; `stop`: ends
            where it is, because its goal has lost its interest; `home`: goes home.
        time: when it gets there, in time steps; all robots move by one cell per time step.
        origin, goal: where it comes from and gets to.
        path: cells passed, without `origin`, with `goal`, shape (n, 2).
        cells, probabilities: what became known, shapes (k, 2) and (k,).
        unknowable: cells that were sensed and stayed unknown, since the world does not know
            them, shape (m, 2).
        frontier_size: of the frontier when the goal was chosen.
        priority: worth of the goal per path length when it was chosen; None at distance 0, and
            where there was nothing to choose.
    """

    robot: int
    kind: Kind
    time: int
    origin: Cell
    goal: Cell
    path: NDArray[np.int32]
    cells: NDArray[np.int32]
    probabilities: NDArray[np.float32]
    unknowable: NDArray[np.int32]
    frontier_size: int
    priority: float | None


@dataclass(frozen=True, eq=False)
class StepColumns(Sequence[Step]):
    """Many steps, held in columns: a large map has millions of them.

    Attributes:
        robot, kind, time, frontier_size: of each step, shape (n,); kind is an index into KINDS.
        origin, goal: shape (n, 2).
        priority: NaN for None, shape (n,).
        path, path_end: all paths one after the other, shape (p, 2), and where each ends.
        cells, probabilities, sensed_end: the same of what became known.
        unknowable, unknowable_end: the same of what was sensed and stayed unknown.
    """

    robot: NDArray[np.int32]
    kind: NDArray[np.int32]
    time: NDArray[np.int32]
    origin: NDArray[np.int32]
    goal: NDArray[np.int32]
    frontier_size: NDArray[np.int32]
    priority: NDArray[np.float64]
    path: NDArray[np.int32]
    path_end: NDArray[np.int64]
    cells: NDArray[np.int32]
    probabilities: NDArray[np.float32]
    sensed_end: NDArray[np.int64]
    unknowable: NDArray[np.int32]
    unknowable_end: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.robot)

    @overload
    def __getitem__(self, index: int) -> Step: ...
    @overload
    def __getitem__(self, index: slice) -> list[Step]: ...
    def __getitem__(self, index: int | slice) -> Step | list[Step]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        k = range(len(self))[index]
        priority = float(self.priority[k])
        sensed = part(k, self.sensed_end)
        return Step(
            int(self.robot[k]), KINDS[self.kind[k]], int(self.time[k]),
            (int(self.origin[k, 0]), int(self.origin[k, 1])),
            (int(self.goal[k, 0]), int(self.goal[k, 1])),
            self.path[part(k, self.path_end)], self.cells[sensed], self.probabilities[sensed],
            self.unknowable[part(k, self.unknowable_end)],
            int(self.frontier_size[k]), None if np.isnan(priority) else priority,
        )  # fmt: skip

    def __iter__(self) -> Iterator[Step]:
        return (self[k] for k in range(len(self)))


def part(k: int, ends: NDArray[np.int64]) -> slice:
    """Where step k's part of a column is, by where the parts end."""
    return between(k, k + 1, ends)


def between(first: int, last: int, ends: NDArray[np.int64]) -> slice:
    """Where the parts of the steps from `first` up to `last` (excluded) are."""
    return slice(int(ends[first - 1]) if first else 0, int(ends[last - 1]) if last else 0)


@dataclass(frozen=True)
class ExplorationSummary:
    """How an exploration went.

    Attributes:
        reason: why it ended.
        steps: of all robots.
        time_steps: until the last robot came to rest.
        distance_cells, distance_m: moves of all robots, and their length.
        known_cells: in the map at the end.
        coverage: share of the explorable cells that is known: the open cells that a robot could
            reach in the world were it a point, and those beside them.
        unreachable: frontier cells that are left.
        corrected: cells where the world was not what was known.
        not_home: robots that were to go home and could not get there.
    """

    reason: Reason
    steps: int
    time_steps: int
    distance_cells: int
    distance_m: float
    known_cells: int
    coverage: float
    unreachable: int
    corrected: int = 0
    not_home: int = 0


LIMIT_FIELDS = limit_fields((field.name for field in fields(ExplorationSummary)), reason=REASONS)
"""What limits may be set on."""


@dataclass(frozen=True)
class FrontierCell:
    """A cell of the frontier, as the robots see it.

    Attributes:
        cell: (row, column).
        unknown: its unknown neighbours (left, right, up, down), a of Sect. 9.3.3.
        robot, distance: the nearest robot and the path length in cells, d; None when it is out
            of everybody's reach.
        priority: worth / distance by the strategy; None at distance 0 or out of reach.
    """

    cell: Cell
    unknown: int
    robot: int | None
    distance: int | None
    priority: float | None


@dataclass(frozen=True)
class NextGoal:
    """Where a robot would go next; `path` without its own cell, with the goal."""

    robot: int
    goal: Cell
    path: list[Cell]
    priority: float | None


@dataclass(frozen=True, eq=False)
class Exploration:
    """An exploration, from what was known at the start to what is known at the end.

    Attributes:
        robots: cells where they started.
        before, after: the known map at the start and at the end. Before anything is given to
            them the robots sense where they stand: those are the first steps.
        steps: in the order in which they happened.
        frontier: frontier cells at the end, in the order of rows and columns.
        plan: the next goals, when that is all that was asked for.
        explorable: which cells count for the coverage, shape (rows, columns).
        summary: see there.
    """

    robots: tuple[Cell, ...]
    before: GridMap
    after: GridMap
    steps: StepColumns
    frontier: tuple[FrontierCell, ...]
    plan: tuple[NextGoal, ...] | None
    explorable: NDArray[np.bool_]
    summary: ExplorationSummary


@dataclass(frozen=True, eq=False)
class CoverageCurve:
    """What was known after each step, beginning with the start: arrays of the same length.

    Attributes:
        time_steps, distance_cells, distance_m: how far, all robots together.
        known_cells, coverage: what was known then.
    """

    time_steps: NDArray[np.int64]
    distance_cells: NDArray[np.int64]
    distance_m: NDArray[np.float64]
    known_cells: NDArray[np.int64]
    coverage: NDArray[np.float64]


def coverage_curve(exploration: Exploration) -> CoverageCurve:
    """Coverage over distance (Activity 9.2)."""
    steps = exploration.steps
    moves = np.concatenate([[0], steps.path_end])
    lengths = np.concatenate([[0.0], np.cumsum(move_lengths(steps))])
    cells, explorable = steps.cells, exploration.explorable
    # A cell may be sensed again where the world was not what was known; it counts once.
    fresh = ~exploration.before.known
    flat = cells[:, 0].astype(np.int64) * exploration.before.columns + cells[:, 1]
    first = np.zeros(len(cells), dtype=bool)
    first[np.unique(flat, return_index=True)[1]] = True
    first &= fresh[cells[:, 0], cells[:, 1]]
    counted = np.concatenate([[0], np.cumsum(first)])
    wanted = np.concatenate([[0], np.cumsum(first & explorable[cells[:, 0], cells[:, 1]])])
    ends = np.concatenate([[0], steps.sensed_end])
    begun = int(np.count_nonzero(~fresh & explorable))
    return CoverageCurve(
        np.concatenate([[0], steps.time]),
        moves,
        lengths[moves] * exploration.before.resolution,
        int(np.count_nonzero(~fresh)) + counted[ends],
        (begun + wanted[ends]) / max(int(np.count_nonzero(explorable)), 1),
    )


def move_lengths(steps: StepColumns) -> NDArray[np.float64]:
    """Length in cells of each move of all paths, shape (p,): 1, or the root of 2."""
    away = np.abs(steps.path - cells_before(steps))
    return np.asarray(np.hypot(away[:, 0], away[:, 1]))


def cells_before(steps: StepColumns) -> NDArray[np.int32]:
    """Where each move of all paths began, shape (p, 2)."""
    before = np.vstack([steps.path[:1], steps.path[:-1]])
    begins = np.concatenate([[0], steps.path_end])[:-1]
    moving = steps.path_end > begins
    before[begins[moving]] = steps.origin[moving]
    return before
