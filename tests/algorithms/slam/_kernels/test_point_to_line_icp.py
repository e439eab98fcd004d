"""The compiled loops that fit scans to surfels, against slow and obvious twins."""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.pose_chains import dense, empty
from support.surfels import CELL, Floats, empty_table, full_of, moved, scattered, table_of

from mapcli.algorithms.slam._kernels import point_to_line_icp as icp
from mapcli.algorithms.slam._kernels.gauss_newton import NormalEquations, linearise
from mapcli.algorithms.slam._kernels.pose import Pose
from mapcli.algorithms.slam._kernels.surfel_map import SurfelTable, nearest_surfel

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(deadline=None, max_examples=30)


@FEW
@given(SEEDS)
def test_associate_is_nearest_surfel_of_each_point(seed: int) -> None:
    table, _ = table_of(scattered(seed, 120, 0.5))
    points, pose = scattered(seed + 1, 40, 0.7), Pose(0.1, -0.05, 2.5)
    correspondences = np.full(len(points), -9)
    matched = icp.associate(table, points, pose, correspondences)
    expected = [nearest_surfel(table, x, y, x - pose.x, y - pose.y) for x, y in moved(points, pose)]
    assert correspondences.tolist() == expected
    assert matched == sum(slot > 0 for slot in expected)


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


def fit(
    table: SurfelTable, points: Floats, start: Floats, variance: float = 0.0
) -> tuple[Floats, Floats, int]:
    """Pose, normal matrix and number of correspondences, without odometry."""
    x, y, theta = start.tolist()
    correspondences, nothing = np.empty(len(points), np.int64), (0.0, 0.0, 0.0, 9.0)
    pose, upper, matched = icp.fit_scan(
        table, points, correspondences, (x, y, theta), (0.0, 0.0, 0.0), nothing, variance
    )
    assert matched == np.count_nonzero(correspondences)
    return np.array(pose), full_of(NormalEquations(*upper, 0.0, 0.0, 0.0))[0], matched


@pytest.mark.parametrize("seed", range(5))
def test_a_fit_finds_a_pose_that_is_less_than_a_cell_off(seed: int) -> None:
    table, _ = table_of(room(0.02, 0.004))
    rng = np.random.default_rng(seed)
    true = np.array([*rng.uniform(-0.3, 0.3, 2), rng.uniform(-pi, pi)])
    world = room(0.07, 0.031)
    c, s = cos(true[2]), sin(true[2])
    points = (world - true[:2]) @ np.array([[c, -s], [s, c]])
    start = true + np.array([*rng.uniform(-CELL, CELL, 2) * 0.7, rng.uniform(-0.015, 0.015)])
    pose, normal, matched = fit(table, points, start)
    # Nothing but corners, where two walls are in one cell, keeps it from being exact.
    assert np.hypot(*(pose - true)[:2]) < CELL / 10
    assert abs(pose[2] - true[2]) < radians(0.1)
    assert matched > 0.99 * len(points)
    assert (np.linalg.eigvalsh(normal) > 0).all()


def test_scans_say_each_what_its_own_points_do() -> None:
    table, _ = table_of(room(0.02, 0.004))
    scans = [room(0.07, 0.031), room(0.3, 0.2), np.empty((0, 2)), room(0.2, 0.1)[:20]]
    poses = np.array([[0.01 * k, -0.02, 0.003 * k] for k in range(4)])
    points, bounds = np.concatenate(scans), np.cumsum([0, *(len(scan) for scan in scans)])
    correspondences, equations = np.empty(len(points), np.int64), empty(4)
    icp.add_scans(table, points, bounds, correspondences, 1e-4, poses, equations)
    matrix = dense(equations)
    for k, scan in enumerate(scans):
        own, pose = slice(3 * k, 3 * k + 3), Pose(*poses[k].tolist())
        partners = np.empty(len(scan), np.int64)
        icp.associate(table, scan, pose, partners)
        alone = linearise(table.surfels, scan, partners, pose, 1e-4)
        assert matrix[own, own][np.triu_indices(3)].tolist() == list(alone[:6])
        assert equations.right[own].tolist() == list(alone[6:])
        matrix[own, own] = 0
    assert not matrix.any()  # no scan says anything of another's pose


def test_a_fit_where_nothing_is_stays() -> None:
    start = np.array([1.0, 2.0, 3.0])
    pose, normal, matched = fit(empty_table(16), room(0.5, 0.1), start)
    assert pose.tolist() == [1, 2, 3]
    assert not normal.any()
    assert matched == 0
