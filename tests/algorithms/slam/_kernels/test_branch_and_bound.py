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
from mapcli.algorithms.slam._kernels.branch_and_bound import BestPose, Pyramid
from mapcli.algorithms.slam._kernels.window_scores import PoseGrid, Prior
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=40)


def test_nearest_in_as_its_twin() -> None:
    for low in range(-20, 21):
        for width in range(1, 18):
            nearest = min(abs(x) for x in range(low, low + width))
            assert kernels.nearest_in(low, width) == nearest


def score_at(
    field: NDArray[np.uint8],
    points: Floats,
    middle: Floats,
    shift: tuple[int, int, int],
    turn_step: float,
    prior: Prior,
) -> tuple[float, int]:
    """(score, sum of the field) of the pose (du, dv, turns) away from `middle`."""
    du, dv, turns = shift
    pose = middle + np.array([0, 0, turns * turn_step])
    fit = 0
    for point in points:
        u, v = place(point, pose)
        fit += int(field[floor(v) + dv, floor(u) + du])
    most, half_at, per_cell, per_turn = prior
    a, b = (du**2 + dv**2) * per_cell, turns**2 * per_turn
    return fit - most * a / (half_at + a) - most * b / (half_at + b), fit


def slow_search(
    field: NDArray[np.uint8], points: Floats, middle: Floats, poses: PoseGrid, prior: Prior
) -> float:
    """The best score of all poses of a window, every one tried."""
    reach, turns, stride, turn_step = poses
    most, half_at, per_cell, per_turn = prior
    shifts = np.arange(-reach, reach + 1)
    shifts = shifts[shifts % stride == 0]
    a = (shifts[:, None] ** 2 + shifts[None, :] ** 2) * per_cell
    best = -np.inf
    for k in range(-turns, turns + 1):
        pose = middle + np.array([0, 0, k * turn_step])
        fits = np.zeros((len(shifts), len(shifts)))
        for point in points:
            u, v = place(point, pose)
            fits += field[np.ix_(floor(v) + shifts, floor(u) + shifts)]
        b = k**2 * per_turn
        scores = fits - most * a / (half_at + a) - most * b / (half_at + b)
        best = max(best, float(scores.max()))
    return best


def pyramid_of(fields: NDArray[np.uint8], top: int) -> Pyramid:
    return Pyramid(fields.reshape(len(fields), -1), LEVEL_WIDTHS, fields.shape[2], top)


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
    middle = np.array([*rng.uniform(MIDDLE - 6, MIDDLE + 6, 2), rng.uniform(-3.5, 3.5)])
    if rng.random() < 0.5:
        middle[2] = rng.uniform(-0.1, 0.1)
    poses = PoseGrid(reach, turns, stride, float(rng.uniform(0.005, 0.1)))
    prior = Prior(255.0 * n * share, 9.0, float(rng.uniform(0, 2)), float(rng.uniform(0, 2)))
    best = slow_search(fields[0], points, middle, poses, prior)
    pyramid = pyramid_of(fields, top)

    du, dv, k, score, fit = kernels.search(pyramid, points, middle, poses, prior)

    assert score == pytest.approx(best, abs=1e-6)
    assert max(abs(du), abs(dv)) <= reach
    assert abs(k) <= turns
    assert du % stride == dv % stride == 0
    own = score_at(fields[0], points, middle, (du, dv, k), poses.turn_step, prior)
    assert (score, fit) == pytest.approx(own, abs=1e-6)

    smaller = poses._replace(reach=reach // 2, turns=turns // 2)
    known = kernels.search(pyramid, points, middle, smaller, prior)
    again = kernels.search(pyramid, points, middle, poses, prior, known)
    assert again.score == pytest.approx(best, abs=1e-6)


def test_search_of_noise() -> None:
    # Random fields, whose bounds say little.
    rng = np.random.default_rng(7)
    for top in (1, 2, 3):
        field = rng.integers(0, 256, (SIZE, SIZE)).astype(np.uint8)
        levels = [np.full_like(field, 255) for _ in LEVEL_WIDTHS]
        fields = np.stack([field, *levels[1:]])
        points, middle = rng.uniform(-15, 15, (9, 2)), np.array([MIDDLE, MIDDLE, 0.3])
        poses, prior = PoseGrid(7, 2, 1, 0.02), Prior(200.0, 9.0, 0.1, 0.1)
        best = slow_search(field, points, middle, poses, prior)
        found = kernels.search(pyramid_of(fields, top), points, middle, poses, prior)
        assert found.score == pytest.approx(best)


def test_search_by_hand() -> None:
    # One wall, and a robot that sees it 5 cells ahead while it is 8 ahead and 2 to the left.
    log_odds = np.zeros((SIZE, SIZE), np.int16)
    log_odds[52, 58] = 1
    pyramid, points = pyramid_of(fields_of(log_odds), 2), np.array([[5.0, 0.0]])
    middle, poses = np.array([50.5, 50.5, 0.0]), PoseGrid(6, 0, 1, 0.01)
    found = kernels.search(pyramid, points, middle, poses, Prior(0.0, 13.0, 1.0, 1.0))
    assert found == BestPose(3, 2, 0, score=255, fit=255)
    assert found.cells(middle, 0.01).tolist() == [53.5, 52.5, 0]
    # 13 squared standard deviations cost half of what they may cost at most.
    found = kernels.search(pyramid, points, middle, poses, Prior(100.0, 13.0, 1.0, 1.0))
    assert found == BestPose(3, 2, 0, score=205, fit=255)


def test_where_the_map_does_not_care_the_prior_decides() -> None:
    fields = np.full((len(LEVEL_WIDTHS), SIZE, SIZE), 9, np.uint8)
    points, middle = np.array([[3.0, 4.0], [-5.0, 1.0]]), np.array([MIDDLE, MIDDLE, 1.0])
    poses, prior = PoseGrid(9, 3, 1, 0.1), Prior(10.0, 9.0, 0.1, 0.1)
    for top in (1, 2, 3):
        found = kernels.search(pyramid_of(fields, top), points, middle, poses, prior)
        assert found == BestPose(0, 0, 0, score=18, fit=18)
