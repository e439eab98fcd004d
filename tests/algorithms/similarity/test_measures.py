"""S(i, j) of Sect. 9.5 and the other similarity functions, by hand and against slow twins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.algorithms.similarity.measures import (
    LOWER_IS_BETTER,
    SIMILARITIES,
    Similarity,
    higher_is_better,
    similarity_of_counts,
    similarity_of_readings,
)
from mapcli.algorithms.similarity.perception_map import PerceptionMap
from mapcli.algorithms.similarity.ternary_map import TernaryMap, find_runs

FEW = settings(max_examples=40, deadline=None)


def matrix(*rows: str) -> np.ndarray:
    """`#` obstacle, `.` empty, `?` unknown; bottom-up, as the algorithms have it."""
    return np.array([[{"#": 1, ".": -1, "?": 0}[c] for c in row] for row in rows[::-1]], np.int8)


def score(similarity: Similarity, m: np.ndarray, p: np.ndarray) -> float:
    counts = TernaryMap(m).pair_counts(PerceptionMap(p, 0, 0), np.zeros((1, 2), np.int64))
    return float(similarity_of_counts(similarity, counts)[0])


@pytest.mark.parametrize(
    ("m", "p", "s"),
    [("#", "#", 1), (".", ".", 1), ("#", ".", -1), (".", "#", -1),
     ("?", "#", 0), ("?", ".", 0), ("#", "?", 0), (".", "?", 0), ("?", "?", 0)],
)  # fmt: skip
def test_the_three_cases_of_similarity(m: str, p: str, s: int) -> None:
    """Sect. 9.5: 1 where both know and agree, -1 where they differ, 0 where one is unknown."""
    assert score("product", matrix(m), matrix(p)) == s


M = matrix("##?", "#..", "?..")
P = matrix("#.#", "##.", "..?")
"""Both know six cells. Obstacle in both: 2 (upper left, middle left). Empty in both: 2 (middle
right, bottom middle). m obstacle, p empty: 1 (top middle). m empty, p obstacle: 1 (the middle)."""


@pytest.mark.parametrize(
    ("similarity", "expected"),
    [
        ("product", 4 - 2),
        ("agreement", 4 / 6),
        ("jaccard", 2 / 4),
        # means 0 and 0, so the mean of the products over the deviations, 1 and 1
        ("correlation", (4 - 2) / 6),
        ("l1", 2 + 2),
        ("l2", math.sqrt(4 + 4)),
    ],
)
def test_three_by_three_by_hand(similarity: Similarity, expected: float) -> None:
    assert score(similarity, M, P) == pytest.approx(expected)


@pytest.mark.parametrize("similarity", SIMILARITIES)
def test_equal_matrices_are_the_most_similar(similarity: Similarity) -> None:
    scores = np.array([score(similarity, M, M), score(similarity, M, P), score(similarity, M, -M)])
    assert np.argmax(higher_is_better(similarity, scores)) == 0
    assert np.argmin(higher_is_better(similarity, scores)) == 2


def test_nothing_in_common() -> None:
    nothing = matrix("???", "???", "???")
    assert score("product", M, nothing) == 0
    for similarity in SIMILARITIES[1:]:
        assert math.isnan(score(similarity, M, nothing))


def test_not_every_function_always_has_a_value() -> None:
    empty = matrix("..", "..")
    assert math.isnan(score("jaccard", empty, empty))
    assert math.isnan(score("correlation", empty, matrix("#.", "..")))


def by_cells(similarity: Similarity, m: np.ndarray, p: np.ndarray) -> float:
    """The slow twin: cell by cell, as the definitions have it."""
    pairs = [(int(a), int(b)) for a, b in zip(m.ravel(), p.ravel(), strict=True) if a and b]
    if similarity == "product":
        return sum(a * b for a, b in pairs)
    if not pairs:
        return math.nan
    if similarity == "agreement":
        return sum(a == b for a, b in pairs) / len(pairs)
    if similarity == "l1":
        return sum(abs(a - b) for a, b in pairs)
    if similarity == "l2":
        return math.sqrt(sum((a - b) ** 2 for a, b in pairs))
    if similarity == "jaccard":
        either = sum(1 in pair for pair in pairs)
        return sum(pair == (1, 1) for pair in pairs) / either if either else math.nan
    a, b = np.array(pairs, float).T
    if a.std() == 0 or b.std() == 0:
        return math.nan
    return float(np.corrcoef(a, b)[0, 1])


def shifted(p: PerceptionMap, shape: tuple[int, int], du: int, dv: int) -> np.ndarray:
    """The perception on cells of the map, moved."""
    result = np.zeros(shape, int)
    for (r, c), value in np.ndenumerate(p.values):
        v, u = r + p.bottom + dv, c + p.left + du
        if 0 <= v < shape[0] and 0 <= u < shape[1]:
            result[v, u] = value
    return result


@pytest.mark.slow
@FEW
@given(st.integers(0, 10_000))
def test_pair_counts_as_the_slow_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(int(n) for n in rng.integers(1, 9, 2))
    m = rng.integers(-1, 2, shape).astype(np.int8)
    p = PerceptionMap(
        rng.integers(-1, 2, rng.integers(1, 9, 2)).astype(np.int8), *rng.integers(-4, 5, 2).tolist()
    )
    offsets = rng.integers(-5, 6, (7, 2))
    plain = TernaryMap(m).pair_counts(p, offsets)
    np.testing.assert_array_equal(plain, TernaryMap(m).pair_counts(p, offsets, compiled=True))
    for similarity in SIMILARITIES:
        found = similarity_of_counts(similarity, plain)
        for k, (du, dv) in enumerate(offsets.tolist()):
            slow = by_cells(similarity, m, shifted(p, m.shape, du, dv))
            assert found[k] == pytest.approx(slow, nan_ok=True)


def test_runs() -> None:
    p = matrix("?..#", "....", "????")
    assert find_runs(p).tolist() == [[1, 0, 4, -1], [2, 1, 3, -1], [2, 3, 4, 1]]


# --- readings

EXPECTED = np.array([[[2.0, 0.5], [3.0, -0.2]]])
MEASURED = np.array([[2.5, 0.4], [3.0, 0.2]])


@pytest.mark.parametrize(
    ("similarity", "expected"),
    [
        ("l1", 0.5 + 0.1 + 0.0 + 0.4),
        ("l2", math.sqrt(0.25 + 0.01 + 0.16)),
        ("product", 2.0 * 2.5 + 0.5 * 0.4 + 9.0 - 0.2 * 0.2),
        ("agreement", 1 / 2),  # of the second, the bearing differs by 0.4
        ("jaccard", 1 / 3),
        ("correlation", np.corrcoef([2.0, 0.5, 3.0, -0.2], [2.5, 0.4, 3.0, 0.2])[0, 1]),
    ],
)
def test_readings_by_hand(similarity: Similarity, expected: float) -> None:
    found = similarity_of_readings(similarity, EXPECTED, MEASURED, np.array([0.5, 0.3]))
    assert found == pytest.approx([expected])


@pytest.mark.parametrize("similarity", SIMILARITIES)
def test_unknown_readings_are_left_out(similarity: Similarity) -> None:
    tolerance = np.array([0.5, 0.3])
    more = np.concatenate([EXPECTED, [[[7.0, 7.0]]]], axis=1)
    with_gap = np.concatenate([MEASURED, [[np.nan, np.nan]]])
    assert similarity_of_readings(similarity, more, with_gap, tolerance) == pytest.approx(
        similarity_of_readings(similarity, EXPECTED, MEASURED, tolerance)
    )
    nothing = np.full((2, 2), np.nan)
    assert np.isnan(similarity_of_readings(similarity, EXPECTED, nothing, tolerance)).all()


def test_lower_is_better_for_distances_only() -> None:
    assert {"l1", "l2"} == LOWER_IS_BETTER
    assert higher_is_better("l1", np.array([1.0, np.nan, 3.0])).tolist() == [-1, -np.inf, -3]
