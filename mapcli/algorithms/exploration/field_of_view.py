"""What a robot senses from where it stands.

A range of one cell is the book's robot: its own cell and the eight around it, whatever is in
between. Beyond that it sees as a range finder with rays in every direction: a ray leaves the
centre of the robot's cell, shows each cell that it enters, and ends in the first that it cannot
pass, which it still shows, or where the range ends (centre to centre, in cells). A single ray is
too thin to count: a cell is seen when a bundle of rays gets there, so nothing is seen between two
obstacles that touch at a corner.

All rays are followed at once, octant by octant and row by row: a sector of slopes is narrowed and
split by what stands in it (recursive shadow casting, here with whole squares and exact fractions).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapcli.algorithms.exploration.exploration_state import (
    KIND,
    OPEN,
    UNKNOWN,
    Cells,
    ExplorationState,
)

THROUGH_OPEN = 1 << OPEN
THROUGH_UNKNOWN = 1 << OPEN | 1 << UNKNOWN
"""Which kinds of cells a ray passes, as bits."""


MAX_QUERIES = 2**31 - 2
"""Then the window is cleared, as its numbers would be too large for it."""


class FieldOfView(NamedTuple):
    """A sensor and its scratch memory (mutable).

    Attributes:
        range: in cells; 1 means the eight neighbours.
        reach: of the window, in rows and columns: the range or the map's size.
        seen: the visible cells that the last query found (int64).
        window: the query in which each cell around the robot was last seen, shape
            ((2 reach + 1) ** 2,) (int32).
        queries: how many there were, shape (1,) (int64).
        sectors: stack of sectors that wait, five numbers each (int64).
    """

    range: int
    reach: int
    seen: Cells
    window: Cells
    queries: Cells
    sectors: Cells


def make_field_of_view(state: ExplorationState, sensor_range: int) -> FieldOfView:
    """A sensor that reaches `sensor_range` cells, for this map."""
    reach = min(sensor_range, max(state.rows, state.columns))
    side = 2 * reach + 1
    waiting = 5 * (reach + 2) * (reach + 3) if sensor_range > 1 else 0
    return FieldOfView(
        min(sensor_range, state.rows + state.columns),
        reach,
        np.zeros(min(side * side, len(state.known)), np.int64),
        np.zeros(side * side if sensor_range > 1 else 0, np.int32),
        np.zeros(1, np.int64),
        np.zeros(waiting, np.int64),
    )


def cells_in_range(fov: FieldOfView) -> int:
    """How many cells besides its own a robot could see at most."""
    if fov.range == 1:
        return 8
    rows = np.arange(-fov.range, fov.range + 1)
    return int((2 * np.floor(np.sqrt(fov.range**2 - rows**2)) + 1).sum()) - 1


def visible_cells(
    state: ExplorationState, fov: FieldOfView, kinds: Cells, passed: int, cell: int
) -> int:
    """The cells visible from a cell: how many entries of `fov.seen` they are.

    Args:
        kinds: what each cell is, `state.world` or `state.known`.
        passed: the kinds that rays pass, THROUGH_OPEN or THROUGH_UNKNOWN.
    """
    if fov.range == 1:
        return eight_neighbours(state, fov, cell)
    start_query(fov)
    fov.seen[0] = cell
    fov.window[fov.reach * (2 * fov.reach + 2)] = fov.queries[0]
    seen, whole = 1, Sector(fov.reach, 0, SLOPES)
    for vertical in (-1, 1):
        for horizontal in (-1, 1):
            for steep in (True, False):
                octant = octant_of(state, fov, cell, vertical, horizontal, steep)
                seen = scan_octant(fov, kinds, passed, cell, octant, whole, seen)
    return seen


def start_query(fov: FieldOfView) -> None:
    """What was seen before counts no longer."""
    fov.queries[0] += 1
    if fov.queries[0] > MAX_QUERIES:
        for here in range(len(fov.window)):
            fov.window[here] = 0
        fov.queries[0] = 1


SLOPES = 256
"""Parts of an octant that a `Sector` can tell apart."""


class Sector(NamedTuple):
    """A part of an octant: rays of slopes from low / SLOPES to high / SLOPES, over so many rows."""

    depth: int
    low: int
    high: int


class Octant(NamedTuple):
    """An eighth of what there is to see from a cell.

    It has rows in its own sense, at depth 1, 2, ... away from the cell, and in them cells 0, 1,
    ... aside of its axis; rays have slopes (cells aside per row) from 0 to 1. The cell at
    (depth, aside) is entered by rays of slopes (2 aside - 1) / (2 depth + 1) to
    (2 aside + 1) / (2 depth - 1).

    Attributes:
        down, right: index offsets from row to row, and from cell to cell.
        down_here, right_here: the same in the sensor's window.
        far, wide: how many rows and cells there are up to the edge of the map.
    """

    down: int
    right: int
    down_here: int
    right_here: int
    far: int
    wide: int


def octant_of(
    state: ExplorationState,
    fov: FieldOfView,
    cell: int,
    vertical: int,
    horizontal: int,
    steep: bool,
) -> Octant:
    """The octant down or up (vertical 1, -1), right or left, more the former when steep."""
    row, column = cell // state.stride, cell % state.stride
    height = row - 1 if vertical < 0 else state.rows - row
    width = column - 1 if horizontal < 0 else state.columns - column
    down, right = vertical * state.stride, horizontal
    down_here, right_here = vertical * (2 * fov.reach + 1), horizontal
    if steep:
        far, wide = min(height, fov.reach), width
        return Octant(down, right, down_here, right_here, far, wide)
    far, wide = min(width, fov.reach), height
    return Octant(right, down, right_here, down_here, far, wide)


def eight_neighbours(state: ExplorationState, fov: FieldOfView, cell: int) -> int:
    """The robot's cell and the eight around it, as far as the map goes."""
    row, column = cell // state.stride, cell % state.stride
    seen = 0
    for r in range(max(row - 1, 1), min(row + 1, state.rows) + 1):
        for c in range(max(column - 1, 1), min(column + 1, state.columns) + 1):
            fov.seen[seen] = r * state.stride + c
            seen += 1
    return seen


