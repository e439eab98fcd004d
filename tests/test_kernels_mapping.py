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

from mapcli.algorithms._kernels.mapping import (
    WALL,
    bridge_walls,
    highest_bump,
    integrate_beams,
    place_beams,
    update_field,
)
from mapcli.algorithms.likelihood import LEVEL_WIDTHS
from mapcli.algorithms.occupancy import MapParameters

Cells = set[tuple[int, int]]

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=25)
RULES = (85, 25, 1000, -500)
"""hit, miss, highest, lowest"""

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
    rules: tuple[int, int, int, int],
    field: NDArray[np.uint8] | None = None,
) -> tuple[NDArray[np.int16], Cells]:
    """The map after a scan, and the cells that became occupied or ceased to be, or to be taken
    for wall."""
    hit, miss, highest, lowest = rules
    after = log_odds.copy()
    were_hit = {(floor(v), floor(u)) for u, v in ends[:hits]}
    were_passed = {cell for end in ends for cell in crossed(laser, end)} - were_hit
    for cell in were_hit:
        after[cell] = min(highest, int(log_odds[cell]) + hit) or 1
    for cell in were_passed:
        after[cell] = max(lowest, int(log_odds[cell]) - miss) or -1
    changed = (after > 0) != (log_odds > 0)
    if field is not None:
        changed |= (field == WALL) & (log_odds == 0) & (after < 0)
    return after, {(v, u) for v, u in np.argwhere(changed).tolist()}


def fast_integrate(
    log_odds: NDArray[np.int16],
    laser: NDArray[np.float64],
    ends: NDArray[np.float64],
    hits: int,
    rules: tuple[int, int, int, int] = RULES,
    field: NDArray[np.uint8] | None = None,
) -> tuple[NDArray[np.int16], list[tuple[int, int]]]:
    after, columns = log_odds.copy(), log_odds.shape[1]
    field = np.zeros(log_odds.shape, np.uint8) if field is None else field
    room = int(np.abs(ends - laser).sum()) + 4 * len(ends)
    touched, changed = np.full(room, -1), np.full(room, -1)
    both = np.concatenate([ends, laser[None]])
    count = integrate_beams(
        after.reshape(-1), field.reshape(-1), columns, both, hits, rules, touched, changed
    )
    return after, [divmod(cell, columns) for cell in changed[:count].tolist()]


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
    field = rng.choice(np.array([0, 100, WALL], np.uint8), (size, size))
    expected, changes = slow_integrate(log_odds, laser, ends, hits, RULES, field)
    after, changed = fast_integrate(log_odds, laser, ends, hits, field=field)
    assert (after == expected).all()
    assert sorted(changed) == sorted(changes)


