"""Views of scans, against slow and obvious twins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels.views import (
    CLEARED,
    ViewCounts,
    compare_view,
    count_view,
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
        counts.passes[5, 5] = passes
        assert compare_view(counts, end) == found
