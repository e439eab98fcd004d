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
    x, y = (np.array(points)[:, :2] - centre).T
    return [len(x), x.sum(), y.sum(), (x * x).sum(), (x * y).sum(), (y * y).sum()]


def rays_to(points: Floats) -> Floats:
    """Unit vectors to them from somewhere off the middle."""
    rays = points - [0.4, -0.3]
    unit: Floats = rays / np.hypot(*rays.T)[:, None]
    return unit


def seen(points: Floats) -> Floats:
    """Points and rays, shape (n, 4)."""
    return np.hstack([points, rays_to(points)])


# --- points


@FEW
@given(SEEDS, st.integers(0, 200), st.sampled_from([0.1, 0.5, 500.0]))
def test_add_points_as_its_twin(seed: int, count: int, extent: float) -> None:
    points = scattered(seed, count, extent)
    table, (_, used) = table_of(points, rays_to(points))
    twin = cells_of(seen(points))
    assert used == 1 + len(twin)
    for number, (cell, inside) in enumerate(twin.items(), start=1):
        assert slot_of(table.grid, *cell) == number  # in the order of their first points
        *moments, x, y, ray_x, ray_y = table.moments[number]
        assert moments == pytest.approx(moments_of(inside, centre_of(cell)), abs=1e-9)
        assert [x, y] == pytest.approx(np.mean(inside, axis=0)[:2])
        assert [ray_x, ray_y] == pytest.approx(np.sum(inside, axis=0)[2:], abs=1e-9)
    assert table.moments[0].tolist() == [0] * 6 + [kernels.NOWHERE] * 2 + [0] * 2


def test_points_of_a_second_scan_go_into_the_same_cells() -> None:
    points = scattered(0, 120, 0.3)
    rays = rays_to(points)
    expected, used = table_of(points, rays)
    table = empty_table(len(expected.moments), 0.3)
    _, halfway = kernels.add_points(table, (1, 1), points[:50], rays[:50], 0)
    assert kernels.add_points(table, halfway, points, rays, 50) == (120, used)
    assert np.array_equal(table.moments, expected.moments)


def test_points_are_added_as_far_as_there_is_room() -> None:
    points = np.array([(0.01, 0.01), (0.06, 0.01), (0.02, 0.01), (0.11, 0.01), (9.0, 0.0)])
    table = empty_table(4)
    for room, (first, used), expected in (
        (3, (0, (1, 1)), (3, (2, 3))),  # two cells, and no more slots
        (4, (3, (2, 3)), (4, (2, 4))),  # the third cell, and nothing so far away
    ):
        part = table._replace(moments=table.moments[:room])
        assert kernels.add_points(part, used, points, rays_to(points), first) == expected
    assert table.moments[:, kernels.COUNT].tolist() == [0, 2, 1, 1]


# --- surfels


def are_opposite(one: Floats, other: Floats) -> bool:
    """Whether two vectors are more than 120 degrees apart."""
    cosine = one @ other / max(np.linalg.norm(one) * np.linalg.norm(other), 1e-12)
    return bool(np.degrees(np.arccos(cosine.clip(-1, 1))) > 120)


def slow_neighbourhood(cells: dict[Cell, list[Floats]], at: Cell) -> list[float]:
    """Moments of the smallest square around a cell, 3 x 3 at least, with enough points in cells
    that were not seen from the other side, and the sum of their rays."""
    ray = np.sum(cells[at], axis=0)[2:]
    for reach in range(1, kernels.WIDEST_NEIGHBOURHOOD + 1):
        inside = [
            point
            for (u, v), points in cells.items()
            if max(abs(u - at[0]), abs(v - at[1])) <= reach
            and not are_opposite(np.sum(points, axis=0)[2:], ray)
            for point in points
        ]
        if len(inside) >= kernels.FEWEST:
            break
    return [*moments_of(inside, centre_of(at)), *np.sum(inside, axis=0)[2:]]


@FEW
@given(SEEDS, st.integers(1, 150), st.sampled_from([0.2, 0.5, 2.0]))
def test_neighbourhood_as_its_twin(seed: int, count: int, extent: float) -> None:
    points = scattered(seed, count, extent)
    table, _ = table_of(points, rays_to(points))
    cells = cells_of(seen(points))
    for cell in list(cells)[:20]:
        found = kernels.neighbourhood(table, *cell, ray_of(table, slot_of(table.grid, *cell)))
        assert found == pytest.approx(slow_neighbourhood(cells, cell), abs=1e-9)


def ray_of(table: kernels.SurfelTable, slot: int) -> tuple[float, float]:
    """The sum of the rays to a cell's points."""
    x, y = table.moments[slot, kernels.RAY_X :].tolist()
    return x, y


def is_line(points: Floats) -> bool:
    narrow, wide = np.linalg.eigvalsh(np.cov(points.T, bias=True)).tolist()
    return bool(narrow <= kernels.MOST_ROUND * wide)


def slow_surfel(points: Floats) -> list[float]:
    """Mean, and information by the eigenvectors of the points' spread."""
    wide_last, directions = np.linalg.eigh(np.cov(points.T, bias=True))
    narrow, wide = wide_last
    information = np.array([1 / (narrow + THICKNESS**2), 0.0])
    if not is_line(points):
        information[1] = 1 / (wide + THICKNESS**2)
    xx, xy, _, yy = (directions @ np.diag(information) @ directions.T).ravel()
    return [*points.mean(axis=0), xx, xy, yy]


