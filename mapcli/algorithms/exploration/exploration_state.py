"""The state of an exploration: the world, what is known of it, and the frontier, cell by cell.

Everything the loops of Algorithm 9.1 touch is a flat array (two bytes a cell, as a square kilometre
has 400 million of them), because the same functions run twice:
as plain Python on small maps, where nothing heavy may be imported, and compiled by numba on large
ones (`_kernels/compiled_loops.py`). A cell is an index into these arrays; the map has a border of
OUTSIDE cells one cell wide, so that every cell has eight neighbours:

    cell = (row + 1) * stride + column + 1,    stride = columns + 2

The order of indices is the order of ties: smallest row, then smallest column.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray


class Cells(Protocol):
    """A flat array of numbers, or a memoryview of one, which is the faster in plain Python."""

    def __len__(self) -> int: ...
    def __getitem__(self, place: int, /) -> int: ...
    def __setitem__(self, place: int, value: int, /) -> None: ...


class Reals(Protocol):
    """The same of numbers that are not whole."""

    def __len__(self) -> int: ...
    def __getitem__(self, place: int, /) -> float: ...
    def __setitem__(self, place: int, value: float, /) -> None: ...


OUTSIDE, UNKNOWN, UNKNOWABLE, OPEN, OBSTACLE = range(5)
"""What a cell is. UNKNOWN may be learned yet; UNKNOWABLE was sensed and stayed unknown, because
the world itself does not know it, and it is not sensed for again. In the world itself a cell is
never UNKNOWN. Beyond the edge of the map there is nothing to learn: OUTSIDE."""

KIND = 7
ON_FRONTIER, EXPLORABLE, OUTDATED = 8, 16, 32
"""Bits of `ExplorationState.world`: what the cell is, and what is noted of it. It is a frontier
cell; it counts for the coverage; another value than the world's is known of it, though of the same
kind."""

BLOCK = 16
"""Rows and columns of a block of cells."""

FRONTIER_SIZE, KNOWN_CELLS, KNOWN_EXPLORABLE, CONTRADICTED = range(4)
"""Places in `ExplorationState.counts`."""


class ExplorationState(NamedTuple):
    """What the robots share (its arrays change as they explore).

    Attributes:
        rows, columns, stride: the map's size, and from one row to the next.
        world: what each cell of the world is, and what is noted of it: see KIND (uint8).
        known: what each cell is as far as it is known (uint8).
        blocks: how many frontier cells each block of BLOCK x BLOCK cells has (int32).
        inflated: inflation of known obstacles by the robot's radius: how many of them a robot on
            the cell would touch (int32).
        disc_rows, disc_columns: offsets of the obstacles that a robot would touch (int32).
        moves: index offsets of the moves, straight ones first, each kind sorted (int64).
        counts: see FRONTIER_SIZE and its neighbours (int64).
    """

    rows: int
    columns: int
    stride: int
    world: Cells
    known: Cells
    blocks: Cells
    inflated: Cells
    disc_rows: Cells
    disc_columns: Cells
    moves: Cells
    counts: Cells


def mark_sensed_cell(state: ExplorationState, cell: int) -> bool:
    """Line 12: mark grid(cell) with what was sensed. True when that changed anything.

    The world wins over what was believed; a cell that the world does not know stays as it is.
    """
    before, found = state.known[cell], state.world[cell] & KIND
    if found == UNKNOWABLE:
        if before == UNKNOWN:
            state.known[cell] = UNKNOWABLE
        return before == UNKNOWN
    if before == found and not state.world[cell] & OUTDATED:
        return False
    state.known[cell] = found
    state.world[cell] &= 255 - OUTDATED
    if before in (UNKNOWN, UNKNOWABLE):
        state.counts[KNOWN_CELLS] += 1
        state.counts[KNOWN_EXPLORABLE] += is_explorable(state, cell)
    elif before != found:
        state.counts[CONTRADICTED] += 1
    if (found == OBSTACLE) != (before == OBSTACLE):
        inflate(state, cell, 1 if found == OBSTACLE else -1)
    return True


def is_explorable(state: ExplorationState, cell: int) -> bool:
    """Whether a cell counts for the coverage."""
    return (state.world[cell] & EXPLORABLE) != 0


def is_on_frontier(state: ExplorationState, cell: int) -> bool:
    """Whether a cell is a frontier cell."""
    return (state.world[cell] & ON_FRONTIER) != 0


def inflate(state: ExplorationState, cell: int, count: int) -> None:
    """Inflation: an obstacle appeared (+1) or vanished (-1) that a robot on these cells touches."""
    row, column = cell // state.stride, cell % state.stride
    for k in range(len(state.disc_rows)):
        r, c = row + state.disc_rows[k], column + state.disc_columns[k]
        if 1 <= r <= state.rows and 1 <= c <= state.columns:
            state.inflated[r * state.stride + c] += count


def unknown_neighbours(state: ExplorationState, cell: int) -> int:
    """a of Sect. 9.3.3: neighbours (left, right, up, down) that may be learned yet."""
    known, stride = state.known, state.stride
    return (
        (known[cell - stride] == UNKNOWN)
        + (known[cell - 1] == UNKNOWN)
        + (known[cell + 1] == UNKNOWN)
        + (known[cell + stride] == UNKNOWN)
    )


def block_of(state: ExplorationState, cell: int) -> int:
    """The block that a cell is in."""
    row, column = cell // state.stride, cell % state.stride
    return row // BLOCK * blocks_in(state.stride) + column // BLOCK


def blocks_in(cells: int) -> int:
    """How many blocks there are in so many cells, the last one perhaps a part."""
    return (cells + BLOCK - 1) // BLOCK


def flatten(cells: NDArray[Any], border: Any) -> NDArray[Any]:
    """A map's cells as a flat array with a border one cell wide."""
    padded = np.full((cells.shape[0] + 2, cells.shape[1] + 2), border, dtype=cells.dtype)
    padded[1:-1, 1:-1] = cells
    return padded.ravel()


def unflatten(state: ExplorationState, cells: Cells) -> NDArray[Any]:
    """A flat array as a map's cells again, shape (rows, columns), a view."""
    padded = np.asarray(cells).reshape(state.rows + 2, state.stride)
    return padded[1:-1, 1:-1]


def classify_cells(cells: NDArray[np.float32], low: float, unknown: int) -> NDArray[np.uint8]:
    """OPEN, OBSTACLE or `unknown` of each cell. Compared as float32, in which cells are held:
    a cell of 0.7 is not below a `low` of 0.7."""
    kind = np.where(cells < np.float32(low), np.uint8(OPEN), np.uint8(OBSTACLE))
    kind[np.isnan(cells)] = unknown
    return kind


def offsets_of_disc(radius: float) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """(row, column) offsets of the obstacles that a robot of this radius, in cells, would touch.

    A robot is a disc around its cell's centre, an obstacle the whole square of its cell; to graze
    is not to touch. A radius up to half a cell touches nothing: the robot of the book.
    """
    reach = int(np.ceil(radius + 0.5))
    rows, columns = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1)
    gap = np.hypot(np.maximum(abs(rows) - 0.5, 0), np.maximum(abs(columns) - 0.5, 0))
    nearest_first = np.argsort(rows**2 + columns**2, kind="stable")
    touched = nearest_first[gap[nearest_first] < radius - 1e-9]
    own = (rows[touched] == 0) & (columns[touched] == 0)
    return rows[touched[~own]].astype(np.int32), columns[touched[~own]].astype(np.int32)
