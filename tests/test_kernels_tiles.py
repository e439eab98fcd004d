"""Sparse cells in tiles, against a dictionary."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.algorithms._kernels import tiles as kernels

Cell = tuple[int, int]

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=30)
SIZE = 64


def entered(cells: list[Cell]) -> tuple[kernels.Places, kernels.Tiles, list[int]]:
    """Tiles with these cells, and the slots that they got."""
    places = np.full((SIZE, 2), kernels.EMPTY, np.int64)
    tiles = np.zeros((SIZE // 2, kernels.SIDE, kernels.SIDE), np.int32)
    used, slots = (1, 1), []
    for cell in cells:
        slot, used = kernels.enter(places, tiles, used, *cell)
        slots.append(slot)
    assert used[0] == 1 + len({(u // kernels.SIDE, v // kernels.SIDE) for u, v in cells})
    assert used[1] == 1 + len(set(cells))
    return places, tiles, slots


def random_cells(seed: int, extent: int) -> list[Cell]:
    """Few enough for the smallest table, some of them near each other."""
    rng = np.random.default_rng(seed)
    far = rng.integers(-extent, extent, (SIZE // 4 - 1, 2), endpoint=True)
    near = far // kernels.SIDE * kernels.SIDE + rng.integers(0, kernels.SIDE, far.shape)
    return [(u, v) for u, v in np.concatenate([far, near, far]).tolist()]


@FEW
@given(SEEDS, st.sampled_from([3, 40, 2**30 - 20]))
def test_enter_numbers_cells_as_they_come(seed: int, extent: int) -> None:
    cells = random_cells(seed, extent)
    _, _, slots = entered(cells)
    numbers = {cell: k for k, cell in enumerate(dict.fromkeys(cells), start=1)}
    assert slots == [numbers[cell] for cell in cells]


@FEW
@given(SEEDS, st.sampled_from([3, 40, 2**30 - 20]), st.integers(0, 7))
def test_the_cells_around_a_cell_as_a_dictionary(seed: int, extent: int, reach: int) -> None:
    cells = random_cells(seed, extent)
    places, tiles, slots = entered(cells)
    twin = dict(zip(cells, slots, strict=True))
    for u, v in cells[:10]:
        around = kernels.tiles_around(places, u, v, reach)
        assert kernels.has_any(around)
        for near_v in range(v - reach, v + reach + 1):
            for near_u in range(u - reach, u + reach + 1):
                found = kernels.slot_in(around, tiles, near_u, near_v)
                assert found == twin.get((near_u, near_v), 0)


def test_far_from_everything_is_nothing() -> None:
    places, tiles, _ = entered([(0, 0), (-1, 5)])
    far = kernels.tiles_around(places, 3 * kernels.SIDE, -40, 5)
    assert not kernels.has_any(far)
    assert kernels.slot_in(far, tiles, 3 * kernels.SIDE, -40) == 0


@FEW
@given(SEEDS, st.sampled_from([40, 2**30 - 20]))
def test_rehash_keeps_every_tile(seed: int, extent: int) -> None:
    cells = random_cells(seed, extent)
    places, _, _ = entered(cells)
    larger = np.full((4 * SIZE, 2), kernels.EMPTY, np.int64)
    kernels.rehash(places, larger)
    assert (larger[:, 0] != kernels.EMPTY).sum() == (places[:, 0] != kernels.EMPTY).sum()
    for u, v in cells:
        tile = u // kernels.SIDE, v // kernels.SIDE
        for there in (tile, (tile[0] + 1, tile[1])):
            assert kernels.tile_of(larger, *there) == kernels.tile_of(places, *there)


def test_tiles_in_a_row_do_not_collide() -> None:
    # A hash of too few bits would send all of them to the same place.
    places = np.full((1024, 2), kernels.EMPTY, np.int64)
    at = {kernels.find(places, u, 7) for u in range(200)}
    assert len(at) > 150