@FEW
@given(SEEDS, st.integers(4, 30), st.floats(-pi, pi), st.sampled_from([0.0, 0.005, 0.02, 0.05]))
def test_make_surfel_as_its_twin(seed: int, count: int, turn: float, thick: float) -> None:
    points = np.random.default_rng(seed).normal(0, [0.05, thick], (count, 2))
    points = points @ np.array([[cos(turn), sin(turn)], [-sin(turn), cos(turn)]]) + [0.02, -0.03]
    centre, table = np.array([-7.025, 3.975]), empty_table(3)
    moments = kernels.Moments(
        *map(float, moments_of(list(points), np.zeros(2))), 0.3 * count, -0.7 * count
    )
    state = kernels.make_surfel(table, 1, moments, tuple(centre.tolist()))
    assert not table.surfels[::2].any()
    surfel = table.surfels[1]
    assert state == kernels.FRESH
    mean, information = slow_surfel(points)[:2], slow_surfel(points)[2:]
    assert surfel[:2] == pytest.approx(mean + centre, abs=1e-9)
    assert surfel[2:5] == pytest.approx(information, abs=1e-6 / THICKNESS**2)
    xx, xy, yy = information
    normal = np.linalg.eigh([[xx, xy], [xy, yy]])[1][:, 1]
    share = normal @ [0.3, -0.7]
    is_sided = is_line(points) and abs(share) > kernels.LEAST_ACROSS
    across = 2 * count * share * normal if is_sided else np.zeros(2)
    assert surfel[5:] == pytest.approx(across, abs=1e-6)


def test_a_wall_by_hand() -> None:
    # Ten points from (0, 0) to (0.09, 0): it tells y to 1.5 cm, and nothing about x.
    # It was seen from above and the left: its normal looks down.
    points = [np.array([k / 100, 0.0]) for k in range(10)]
    table = empty_table(1)
    moments = kernels.Moments(*map(float, moments_of(points, np.zeros(2))), 8.0, -6.0)
    assert kernels.make_surfel(table, 0, moments, (1.0, 2.0)) == kernels.FRESH
    expected = [1.045, 2.0, 0.0, 0.0, 1 / 0.015**2, 0.0, -12.0]
    assert table.surfels[0] == pytest.approx(expected, abs=1e-6)


def test_too_few_points_make_no_surfel() -> None:
    table, few = empty_table(1), kernels.Moments(kernels.FEWEST - 1.0, *[0.0] * 7)
    assert kernels.make_surfel(table, 0, few, (0.0, 0.0)) == kernels.NONE
    assert not table.surfels.any()


def slow_nearest(cells: dict[Cell, list[Floats]], x: float, y: float) -> Cell | None:
    """The cell within reach whose points' mean is nearest, if they and others make a wall."""
    here = floor(x / CELL), floor(y / CELL)
    gaps = {
        cell: np.hypot(*(np.mean(points, axis=0)[:2] - [x, y]))
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
    table, _ = table_of(points, rays_to(points))
    cells, rng = cells_of(seen(points)), np.random.default_rng(seed + 1)
    for x, y in rng.uniform(-extent - 0.3, extent + 0.3, (30, 2)):
        ray, cell = rng.normal(0, 1, 2), slow_nearest(cells, x, y)
        slot = kernels.nearest_surfel(table, x, y, *ray.tolist())
        if cell is None:
            assert slot == 0
            continue
        expected, at = empty_table(1), slot_of(table.grid, *cell)
        around = kernels.neighbourhood(table, *cell, ray_of(table, at))
        kernels.make_surfel(expected, 0, around, tuple(centre_of(cell).tolist()))
        is_behind = expected.surfels[0, kernels.NORMAL_X :] @ ray < 0
        assert slot == (0 if is_behind else at)
        assert table.surfels[at] == pytest.approx(expected.surfels[0])


def test_a_thing_thinner_than_a_cell_has_no_side() -> None:
    x = np.arange(0, 1, 0.01)
    board, rays = np.column_stack([x, np.full(len(x), 0.02)]), np.tile([0.6, -0.8], (100, 1))
    rays[::2, 1] = 0.8
    table, _ = table_of(board, rays)
    slots = [kernels.nearest_surfel(table, 0.5, 0.02, 0.0, ray) for ray in (-1.0, 1.0)]
    assert slots[0] == slots[1] > 0


def test_two_sides_of_a_wall_are_two_lines() -> None:
    # A wall of 10 cm, its sides seen from above and from below.
    x = np.arange(0, 1, 0.01)
    above, below = (np.column_stack([x, np.full(len(x), y)]) for y in (0.07, -0.03))
    down, up = np.tile([0.6, -0.8], (100, 1)), np.tile([0.6, 0.8], (100, 1))
    table, _ = table_of(np.vstack([above, below]), np.vstack([down, up]))
    for y, ray in ((0.07, -1.0), (-0.03, 1.0)):
        slot = kernels.nearest_surfel(table, 0.5, y + 0.01, 0.0, ray)
        assert table.surfels[slot, kernels.SURFEL_Y] == pytest.approx(y)
        assert table.surfels[slot, kernels.INFORMATION_YY] == pytest.approx(1 / THICKNESS**2)
        assert kernels.nearest_surfel(table, 0.5, y, 0.0, -ray) == 0
        assert kernels.nearest_surfel(table, 0.5, y, 0.9, 0.1 * ray) == slot
