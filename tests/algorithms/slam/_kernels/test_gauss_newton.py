"""Gauss-Newton on the points of a scan, against slow and obvious twins."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.surfels import Floats, full_of, moved, pose_of, scattered, table_of

from mapcli.algorithms.slam._kernels import gauss_newton as gn
from mapcli.algorithms.slam._kernels.gauss_newton import SQUARED_SCALE
from mapcli.algorithms.slam._kernels.point_to_line_icp import associate
from mapcli.algorithms.slam._kernels.pose import Pose

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=30)


def robust_cost(
    surfels: Floats, correspondences: NDArray[np.int64], points: Floats, pose: Floats
) -> float:
    """What Gauss-Newton brings down: squared deviations q of the points, levelled off."""
    cost = 0.0
    for point, slot in zip(moved(points, pose), correspondences, strict=True):
        if slot > 0:
            x, y, xx, xy, yy = surfels[slot, :5]
            gap = np.array([x, y]) - point
            q = gap @ np.array([[xx, xy], [xy, yy]]) @ gap
            cost += SQUARED_SCALE * q / (SQUARED_SCALE + q)
    return cost


def system_of(normal: Floats, gradient: Floats) -> gn.NormalEquations:
    return gn.NormalEquations(*normal[np.triu_indices(3)].tolist(), *gradient.tolist())


def linearised(
    surfels: Floats,
    correspondences: NDArray[np.int64],
    points: Floats,
    pose: Floats,
    bearing_variance: float = 0.0,
) -> tuple[Floats, Floats]:
    """Normal matrix and gradient of all points."""
    return full_of(gn.linearise(surfels, points, correspondences, pose_of(pose), bearing_variance))


def random_fit(seed: int) -> tuple[Floats, NDArray[np.int64], Floats, Floats]:
    """Surfels, correspondences, points and a pose, near enough to each other to matter."""
    rng = np.random.default_rng(seed)
    table, _ = table_of(scattered(seed, 200, 0.5))
    points, pose = scattered(seed + 1, 60, 0.5), np.array([*rng.normal(0, 0.02, 2), 0.05])
    correspondences = np.empty(len(points), np.int64)
    assert associate(table, points, pose_of(pose), correspondences) > 20
    return table.surfels, correspondences, points, pose


@FEW
@given(SEEDS)
def test_the_gradient_is_that_of_the_robust_cost(seed: int) -> None:
    surfels, correspondences, points, pose = random_fit(seed)
    _, gradient = linearised(surfels, correspondences, points, pose)
    step = 1e-6
    for k in range(3):
        off = np.zeros(3)
        off[k] = step
        rise = robust_cost(surfels, correspondences, points, pose + off)
        rise -= robust_cost(surfels, correspondences, points, pose - off)
        # Downhill, and half, since the squares' 2 is left out on both sides of the equation.
        assert gradient[k] == pytest.approx(-rise / (4 * step), rel=1e-4, abs=1e-2)


@FEW
@given(SEEDS, st.floats(0.0, 0.1))
def test_the_normal_matrix_as_its_twin(seed: int, bearing_variance: float) -> None:
    surfels, correspondences, points, pose = random_fit(seed)
    normal, _ = linearised(surfels, correspondences, points, pose, bearing_variance)
    expected = np.zeros((3, 3))
    for point, slot in zip(points, correspondences, strict=True):
        if slot > 0:
            x, y, xx, xy, yy = surfels[slot, :5]
            information = np.array([[xx, xy], [xy, yy]])
            rx, ry = moved(point[None], np.array([0, 0, pose[2]]))[0]
            gap = np.array([x - pose[0] - rx, y - pose[1] - ry])
            turned = np.array([-ry, rx])
            information /= 1 + bearing_variance * turned @ information @ turned
            weight = (1 + gap @ information @ gap / SQUARED_SCALE) ** -2
            jacobian = np.array([[1, 0, -ry], [0, 1, rx]])
            expected += weight * jacobian.T @ information @ jacobian
    assert normal == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_normal_equations_of_parts_add_up() -> None:
    surfels, correspondences, points, pose = random_fit(5)
    normal, gradient = linearised(surfels, correspondences, points, pose)
    parts = [
        gn.linearise(surfels, points[part], correspondences[part], pose_of(pose), 0.0)
        for part in (slice(20), slice(20, None))
    ]
    in_parts, gradient_in_parts = full_of(gn.NormalEquations(*np.sum(parts, axis=0)))
    assert in_parts == pytest.approx(normal)
    assert gradient_in_parts == pytest.approx(gradient)


def test_a_points_weight_falls_to_a_quarter_at_the_kernel_scale() -> None:
    surfels = np.array([[0.0] * 5, [0.0, 0.0, 100.0, 0.0, 100.0]])
    correspondences, pose = np.ones(1, np.int64), np.zeros(3)
    for deviations, weight in ((0.0, 1.0), (sqrt(SQUARED_SCALE), 0.25)):
        point = np.array([[deviations / 10, 0.0]])
        normal, gradient = linearised(surfels, correspondences, point, pose)
        assert normal[0, 0] == pytest.approx(100 * weight)
        assert gradient[0] == pytest.approx(-100 * weight * deviations / 10)


def prediction_cost(pose: Floats, prediction: gn.Prediction) -> float:
    (x, y, turn), scale = np.array(prediction.pose) - pose, prediction.squared_scale
    off = (x + 1j * y) * np.exp(-1j * prediction.pose.theta)
    squares = (
        prediction.information_ahead * off.real**2 + prediction.information_left * off.imag**2,
        prediction.information_theta * turn**2,
    )
    return sum(scale * q / (scale + q) for q in squares)


@FEW
@given(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)))
def test_the_prediction_pulls_down_its_cost(place: tuple[float, float, float]) -> None:
    pose, predicted = np.array(place), np.array([0.2, -0.1, 0.3])
    prediction = gn.Prediction(pose_of(predicted), 100.0, 900.0, 400.0, 9.0)
    known, pull = np.diag([5.0, 6.0, 7.0]) + 1, np.array([1.0, 2.0, 3.0])
    system = system_of(known, pull)
    total = gn.with_prediction(system, pose_of(pose), prediction)
    normal, gradient = (a - b for a, b in zip(full_of(total), (known, pull), strict=True))
    assert not normal[:2, 2].any()
    assert np.linalg.eigvalsh(normal).min() > -1e-9
    for k in range(3):
        off = np.zeros(3)
        off[k] = 1e-6
        rise = prediction_cost(pose + off, prediction) - prediction_cost(pose - off, prediction)
        assert gradient[k] == pytest.approx(-rise / 4e-6, rel=1e-4, abs=1e-4)
    assert gradient == pytest.approx(normal @ (predicted - pose))


@FEW
@given(SEEDS)
def test_a_step_as_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    factor = rng.normal(0, 30, (3, 5))
    matrix, right = factor @ factor.T, rng.normal(0, 100, 3)
    found = gn.solve_step(Pose(1.0, 2.0, 3.0), system_of(matrix, right))
    assert matrix @ (np.array(found) - [1, 2, 3]) == pytest.approx(right, abs=1e-6)


def test_a_step_without_any_information_stays_where_it_is() -> None:
    nothing = system_of(np.zeros((3, 3)), np.zeros(3))
    assert gn.solve_step(Pose(1.0, 2.0, 3.0), nothing) == (1.0, 2.0, 3.0)


def test_when_a_pose_is_still() -> None:
    still = gn.STILL, gn.STILL_TURN
    for x, turn, share, expected in (
        (0.9 * still[0], 0.0, 1.0, True),
        (1.1 * still[0], 0.0, 1.0, False),
        (0.3 * still[0], 0.0, 0.2, False),
        (0.0, 1.1 * still[1], 1.0, False),
        (-0.1 * still[0], -0.1 * still[1], 0.2, True),
    ):
        assert gn.is_still(Pose(0.0, 0.0, 1.0), Pose(x, 0.0, 1 + turn), share) is expected


def test_a_beam_is_worth_less_the_farther_and_the_flatter_it_hits() -> None:
    """A wall along x, seen to 1 cm, by beams known to 0.01 rad: variances across it add up."""
    surfels = np.array([[0.0] * 5, [0.0, 0.0, 0.0, 0.0, 1e4]])
    correspondences, pose = np.ones(1, np.int64), np.zeros(3)
    for x, y, across in ((0.0, 30.0, 0.0), (5.0, 1.0, 0.05), (20.0, 1.0, 0.2), (20.0, 9.0, 0.2)):
        surfels[1, 1] = y
        normal, _ = linearised(surfels, correspondences, np.array([[x, y]]), pose, 0.01**2)
        assert normal[1, 1] == pytest.approx(1 / (0.01**2 + across**2))
