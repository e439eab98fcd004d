"""Visibility test: whether anything unknown is visible from a cell.

The answer is that of the field of view over known open cells (`field_of_view.visible_cells`), which
takes long when the range is. But a ray that comes to an unknown cell comes from an open one beside
it, and that is a frontier cell. So in each octant only the sector with frontier cells in it is
searched; these are counted in blocks (`ExplorationState.blocks`).
"""

from __future__ import annotations

from mapcli.algorithms.exploration.exploration_state import BLOCK, ExplorationState, blocks_in
from mapcli.algorithms.exploration.field_of_view import (
    SLOPES,
    THROUGH_OPEN,
    FieldOfView,
    Sector,
    count_unknown,
    eight_neighbours,
    octant_of,
    scan_octant,
    start_query,
)


def shows_unknown(state: ExplorationState, fov: FieldOfView, cell: int) -> bool:
    """Whether an unknown cell is visible from a cell over known open cells."""
    if fov.range == 1:
        return count_unknown(state, fov, eight_neighbours(state, fov, cell)) > 0
    start_query(fov)
    for vertical in (-1, 1):
        for horizontal in (-1, 1):
            for steep in (True, False):
                sector = frontier_sector(state, fov, cell, vertical, horizontal, steep)
                octant = octant_of(state, fov, cell, vertical, horizontal, steep)
                seen = scan_octant(fov, state.known, THROUGH_OPEN, cell, octant, sector, 0)
                if count_unknown(state, fov, seen) > 0:
                    return True
    return False


def frontier_sector(
    state: ExplorationState,
    fov: FieldOfView,
    cell: int,
    vertical: int,
    horizontal: int,
    steep: bool,
) -> Sector:
    """A sector of an octant outside which there is nothing unknown beside a frontier cell. It may
    be larger than need be, as it is that of whole blocks."""
    row, column = cell // state.stride, cell % state.stride
    across, depth, low, high = blocks_in(state.stride), 0, SLOPES, 0
    for r in range(first_block(fov, row, vertical), end_block(fov, row, vertical, state.rows)):
        for c in range(
            first_block(fov, column, horizontal),
            end_block(fov, column, horizontal, state.columns),
        ):
            if state.blocks[r * across + c]:
                down, aside = nearest(r, row, vertical), nearest(c, column, horizontal)
                if not steep:
                    down, aside = aside, down
                lowest = SLOPES * (2 * aside - 1) // (2 * (down + BLOCK) - 1)
                if lowest < SLOPES:  # else it is beyond the octant's diagonal
                    highest = -(-SLOPES * (2 * (aside + BLOCK) - 1) // max(2 * down - 1, 1))
                    depth, low = max(depth, down + BLOCK), min(low, lowest)
                    high = max(high, highest)
    return Sector(depth, max(low, 0), min(high, SLOPES))


def first_block(fov: FieldOfView, place: int, sense: int) -> int:
    """The first of the blocks that are within the range of a row (or column), in the sense of 1
    or -1."""
    return max(place - (fov.reach if sense < 0 else 0), 0) // BLOCK


def end_block(fov: FieldOfView, place: int, sense: int, last: int) -> int:
    """The one after the last of them; the last row of the map is given."""
    return min(place + (fov.reach if sense > 0 else 0), last) // BLOCK + 1


def nearest(block: int, place: int, sense: int) -> int:
    """How far away the nearest row of a block is, in that sense; less than 0 when it is beside
    the place or on its other side."""
    return block * BLOCK - place if sense > 0 else place - (block * BLOCK + BLOCK - 1)
