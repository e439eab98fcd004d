"""Gauss-Newton on a chain of poses, against numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.pose_chains import dense, empty

from mapcli.algorithms.slam._kernels import pose_chain
from mapcli.algorithms.slam._kernels.pose_chain import BAND, OdometrySteps

RNG = np.random.default_rng(5)
POSES = np.column_stack([np.arange(4) * 0.2, RNG.normal(0, 0.1, 4), RNG.normal(0, 0.2, 4)])


def test_the_banded_solution_is_that_of_the_full_matrix() -> None:
    equations = empty(4)
    for i in range(12):
        for a in range(min(BAND, 12 - i)):
            equations.matrix[i, a] = 20.0 if a == 0 else RNG.normal()
    equations.right[:] = RNG.normal(0, 1, 12)
    expected = np.linalg.solve(dense(equations), equations.right)
    pose_chain.solve_banded(equations)
    assert equations.right == pytest.approx(expected, abs=1e-8)


def numeric(cost, poses: np.ndarray) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Minus half the gradient of a cost by all poses."""
    gradient = np.empty(poses.size)
    for i in range(poses.size):
        step = np.zeros(poses.size)
        step[i] = 1e-6
        more, less = (cost(poses + sign * step.reshape(-1, 3)) for sign in (1, -1))
        gradient[i] = -(more - less) / 2e-6 / 2
    return gradient


def test_odometry_pulls_down_its_cost() -> None:
    counted = np.array([[0.19, 0.02, 0.1], [0.22, -0.01, -0.1], [0.2, 0.0, 0.0]])
    information = np.tile([4.0, 20.0, 4.0], (3, 1))  # weak, so that robust weights hardly matter
    steps = OdometrySteps(counted, information)

    def cost(poses: np.ndarray) -> float:
        total = 0.0
        for k in range(3):
            x, y, theta = counted[k]
            cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
            moved = poses[k + 1] - poses[k]
            ahead, left = cos * moved[0] + sin * moved[1], cos * moved[1] - sin * moved[0]
            squares = information[k] * np.array([ahead - x, left - y, moved[2] - theta]) ** 2
            for square in (squares[0] + squares[1], squares[2]):
                total += 9 * square / (9 + square)
        return total

    equations = empty(4)
    pose_chain.add_odometry(steps, POSES, equations)
    assert equations.right == pytest.approx(numeric(cost, POSES), abs=1e-5)
    # The matrix is J^T W J: positive, and no more than that of all steps without weights.
    assert np.linalg.eigvalsh(dense(equations)).min() > -1e-9
