"""Views of scans, against slow and obvious twins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels.views import (
    CLEARED,
    DIRECTIONS,
    ViewCounts,
    compare_view,
    count_view,
    least_loss,
)

SHAPE = 40, 50


def nothing() -> ViewCounts:
    return ViewCounts(np.zeros(SHAPE, np.int16), np.zeros(SHAPE, np.int16))


def scan(seed: int) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    ends = rng.uniform((2, 2), (SHAPE[1] - 2, SHAPE[0] - 2), (30, 2)).astype(np.float32)
    return ends, rng.uniform((10, 10), (30, 30))


def slow_counts(ends: NDArray[np.float32], start: NDArray[np.float64]) -> ViewCounts:
    """Samples a cell apart along each beam, but for the last cell and a half."""
    counts = nothing()
    for end in ends:
        way = end - start
        length = math.hypot(*way)
        for k in range(int(length) - 1):
            u, v = start + way * (k + 0.5) / length
            counts.passes[math.floor(v), math.floor(u)] += 1
        counts.hits[math.floor(end[1]), math.floor(end[0])] += 1
    return counts


@pytest.mark.parametrize("seed", range(5))
def test_counts_are_those_of_the_twin(seed: int) -> None:
    counts, twin = nothing(), slow_counts(*scan(seed))
    count_view(counts, *scan(seed), 1)
    np.testing.assert_array_equal(counts.hits, twin.hits)
    np.testing.assert_array_equal(counts.passes, twin.passes)
    count_view(counts, *scan(seed), -1)
    assert not counts.hits.any()
    assert not counts.passes.any()


def test_one_beam_by_hand() -> None:
    # From the middle of cell 2 to the middle of cell 7 in row 3: five cells long. Cells 2 to 5 are
    # passed, 6 and 7 may belong to the wall.
    counts = nothing()
    count_view(counts, np.array([[7.5, 3.5]], np.float32), np.array([2.5, 3.5]), 1)
    assert np.flatnonzero(counts.passes[3]).tolist() == [3, 4, 5, 6][:4]
    assert np.flatnonzero(counts.hits[3]).tolist() == [7]


def test_ends_are_compared_by_hand() -> None:
    counts = nothing()
    counts.hits[5, 5] = 1
    counts.passes[5:20, 10:30] = CLEARED
    counts.passes[30, 30] = CLEARED - 1
    ends = [(5.5, 5.5), (6.5, 4.2), (15.5, 10.5), (30.5, 30.5), (40.5, 30.5)]
    #        the hit     beside it   in the open   seen once     unseen
    assert compare_view(counts, np.array(ends, np.float32)) == (2, 1)


def test_what_is_seen_through_as_often_as_hit_is_there() -> None:
    counts = nothing()
    counts.hits[5, 5] = 3
    end = np.array([[5.5, 5.5]], np.float32)
    for passes, found in ((3, (1, 0)), (4, (0, 1))):
        counts.passes[4:7, 4:7] = passes
        assert compare_view(counts, end) == found


def test_what_beams_graze_is_not_seen_through() -> None:
    # A wall between rows 9 and 10, hit by one scan and grazed on this side by many: their beams
    # ran along it through its own cells.
    counts = nothing()
    counts.hits[9, 5:30] = 1
    counts.passes[2:10, 5:30] = 20
    wall = np.array([[15.5, 9.8], [16.5, 9.8]], np.float32)
    assert compare_view(counts, wall) == (2, 0)
    assert compare_view(counts, wall, 0.0, -5.0) == (0, 2)


def slow_loss(counts: ViewCounts, ends: NDArray[np.float32], cells: float) -> int:
    """Every end, moved in every direction, held against the counts around it."""

    def agreement(move: complex) -> int:
        total = 0
        for end in ends:
            u, v = math.floor(end[0] + move.real), math.floor(end[1] + move.imag)
            hits = counts.hits[v - 1 : v + 2, u - 1 : u + 2].sum()
            passes = counts.passes[v - 1 : v + 2, u - 1 : u + 2].min()
            if passes >= CLEARED and passes > hits:
                total -= 1
            elif hits:
                total += 1
        return total

    turns = [2j * math.pi * k / DIRECTIONS for k in range(DIRECTIONS)]
    return agreement(0j) - max(agreement(cells * np.exp(turn)) for turn in turns)


@pytest.mark.parametrize("seed", range(5))
def test_the_least_loss_is_that_of_the_twin(seed: int) -> None:
    counts, (ends, _) = nothing(), scan(seed)
    for other in range(6):
        count_view(counts, *scan(20 * seed + other), 1)
    ends = np.clip(ends, 8, (SHAPE[1] - 8, SHAPE[0] - 8)).astype(np.float32)
    assert least_loss(counts, ends, 5.0) == slow_loss(counts, ends, 5.0)


def test_along_a_corridor_nothing_is_lost() -> None:
    # Walls beside rows 10 and 20, which end at column 40 in one that runs across.
    counts = nothing()
    counts.passes[10:21, 2:40] = 5
    counts.hits[9, 2:41] = counts.hits[21, 2:41] = 5
    counts.hits[9:22, 41] = 5
    along = [(u + 0.5, v) for u in range(10, 30) for v in (9.5, 21.5)]
    across = [(41.5, v + 0.5) for v in range(10, 20)]
    assert least_loss(counts, np.array(along, np.float32), 5.0) == 0
    # Five cells away the ten are in the open on one side, and nowhere on the other.
    assert least_loss(counts, np.array(along + across, np.float32), 5.0) == 10
