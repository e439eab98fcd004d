"""Cells of a plane of which few are used, numbered as they come: a hash table of tiles of cells.

Looking up the cells around a cell is what fitting a scan to walls mostly does. Neighbours lie in
the same tile, or in one of four, which are looked up once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms._kernels.compiling import kernel

EMPTY = -1
BIAS = 1 << 30
GOLDEN = -0x61C8864680B583EB
"""2^64 over the golden ratio: keys in a row times this are spread over all places (Knuth)."""

SHIFT = 4
SIDE = 1 << SHIFT
"""Cells along a side of a tile."""

Places = NDArray[np.int64]
"""A hash table, shape (a power of 2, 2): keys of tiles, EMPTY where there is none, and numbers."""
Tiles = NDArray[np.int32]
"""Slots of each tile's cells, [tile, v, u]; 0 is a cell that is not used, tile 0 has only such."""
Around = tuple[int, int, int, int, int, int]
"""Tiles beside each other: (u, v) of the lowest, then the numbers of it, of the one to its right,
of the one above it, and of the one above to its right."""


@kernel
def find(places: Places, u: int, v: int) -> int:
    """Where a tile is in the hash table, or where it would go."""
    key = key_of(u, v)
    mask = len(places) - 1
    at = ((key * GOLDEN) >> 40) & mask
    while places[at, 0] != EMPTY and places[at, 0] != key:
        at = (at + 1) & mask
    return at


@kernel
def key_of(u: int, v: int) -> int:
    """What stands for a tile in the hash table."""
    return ((u + BIAS) << 31) | (v + BIAS)


@kernel
def tile_of(places: Places, u: int, v: int) -> int:
    """The number of a tile, 0 where there is none."""
    at = find(places, u, v)
    return places[at, 1] if places[at, 0] != EMPTY else 0


@kernel
def enter(
    places: Places, tiles: Tiles, used: tuple[int, int], u: int, v: int
) -> tuple[int, tuple[int, int]]:
    """The slot of a cell, which is given the next one if it has none, and how many tiles and
    slots are in use then."""
    n_tiles, n_slots = used
    at = find(places, u >> SHIFT, v >> SHIFT)
    if places[at, 0] == EMPTY:
        places[at, 0], places[at, 1] = key_of(u >> SHIFT, v >> SHIFT), n_tiles
        n_tiles += 1
    tile, row, column = places[at, 1], v & (SIDE - 1), u & (SIDE - 1)
    if tiles[tile, row, column] == 0:
        tiles[tile, row, column] = n_slots
        n_slots += 1
    return tiles[tile, row, column], (n_tiles, n_slots)


@kernel
def tiles_around(places: Places, u: int, v: int, reach: int) -> Around:
    """The tiles that hold the cells up to `reach` from a cell, less than half a tile's side."""
    left, low = (u - reach) >> SHIFT, (v - reach) >> SHIFT
    is_wide, is_high = (u + reach) >> SHIFT > left, (v + reach) >> SHIFT > low
    one = tile_of(places, left, low)
    right = tile_of(places, left + 1, low) if is_wide else one
    above = tile_of(places, left, low + 1) if is_high else one
    beyond = tile_of(places, left + 1, low + 1) if is_wide and is_high else one
    return left, low, one, right, above, beyond


@kernel
def has_any(around: Around) -> bool:
    """Whether any of the tiles exists, or none of their cells can be used."""
    return around[2] | around[3] | around[4] | around[5] != 0


@kernel
def slot_in(around: Around, tiles: Tiles, u: int, v: int) -> int:
    """The slot of a cell in tiles that were looked up before, 0 if it has none."""
    left, low, one, right, above, beyond = around
    is_right, is_above = u >> SHIFT > left, v >> SHIFT > low
    tile = (beyond if is_right else above) if is_above else (right if is_right else one)
    slot: int = tiles[tile, v & (SIDE - 1), u & (SIDE - 1)]
    return slot


@kernel
def rehash(old: Places, places: Places) -> None:
    """Fill a larger hash table from a smaller one."""
    for k in range(len(old)):
        key = old[k, 0]
        if key != EMPTY:
            at = find(places, (key >> 31) - BIAS, (key & ((1 << 31) - 1)) - BIAS)
            places[at, 0], places[at, 1] = key, old[k, 1]
