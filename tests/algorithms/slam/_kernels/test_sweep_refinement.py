"""Kernels of the refinement of sweeps, against numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from support.pose_chains import dense, empty

from mapcli.algorithms.slam._kernels import sweep_refinement as kernels
from mapcli.algorithms.slam._kernels.sweep_refinement import ALONE, Path, TimedPoints
from mapcli.algorithms.slam.surfel_map import SurfelMap

RNG = np.random.default_rng(5)
POSES = np.column_stack([np.arange(4) * 0.2, RNG.normal(0, 0.1, 4), RNG.normal(0, 0.2, 4)])
SECONDS = np.array([0.2, 0.1, 0.3])
COUNTED = np.column_stack([SECONDS, np.full(3, 0.02), np.full(3, 0.1)])
PATH = Path(POSES, RNG.normal(0, 1, (4, 3)), SECONDS, COUNTED, np.zeros((3, 3)))


def timed(points: np.ndarray, steps: list[int], shares: list[float]) -> TimedPoints:
    n = len(points)
    scans = np.maximum(np.array(steps), 0)
    motions = np.tile([0.05, 0.02, 0.1], (n, 1))
    return TimedPoints(points, scans, np.array(steps), np.array(shares), motions)


def test_points_are_seen_from_the_cubic_through_the_poses() -> None:
    times = np.concatenate([[0], np.cumsum(SECONDS)])
    spline = CubicHermiteSpline(times, POSES, PATH.velocities)
    steps, shares = [0, 0, 1, 2, 2], [0.0, 0.3, 0.5, 0.9, 1.1]
    seen = np.empty((5, 3))
    kernels.place_points(timed(np.zeros((5, 2)), steps, shares), PATH, seen)
    at = [times[i] + u * SECONDS[i] for i, u in zip(steps, shares, strict=True)]
    assert seen == pytest.approx(spline(at))


def test_a_point_alone_moves_as_was_told() -> None:
    seen = np.empty((1, 3))
    kernels.place_points(timed(np.zeros((1, 2)), [ALONE], [0.0]), PATH, seen)
    x, y, theta = POSES[0]
    cos, sin = math.cos(theta), math.sin(theta)
    expected = x + 0.05 * cos - 0.02 * sin, y + 0.05 * sin + 0.02 * cos, theta + 0.1
    assert seen[0] == pytest.approx(expected)


@pytest.mark.parametrize("later", [False, True])
def test_by_odometry_the_way_has_its_shape_and_ends_at_the_poses(later: bool) -> None:
    # From scan 1 to 2, by the scan at its beginning, or by that at its end, backwards.
    path = PATH._replace(shares=np.ones((3, 3)))
    scan, share = (2, 0.0) if later else (1, 1.0)
    step = tuple(COUNTED[1].tolist())
    motion = kernels.inverse(step) if later else step
    some = TimedPoints(
        np.zeros((3, 2)),
        np.full(3, scan),
        np.ones(3, np.int64),
        np.array([0.0, 0.5, 1.0]),
        np.array([motion if share == u else (0.0, 0.0, 0.0) for u in (0.0, 0.5, 1.0)]),
    )
    seen = np.empty((3, 3))
    kernels.place_points(some, path, seen)
    assert seen[[0, 2]] == pytest.approx(POSES[[1, 2]])
    # Half way nothing was counted, so that half of the error is all that is left of the way.
    off = POSES[1 if later else 2] - np.array(kernels.composed(POSES, scan, motion))
    assert seen[1] == pytest.approx(POSES[scan] + off / 2)


def test_both_poses_share_a_point_in_proportion_to_time() -> None:
    surfels = SurfelMap(0.05)
    surfels.add(np.column_stack([np.full(400, 2.0), np.linspace(-2, 2, 400)]))
    point, u = np.array([[1.95, 0.5]]), 0.3
    # The robot stands, so that the point is seen from the same place whatever its time.
    poses, zeros = np.tile([0.02, 0.01, 0.05], (2, 1)), np.zeros((1, 3))
    path = Path(poses, np.zeros((2, 3)), np.array([0.2]), zeros, zeros)
    found = []
    for some in (timed(point, [ALONE], [0.0])._replace(motions=np.zeros((1, 3))),
                 timed(point, [0], [u])):  # fmt: skip
        seen, equations = np.empty((1, 3)), empty(2)
        kernels.place_points(some, path, seen)
        kernels.add_points(surfels.table, some, seen, 1e-4, equations)
        found.append((dense(equations), equations.right))
    (alone, pull), (shared, pulls) = found
    assert alone[0, 0] > 0
    block = alone[:3, :3]
    assert shared[:3, :3] == pytest.approx((1 - u) ** 2 * block)
    assert shared[:3, 3:] == pytest.approx(u * (1 - u) * block)
    assert shared[3:, 3:] == pytest.approx(u**2 * block)
    assert pulls == pytest.approx(np.concatenate([(1 - u) * pull[:3], u * pull[:3]]))


def test_points_on_walls_are_counted() -> None:
    surfels = SurfelMap(0.05)
    surfels.add(np.column_stack([np.full(200, 1.0), np.linspace(-1, 1, 200)]))
    points = np.array([[1.0, 0.3], [1.01, -0.2], [0.9, 0.0], [5.0, 5.0]])
    assert kernels.points_on_walls(surfels.table, points, np.zeros((4, 3))) == 2
