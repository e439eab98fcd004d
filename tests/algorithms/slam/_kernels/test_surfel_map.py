"""The compiled loops that make surfels, against slow and obvious twins."""

from __future__ import annotations

from collections import defaultdict
from math import cos, floor, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.surfels import CELL, THICKNESS, Floats, empty_table, scattered, table_of

from mapcli.algorithms.slam._kernels import surfel_map as kernels
from mapcli.algorithms.slam._kernels.sparse_grid import slot_of

Cell = tuple[int, int]

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=30)


def cells_of(points: Floats) -> dict[Cell, list[Floats]]:
    """The same as a dictionary."""
    cells: dict[Cell, list[Floats]] = defaultdict(list)
    for point in points:
        cells[floor(point[0] / CELL), floor(point[1] / CELL)].append(point)
    return dict(cells)


def centre_of(cell: Cell) -> Floats:
    return (np.array(cell) + 0.5) * CELL


def moments_of(points: list[Floats], centre: Floats) -> list[float]:
    """How many, and the sums of x, y, xx, xy, yy from a centre."""
    if not points:
        return [0.0] * 6
    x, y = (np.array(points) - centre).T
    return [len(x), x.sum(), y.sum(), (x * x).sum(), (x * y).sum(), (y * y).sum()]


# --- points


@FEW
@given(SEEDS, st.integers(0, 200), st.sampled_from([0.1, 0.5, 500.0]))
def test_add_points_as_its_twin(seed: int, count: int, extent: float) -> None:
    points = scattered(seed, count, extent)
    table, (_, used) = table_of(points)
    twin = cells_of(points)
    assert used == 1 + len(twin)
    for number, (cell, inside) in enumerate(twin.items(), start=1):
        assert slot_of(table.grid, *cell) == number  # in the order of their first points
        *moments, x, y = table.moments[number]
        assert moments == pytest.approx(moments_of(inside, centre_of(cell)), abs=1e-9)
        assert [x, y] == pytest.approx(np.mean(inside, axis=0))
    assert table.moments[0].tolist() == [0] * 6 + [kernels.NOWHERE] * 2


def test_points_of_a_second_scan_go_into_the_same_cells() -> None:
    points = scattered(0, 120, 0.3)
    expected, used = table_of(points)
    table = empty_table(len(expected.moments), 0.3)
    _, halfway = kernels.add_points(table, (1, 1), points[:50], 0)
    assert kernels.add_points(table, halfway, points, 50) == (120, used)
    assert np.array_equal(table.moments, expected.moments)


def test_points_are_added_as_far_as_there_is_room() -> None:
    points = np.array([(0.01, 0.01), (0.06, 0.01), (0.02, 0.01), (0.11, 0.01), (9.0, 0.0)])
    table = empty_table(4)
    for room, (first, used), expected in (
        (3, (0, (1, 1)), (3, (2, 3))),  # two cells, and no more slots
        (4, (3, (2, 3)), (4, (2, 4))),  # the third cell, and nothing so far away
    ):
        part = table._replace(moments=table.moments[:room])
        assert kernels.add_points(part, used, points, first) == expected
    assert table.moments[:, kernels.COUNT].tolist() == [0, 2, 1, 1]


# --- surfels


def slow_neighbourhood(cells: dict[Cell, list[Floats]], at: Cell) -> list[float]:
    """Moments of the smallest square around a cell, 3 x 3 at least, with enough points."""
    for reach in range(1, kernels.WIDEST_NEIGHBOURHOOD + 1):
        inside = [
            point
            for (u, v), points in cells.items()
            if max(abs(u - at[0]), abs(v - at[1])) <= reach
            for point in points
        ]
        if len(inside) >= kernels.FEWEST:
            break
    return moments_of(inside, centre_of(at))


@FEW
@given(SEEDS, st.integers(1, 150), st.sampled_from([0.2, 0.5, 2.0]))
def test_neighbourhood_as_its_twin(seed: int, count: int, extent: float) -> None:
    points = scattered(seed, count, extent)
    table, _ = table_of(points)
    cells = cells_of(points)
    for cell in list(cells)[:20]:
        found = kernels.neighbourhood(table, *cell)
        assert found == pytest.approx(slow_neighbourhood(cells, cell), abs=1e-9)


