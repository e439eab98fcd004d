"""The compiled loops that fit scans to walls, against slow and obvious twins."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from math import cos, floor, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels import point_to_line_icp as surfel_fit
from mapcli.algorithms.slam._kernels import surfel_map as kernels
from mapcli.algorithms.slam._kernels.sparse_grid import BORDER, SIDE, slot_of
from mapcli.algorithms.slam._kernels.window_scores import fits

Floats = NDArray[np.float64]
Cell = tuple[int, int]

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=30)
CELL, THICKNESS, DOUBT = 0.05, 0.015, 3.0
SHAPE = CELL, THICKNESS, DOUBT


def empty_table(room: int, extent: float = 0.0) -> kernels.Table:
    """Room for so many tiles and slots, and for points so far from the origin, metres."""
    far = BORDER + 1 + floor(extent / CELL / SIDE)
    directory = np.zeros((2 * far, 2 * far), np.int32)
    sums = np.zeros((room, 8))
    sums[0, 6:] = kernels.NOWHERE
    tiles = np.zeros((room, SIDE, SIDE), np.int32)
    return directory, (-far, -far), tiles, sums, np.zeros((room, 5)), np.zeros(room, np.int8)


def table_of(points: Floats) -> tuple[kernels.Table, tuple[int, int]]:
    """A table with these points, and the numbers of tiles and slots in it."""
    table = empty_table(len(points) + 1, np.abs(points).max(initial=0.0))
    done, used = kernels.add_points(table, (1, 1), points, 0, CELL)
    assert done == len(points)
    return table, used


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


def scattered(seed: int, count: int, extent: float) -> Floats:
    """Points on both sides of zero, some of them on walls."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-extent, extent, (count, 2))
    points[::3, 1] = rng.normal(0.013, 0.004, len(points[::3]))
    points[1::3, 0] = rng.normal(-0.21, 0.004, len(points[1::3]))
    return points


# --- points


@FEW
@given(SEEDS, st.integers(0, 200), st.sampled_from([0.1, 0.5, 500.0]))
def test_add_points_as_its_twin(seed: int, count: int, extent: float) -> None:
    points = scattered(seed, count, extent)
    table, (_, used) = table_of(points)
    twin = cells_of(points)
    assert used == 1 + len(twin)
    for number, (cell, inside) in enumerate(twin.items(), start=1):
        assert slot_of(*table[:3], *cell) == number  # in the order of their first points
        *moments, x, y = table[3][number]
        assert moments == pytest.approx(moments_of(inside, centre_of(cell)), abs=1e-9)
        assert [x, y] == pytest.approx(np.mean(inside, axis=0))
    assert table[3][0].tolist() == [0] * 6 + [kernels.NOWHERE] * 2


def test_points_of_a_second_scan_go_into_the_same_cells() -> None:
    points = scattered(0, 120, 0.3)
    expected, used = table_of(points)
    table = empty_table(len(expected[3]), 0.3)
    _, halfway = kernels.add_points(table, (1, 1), points[:50], 0, CELL)
    assert kernels.add_points(table, halfway, points, 50, CELL) == (120, used)
    assert np.array_equal(table[3], expected[3])


def test_points_are_added_as_far_as_there_is_room() -> None:
    points = np.array([(0.01, 0.01), (0.06, 0.01), (0.02, 0.01), (0.11, 0.01), (9.0, 0.0)])
    table = empty_table(4)
    for room, (first, used), expected in (
        (3, (0, (1, 1)), (3, (2, 3))),  # two cells, and no more slots
        (4, (3, (2, 3)), (4, (2, 4))),  # the third cell, and nothing so far away
    ):
        part = (*table[:3], table[3][:room], *table[4:])
        assert kernels.add_points(part, used, points, first, CELL) == expected
    assert table[3][:, 0].tolist() == [0, 2, 1, 1]


# --- surfels


