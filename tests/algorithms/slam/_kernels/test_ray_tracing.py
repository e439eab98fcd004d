"""The compiled loops that write scans into the map, against slow and obvious twins."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from math import cos, floor, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels.likelihood_field import MAX_LIKELIHOOD
from mapcli.algorithms.slam._kernels.pose import Pose
from mapcli.algorithms.slam._kernels.ray_tracing import (
    Beams,
    CellLists,
    GridFrame,
    LogOddsRules,
    MapLayers,
    integrate_beams,
    place_beams,
)

Cells = set[tuple[int, int]]

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=25)
RULES = LogOddsRules(hit=85, miss=25, highest=1000, lowest=-500)

# --- beams


def crossed(laser: NDArray[np.float64], end: NDArray[np.float64]) -> list[tuple[int, int]]:
    """(v, u) of the cells that a beam crosses, in exact arithmetic, without the one it ends in."""
    u0, v0, u1, v1 = (Fraction(float(x)) for x in (*laser, *end))
    shares = {Fraction(0), Fraction(1)}
    for a, b in ((u0, u1), (v0, v1)):
        lines = range(floor(min(a, b)) + 1, floor(max(a, b)) + 1)
        shares |= {(line - a) / (b - a) for line in lines}
    cuts = sorted(share for share in shares if 0 <= share <= 1)
    middles = [(a + b) / 2 for a, b in pairwise(cuts)]
    cells = [(floor(v0 + m * (v1 - v0)), floor(u0 + m * (u1 - u0))) for m in middles]
    return [cell for cell in cells if cell != (floor(v1), floor(u1))]


def slow_integrate(
    log_odds: NDArray[np.int16],
    laser: NDArray[np.float64],
    ends: NDArray[np.float64],
    hits: int,
    rules: LogOddsRules,
    field: NDArray[np.uint8] | None = None,
) -> tuple[NDArray[np.int16], Cells]:
    """The map after a scan, and the cells that became occupied or ceased to be, or to be taken
    for wall."""
    after = log_odds.copy()
    were_hit = {(floor(v), floor(u)) for u, v in ends[:hits]}
    were_passed = {cell for end in ends for cell in crossed(laser, end)} - were_hit
    for cell in were_hit:
        after[cell] = min(rules.highest, int(log_odds[cell]) + rules.hit) or 1
    for cell in were_passed:
        after[cell] = max(rules.lowest, int(log_odds[cell]) - rules.miss) or -1
    changed = (after > 0) != (log_odds > 0)
    if field is not None:
        changed |= (field == MAX_LIKELIHOOD) & (log_odds == 0) & (after < 0)
    return after, {(v, u) for v, u in np.argwhere(changed).tolist()}


def fast_integrate(
    log_odds: NDArray[np.int16],
    laser: NDArray[np.float64],
    ends: NDArray[np.float64],
    hits: int,
    rules: LogOddsRules = RULES,
    field: NDArray[np.uint8] | None = None,
) -> tuple[NDArray[np.int16], list[tuple[int, int]]]:
    after, columns = log_odds.copy(), log_odds.shape[1]
    field = np.zeros(log_odds.shape, np.uint8) if field is None else field
    room = int(np.abs(ends - laser).sum()) + 4 * len(ends)
    lists = CellLists(touched=np.full(room, -1), changed=np.full(room, -1))
    grid = MapLayers(after.reshape(-1), field.reshape(-1), columns)
    beams = Beams(np.concatenate([ends, laser[None]]), hits)
    lengths = integrate_beams(grid, beams, rules, lists)
    return after, [divmod(cell, columns) for cell in lists.changed[: lengths.changed].tolist()]


def beams(*ends: tuple[float, float]) -> NDArray[np.float64]:
    return np.array(ends, np.float64).reshape(-1, 2)


LASER = np.array([2.5, 2.5])
EMPTY = np.zeros((12, 12), np.int16)


@FEW
@given(SEEDS, st.integers(0, 20), st.integers(2, 25))
def test_integrate_as_its_twin(seed: int, n: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    log_odds = rng.integers(-500, 1001, (size, size)).astype(np.int16)
    log_odds[rng.random((size, size)) < 0.5] = 0
    laser, ends = rng.uniform(0, size, 2), rng.uniform(0, size, (n, 2))
    ends[: n // 3, rng.integers(2)] = laser[0]  # some straight along an axis, or nearly
    hits = int(rng.integers(0, n + 1))
    field = rng.choice(np.array([0, 100, MAX_LIKELIHOOD], np.uint8), (size, size))
    expected, changes = slow_integrate(log_odds, laser, ends, hits, RULES, field)
    after, changed = fast_integrate(log_odds, laser, ends, hits, field=field)
    assert (after == expected).all()
    assert sorted(changed) == sorted(changes)


@FEW
@given(SEEDS)
def test_integrate_with_any_rules(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hit, miss, highest, low = (int(x) for x in rng.integers(1, (200, 200, 2000, 2000)))
    rules = LogOddsRules(hit, miss, highest, -low)
    log_odds = rng.integers(-low, highest + 1, (20, 20)).astype(np.int16)
    laser, ends = rng.uniform(0, 20, 2), rng.uniform(0, 20, (12, 2))
    expected, changes = slow_integrate(log_odds, laser, ends, 7, rules)
    after, changed = fast_integrate(log_odds, laser, ends, 7, rules)
    assert (after == expected).all()
    assert sorted(changed) == sorted(changes)


def test_a_scan_of_many_cells() -> None:
    # Longer than the list of touched cells is at first.
    rng = np.random.default_rng(0)
    log_odds = np.zeros((120, 120), np.int16)
    laser, ends = np.array([60.3, 59.6]), rng.uniform(0, 120, (90, 2))
    expected, changes = slow_integrate(log_odds, laser, ends, 60, RULES)
    assert np.count_nonzero(expected) > 2048
    after, changed = fast_integrate(log_odds, laser, ends, 60)
    assert (after == expected).all()
    assert sorted(changed) == sorted(changes)


def test_one_beam_by_hand() -> None:
    after, changed = fast_integrate(EMPTY, LASER, beams((6.5, 2.5)), 1)
    assert after[2, 2:8].tolist() == [-25, -25, -25, -25, 85, 0]
    assert np.count_nonzero(after) == 5
    assert changed == [(2, 6)]


@pytest.mark.parametrize(
    ("end", "passed"),
    [
        ((0.5, 2.5), [(2, 2), (2, 1)]),
        ((2.5, 5.5), [(2, 2), (3, 2), (4, 2)]),
        ((2.5, 0.5), [(2, 2), (1, 2)]),
        ((4.5, 3.5), [(2, 2), (2, 3), (3, 3)]),  # slope 1/2: crosses u = 3 before v = 3
        ((0.5, 1.5), [(2, 2), (2, 1), (1, 1)]),
        ((2.9, 2.1), []),  # within the laser's own cell
    ],
)
def test_what_an_open_beam_passes(end: tuple[float, float], passed: list) -> None:
    after, changed = fast_integrate(EMPTY, LASER, beams(end), 0)
    assert sorted((v, u) for v, u in np.argwhere(after == -25).tolist()) == sorted(passed)
    assert np.count_nonzero(after) == len(passed)
    assert changed == []


def test_a_beam_of_no_length() -> None:
    after, changed = fast_integrate(EMPTY, LASER, beams((2.5, 2.5)), 1)
    assert np.argwhere(after).tolist() == [[2, 2]]
    assert after[2, 2] == 85
    assert changed == [(2, 2)]


def test_through_corners_a_beam_stays_within_one_cell_of_itself() -> None:
    after, _ = fast_integrate(EMPTY, np.array([2.0, 2.0]), beams((7.0, 7.0)), 1)
    assert after[7, 7] == 85
    cells = np.argwhere(after == -25)
    assert {(k, k) for k in range(2, 7)} <= {(v, u) for v, u in cells.tolist()}
    assert (np.abs(cells[:, 0] - cells[:, 1]) <= 1).all()
    assert (cells <= 7).all()


def test_a_cell_is_written_at_most_once_a_scan() -> None:
    # Three beams end in one cell and pass the same cells.
    ends = beams((6.5, 2.5), (6.6, 2.5), (6.7, 2.5))
    after, changed = fast_integrate(EMPTY, LASER, ends, 3)
    assert after[2, 2:8].tolist() == [-25, -25, -25, -25, 85, 0]
    assert changed == [(2, 6)]


def test_being_hit_goes_before_being_passed() -> None:
    # The second beam ends where the first passes, in whichever order they come.
    ends = beams((6.5, 2.5), (4.5, 2.5))
    for order in (ends, ends[::-1].copy()):
        after, changed = fast_integrate(EMPTY, LASER, order, 2)
        assert after[2, 2:8].tolist() == [-25, -25, 85, -25, 85, 0]
        assert sorted(changed) == [(2, 4), (2, 6)]


def test_the_limits() -> None:
    log_odds = EMPTY.copy()
    log_odds[2, 3:8] = [-490, -500, -476, 990, 1000]
    after, _ = fast_integrate(log_odds, LASER, beams((6.5, 2.5)), 1)
    assert after[2, 3:7].tolist() == [-500, -500, -500, 1000]
    after, _ = fast_integrate(log_odds, LASER, beams((7.5, 2.5)), 1)
    assert after[2, 6:8].tolist() == [965, 1000]


def test_what_is_known_never_becomes_unknown() -> None:
    log_odds = EMPTY.copy()
    log_odds[2, 4], log_odds[2, 6] = 25, -85  # 25 - 25 and -85 + 85
    after, changed = fast_integrate(log_odds, LASER, beams((6.5, 2.5)), 1)
    assert (after[2, 4], after[2, 6]) == (-1, 1)
    assert sorted(changed) == [(2, 4), (2, 6)]


def test_only_a_change_of_side_is_a_change() -> None:
    log_odds = EMPTY.copy()
    log_odds[2, 2:7] = [26, 25, 24, -300, 100]
    after, changed = fast_integrate(log_odds, LASER, beams((6.5, 2.5)), 1)
    assert after[2, 2:7].tolist() == [1, -1, -1, -325, 185]
    assert sorted(changed) == [(2, 3), (2, 4)]


def test_no_beams() -> None:
    after, changed = fast_integrate(EMPTY, LASER, beams(), 0)
    assert not after.any()
    assert changed == []


# --- where beams are


@FEW
@given(SEEDS, st.integers(0, 12))
def test_place_beams_as_its_twin(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    beams, (x, y, theta) = rng.normal(0, 5, (n + 1, 2)), rng.normal(0, 20, 3).tolist()
    base, cell = rng.normal(0, 9, 2), 0.05
    world, cells = np.empty_like(beams), np.empty_like(beams)
    frame = GridFrame(*base.tolist(), cell)
    extent = place_beams(beams, Pose(x, y, theta), frame, world, cells)
    turn = np.array([[cos(theta), -sin(theta)], [sin(theta), cos(theta)]])
    assert world == pytest.approx(beams @ turn.T + (x, y))
    assert cells == pytest.approx((world - base) / cell)
    whole = np.floor(cells)
    assert extent.box == (*whole.min(axis=0), *whole.max(axis=0))
    # Each beam touches the cell it ends in and those that it leaves on the way there.
    assert extent.max_touched == n + np.abs(whole[:-1] - whole[-1]).sum()


def test_place_beams_by_hand() -> None:
    # The robot at (1, 2) looks up; the beam ends two metres ahead; the laser is half a metre ahead.
    beams, world, cells = np.array([[2.0, 0.0], [0.5, 0.0]]), np.empty((2, 2)), np.empty((2, 2))
    frame = GridFrame(0.75, 0.0, 0.5)
    extent = place_beams(beams, Pose(1.0, 2.0, pi / 2), frame, world, cells)
    assert world == pytest.approx(np.array([[1, 4], [1, 2.5]]))
    assert cells == pytest.approx(np.array([[0.5, 8], [0.5, 5]]))
    assert extent == ((0, 5, 0, 8), 4)
