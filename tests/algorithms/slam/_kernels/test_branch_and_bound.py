"""The compiled loops that find poses, against slow and obvious twins."""

from __future__ import annotations

from math import floor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.walls import MIDDLE, SIZE, Floats, fields_of, place, scan_around, walls

from mapcli.algorithms.slam._kernels import branch_and_bound as kernels
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=40)

# --- thin


def slow_thin(points: Floats, cell: float) -> list[int]:
    first: dict[tuple[int, int], int] = {}
    for i, (x, y) in enumerate(points):
        first.setdefault((floor(x / cell), floor(y / cell)), i)
    return sorted(first.values())


@FEW
@given(SEEDS, st.integers(0, 80), st.floats(0.01, 3), st.sampled_from([0.1, 2.0, 300.0]))
def test_thin_as_its_twin(seed: int, n: int, cell: float, extent: float) -> None:
    points = np.random.default_rng(seed).normal(0, extent, (n, 2))
    kept = kernels.thin(points, cell)
    assert kept.tolist() == slow_thin(points, cell)


def test_thin_by_hand() -> None:
    points = np.array([[0.1, 0.1], [0.9, 0.9], [-0.1, 0.1], [1.0, 0.5], [-0.9, 0.9], [0.1, -0.1]])
    assert kernels.thin(points, 1.0).tolist() == [0, 2, 3, 5]
    assert kernels.thin(points, 0.5).tolist() == [0, 1, 2, 3, 4, 5]


# --- the penalty


@FEW
@given(
    st.integers(0, 10**6),
    st.integers(0, 10**4),
    st.tuples(st.floats(0, 1e5), st.floats(0.1, 100), st.floats(0, 10), st.floats(0, 10)),
)
def test_penalty_as_its_twin(shift: int, turn: int, prior: kernels.Prior) -> None:
    most, knee, per_cell, per_step = prior
    by_shift = shift * per_cell / (knee + shift * per_cell)
    by_turn = turn * per_step / (knee + turn * per_step)
    assert kernels.penalty(shift, turn, prior) == pytest.approx(most * (by_shift + by_turn))


def test_penalty_by_hand() -> None:
    prior = 100.0, 9.0, 0.25, 0.5
    assert kernels.penalty(0, 0, prior) == 0
    assert kernels.penalty(36, 0, prior) == 50  # 6 cells, 3 standard deviations: half of the most
    assert kernels.penalty(0, 18, prior) == 50
    assert kernels.penalty(36, 18, prior) == 100
    assert 199.9 < kernels.penalty(10**9, 10**9, prior) < 200  # level far away
    assert kernels.penalty(36, 18, (0.0, 9.0, 0.25, 0.5)) == 0


def test_nearest_in_as_its_twin() -> None:
    for low in range(-20, 21):
        for width in range(1, 18):
            nearest = min(abs(x) for x in range(low, low + width))
            assert kernels.nearest_in(low, width) == nearest


def test_total_as_its_twin() -> None:
    rng = np.random.default_rng(0)
    field = rng.integers(0, 256, 500).astype(np.uint8)
    for n in (0, 1, 3, 4, 5, 64, 1001):
        places = rng.integers(50, 450, n)
        for offset in (-50, 0, 49):
            expected = sum(int(field[p + offset]) for p in places)
            assert kernels.total(field, places, offset) == expected


# --- search


def score_at(
    field: NDArray[np.uint8],
    points: Floats,
    start: Floats,
    shift: tuple[int, int, int],
    turn_step: float,
    prior: kernels.Prior,
) -> tuple[float, int]:
    """(score, sum of the field) of the pose (du, dv, turns) away from `start`."""
    du, dv, turns = shift
    pose = start + np.array([0, 0, turns * turn_step])
    fit = 0
    for point in points:
        u, v = place(point, pose)
        fit += int(field[floor(v) + dv, floor(u) + du])
    most, knee, per_cell, per_step = prior
    a, b = (du**2 + dv**2) * per_cell, turns**2 * per_step
    return fit - most * a / (knee + a) - most * b / (knee + b), fit


def slow_search(
    field: NDArray[np.uint8],
    points: Floats,
    start: Floats,
    half: tuple[int, int],
    steps: tuple[int, float],
    prior: kernels.Prior,
) -> float:
    """The best score of all poses of a window, every one tried."""
    reach, turns = half
    most, knee, per_cell, per_step = prior
    shifts = np.arange(-reach, reach + 1)
    shifts = shifts[shifts % steps[0] == 0]
    a = (shifts[:, None] ** 2 + shifts[None, :] ** 2) * per_cell
    best = -np.inf
    for k in range(-turns, turns + 1):
        pose = start + np.array([0, 0, k * steps[1]])
        fits = np.zeros((len(shifts), len(shifts)))
        for point in points:
            u, v = place(point, pose)
            fits += field[np.ix_(floor(v) + shifts, floor(u) + shifts)]
        b = k**2 * per_step
        scores = fits - most * a / (knee + a) - most * b / (knee + b)
        best = max(best, float(scores.max()))
    return best


