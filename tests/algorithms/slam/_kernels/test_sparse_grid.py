"""Sparse cells in tiles, against a dictionary."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.algorithms.slam._kernels import sparse_grid as kernels

Cell = tuple[int, int]

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=30)
ROOM = 60


def empty(extent: int) -> kernels.SparseGrid:
    """Room for cells up to so far from the origin."""
    far = kernels.BORDER + 1 + extent // kernels.SIDE
    directory = np.zeros((2 * far, 2 * far), np.int32)
    tiles = np.zeros((ROOM, kernels.SIDE, kernels.SIDE), np.int32)
    return kernels.SparseGrid(directory, (-far, -far), tiles)


def entered(cells: list[Cell], extent: int) -> tuple[kernels.SparseGrid, list[int]]:
    """Tiles with these cells, and the slots that they got."""
    grid, used, slots = empty(extent), (1, 1), []
    for cell in cells:
        slot, used = kernels.enter(grid, used, ROOM, *cell)
        slots.append(slot)
    assert used[0] == 1 + len({(u // kernels.SIDE, v // kernels.SIDE) for u, v in cells})
    assert used[1] == 1 + len(set(cells))
    return grid, slots


def random_cells(seed: int, extent: int) -> list[Cell]:
    """Some of them near each other, some twice."""
    rng = np.random.default_rng(seed)
    far = rng.integers(-extent, extent, (15, 2), endpoint=True)
    near = far // kernels.SIDE * kernels.SIDE + rng.integers(0, kernels.SIDE, far.shape)
    near = near.clip(-extent, extent)
    return [(u, v) for u, v in np.concatenate([far, near, far]).tolist()]


@FEW
@given(SEEDS, st.sampled_from([3, 40, 5000]))
def test_enter_numbers_cells_as_they_come(seed: int, extent: int) -> None:
    cells = random_cells(seed, extent)
    _, slots = entered(cells, extent)
    numbers = {cell: k for k, cell in enumerate(dict.fromkeys(cells), start=1)}
    assert slots == [numbers[cell] for cell in cells]


@FEW
@given(SEEDS, st.sampled_from([3, 40, 5000]))
def test_the_cells_around_a_cell_as_a_dictionary(seed: int, extent: int) -> None:
    cells = random_cells(seed, extent)
    grid, slots = entered(cells, extent)
    twin = dict(zip(cells, slots, strict=True))
    for u, v in cells[:10]:
        for near_v in range(v - kernels.SIDE, v + kernels.SIDE + 1):
            for near_u in range(u - kernels.SIDE, u + kernels.SIDE + 1):
                found = kernels.slot_of(grid, near_u, near_v)
                assert found == twin.get((near_u, near_v), 0)


def test_where_the_directory_ends() -> None:
    grid = empty(0)  # one tile, and its border, on each side of the axes
    side, border = kernels.SIDE, kernels.BORDER
    for border_, low, high in ((border, -side, side), (1, -2 * side, 2 * side)):
        for u, expected in ((low - 1, False), (low, True), (high - 1, True), (high, False)):
            for cell in ((u, 0), (0, u)):
                assert kernels.is_within(grid, *cell, border_) is expected


def test_no_room() -> None:
    grid, enter = empty(0), kernels.enter
    one, two = (grid._replace(tiles=grid.tiles[:count]) for count in (1, 2))
    assert enter(grid, (1, 1), 9, kernels.SIDE, 0) == (0, (1, 1))  # beyond
    assert enter(one, (1, 1), 9, 0, 0) == (0, (1, 1))  # no tile left
    assert enter(grid, (1, 1), 1, 0, 0) == (0, (1, 1))  # no slot left
    assert not grid.directory.any()
    assert enter(grid, (1, 1), 2, 0, 0) == (1, (2, 2))
    assert enter(two, (2, 2), 2, 0, 0) == (1, (2, 2))  # it has one
