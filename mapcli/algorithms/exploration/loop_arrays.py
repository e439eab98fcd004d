"""The arrays that the loops work on: made from maps and robots, and the trace read out of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.exploration import path_search as motion
from mapcli.algorithms.exploration.exploration_parameters import ExplorationParameters
from mapcli.algorithms.exploration.exploration_state import (
    OUTSIDE,
    UNKNOWABLE,
    UNKNOWN,
    ExplorationState,
    blocks_in,
    classify_cells,
    flatten,
    offsets_of_disc,
)
from mapcli.algorithms.exploration.trace_columns import (
    FRONTIER,
    NOWHERE,
    SENSED,
    START,
    STEPS,
    Robots,
    Trace,
)
from mapcli.model.exploration import StepColumns
from mapcli.model.grid import GridMap

STEP_COLUMNS = Trace._fields[: Trace._fields.index("paths")]


STRAIGHT = ((-1, 0), (0, -1), (0, 1), (1, 0))
DIAGONAL = ((-1, -1), (-1, 1), (1, -1), (1, 1))
"""(row, column) of the moves, in the order in which ties are decided."""


def make_state(
    world: GridMap, known: GridMap, parameters: ExplorationParameters
) -> ExplorationState:
    """The state at the start. Where something is known, `initialisation.register_known_map` is
    still due."""
    rows, columns = world.rows, world.columns
    empty = np.zeros((rows, columns), np.int32)
    moves = STRAIGHT if parameters.connectivity == 4 else STRAIGHT + DIAGONAL
    # Obstacles farther away than the map is large are none.
    radius = min(parameters.robot_radius / world.resolution, float(rows + columns))
    disc_rows, disc_columns = offsets_of_disc(radius)
    return ExplorationState(
        rows,
        columns,
        columns + 2,
        world=flatten(classify_cells(world.cells, parameters.low, UNKNOWABLE), OUTSIDE),
        truth=flatten(world.cells, np.nan),
        known=flatten(classify_cells(known.cells, parameters.low, UNKNOWN), OUTSIDE),
        grid=flatten(known.cells, np.nan),
        frontier=flatten(empty.astype(np.uint8), 0),
        blocks=np.zeros(blocks_in(rows + 2) * blocks_in(columns + 2), np.int32),
        inflated=flatten(empty, 0),
        explorable=flatten(empty.astype(np.uint8), 0),
        disc_rows=disc_rows,
        disc_columns=disc_columns,
        moves=np.array([r * (columns + 2) + c for r, c in moves], np.int64),
        counts=np.zeros(4, np.int64),
    )


def make_robots(cells: Sequence[int], *, at_start: bool) -> Robots:
    """Robots on cells, without goals or, `at_start`, about to sense where they stand."""
    count = len(cells)
    columns = {name: np.zeros(count, np.int64) for name in Robots._fields}
    columns["cell"][:] = columns["origin"][:] = cells
    columns["goal"][:] = cells if at_start else NOWHERE
    columns["kind"][:] = START if at_start else FRONTIER
    return Robots(**columns)


def make_trace(sensed: int, robots: int) -> Trace:
    """An empty trace with room for a round that senses so many cells."""
    columns = {name: np.zeros(1024 + robots, np.int32) for name in STEP_COLUMNS}
    return Trace(
        **columns,
        paths=np.zeros(4096, np.int32),
        sensed=np.zeros(4096 + 2 * sensed, np.int32),
        counts=np.zeros(6, np.int64),
        length=np.zeros(1, np.float64),
    )


def with_double_room(trace: Trace) -> Trace:
    """The same trace with twice the room.

    Raises:
        MemoryError: the columns cannot count so far.
    """
    if 2 * max(len(trace.paths), len(trace.sensed)) > motion.NEVER:
        raise MemoryError("more than a thousand million moves")
    columns = (*STEP_COLUMNS, "paths", "sensed")
    arrays = {name: np.asarray(getattr(trace, name)) for name in columns}
    twice = {name: np.zeros(2 * len(a), a.dtype) for name, a in arrays.items()}
    for name, a in arrays.items():
        twice[name][: len(a)] = a  # memory that is never touched costs nothing
    return trace._replace(**twice)


def read_steps(state: ExplorationState, trace: Trace) -> StepColumns:
    """The steps as people see them: rows and columns instead of indices."""
    count = trace.counts[STEPS]
    columns = {name: np.asarray(getattr(trace, name))[:count] for name in STEP_COLUMNS}
    paths, path_end = _gathered(trace.paths, columns["path_begin"], columns["path_end"])
    ends = columns["sensed_end"].astype(np.int64)
    sensed = _sorted_within_steps(np.asarray(trace.sensed)[: trace.counts[SENSED]], ends)
    stayed = sensed < 0
    stayed_end = np.concatenate([[0], np.cumsum(stayed)])[ends]
    moves = columns["moves"]
    priority = np.full(count, np.nan)
    np.divide(columns["utility"], moves, out=priority, where=moves > 0)
    return StepColumns(
        robot=columns["robot"],
        kind=columns["kind"],
        time=columns["time"],
        origin=cells_of(state, columns["origin"]),
        goal=cells_of(state, columns["goal"]),
        frontier_size=columns["frontier"],
        priority=priority,
        path=cells_of(state, paths),
        path_end=path_end,
        cells=cells_of(state, sensed[~stayed]),
        probabilities=np.asarray(state.truth)[sensed[~stayed]],
        sensed_end=ends - stayed_end,
        unknowable=cells_of(state, -sensed[stayed]),
        unknowable_end=stayed_end,
    )


def cells_of(state: ExplorationState, indices: NDArray[np.integer]) -> NDArray[np.int32]:
    """(row, column) of cell indices, shape (n, 2)."""
    rows, columns = np.divmod(indices, state.stride)
    return np.column_stack([rows - 1, columns - 1]).astype(np.int32)


def _sorted_within_steps(sensed: NDArray[np.int32], ends: NDArray[np.int64]) -> NDArray[np.int32]:
    """Cells of each step by row and column, whatever their sign.

    One number per cell, step first, sorts ten times faster than two. All happens in one array,
    as there may be many millions of them.
    """
    span = 2 * (int(np.abs(sensed).max(initial=0)) + 1)
    keys = np.repeat(np.arange(len(ends)) * span, np.diff(ends, prepend=0))
    keys += np.abs(sensed)
    keys += np.abs(sensed)
    keys += sensed < 0
    keys.sort()
    keys %= span
    stayed = keys % 2 == 1
    keys //= 2
    np.negative(keys, out=keys, where=stayed)
    return keys.astype(np.int32)


def _gathered(
    column: object, begin: NDArray[np.int32], end: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The parts begin...end of a column one after the other, and where each now ends."""
    lengths = end - begin
    ends = np.cumsum(lengths, dtype=np.int64)
    places = np.arange(ends[-1] if len(ends) else 0) + np.repeat(begin - (ends - lengths), lengths)
    return np.asarray(column)[places], ends