@settings(deadline=None, max_examples=150)
@given(
    seed=SEEDS,
    n=st.integers(0, 40),
    reach=st.integers(0, 12),
    turns=st.integers(0, 4),
    stride=st.integers(1, 3),
    top=st.integers(1, 3),
    share=st.sampled_from([0.0, 0.05, 0.2, 1.0]),
)
def test_search_finds_what_trying_everything_finds(
    seed: int, n: int, reach: int, turns: int, stride: int, top: int, share: float
) -> None:
    rng = np.random.default_rng(seed)
    log_odds = walls(rng, int(rng.integers(0, 12)))
    fields, points = fields_of(log_odds), scan_around(rng, log_odds, n)
    start = np.array([*rng.uniform(MIDDLE - 6, MIDDLE + 6, 2), rng.uniform(-3.5, 3.5)])
    if rng.random() < 0.5:
        start[2] = rng.uniform(-0.1, 0.1)
    steps = stride, float(rng.uniform(0.005, 0.1))
    prior = 255.0 * n * share, 9.0, float(rng.uniform(0, 2)), float(rng.uniform(0, 2))
    best = slow_search(fields[0], points, start, (reach, turns), steps, prior)

    du, dv, k, score, fit = kernels.search(
        fields, LEVEL_WIDTHS, points, start, (reach, turns), steps, prior, top
    )

    assert score == pytest.approx(best, abs=1e-6)
    shift = int(du), int(dv), int(k)
    assert (du, dv, k) == shift
    assert max(abs(du), abs(dv)) <= reach
    assert abs(k) <= turns
    assert du % stride == dv % stride == 0
    own = score_at(fields[0], points, start, shift, steps[1], prior)
    assert (score, fit) == pytest.approx(own, abs=1e-6)

    half = reach // 2, turns // 2
    known = kernels.search(fields, LEVEL_WIDTHS, points, start, half, steps, prior, top)
    kept = known.copy()
    again = kernels.search(
        fields, LEVEL_WIDTHS, points, start, (reach, turns), steps, prior, top, known
    )
    assert again[3] == pytest.approx(best, abs=1e-6)
    assert (known == kept).all()


def test_search_of_noise() -> None:
    # Random fields, whose bounds say little.
    rng = np.random.default_rng(7)
    for top in (1, 2, 3):
        field = rng.integers(0, 256, (SIZE, SIZE)).astype(np.uint8)
        levels = [np.full_like(field, 255) for _ in LEVEL_WIDTHS]
        fields = np.stack([field, *levels[1:]])
        points, start = rng.uniform(-15, 15, (9, 2)), np.array([MIDDLE, MIDDLE, 0.3])
        prior = 200.0, 9.0, 0.1, 0.1
        best = slow_search(field, points, start, (7, 2), (1, 0.02), prior)
        found = kernels.search(fields, LEVEL_WIDTHS, points, start, (7, 2), (1, 0.02), prior, top)
        assert found[3] == pytest.approx(best)


def test_search_by_hand() -> None:
    # One wall, and a robot that sees it 5 cells ahead while it is 8 ahead and 2 to the left.
    log_odds = np.zeros((SIZE, SIZE), np.int16)
    log_odds[52, 58] = 1
    fields, points = fields_of(log_odds), np.array([[5.0, 0.0]])
    start = np.array([50.5, 50.5, 0.0])
    half, steps, prior = (6, 0), (1, 0.01), (0.0, 13.0, 1.0, 1.0)
    found = kernels.search(fields, LEVEL_WIDTHS, points, start, half, steps, prior, 2)
    assert found.tolist() == [3, 2, 0, 255, 255]
    # 13 squared cells against a knee of 13 cost half of what it may cost at most.
    prior = 100.0, 13.0, 1.0, 1.0
    found = kernels.search(fields, LEVEL_WIDTHS, points, start, half, steps, prior, 2)
    assert found.tolist() == [3, 2, 0, 205, 255]


def test_a_map_that_does_not_care_leaves_the_start() -> None:
    fields = np.full((len(LEVEL_WIDTHS), SIZE, SIZE), 9, np.uint8)
    points, start = np.array([[3.0, 4.0], [-5.0, 1.0]]), np.array([MIDDLE, MIDDLE, 1.0])
    prior = 10.0, 9.0, 0.1, 0.1
    for top in (1, 2, 3):
        found = kernels.search(fields, LEVEL_WIDTHS, points, start, (9, 3), (1, 0.1), prior, top)
        assert found.tolist() == [0, 0, 0, 18, 18]