def slow_patch(cells: dict[Cell, list[Floats]], at: Cell) -> list[float]:
    """Moments of the smallest square around a cell, 3 x 3 at least, with enough points."""
    for reach in range(1, kernels.WIDEST_PATCH + 1):
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
def test_patch_as_its_twin(seed: int, count: int, extent: float) -> None:
    points = scattered(seed, count, extent)
    table, _ = table_of(points)
    cells = cells_of(points)
    for cell in list(cells)[:20]:
        found = kernels.patch(table, *cell, CELL)
        assert found == pytest.approx(slow_patch(cells, cell), abs=1e-9)


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
    centre, surfels = np.array([-7.025, 3.975]), np.zeros((3, 5))
    moments = tuple(float(m) for m in moments_of(list(points), np.zeros(2)))
    state = kernels.make_surfel(moments, tuple(centre.tolist()), THICKNESS, surfels, 1)
    assert not surfels[::2].any()
    surfel = surfels[1]
    assert state == kernels.FRESH
    mean, information = slow_surfel(points)[:2], slow_surfel(points)[2:]
    assert surfel[:2] == pytest.approx(mean + centre, abs=1e-9)
    assert surfel[2:] == pytest.approx(information, abs=1e-6 / THICKNESS**2)


def test_a_wall_by_hand() -> None:
    # Ten points from (0, 0) to (0.09, 0): it tells y to 1.5 cm, and nothing about x.
    points = [np.array([k / 100, 0.0]) for k in range(10)]
    surfels = np.zeros((1, 5))
    moments = tuple(float(m) for m in moments_of(points, np.zeros(2)))
    assert kernels.make_surfel(moments, (1.0, 2.0), THICKNESS, surfels, 0) == kernels.FRESH
    expected = [1.045, 2.0, 0.0, 0.0, 1 / 0.015**2]
    assert surfels[0] == pytest.approx(expected, abs=1e-6)


def test_too_few_points_make_no_surfel() -> None:
    surfels, few = np.zeros((1, 5)), (kernels.FEWEST - 1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    assert kernels.make_surfel(few, (0.0, 0.0), THICKNESS, surfels, 0) == kernels.NONE
    assert not surfels.any()


def slow_nearest(cells: dict[Cell, list[Floats]], x: float, y: float) -> Cell | None:
    """The cell within reach whose points' mean is nearest, if they and others make a wall."""
    here = floor(x / CELL), floor(y / CELL)
    gaps = {
        cell: np.hypot(*(np.mean(points, axis=0) - [x, y]))
        for cell, points in cells.items()
        if max(abs(cell[0] - here[0]), abs(cell[1] - here[1])) <= kernels.FARTHEST_PARTNER
    }
    nearest = min(gaps, key=lambda cell: gaps[cell], default=None)
    if nearest is None or slow_patch(cells, nearest)[0] < kernels.FEWEST:
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
        slot = kernels.nearest_surfel(table, x, y, CELL, THICKNESS)
        if cell is None:
            assert slot == 0
            continue
        assert slot == slot_of(*table[:3], *cell)
        expected = np.zeros((1, 5))
        around = kernels.patch(table, *cell, CELL)
        kernels.make_surfel(around, tuple(centre_of(cell).tolist()), THICKNESS, expected, 0)
        assert table[4][slot] == pytest.approx(expected[0])


def moved(points: Floats, pose: Floats | surfel_fit.Pose) -> Floats:
    c, s = cos(pose[2]), sin(pose[2])
    return points @ np.array([[c, s], [-s, c]]) + pose[:2]


@FEW
@given(SEEDS)
def test_associate_is_nearest_surfel_of_each_point(seed: int) -> None:
    table, _ = table_of(scattered(seed, 120, 0.5))
    points, pose = scattered(seed + 1, 40, 0.7), (0.1, -0.05, 2.5)
    partners = np.full(len(points), -9)
    fitted = surfel_fit.associate(table, points, 3, 35, pose, SHAPE, partners)
    expected = [
        kernels.nearest_surfel(table, x, y, CELL, THICKNESS) for x, y in moved(points[3:35], pose)
    ]
    assert partners.tolist() == [-9] * 3 + expected + [-9] * (len(points) - 35)
    assert fitted == sum(partner > 0 for partner in expected)


# --- the fit


def robust_cost(
    surfels: Floats, partners: NDArray[np.int64], points: Floats, pose: Floats
) -> float:
    """What Gauss-Newton brings down: squared deviations q of the points, levelled off."""
    cost = 0.0
    for point, partner in zip(moved(points, pose), partners, strict=True):
        if partner > 0:
            x, y, xx, xy, yy = surfels[partner]
            gap = np.array([x, y]) - point
            q = gap @ np.array([[xx, xy], [xy, yy]]) @ gap
            cost += DOUBT**2 * q / (DOUBT**2 + q)
    return cost


def pose_of(pose: Floats) -> surfel_fit.Pose:
    x, y, theta = pose.tolist()
    return x, y, theta


def full_of(system: surfel_fit.System) -> tuple[Floats, Floats]:
    """Normal matrix and gradient."""
    xx, xy, xt, yy, yt, tt, *gradient = system
    return np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]]), np.array(gradient)