def scan_octant(
    fov: FieldOfView,
    kinds: Cells,
    passed: int,
    origin: int,
    octant: Octant,
    sector: Sector,
    seen: int,
) -> int:
    """Follow the rays of a sector of one octant; returns the new number of cells in `fov.seen`.

    It splits into sectors of slopes between two fractions, low / low_by and high / high_by.
    """
    far = min(octant.far, sector.depth)
    centre, limit = fov.reach * (2 * fov.reach + 2), fov.range * fov.range
    sectors = fov.sectors
    waiting = push(sectors, 0, 1, sector.low, SLOPES, sector.high, SLOPES)
    while waiting:
        waiting -= 5
        depth = sectors[waiting]
        low, low_by = sectors[waiting + 1], sectors[waiting + 2]
        high, high_by = sectors[waiting + 3], sectors[waiting + 4]
        while depth <= far and low * high_by < high * low_by:
            near_edge, far_edge = 2 * depth - 1, 2 * depth + 1
            # The first cell that the lowest ray has not yet passed at the row's near edge.
            aside = (low * near_edge - low_by) // (2 * low_by) + 1
            while low * high_by < high * low_by:
                left, right = 2 * aside - 1, 2 * aside + 1
                if left * high_by >= high * far_edge:
                    break
                if aside > octant.wide or depth * depth + aside * aside > limit:
                    high, high_by = left, far_edge  # the rays from here on have ended
                    break
                cell = origin + depth * octant.down + aside * octant.right
                here = centre + depth * octant.down_here + aside * octant.right_here
                if fov.window[here] != fov.queries[0]:
                    fov.window[here] = fov.queries[0]
                    fov.seen[seen] = cell
                    seen += 1
                if not (passed >> (kinds[cell] & KIND)) & 1:
                    if low * far_edge < left * low_by:
                        waiting = push(sectors, waiting, depth + 1, low, low_by, left, far_edge)
                    if low * near_edge < right * low_by:
                        low, low_by = right, near_edge
                aside += 1
            depth += 1
    return seen


def push(
    sectors: Cells, waiting: int, depth: int, low: int, low_by: int, high: int, high_by: int
) -> int:
    """Let the sector of slopes low / low_by to high / high_by wait for its turn at a row."""
    sectors[waiting] = depth
    sectors[waiting + 1] = low
    sectors[waiting + 2] = low_by
    sectors[waiting + 3] = high
    sectors[waiting + 4] = high_by
    return waiting + 5


def expected_gain(state: ExplorationState, fov: FieldOfView, cell: int) -> int:
    """Cells expected to be seen from a cell: those unknown ones that rays would show if nothing
    but the known obstacles (and cells known to be unknowable) stood in their way."""
    return count_unknown(state, fov, visible_cells(state, fov, state.known, THROUGH_UNKNOWN, cell))


def count_unknown(state: ExplorationState, fov: FieldOfView, seen: int) -> int:
    """How many of the first cells of `fov.seen` are unknown."""
    count = 0
    for k in range(seen):
        count += state.known[fov.seen[k]] == UNKNOWN
    return count