@FEW
@given(SEEDS)
def test_integrate_with_any_rules(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hit, miss, highest, low = (int(x) for x in rng.integers(1, (200, 200, 2000, 2000)))
    rules = hit, miss, highest, -low
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
    world, cells, box = np.empty_like(beams), np.empty_like(beams), np.empty(4, np.int64)
    frame = (*base.tolist(), cell)
    touched = place_beams(beams, (x, y, theta), frame, world, cells, box)
    turn = np.array([[cos(theta), -sin(theta)], [sin(theta), cos(theta)]])
    assert world == pytest.approx(beams @ turn.T + (x, y))
    assert cells == pytest.approx((world - base) / cell)
    whole = np.floor(cells)
    assert box.tolist() == [*whole.min(axis=0), *whole.max(axis=0)]
    # Each beam touches the cell it ends in and those that it leaves on the way there.
    assert touched == n + np.abs(whole[:-1] - whole[-1]).sum()


def test_place_beams_by_hand() -> None:
    # The robot at (1, 2) looks up; the beam ends two metres ahead; the laser is half a metre ahead.
    beams, world, cells = np.array([[2.0, 0.0], [0.5, 0.0]]), np.empty((2, 2)), np.empty((2, 2))
    box = np.empty(4, np.int64)
    touched = place_beams(beams, (1.0, 2.0, pi / 2), (0.75, 0.0, 0.5), world, cells, box)
    assert world == pytest.approx(np.array([[1, 4], [1, 2.5]]))
    assert cells == pytest.approx(np.array([[0.5, 8], [0.5, 5]]))
    assert box.tolist() == [0, 5, 0, 8]
    assert touched == 4


# --- the likelihood field and its bounds

BUMP = MapParameters().bump()
REACH = len(BUMP) // 2
EDGE = 2 * REACH + int(LEVEL_WIDTHS[-1])


def slow_field(log_odds: NDArray[np.int16], bump: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The highest bump of the walls around each cell: one stamp per wall."""
    field = np.zeros(log_odds.shape, np.uint8)
    r = len(bump) // 2
    for v, u in np.argwhere(log_odds > 0):
        around = field[v - r : v + r + 1, u - r : u + r + 1]
        np.maximum(around, bump, out=around)
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


def fields_of(log_odds: NDArray[np.int16], bump: NDArray[np.uint8] = BUMP) -> NDArray[np.uint8]:
    fields = np.zeros((len(LEVEL_WIDTHS), *log_odds.shape), np.uint8)
    changed = changes_between(np.zeros_like(log_odds), log_odds)
    update_field(fields, LEVEL_WIDTHS, log_odds, changed, bump)
    return fields


@FEW
@given(SEEDS, st.sampled_from([0.0, 0.01, 0.1, 0.6]))
def test_every_level_is_exact_while_walls_only_appear(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    log_odds = random_walls(rng, 2 * EDGE + 12, share)
    fields = fields_of(log_odds)
    expected = slow_field(log_odds, BUMP)
    for level, width in enumerate(LEVEL_WIDTHS):
        assert (fields[level] == slow_level(expected, int(width))).all()


@FEW
@given(SEEDS, st.integers(1, 4))
def test_the_field_after_walls_come_and_go(seed: int, scans: int) -> None:
    rng = np.random.default_rng(seed)
    log_odds = random_walls(rng, 2 * EDGE + 12, 0.1)
    fields = fields_of(log_odds)
    for _ in range(scans):
        after = random_walls(rng, 2 * EDGE + 12, 0.1)
        # A part stays, and what changes comes in any order.
        after = np.where(rng.random(after.shape) < 0.7, log_odds, after)
        changed = rng.permutation(changes_between(log_odds, after))
        update_field(fields, LEVEL_WIDTHS, after, changed, BUMP)
        log_odds = after
        expected = slow_field(log_odds, BUMP)
        assert (fields[0] == expected).all()
        for level, width in enumerate(LEVEL_WIDTHS):
            assert (fields[level] >= slow_level(expected, int(width))).all()


def test_a_wall_that_goes_leaves_its_neighbour() -> None:
    size = 2 * EDGE + 3
    before = np.zeros((size, size), np.int16)
    before[EDGE, EDGE : EDGE + 2] = 100
    fields = fields_of(before)
    after = before.copy()
    after[EDGE, EDGE] = -1
    update_field(fields, LEVEL_WIDTHS, after, changes_between(before, after), BUMP)
    alone = np.zeros_like(before)
    alone[EDGE, EDGE + 1] = 100
    assert (fields[0] == slow_field(alone, BUMP)).all()
    assert fields[0, EDGE, EDGE + 1] == 255
    assert fields[0, EDGE, EDGE] == BUMP[REACH, REACH - 1]


def test_a_single_wall_by_hand() -> None:
    bump = np.array([[1, 5, 1], [5, 255, 5], [1, 5, 1]], np.uint8)
    log_odds = np.zeros((40, 40), np.int16)
    log_odds[20, 20] = 7
    fields = fields_of(log_odds, bump)
    assert (fields[0, 19:22, 19:22] == bump).all()
    assert np.count_nonzero(fields[0]) == 9
    # The 2 x 2 cells from (v, u) on hold the wall for v, u in 19, 20.
    assert fields[1, 18:23, 18:23].tolist() == [
        [1, 5, 5, 1, 0],
        [5, 255, 255, 5, 0],
        [5, 255, 255, 5, 0],
        [1, 5, 5, 1, 0],
        [0, 0, 0, 0, 0],
    ]
    assert (fields[3, 5:21, 5:21] == 255).all()
    assert fields[3, 4, 5] == 5
    assert fields[3, 21, 21] == 1
    assert np.count_nonzero(fields[3]) == 18 * 18


def test_a_wider_bump() -> None:
    bump = MapParameters(resolution=0.02, blur=0.05).bump()
    rng = np.random.default_rng(1)
    log_odds = np.zeros((90, 90), np.int16)
    log_odds[40:50, 40:50] = np.where(rng.random((10, 10)) < 0.2, 1, -1)
    fields = fields_of(log_odds, bump)
    expected = slow_field(log_odds, bump)
    for level, width in enumerate(LEVEL_WIDTHS):
        assert (fields[level] == slow_level(expected, int(width))).all()


@FEW
@given(SEEDS)
def test_highest_bump_as_its_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    log_odds = rng.integers(-30, 3, (2 * REACH + 6,) * 2).astype(np.int16)
    expected = 0
    v, u = (int(x) for x in rng.integers(REACH, REACH + 6, 2))
    for dv in range(-REACH, REACH + 1):
        for du in range(-REACH, REACH + 1):
            if log_odds[v + dv, u + du] > 0:
                expected = max(expected, int(BUMP[dv + REACH, du + REACH]))
    assert highest_bump(log_odds, v, u, BUMP) == expected


# --- walls between beams


def bridged(ends: list[tuple[float, float]], log_odds: NDArray[np.int16]) -> Cells:
    """The cells that `bridge_walls` takes for wall."""
    fields = np.zeros((len(LEVEL_WIDTHS), *log_odds.shape), np.uint8)
    bridge_walls(fields, LEVEL_WIDTHS, log_odds, np.array(ends), BUMP)
    whole = {(v, u) for v, u in np.argwhere(fields[0] == WALL).tolist()}
    # What is raised is raised as around an occupied cell, in every level.
    occupied = np.zeros_like(log_odds)
    for cell in whole:
        occupied[cell] = 1
    assert (fields == fields_of(occupied)).all()
    return whole


def slow_bridged(ends: list[tuple[float, float]], log_odds: NDArray[np.int16]) -> Cells:
    """The same, by the rule as it is written."""
    way = [np.subtract(b, a) for a, b in pairwise(ends)]
    length = [float(np.hypot(*w)) for w in way]

    def goes_on(k: int, j: int) -> bool:
        if not 0 <= j < len(way) or max(length[j], length[k]) > 2 * min(length[j], length[k]):
            return False
        return float(way[k] @ way[j]) >= 0.97 * length[k] * length[j]

    cells = set()
    for k in range(len(way)):
        if 1.5 <= length[k] <= 12 and (goes_on(k, k - 1) or goes_on(k, k + 1)):
            steps = floor(length[k])
            for i in range(1, steps + 1):
                u, v = np.add(ends[k], way[k] * (i / (steps + 1)))
                cells.add((floor(v), floor(u)))
    return {cell for cell in cells if log_odds[cell] == 0}


UNKNOWN = np.zeros((80, 80), np.int16)


def test_a_far_wall_is_bridged() -> None:
    row = [(30.5, 40.5), (34.5, 40.5), (38.5, 40.5)]
    between = {(40, u) for u in (31, 32, 33, 35, 36, 37)}
    assert between <= bridged(row, UNKNOWN) <= between | {(40, 30), (40, 34), (40, 38)}


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
def test_what_is_not_bridged(ends: list[tuple[float, float]]) -> None:
    assert bridged(ends, UNKNOWN) == set()


def test_known_cells_are_not_taken_for_wall() -> None:
    log_odds = UNKNOWN.copy()
    log_odds[40, 32] = -25
    log_odds[40, 36] = 85
    row = [(30.5, 40.5), (34.5, 40.5), (38.5, 40.5)]
    assert not {(40, 32), (40, 36)} & bridged(row, log_odds)


@FEW
@given(SEEDS)
def test_bridges_as_their_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    steps = rng.uniform(0.5, 9) * np.ones(12)
    heading = rng.uniform(0, 7) + np.cumsum(rng.choice([0.0, 0.1, 0.5], 12))
    ends = 40 + np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]) * steps[:, None], 0)
    ends = [(u, v) for u, v in np.clip(ends, 22, 58).tolist()]
    log_odds = rng.choice(np.array([0, 0, 0, -25, 85], np.int16), (80, 80))
    assert bridged(ends, log_odds) == slow_bridged(ends, log_odds)


def test_a_beam_through_a_bridge_undoes_it() -> None:
    fields = np.zeros((len(LEVEL_WIDTHS), 80, 80), np.uint8)
    row = np.array([(30.5, 40.5), (34.5, 40.5), (38.5, 40.5)])
    bridge_walls(fields, LEVEL_WIDTHS, UNKNOWN, row, BUMP)
    through, laser = beams((32.5, 50.5)), np.array([32.5, 35.5])
    log_odds, changed = fast_integrate(UNKNOWN, laser, through, 0, field=fields[0])
    assert changed == [(40, 32)]
    update_field(fields, LEVEL_WIDTHS, log_odds, np.array([40 * 80 + 32]), BUMP)
    assert fields[0, 40, 32] == 0