def slow_surfel(points: Floats) -> list[float]:
    """Mean, and information by the eigenvectors of the points' spread."""
    wide_last, directions = np.linalg.eigh(np.cov(points.T, bias=True))
    narrow, wide = wide_last
    information = np.array([1 / (narrow + THICKNESS**2), 0.0])
    if narrow > kernels.MOST_ROUND * wide:
        information[1] = 1 / (wide + THICKNESS**2)
    xx, xy, _, yy = (directions @ np.diag(information) @ directions.T).ravel()
    return [*points.mean(axis=0), xx, xy, yy]


@FEW
@given(SEEDS, st.integers(4, 30), st.floats(-pi, pi), st.sampled_from([0.0, 0.005, 0.02, 0.05]))
def test_make_surfel_as_its_twin(seed: int, count: int, turn: float, thick: float) -> None:
    points = np.random.default_rng(seed).normal(0, [0.05, thick], (count, 2))
    points = points @ np.array([[cos(turn), sin(turn)], [-sin(turn), cos(turn)]]) + [0.02, -0.03]
    centre, table = np.array([-7.025, 3.975]), empty_table(3)
    moments = kernels.Moments(*map(float, moments_of(list(points), np.zeros(2))))
    state = kernels.make_surfel(table, 1, moments, tuple(centre.tolist()))
    assert not table.surfels[::2].any()
    surfel = table.surfels[1]
    assert state == kernels.FRESH
    mean, information = slow_surfel(points)[:2], slow_surfel(points)[2:]
    assert surfel[:2] == pytest.approx(mean + centre, abs=1e-9)
    assert surfel[2:] == pytest.approx(information, abs=1e-6 / THICKNESS**2)


def test_a_wall_by_hand() -> None:
    # Ten points from (0, 0) to (0.09, 0): it tells y to 1.5 cm, and nothing about x.
    points = [np.array([k / 100, 0.0]) for k in range(10)]
    table = empty_table(1)
    moments = kernels.Moments(*map(float, moments_of(points, np.zeros(2))))
    assert kernels.make_surfel(table, 0, moments, (1.0, 2.0)) == kernels.FRESH
    expected = [1.045, 2.0, 0.0, 0.0, 1 / 0.015**2]
    assert table.surfels[0] == pytest.approx(expected, abs=1e-6)


def test_too_few_points_make_no_surfel() -> None:
    table, few = empty_table(1), kernels.Moments(kernels.FEWEST - 1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    assert kernels.make_surfel(table, 0, few, (0.0, 0.0)) == kernels.NONE
    assert not table.surfels.any()


def slow_nearest(cells: dict[Cell, list[Floats]], x: float, y: float) -> Cell | None:
    """The cell within reach whose points' mean is nearest, if they and others make a wall."""
    here = floor(x / CELL), floor(y / CELL)
    gaps = {
        cell: np.hypot(*(np.mean(points, axis=0) - [x, y]))
        for cell, points in cells.items()
        if max(abs(cell[0] - here[0]), abs(cell[1] - here[1])) <= kernels.FARTHEST_CORRESPONDENCE
    }
    nearest = min(gaps, key=lambda cell: gaps[cell], default=None)
    if nearest is None or slow_neighbourhood(cells, nearest)[0] < kernels.FEWEST:
        return None
    return nearest


@FEW
@given(SEEDS, st.sampled_from([3, 30, 150]), st.sampled_from([0.3, 1.0]))
def test_nearest_surfel_as_its_twin(seed: int, count: int, extent: float) -> None:
    points = scattered(seed, count, extent)
    table, _ = table_of(points)
    cells = cells_of(points)
    for x, y in np.random.default_rng(seed + 1).uniform(-extent - 0.3, extent + 0.3, (30, 2)):
        cell = slow_nearest(cells, x, y)
        slot = kernels.nearest_surfel(table, x, y)
        if cell is None:
            assert slot == 0
            continue
        assert slot == slot_of(table.grid, *cell)
        expected = empty_table(1)
        around = kernels.neighbourhood(table, *cell)
        kernels.make_surfel(expected, 0, around, tuple(centre_of(cell).tolist()))
        assert table.surfels[slot] == pytest.approx(expected.surfels[0])
