"""The arrays that the loops work on: made from maps and robots, and the trace read out of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.exploration import path_search as motion
from mapcli.algorithms.exploration.exploration_parameters import ExplorationParameters
from mapcli.algorithms.exploration.exploration_state import (
    EXPLORABLE,
    KIND,
    OUTDATED,
    OUTSIDE,
    UNKNOWABLE,
    UNKNOWN,
    ExplorationState,
    blocks_in,
    classify_cells,
    flatten,
    offsets_of_disc,
    unflatten,
)
from mapcli.algorithms.exploration.trace_columns import (
    FRONTIER,
    NOWHERE,
    PATHS,
    SENSED,
    START,
    STEPS,
    ColumnLengths,
    Robots,
    Trace,
    keeps_cells,
)
from mapcli.memory import require
from mapcli.model.exploration import StepColumns
from mapcli.model.grid import PROBABILITIES, GridMap, bands

STEP_COLUMNS = Trace._fields[: Trace._fields.index("paths")]


KEPT_CELL_BYTES = 40
"""Of a cell that some step sensed: in the loops' columns, sorted, and as rows and columns."""

STRAIGHT = ((-1, 0), (0, -1), (0, 1), (1, 0))
DIAGONAL = ((-1, -1), (-1, 1), (1, -1), (1, 1))
"""(row, column) of the moves, in the order in which ties are decided."""


def make_state(
    world: GridMap, known: GridMap | None, parameters: ExplorationParameters
) -> ExplorationState:
    """The state at the start. Where something is known, `initialisation.register_known_map` is
    still due."""
    rows, columns = world.rows, world.columns
    kinds = flatten(kinds_of(world, parameters.low, UNKNOWABLE), OUTSIDE)
    if known is None:
        believed = flatten(np.broadcast_to(np.uint8(UNKNOWN), (rows, columns)), OUTSIDE)
    else:
        believed = flatten(kinds_of(known, parameters.low, UNKNOWN), OUTSIDE)
        note_outdated(kinds, believed, world, known)
    moves = STRAIGHT if parameters.connectivity == 4 else STRAIGHT + DIAGONAL
    # Obstacles farther away than the map is large are none.
    radius = min(parameters.robot_radius / world.resolution, float(rows + columns))
    disc_rows, disc_columns = offsets_of_disc(radius)
    return ExplorationState(
        rows,
        columns,
        columns + 2,
        world=kinds,
        known=believed,
        blocks=np.zeros(blocks_in(rows + 2) * blocks_in(columns + 2), np.int32),
        inflated=np.zeros(len(kinds), np.int32),  # memory that is never touched costs nothing
        disc_rows=disc_rows,
        disc_columns=disc_columns,
        moves=np.array([r * (columns + 2) + c for r, c in moves], np.int64),
        counts=np.zeros(4, np.int64),
    )


def require_memory(
    world: GridMap, parameters: ExplorationParameters, *, robots: int, keep_cells: bool
) -> None:
    """Refuse to explore a map that would take more memory than a run may.

    Raises:
        MemoryLimitError: it would.
    """
    cell = 2 + 4 + 2  # what is known, the path search, the result
    cell += 8 if parameters.robot_radius else 0  # inflation, viewpoints
    cell += 8 if robots > 1 else 0  # the partition
    size = cell * world.rows * world.columns
    if keep_cells:
        size += KEPT_CELL_BYTES * world.count(lambda cells: ~np.isnan(cells))
    require(size, f"exploring a map of {world.columns:,} x {world.rows:,} cells")


def kinds_of(grid: GridMap, low: float, unknown: int) -> NDArray[np.uint8]:
    """OPEN, OBSTACLE or `unknown` of each cell, shape (rows, columns)."""
    return grid.each(lambda cells: classify_cells(cells, low, unknown))


def note_outdated(
    kinds: NDArray[np.uint8], believed: NDArray[np.uint8], world: GridMap, known: GridMap
) -> None:
    """Set OUTDATED in `kinds` where the kind of a cell is known, but its value is another."""
    inner = (-1, world.columns + 2)
    noted, others = kinds.reshape(inner)[1:-1, 1:-1], believed.reshape(inner)[1:-1, 1:-1]
    for rows in bands(world.rows, world.columns):
        differs = band_of(world, rows) != band_of(known, rows)
        noted[rows][differs & (others[rows] == noted[rows])] |= OUTDATED


