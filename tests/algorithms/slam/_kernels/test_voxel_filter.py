"""The voxel grid filter, against a slow and obvious twin."""

from __future__ import annotations

from math import floor

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from support.walls import Floats

from mapcli.algorithms.slam._kernels.voxel_filter import first_of_each_cell

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=40)


def slow_filter(points: Floats, cell: float) -> list[int]:
    first: dict[tuple[int, int], int] = {}
    for i, (x, y) in enumerate(points):
        first.setdefault((floor(x / cell), floor(y / cell)), i)
    return sorted(first.values())


@FEW
@given(SEEDS, st.integers(0, 80), st.floats(0.01, 3), st.sampled_from([0.1, 2.0, 300.0]))
def test_voxel_filter_as_its_twin(seed: int, n: int, cell: float, extent: float) -> None:
    points = np.random.default_rng(seed).normal(0, extent, (n, 2))
    kept = first_of_each_cell(points, cell)
    assert kept.tolist() == slow_filter(points, cell)


def test_voxel_filter_by_hand() -> None:
    points = np.array([[0.1, 0.1], [0.9, 0.9], [-0.1, 0.1], [1.0, 0.5], [-0.9, 0.9], [0.1, -0.1]])
    assert first_of_each_cell(points, 1.0).tolist() == [0, 2, 3, 5]
    assert first_of_each_cell(points, 0.5).tolist() == [0, 1, 2, 3, 4, 5]
