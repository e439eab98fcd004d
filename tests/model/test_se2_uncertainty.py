"""Covariances of poses: by hand, by small differences, by drawing, and there and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import (
    LEAST_INFORMATION,
    UNKNOWN,
    StandardDeviations,
    covariance_from_information,
    information_from_covariance,
    information_in_own_frame,
    largest_position_variance,
    least_position_deviation,
    mahalanobis_distance,
    moved_covariance,
    turned_covariance,
)

SKEWED = np.array([[4.0, 1.0, 0.5], [1.0, 2.0, -0.3], [0.5, -0.3, 1.0]]) * 1e-4

FEW = settings(max_examples=40)
METRES, ANGLES = st.floats(-100, 100), st.floats(-10, 10)
POSES = st.builds(Pose2D, METRES, METRES, ANGLES)
SEEDS = st.integers(0, 2**32 - 1)


def as_row(pose: Pose2D) -> np.ndarray:
    return np.array([pose.x, pose.y, pose.theta])


def random_covariance(seed: int, size: float = 1.0) -> np.ndarray:
    factor = np.random.default_rng(seed).normal(0, math.sqrt(size), (3, 5))
    return factor @ factor.T


# --- standard deviations


def test_standard_deviations_by_hand() -> None:
    deviations = StandardDeviations(0.1, 0.5)
    assert deviations.covariance() == pytest.approx(np.diag([0.01, 0.01, 0.25]))
    assert deviations.information() == pytest.approx(np.diag([100, 100, 4]))


def test_deviations_along_axes_by_hand() -> None:
    axes = StandardDeviations(0.1, 0.02).along_axes(0.5)
    assert axes == (0.1, 0.05, 0.02)
    assert axes.weights(2.0) == pytest.approx((200.0, 800.0, 5000.0))
    assert UNKNOWN.along_axes().weights() == (0.0, 0.0, 0.0)


def test_of_what_is_unknown_there_is_no_information() -> None:
    assert not UNKNOWN.information().any()


# --- covariance and information


def test_covariance_as_numpy() -> None:
    for size in (1e-3, 1.0, 1e6):
        information = random_covariance(0, size)
        inverse = np.linalg.inv(information + LEAST_INFORMATION * np.eye(3))
        assert covariance_from_information(information) == pytest.approx(inverse, rel=1e-6)


def test_what_is_not_known_is_uncertain_but_not_infinitely() -> None:
    found = covariance_from_information(np.zeros((3, 3)), least=0.01)
    assert found == pytest.approx(100 * np.eye(3))


def test_information_is_the_inverse_of_the_covariance() -> None:
    covariance = np.array([[4.0, 1.0, 0.5], [1.0, 2.0, -0.3], [0.5, -0.3, 1.0]])
    a, b, c, d, e, f = information_from_covariance(covariance)
    information = np.array([[a, b, c], [b, d, e], [c, e, f]])
    assert information @ covariance == pytest.approx(np.eye(3), abs=1e-12)


@FEW
@given(SEEDS)
def test_covariance_to_information_and_back(seed: int) -> None:
    covariance = random_covariance(seed) + 0.1 * np.eye(3)
    a, b, c, d, e, f = information_from_covariance(covariance)
    back = covariance_from_information(np.array([[a, b, c], [b, d, e], [c, e, f]]), least=0.0)
    assert back == pytest.approx(covariance, rel=1e-9, abs=1e-9)


# --- from frame to frame


def test_information_in_the_robots_own_frame_by_hand() -> None:
    # Facing up: ahead is the world's y, left is its -x.
    information = np.array([[100.0, 7.0, 60.0], [7.0, 25.0, 5.0], [60.0, 5.0, 400.0]])
    expected = [[25, -7, 5], [-7, 100, -60], [5, -60, 400]]
    found = information_in_own_frame(information, math.pi / 2)
    assert found == pytest.approx(np.array(expected))


@FEW
@given(SEEDS, ANGLES)
def test_information_in_the_own_frame_as_matrices_and_back(seed: int, theta: float) -> None:
    information, (c, s) = random_covariance(seed), (math.cos(theta), math.sin(theta))
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    own = information_in_own_frame(information, theta)
    assert own == pytest.approx(turn.T @ information @ turn, abs=1e-9)
    assert information_in_own_frame(own, -theta) == pytest.approx(information, abs=1e-9)


@pytest.mark.parametrize("seen", [Pose2D(), Pose2D(3, 0, 0), Pose2D(-2, 5, 2.5)])
def test_moved_covariance_by_small_differences(seen: Pose2D) -> None:
    # b sees a at `seen`; a small error of a carries b along.
    a = Pose2D(7, -3, 1.2)
    b = a.compose(seen.inverse())
    step, columns = 1e-6, []
    for k in range(3):
        off = Pose2D(*(step * np.eye(3)[k]).tolist())
        moved = a.compose(off).compose(a.between(b))
        columns.append(as_row(b.between(moved)) / step)
    jacobian = np.array(columns).T
    expected = jacobian @ SKEWED @ jacobian.T
    assert moved_covariance(SKEWED, seen) == pytest.approx(expected, rel=1e-4, abs=1e-8)


def test_moved_covariance_by_hand() -> None:
    # A turn that is uncertain by 0.1 rad moves what is 3 m ahead by 0.3 m to the side.
    turning = np.diag([0, 0, 0.01])
    moved = moved_covariance(turning, Pose2D(-3, 0, 0))
    assert moved == pytest.approx(np.array([[0, 0, 0], [0, 0.09, 0.03], [0, 0.03, 0.01]]))


def test_moved_covariance_as_if_it_were_drawn() -> None:
    seen, rng, factor = Pose2D(1.5, -0.7, 2.0), np.random.default_rng(0), np.linalg.cholesky(SKEWED)
    errors = []
    for _ in range(4000):
        off = Pose2D(*(factor @ rng.normal(size=3)).tolist())
        errors.append(as_row(seen.compose(off).compose(seen.inverse())))
    expected = moved_covariance(SKEWED, seen)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # 4000 draws know an entry to about sqrt(2 / 4000) = 2 % of its variances.
    assert (np.abs(np.cov(np.array(errors).T) - expected) / scale).max() < 0.1


@FEW
@given(SEEDS, POSES)
def test_moved_there_and_back(seed: int, seen: Pose2D) -> None:
    covariance = random_covariance(seed)
    back = moved_covariance(moved_covariance(covariance, seen), seen.inverse())
    assert back == pytest.approx(covariance, abs=1e-7)


@FEW
@given(SEEDS, POSES, POSES)
def test_moved_on_and_on_is_moved_at_once(seed: int, b_a: Pose2D, c_b: Pose2D) -> None:
    covariance = random_covariance(seed)
    twice = moved_covariance(moved_covariance(covariance, b_a), c_b)
    assert twice == pytest.approx(
        moved_covariance(covariance, c_b.compose(b_a)), rel=1e-6, abs=1e-6
    )


def test_turned_by_hand() -> None:
    ahead = np.array([[4.0, 0.0], [0.0, 1.0]])
    expected = np.zeros((3, 3))
    expected[:2, :2] = [[1.0, 0.0], [0.0, 4.0]]
    assert turned_covariance(ahead, math.pi / 2) == pytest.approx(expected)
    left = np.array([[2.0, 1.0], [1.0, 3.0]])
    c, s = math.cos(0.3), math.sin(0.3)
    turn = np.array([[c, -s], [s, c]])
    assert turned_covariance(left, 0.3)[:2, :2] == pytest.approx(turn @ left @ turn.T)


@FEW
@given(SEEDS, ANGLES)
def test_turning_is_moving_without_going_anywhere(seed: int, theta: float) -> None:
    flat = np.zeros((3, 3))
    flat[:2, :2] = random_covariance(seed)[:2, :2]
    found = turned_covariance(flat[:2, :2], theta)
    assert found == pytest.approx(moved_covariance(flat, Pose2D(0, 0, theta)), abs=1e-9)
    assert turned_covariance(found[:2, :2], -theta) == pytest.approx(flat, abs=1e-9)


# --- how uncertain


def test_of_the_position_by_hand() -> None:
    covariance = turned_covariance(np.diag([9.0, 0.25]), 0.7) + np.diag([0.0, 0.0, 100.0])
    assert largest_position_variance(covariance) == pytest.approx(9.0)
    assert least_position_deviation(covariance) == pytest.approx(0.5)


def test_mahalanobis_distance_by_hand() -> None:
    covariance = np.diag([0.1**2, 0.2**2, 0.3**2])
    assert mahalanobis_distance(Pose2D(), covariance) == 0
    assert mahalanobis_distance(Pose2D(0.3), covariance) == pytest.approx(3)
    assert mahalanobis_distance(Pose2D(0.3, 0.8), covariance) == pytest.approx(5)
    assert mahalanobis_distance(Pose2D(0.0, 0.0, -0.6), covariance) == pytest.approx(2)


@FEW
@given(SEEDS, POSES)
def test_mahalanobis_distance_is_the_same_in_every_frame(seed: int, seen: Pose2D) -> None:
    # A small error of a, and what it does to b.
    covariance = random_covariance(seed) + np.eye(3)
    error = 1e-6 * np.random.default_rng(seed).normal(size=3)
    moved = seen.compose(Pose2D(*error.tolist())).compose(seen.inverse())
    one = mahalanobis_distance(Pose2D(*error.tolist()), covariance)
    other = mahalanobis_distance(moved, moved_covariance(covariance, seen))
    assert other == pytest.approx(one, rel=1e-2, abs=1e-8)