def known_at_the_end(state: ExplorationState, world: GridMap, before: GridMap) -> GridMap:
    """The map as known: the world where it was sensed, and what was known before elsewhere."""
    alike = before.stored.dtype == world.stored.dtype
    old, true = (before.stored, world.stored) if alike else (before.cells, world.cells)
    after = np.array(old)
    kinds, known = unflatten(state, state.world), unflatten(state, state.known)
    for rows in bands(world.rows, world.columns):
        sensed = kinds[rows] & (KIND | OUTDATED) == known[rows]
        after[rows][sensed] = true[rows][sensed]
    return world.replaced(after)


def band_of(grid: GridMap, rows: slice) -> NDArray[np.float32]:
    """Some rows of a map, as probabilities."""
    stored = grid.stored[rows]
    return PROBABILITIES[stored] if stored.dtype == np.uint8 else stored


def noted_cells(state: ExplorationState, note: int) -> NDArray[np.int64]:
    """The cells for which a note of `ExplorationState.world` is set, as indices, shape (n,)."""
    world = np.asarray(state.world)
    parts = [rows.start + np.flatnonzero(world[rows] & note) for rows in bands(len(world), 1)]
    return np.concatenate(parts)


def explorable_cells(state: ExplorationState) -> NDArray[np.bool_]:
    """The cells that count for the coverage, shape (rows, columns)."""
    noted = unflatten(state, state.world)
    explorable = np.empty((state.rows, state.columns), np.bool_)
    for rows in bands(state.rows, state.columns):
        explorable[rows] = noted[rows] & EXPLORABLE
    return explorable


def make_robots(cells: Sequence[int], *, at_start: bool) -> Robots:
    """Robots on cells, without goals or, `at_start`, about to sense where they stand."""
    count = len(cells)
    columns = {name: np.zeros(count, np.int64) for name in Robots._fields}
    columns["cell"][:] = columns["origin"][:] = cells
    columns["goal"][:] = cells if at_start else NOWHERE
    columns["kind"][:] = START if at_start else FRONTIER
    return Robots(**columns)


def make_trace(sensed: int, robots: int) -> Trace:
    """An empty trace with room for a round that senses so many cells; with 0, they are not kept."""
    columns = {name: np.zeros(1024 + robots, np.int32) for name in STEP_COLUMNS}
    return Trace(
        **columns,
        paths=np.zeros(4096, np.int32),
        sensed=np.zeros(4096 + 2 * sensed if sensed else 0, np.int32),
        counts=np.zeros(6, np.int64),
        length=np.zeros(1, np.float64),
    )


def with_room(trace: Trace, needed: ColumnLengths) -> Trace:
    """The same trace with columns at least as long as `needed`, doubled where they are shorter.

    Raises:
        MemoryError: the columns cannot count so far.
    """
    if max(needed.paths, needed.sensed) > motion.NEVER:
        raise MemoryError("more than two thousand million moves")
    steps = trace.counts[STEPS]
    columns = dict.fromkeys(STEP_COLUMNS, (steps, needed.steps))
    columns["paths"] = trace.counts[PATHS], needed.paths
    if keeps_cells(trace):
        columns["sensed"] = trace.counts[SENSED], needed.sensed
    return trace._replace(
        **{name: _longer(getattr(trace, name), *lengths) for name, lengths in columns.items()}
    )


def _longer(column: object, used: int, needed: int) -> NDArray[np.int32]:
    """A column at least `needed` long, of which `used` entries count."""
    array = np.asarray(column)
    if len(array) >= needed:
        return array
    longer = np.zeros(min(max(needed, 2 * len(array)), motion.NEVER), array.dtype)
    longer[:used] = array[:used]  # memory that is never touched costs nothing
    return longer


def read_steps(state: ExplorationState, trace: Trace, world: GridMap) -> StepColumns:
    """The steps as people see them: rows and columns instead of indices."""
    count = trace.counts[STEPS]
    columns = {name: np.asarray(getattr(trace, name))[:count] for name in STEP_COLUMNS}
    paths, path_end = _gathered(trace.paths, columns["path_begin"], columns["path_end"])
    ends = columns["sensed_end"].astype(np.int64) if keeps_cells(trace) else np.zeros(count, int)
    sensed = _sorted_within_steps(np.asarray(trace.sensed)[: ends[-1] if count else 0], ends)
    stayed = sensed < 0
    stayed_end = np.concatenate([[0], np.cumsum(stayed)])[ends]
    moves = columns["moves"]
    cells = cells_of(state, sensed[~stayed])
    found = world.stored[cells[:, 0], cells[:, 1]]
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
        cells=cells,
        probabilities=PROBABILITIES[found] if found.dtype == np.uint8 else found,
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
