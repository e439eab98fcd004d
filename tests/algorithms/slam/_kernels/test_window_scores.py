"""Scores of a whole window, against a slow and obvious twin."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.algorithms.slam._kernels.window_scores import score_shifts

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=30)


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
