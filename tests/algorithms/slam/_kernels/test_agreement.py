"""How scans agree with a map, against a slow and obvious twin."""

from __future__ import annotations

from math import floor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.walls import MIDDLE, fields_of, place, scan_around, walls

from mapcli.algorithms.slam._kernels.agreement import count_agreement

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=40)


@FEW
@given(SEEDS, st.integers(0, 40))
def test_agreement_as_its_twin(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    log_odds = walls(rng, 12)
    field, points = fields_of(log_odds)[0], scan_around(rng, log_odds, n)
    pose = np.array([*rng.uniform(MIDDLE - 6, MIDDLE + 6, 2), rng.uniform(-4, 4)])
    values, contradicted = [], 0
    for point in points:
        u, v = (floor(x) for x in place(point, pose))
        if log_odds[v, u] != 0 or field[v, u] != 0:
            values.append(int(field[v, u]) / 255)
            contradicted += bool(log_odds[v, u] and values[-1] < 0.2)
    score, known, conflicts = count_agreement(log_odds, field, points, pose)
    assert known == len(values)
    assert conflicts == contradicted
    assert score == pytest.approx(sum(values) / len(values) if values else 0.0)


def test_agreement_by_hand() -> None:
    log_odds, field = np.zeros((9, 9), np.int16), np.zeros((9, 9), np.uint8)
    log_odds[2, 2:5] = [-9, 9, 9]
    field[2, 2:6] = [0, 255, 51, 102]  # the last is unknown, beside a wall
    points = np.column_stack([np.arange(8.0), np.zeros(8)]) + 0.5
    pose = np.array([0.0, 2.0, 0.0])
    score, known, conflicts = count_agreement(log_odds, field, points, pose)
    assert known == 4
    assert conflicts == 1  # 51 is as near to a wall as may be
    assert score == pytest.approx((0 + 1 + 0.2 + 0.4) / 4)