def system_of(normal: Floats, gradient: Floats) -> surfel_fit.System:
    return (*normal[np.triu_indices(3)].tolist(), *gradient.tolist())


def linearised(
    surfels: Floats, partners: NDArray[np.int64], points: Floats, pose: Floats
) -> tuple[Floats, Floats]:
    """Normal matrix and gradient of all points."""
    n = len(points)
    return full_of(surfel_fit.linearise(surfels, partners, points, 0, n, pose_of(pose), DOUBT))


def random_fit(seed: int) -> tuple[Floats, NDArray[np.int64], Floats, Floats]:
    """Surfels, partners, points and a pose, near enough to each other to matter."""
    rng = np.random.default_rng(seed)
    table, _ = table_of(scattered(seed, 200, 0.5))
    points, pose = scattered(seed + 1, 60, 0.5), np.array([*rng.normal(0, 0.02, 2), 0.05])
    partners = np.empty(len(points), np.int64)
    found = surfel_fit.associate(table, points, 0, len(points), pose_of(pose), SHAPE, partners)
    assert found > 20
    return table[4], partners, points, pose


@FEW
@given(SEEDS)
def test_the_gradient_is_that_of_the_robust_cost(seed: int) -> None:
    surfels, partners, points, pose = random_fit(seed)
    _, gradient = linearised(surfels, partners, points, pose)
    step = 1e-6
    for k in range(3):
        off = np.zeros(3)
        off[k] = step
        rise = robust_cost(surfels, partners, points, pose + off)
        rise -= robust_cost(surfels, partners, points, pose - off)
        # Downhill, and half, since the squares' 2 is left out on both sides of the equation.
        assert gradient[k] == pytest.approx(-rise / (4 * step), rel=1e-4, abs=1e-2)


@FEW
@given(SEEDS)
def test_the_normal_matrix_as_its_twin(seed: int) -> None:
    surfels, partners, points, pose = random_fit(seed)
    normal, _ = linearised(surfels, partners, points, pose)
    expected = np.zeros((3, 3))
    for point, partner in zip(points, partners, strict=True):
        if partner > 0:
            x, y, xx, xy, yy = surfels[partner]
            information = np.array([[xx, xy], [xy, yy]])
            rx, ry = moved(point[None], np.array([0, 0, pose[2]]))[0]
            gap = np.array([x - pose[0] - rx, y - pose[1] - ry])
            say = (1 + gap @ information @ gap / DOUBT**2) ** -2
            jacobian = np.array([[1, 0, -ry], [0, 1, rx]])
            expected += say * jacobian.T @ information @ jacobian
    assert normal == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_a_part_of_the_points_is_linearised() -> None:
    surfels, partners, points, pose = random_fit(5)
    normal, gradient = linearised(surfels, partners, points, pose)
    parts = [
        surfel_fit.linearise(surfels, partners, points, *part, pose_of(pose), DOUBT)
        for part in ((0, 20), (20, len(points)))
    ]
    in_parts, gradient_in_parts = full_of(tuple(np.sum(parts, axis=0)))
    assert in_parts == pytest.approx(normal)
    assert gradient_in_parts == pytest.approx(gradient)


