"""Scores of poses in a window, against slow and obvious twins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.algorithms.slam._kernels.window_scores import Prior, penalty, score_shifts, sum_of_field

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=30)


@FEW
@given(
    st.integers(0, 10**6),
    st.integers(0, 10**4),
    st.builds(Prior, st.floats(0, 1e5), st.floats(0.1, 100), st.floats(0, 10), st.floats(0, 10)),
)
def test_penalty_as_its_twin(shift: int, turn: int, prior: Prior) -> None:
    most, half_at, per_cell, per_turn = prior
    by_shift = shift * per_cell / (half_at + shift * per_cell)
    by_turn = turn * per_turn / (half_at + turn * per_turn)
    assert penalty(shift, turn, prior) == pytest.approx(most * (by_shift + by_turn))


def test_penalty_by_hand() -> None:
    prior = Prior(100.0, 9.0, 0.25, 0.5)
    assert penalty(0, 0, prior) == 0
    assert penalty(36, 0, prior) == 50  # 6 cells, 3 standard deviations: half of the most
    assert penalty(0, 18, prior) == 50
    assert penalty(36, 18, prior) == 100
    assert 199.9 < penalty(10**9, 10**9, prior) < 200  # level far away
    assert penalty(36, 18, Prior(0.0, 9.0, 0.25, 0.5)) == 0


def test_sum_of_field_as_its_twin() -> None:
    rng = np.random.default_rng(0)
    field = rng.integers(0, 256, 500).astype(np.uint8)
    for n in (0, 1, 3, 4, 5, 64, 1001):
        scan = rng.integers(50, 450, n)
        for offset in (-50, 0, 49):
            expected = sum(int(field[p + offset]) for p in scan)
            assert sum_of_field(field, scan, offset) == expected


@FEW
@given(
    SEEDS, st.tuples(st.integers(-8, 3), st.integers(-8, 3)), st.integers(0, 4), st.integers(1, 3)
)
def test_score_shifts_as_its_twin(seed: int, low: tuple[int, int], count: int, stride: int) -> None:
    rng = np.random.default_rng(seed)
    field = rng.integers(0, 256, (45, 50)).astype(np.uint8)
    points = rng.integers(8, 30, (25, 2))  # rows, columns
    places = points[:, 0] * 50 + points[:, 1]
    sums = np.empty((count, count), np.int64)
    score_shifts(field.reshape(-1), places, 50, low, stride, sums)
    across, down = ([start + k * stride for k in range(count)] for start in low)
    expected = [
        [sum(int(field[r + dv, c + du]) for r, c in points) for du in across] for dv in down
    ]
    assert sums.tolist() == expected
