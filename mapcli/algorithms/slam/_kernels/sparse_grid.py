"""A sparse grid: cells of an unbounded plane of which few are used, each with a number (its SLOT).

Two levels: a directory of tiles, and tiles of 16 x 16 cells that hold the cells' slots. Slots are
given out in the order in which cells are first used, so what is known about them can lie in plain
arrays. Looking up the cells around a cell is what fitting a scan to surfels mostly does: it takes
two loads for each.

Cells are (u, v): u along x, v along y, in whole cells from the origin; they may be negative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel

SHIFT = 4
SIDE = 1 << SHIFT
"""Cells along a side of a tile."""

BORDER = 2
"""Tiles along each edge of the directory that are never used, so that the cells less than a tile
away from any cell that is looked up are in the directory."""


class SparseGrid(NamedTuple):
    """Which cells are used.

    Attributes:
        directory: numbers of tiles, int32, [v, u] from the corner; 0 where there is no tile.
        corner: (u, v) of the directory's lowest tile, in tiles.
        tiles: slots of each tile's cells, int32, [tile, v, u]; 0 is a cell that is not used, and
            tile 0 has only such.
    """

    directory: NDArray[np.int32]
    corner: tuple[int, int]
    tiles: NDArray[np.int32]


Used = tuple[int, int]
"""How many tiles and slots are used, the empty tile 0 and the empty slot 0 included."""


@kernel
def is_within(grid: SparseGrid, u: int, v: int, border: int) -> bool:
    """Whether a cell is in a tile of the directory, at least `border` tiles from its edge."""
    across, up = (u >> SHIFT) - grid.corner[0], (v >> SHIFT) - grid.corner[1]
    rows, columns = grid.directory.shape
    is_across: bool = border <= across < columns - border
    return is_across and border <= up < rows - border


@kernel
def slot_of(grid: SparseGrid, u: int, v: int) -> int:
    """The slot of a cell, which must be in the directory; 0 if it has none."""
    tile = grid.directory[(v >> SHIFT) - grid.corner[1], (u >> SHIFT) - grid.corner[0]]
    slot: int = grid.tiles[tile, v & (SIDE - 1), u & (SIDE - 1)]
    return slot


@kernel
def enter(grid: SparseGrid, used: Used, most: int, u: int, v: int) -> tuple[int, Used]:
    """The slot of a cell, which is given the next one if it has none, and what is used then.

    Slot 0 where there is no room: for the cell in the directory, for another tile in `tiles`, or
    for more than `most` slots.
    """
    if not is_within(grid, u, v, BORDER):
        return 0, used
    up, across = (v >> SHIFT) - grid.corner[1], (u >> SHIFT) - grid.corner[0]
    row, column = v & (SIDE - 1), u & (SIDE - 1)
    tile = grid.directory[up, across]
    slot: int = grid.tiles[tile, row, column]
    if slot:
        return slot, used
    tiles, slots = used
    if slots == most or (tile == 0 and tiles == len(grid.tiles)):
        return 0, used
    if tile == 0:
        tile = tiles
        grid.directory[up, across] = tile
        tiles += 1
    grid.tiles[tile, row, column] = slots
    return slots, (tiles, slots + 1)