def test_a_points_say_falls_to_a_quarter_at_the_doubt() -> None:
    surfels = np.array([[0.0] * 5, [0.0, 0.0, 100.0, 0.0, 100.0]])
    partners, pose = np.ones(1, np.int64), np.zeros(3)
    for deviations, say in ((0.0, 1.0), (DOUBT, 0.25)):
        point = np.array([[deviations / 10, 0.0]])
        normal, gradient = linearised(surfels, partners, point, pose)
        assert normal[0, 0] == pytest.approx(100 * say)
        assert gradient[0] == pytest.approx(-100 * say * deviations / 10)


def prior_cost(pose: Floats, predicted: Floats, prior: tuple[float, float, float]) -> float:
    per_metre, per_radian, knee = prior
    squares = (
        per_metre * ((predicted - pose)[:2] ** 2).sum(),
        per_radian * (predicted - pose)[2] ** 2,
    )
    return sum(knee * q / (knee + q) for q in squares)


@FEW
@given(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)))
def test_the_prior_pulls_down_its_cost(place: tuple[float, float, float]) -> None:
    pose, predicted, prior = np.array(place), np.array([0.2, -0.1, 0.3]), (100.0, 400.0, 9.0)
    known, pull = np.diag([5.0, 6.0, 7.0]) + 1, np.array([1.0, 2.0, 3.0])
    system = system_of(known, pull)
    total = surfel_fit.with_prior(system, pose_of(pose), pose_of(predicted), prior)
    normal, gradient = (a - b for a, b in zip(full_of(total), (known, pull), strict=True))
    assert (normal == np.diag(np.diag(normal))).all()
    for k in range(3):
        off = np.zeros(3)
        off[k] = 1e-6
        rise = prior_cost(pose + off, predicted, prior) - prior_cost(pose - off, predicted, prior)
        assert gradient[k] == pytest.approx(-rise / 4e-6, rel=1e-4, abs=1e-4)
        assert gradient[k] == pytest.approx(normal[k, k] * (predicted - pose)[k])


@FEW
@given(SEEDS)
def test_a_step_as_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    factor = rng.normal(0, 30, (3, 5))
    matrix, right = factor @ factor.T, rng.normal(0, 100, 3)
    found = surfel_fit.stepped((1.0, 2.0, 3.0), system_of(matrix, right))
    assert matrix @ (np.array(found) - [1, 2, 3]) == pytest.approx(right, abs=1e-6)


def test_a_step_without_any_information_stays_where_it_is() -> None:
    nothing = system_of(np.zeros((3, 3)), np.zeros(3))
    assert surfel_fit.stepped((1.0, 2.0, 3.0), nothing) == (1.0, 2.0, 3.0)


def test_when_a_pose_is_still() -> None:
    still = surfel_fit.STILL, surfel_fit.STILL_TURN
    for x, turn, share, expected in (
        (0.9 * still[0], 0.0, 1.0, True),
        (1.1 * still[0], 0.0, 1.0, False),
        (0.3 * still[0], 0.0, 0.2, False),
        (0.0, 1.1 * still[1], 1.0, False),
        (-0.1 * still[0], -0.1 * still[1], 0.2, True),
    ):
        assert surfel_fit.is_still((0.0, 0.0, 1.0), (x, 0.0, 1 + turn), share) is expected


def room(step: float, start: float) -> Floats:
    """Points every `step` along the walls of 6.1 m by 4.3 m and of a pillar, turned by 0.3."""
    boxes = [(-3.02, -2.07, 3.08, 2.23), (0.61, 0.44, 1.12, 0.93)]
    corners = [[(a, b), (c, b), (c, d), (a, d), (a, b)] for a, b, c, d in boxes]
    walls = [np.array(ends) for box in corners for ends in pairwise(box)]
    parts = []
    for one, other in walls:
        length = np.hypot(*(other - one))
        share = np.arange(start, length, step) / length
        parts.append(one + share[:, None] * (other - one))
    return moved(np.concatenate(parts), np.array([0, 0, 0.3]))


