"""The compiled loops that keep the likelihood field, against slow and obvious twins."""

from __future__ import annotations

from itertools import pairwise
from math import floor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels.likelihood_field import (
    MAX_LIKELIHOOD,
    interpolate_gaps,
    recompute_field,
    update_likelihood_field,
)
from mapcli.algorithms.slam._kernels.ray_tracing import (
    Beams,
    CellLists,
    LogOddsRules,
    MapLayers,
    integrate_beams,
)
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS
from mapcli.algorithms.slam.map_parameters import MapParameters

Cells = set[tuple[int, int]]

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=25)
RULES = LogOddsRules(hit=85, miss=25, highest=1000, lowest=-500)

# --- the likelihood field and its bounds

GAUSSIAN = MapParameters().gaussian_kernel()
REACH = len(GAUSSIAN) // 2
EDGE = 2 * REACH + int(LEVEL_WIDTHS[-1])


def slow_field(log_odds: NDArray[np.int16], gaussian: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The highest gaussian of the walls around each cell: one stamp per wall."""
    field = np.zeros(log_odds.shape, np.uint8)
    r = len(gaussian) // 2
    for v, u in np.argwhere(log_odds > 0):
        around = field[v - r : v + r + 1, u - r : u + r + 1]
        np.maximum(around, gaussian, out=around)
    return field


def slow_level(field: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """The highest value of the `width` x `width` cells from each cell up and right."""
    padded = np.pad(field, ((0, width), (0, width)))
    rows, columns = field.shape
    level = np.zeros_like(field)
    for dv in range(width):
        for du in range(width):
            level = np.maximum(level, padded[dv : dv + rows, du : du + columns])
    return level


def random_walls(rng: np.random.Generator, size: int, share: float) -> NDArray[np.int16]:
    """Known cells of both kinds, far enough from the edge."""
    inner = size - 2 * EDGE
    log_odds = np.zeros((size, size), np.int16)
    values = np.where(rng.random((inner, inner)) < share, 100, -100)
    values[rng.random((inner, inner)) < 0.2] = 0
    log_odds[EDGE:-EDGE, EDGE:-EDGE] = values
    return log_odds


def changes_between(before: NDArray[np.int16], after: NDArray[np.int16]) -> NDArray[np.int64]:
    return np.flatnonzero((before > 0) != (after > 0))


def fields_of(
    log_odds: NDArray[np.int16], gaussian: NDArray[np.uint8] = GAUSSIAN
) -> NDArray[np.uint8]:
    pyramid = np.zeros((len(LEVEL_WIDTHS), *log_odds.shape), np.uint8)
    changed = changes_between(np.zeros_like(log_odds), log_odds)
    update_likelihood_field(pyramid, LEVEL_WIDTHS, log_odds, changed, gaussian)
    return pyramid


@FEW
@given(SEEDS, st.sampled_from([0.0, 0.01, 0.1, 0.6]))
def test_every_level_is_exact_while_walls_only_appear(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    log_odds = random_walls(rng, 2 * EDGE + 12, share)
    pyramid = fields_of(log_odds)
    expected = slow_field(log_odds, GAUSSIAN)
    for level, width in enumerate(LEVEL_WIDTHS):
        assert (pyramid[level] == slow_level(expected, int(width))).all()


@FEW
@given(SEEDS, st.integers(1, 4))
def test_the_field_after_walls_come_and_go(seed: int, scans: int) -> None:
    rng = np.random.default_rng(seed)
    log_odds = random_walls(rng, 2 * EDGE + 12, 0.1)
    pyramid = fields_of(log_odds)
    for _ in range(scans):
        after = random_walls(rng, 2 * EDGE + 12, 0.1)
        # A part stays, and what changes comes in any order.
        after = np.where(rng.random(after.shape) < 0.7, log_odds, after)
        changed = rng.permutation(changes_between(log_odds, after))
        update_likelihood_field(pyramid, LEVEL_WIDTHS, after, changed, GAUSSIAN)
        log_odds = after
        expected = slow_field(log_odds, GAUSSIAN)
        assert (pyramid[0] == expected).all()
        for level, width in enumerate(LEVEL_WIDTHS):
            assert (pyramid[level] >= slow_level(expected, int(width))).all()


def test_a_wall_that_goes_leaves_its_neighbour() -> None:
    size = 2 * EDGE + 3
    before = np.zeros((size, size), np.int16)
    before[EDGE, EDGE : EDGE + 2] = 100
    pyramid = fields_of(before)
    after = before.copy()
    after[EDGE, EDGE] = -1
    update_likelihood_field(pyramid, LEVEL_WIDTHS, after, changes_between(before, after), GAUSSIAN)
    alone = np.zeros_like(before)
    alone[EDGE, EDGE + 1] = 100
    assert (pyramid[0] == slow_field(alone, GAUSSIAN)).all()
    assert pyramid[0, EDGE, EDGE + 1] == 255
    assert pyramid[0, EDGE, EDGE] == GAUSSIAN[REACH, REACH - 1]


def test_a_single_wall_by_hand() -> None:
    gaussian = np.array([[1, 5, 1], [5, 255, 5], [1, 5, 1]], np.uint8)
    log_odds = np.zeros((40, 40), np.int16)
    log_odds[20, 20] = 7
    pyramid = fields_of(log_odds, gaussian)
    assert (pyramid[0, 19:22, 19:22] == gaussian).all()
    assert np.count_nonzero(pyramid[0]) == 9
    # The 2 x 2 cells from (v, u) on hold the wall for v, u in 19, 20.
    assert pyramid[1, 18:23, 18:23].tolist() == [
        [1, 5, 5, 1, 0],
        [5, 255, 255, 5, 0],
        [5, 255, 255, 5, 0],
        [1, 5, 5, 1, 0],
        [0, 0, 0, 0, 0],
    ]
    assert (pyramid[3, 5:21, 5:21] == 255).all()
    assert pyramid[3, 4, 5] == 5
    assert pyramid[3, 21, 21] == 1
    assert np.count_nonzero(pyramid[3]) == 18 * 18


def test_a_wider_gaussian() -> None:
    gaussian = MapParameters(resolution=0.02, blur=0.05).gaussian_kernel()
    rng = np.random.default_rng(1)
    log_odds = np.zeros((90, 90), np.int16)
    log_odds[40:50, 40:50] = np.where(rng.random((10, 10)) < 0.2, 1, -1)
    pyramid = fields_of(log_odds, gaussian)
    expected = slow_field(log_odds, gaussian)
    for level, width in enumerate(LEVEL_WIDTHS):
        assert (pyramid[level] == slow_level(expected, int(width))).all()


@FEW
@given(SEEDS)
def test_recomputing_around_a_cell_as_its_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    log_odds = random_walls(rng, 80, 0.1)
    field = rng.integers(0, 256, log_odds.shape).astype(np.uint8)
    v, u = (int(x) for x in rng.integers(EDGE, 80 - EDGE, 2))
    expected, near = field.copy(), np.s_[v - REACH : v + REACH + 1, u - REACH : u + REACH + 1]
    expected[near] = slow_field(log_odds, GAUSSIAN)[near]
    recompute_field(field, log_odds, v, u, GAUSSIAN)
    assert np.array_equal(field, expected)


# --- gaps between beams


def interpolated(ends: list[tuple[float, float]], log_odds: NDArray[np.int16]) -> Cells:
    """The cells that `interpolate_gaps` takes for wall."""
    pyramid = np.zeros((len(LEVEL_WIDTHS), *log_odds.shape), np.uint8)
    interpolate_gaps(pyramid, LEVEL_WIDTHS, log_odds, np.array(ends), GAUSSIAN)
    whole = {(v, u) for v, u in np.argwhere(pyramid[0] == MAX_LIKELIHOOD).tolist()}
    # What is raised is raised as around an occupied cell, in every level.
    occupied = np.zeros_like(log_odds)
    for cell in whole:
        occupied[cell] = 1
    assert (pyramid == fields_of(occupied)).all()
    return whole


def slow_interpolated(ends: list[tuple[float, float]], log_odds: NDArray[np.int16]) -> Cells:
    """The same, by the rule as it is written."""
    way = [np.subtract(b, a) for a, b in pairwise(ends)]
    length = [float(np.hypot(*w)) for w in way]

    def is_collinear(k: int, j: int) -> bool:
        if not 0 <= j < len(way) or max(length[j], length[k]) > 2 * min(length[j], length[k]):
            return False
        return float(way[k] @ way[j]) >= 0.97 * length[k] * length[j]

    cells = set()
    for k in range(len(way)):
        if 1.5 <= length[k] <= 12 and (is_collinear(k, k - 1) or is_collinear(k, k + 1)):
            steps = floor(length[k])
            for i in range(1, steps + 1):
                u, v = np.add(ends[k], way[k] * (i / (steps + 1)))
                cells.add((floor(v), floor(u)))
    return {cell for cell in cells if log_odds[cell] == 0}


UNKNOWN = np.zeros((80, 80), np.int16)


def test_the_gaps_of_a_far_wall_are_interpolated() -> None:
    row = [(30.5, 40.5), (34.5, 40.5), (38.5, 40.5)]
    between = {(40, u) for u in (31, 32, 33, 35, 36, 37)}
    assert between <= interpolated(row, UNKNOWN) <= between | {(40, 30), (40, 34), (40, 38)}


@pytest.mark.parametrize(
    "ends",
    [
        [(30.5, 40.5), (34.5, 40.5)],  # two points may be anything
        [(30.5, 40.5), (34.5, 40.5), (34.5, 44.5)],  # a corner
        [(20.5, 40.5), (33.5, 40.5), (46.5, 40.5)],  # too far apart
        [(30.5, 40.5), (34.5, 40.5), (45.5, 40.5)],  # not as regular as a wall
        [(30.5, 40.5), (31.5, 40.5), (32.5, 40.5)],  # nothing in between
    ],
)
def test_which_gaps_are_not_interpolated(ends: list[tuple[float, float]]) -> None:
    assert interpolated(ends, UNKNOWN) == set()


def test_known_cells_are_not_interpolated() -> None:
    log_odds = UNKNOWN.copy()
    log_odds[40, 32] = -25
    log_odds[40, 36] = 85
    row = [(30.5, 40.5), (34.5, 40.5), (38.5, 40.5)]
    assert not {(40, 32), (40, 36)} & interpolated(row, log_odds)


@FEW
@given(SEEDS)
def test_interpolated_gaps_as_their_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    steps = rng.uniform(0.5, 9) * np.ones(12)
    heading = rng.uniform(0, 7) + np.cumsum(rng.choice([0.0, 0.1, 0.5], 12))
    ends = 40 + np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]) * steps[:, None], 0)
    ends = [(u, v) for u, v in np.clip(ends, 22, 58).tolist()]
    log_odds = rng.choice(np.array([0, 0, 0, -25, 85], np.int16), (80, 80))
    assert interpolated(ends, log_odds) == slow_interpolated(ends, log_odds)


def test_a_beam_through_an_interpolated_gap_undoes_it() -> None:
    pyramid = np.zeros((len(LEVEL_WIDTHS), 80, 80), np.uint8)
    row = np.array([(30.5, 40.5), (34.5, 40.5), (38.5, 40.5)])
    interpolate_gaps(pyramid, LEVEL_WIDTHS, UNKNOWN, row, GAUSSIAN)
    log_odds, beam = UNKNOWN.copy(), np.array([(32.5, 50.5), (32.5, 35.5)])
    lists = CellLists(np.empty(20, np.int64), np.empty(20, np.int64))
    grid = MapLayers(log_odds.reshape(-1), pyramid[0].reshape(-1), 80)
    lengths = integrate_beams(grid, Beams(beam, 0), RULES, lists)
    changed = lists.changed[: lengths.changed]
    assert changed.tolist() == [40 * 80 + 32]
    update_likelihood_field(pyramid, LEVEL_WIDTHS, log_odds, changed, GAUSSIAN)
    assert pyramid[0, 40, 32] == 0
