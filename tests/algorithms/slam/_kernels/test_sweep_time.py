"""What a scan says about the time of a turn, against slow and obvious twins."""

from __future__ import annotations

import numpy as np
import pytest
from support.surfels import Floats, moved, scattered, table_of

from mapcli.algorithms.slam._kernels.gauss_newton import SQUARED_SCALE
from mapcli.algorithms.slam._kernels.surfel_map import SurfelTable, nearest_surfel
from mapcli.algorithms.slam._kernels.sweep_time import TimeEquations, add_scan

VELOCITY = np.array([0.8, -0.1, 1.3])


def equations_of(table: SurfelTable, points: Floats, shares: Floats, pose: Floats) -> TimeEquations:
    equations = TimeEquations(np.zeros((4, 4)), np.zeros(4))
    add_scan(table, points, shares, pose, VELOCITY, 0.0, equations)
    return equations


def seen_at(point: Floats, share: float, unknowns: Floats) -> Floats:
    """The end of a beam in the map, by x, y, theta and the time of a turn."""
    *pose, turn_s = unknowns
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    turned = np.array([[cos, -sin], [sin, cos]])
    passing = VELOCITY[:2] + VELOCITY[2] * np.array([-point[1], point[0]])
    return np.array(pose[:2]) + turned @ (point + share * turn_s * passing)


@pytest.mark.parametrize("seed", range(5))
def test_the_equations_are_those_of_every_point(seed: int) -> None:
    rng = np.random.default_rng(seed)
    table, _ = table_of(scattered(seed, 200, 0.5))
    points, pose = scattered(seed + 1, 60, 0.5), np.array([*rng.normal(0, 0.02, 2), 0.05])
    shares, unknowns = rng.random(60), np.append(pose, 0.0)
    matrix, right, used = np.zeros((4, 4)), np.zeros(4), 0
    for point, share in zip(points, shares, strict=True):
        end = moved(point[None], pose)[0]
        at = nearest_surfel(table, *end, *(end - pose[:2]))
        if at == 0:
            continue
        used += 1
        x, y, xx, xy, yy = table.surfels[at, :5]
        information, residual = np.array([[xx, xy], [xy, yy]]), np.array([x, y]) - end
        weight = (SQUARED_SCALE / (SQUARED_SCALE + residual @ information @ residual)) ** 2
        steps = 1e-6 * np.eye(4)
        jacobian = np.column_stack(
            [
                (seen_at(point, share, unknowns + step) - seen_at(point, share, unknowns - step))
                / 2e-6
                for step in steps
            ]
        )
        matrix += weight * jacobian.T @ information @ jacobian
        right += weight * jacobian.T @ information @ residual
    assert used > 20
    equations = equations_of(table, points, shares, pose)
    np.testing.assert_allclose(equations.matrix, matrix, rtol=1e-6, atol=1e-6 * matrix.max())
    np.testing.assert_allclose(equations.right, right, rtol=1e-6, atol=1e-6 * abs(right).max())