NO_PRIOR = 0.0, 0.0, 9.0


def fit_scans(
    table: kernels.Table, scans: list[Floats], starts: list[Floats], rounds: int
) -> list[tuple[Floats, Floats, int]]:
    """Pose, normal matrix and points at walls of each scan, without odometry."""
    points, bounds = np.concatenate(scans), np.cumsum([0, *(len(scan) for scan in scans)])
    poses, systems = np.array(starts), np.empty((len(scans), 6))
    partners, fitted = np.empty(len(points), np.int64), np.empty(len(scans), np.int64)
    surfel_fit.fit_scans(
        table,
        points,
        bounds,
        poses,
        poses.copy(),
        NO_PRIOR,
        SHAPE,
        rounds,
        partners,
        systems,
        fitted,
    )
    normals = [full_of((*system, 0.0, 0.0, 0.0))[0] for system in systems]
    return list(zip(poses, normals, fitted.tolist(), strict=True))


@pytest.mark.parametrize("seed", range(5))
def test_a_fit_finds_a_pose_that_is_less_than_a_cell_off(seed: int) -> None:
    table, _ = table_of(room(0.02, 0.004))
    rng = np.random.default_rng(seed)
    true = np.array([*rng.uniform(-0.3, 0.3, 2), rng.uniform(-pi, pi)])
    world = room(0.07, 0.031)
    c, s = cos(true[2]), sin(true[2])
    points = (world - true[:2]) @ np.array([[c, -s], [s, c]])
    start = true + np.array([*rng.uniform(-CELL, CELL, 2) * 0.7, rng.uniform(-0.015, 0.015)])
    ((pose, normal, fitted),) = fit_scans(table, [points], [start], 20)
    # Nothing but corners, where two walls are in one cell, keeps it from being exact.
    assert np.hypot(*(pose - true)[:2]) < CELL / 10
    assert abs(pose[2] - true[2]) < radians(0.1)
    assert fitted > 0.99 * len(points)
    assert (np.linalg.eigvalsh(normal) > 0).all()


def test_scans_are_fitted_each_for_itself() -> None:
    table, _ = table_of(room(0.02, 0.004))
    scans = [room(0.07, 0.031), room(0.3, 0.2), np.empty((0, 2)), room(0.2, 0.1)[:20]]
    starts = [np.array([0.01 * k, -0.02, 0.003 * k]) for k in range(4)]
    together = fit_scans(table, scans, starts, 3)
    for scan, start, found in zip(scans, starts, together, strict=True):
        ((pose, normal, fitted),) = fit_scans(table, [scan], [start], 3)
        assert pose.tolist() == found[0].tolist()
        assert normal.tolist() == found[1].tolist()
        assert fitted == found[2]


def test_a_fit_where_nothing_is_stays() -> None:
    start = np.array([1.0, 2.0, 3.0])
    ((pose, normal, fitted),) = fit_scans(empty_table(16), [room(0.5, 0.1)], [start], 5)
    assert pose.tolist() == [1, 2, 3]
    assert not normal.any()
    assert fitted == 0


# --- ambiguity


@FEW
@given(
    SEEDS, st.tuples(st.integers(-8, 3), st.integers(-8, 3)), st.integers(0, 4), st.integers(1, 3)
)
def test_fits_as_its_twin(seed: int, low: tuple[int, int], count: int, stride: int) -> None:
    rng = np.random.default_rng(seed)
    field = rng.integers(0, 256, (45, 50)).astype(np.uint8)
    points = rng.integers(8, 30, (25, 2))  # rows, columns
    places = points[:, 0] * 50 + points[:, 1]
    sums = np.empty((count, count), np.int64)
    fits(field.reshape(-1), places, 50, low, stride, sums)
    across, down = ([start + k * stride for k in range(count)] for start in low)
    expected = [
        [sum(int(field[r + dv, c + du]) for r, c in points) for du in across] for dv in down
    ]
    assert sums.tolist() == expected
