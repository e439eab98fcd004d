"""Cells of a plane of which few are used, numbered as they come: tiles of cells in a directory.

Looking up the cells around a cell is what fitting a scan to walls mostly does: two loads each.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel

SHIFT = 4
SIDE = 1 << SHIFT
"""Cells along a side of a tile."""

BORDER = 2
"""Tiles along each edge of the directory that are never used, so that the cells less than a tile
away from any cell that is looked up are in the directory."""

Directory = NDArray[np.int32]
"""Numbers of tiles, [v, u] from the corner, 0 where there is none."""
Corner = tuple[int, int]
"""(u, v) of the directory's lowest tile."""
Tiles = NDArray[np.int32]
"""Slots of each tile's cells, [tile, v, u]; 0 is a cell that is not used, tile 0 has only such."""


@kernel
def is_within(directory: Directory, corner: Corner, u: int, v: int, border: int) -> bool:
    """Whether a cell is in a tile so far from the directory's edge."""
    across, up = (u >> SHIFT) - corner[0], (v >> SHIFT) - corner[1]
    rows, columns = directory.shape
    is_across: bool = border <= across < columns - border
    return is_across and border <= up < rows - border


@kernel
def slot_of(directory: Directory, corner: Corner, tiles: Tiles, u: int, v: int) -> int:
    """The slot of a cell, which is in the directory; 0 if it has none."""
    tile = directory[(v >> SHIFT) - corner[1], (u >> SHIFT) - corner[0]]
    slot: int = tiles[tile, v & (SIDE - 1), u & (SIDE - 1)]
    return slot


@kernel
def enter(
    directory: Directory,
    corner: Corner,
    tiles: Tiles,
    used: tuple[int, int],
    most: int,
    u: int,
    v: int,
) -> tuple[int, tuple[int, int]]:
    """The slot of a cell, which is given the next one if it has none, and how many tiles and
    slots are used then; slot 0 where there is no room: for the cell in the directory, for a tile
    in `tiles`, or for more than `most` slots."""
    n_tiles, n_slots = used
    if not is_within(directory, corner, u, v, BORDER):
        return 0, used
    up, across = (v >> SHIFT) - corner[1], (u >> SHIFT) - corner[0]
    row, column = v & (SIDE - 1), u & (SIDE - 1)
    tile = directory[up, across]
    slot: int = tiles[tile, row, column]
    if slot:
        return slot, used
    if n_slots == most or (tile == 0 and n_tiles == len(tiles)):
        return 0, used
    if tile == 0:
        tile = n_tiles
        directory[up, across] = tile
        n_tiles += 1
    tiles[tile, row, column] = n_slots
    return n_slots, (n_tiles, n_slots + 1)
