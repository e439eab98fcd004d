"""Map refinement: scans are fitted to the surfels that all of them show."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from support.looping import MAP, ODOMETRY, ring_trajectory

from mapcli.algorithms.slam.map_refinement import refine
from mapcli.algorithms.slam.scan_store import ScanStore
from mapcli.model.pose import Pose2D


def test_refinement_takes_the_noise_out_of_poses() -> None:
    trajectory, true = ring_trajectory(0.0)
    rng = np.random.default_rng(0)
    noisy = [pose.compose(Pose2D(*rng.normal(0, [0.03, 0.03, 0.01]).tolist())) for pose in true]
    noisy[0] = true[0]
    refined = refine(trajectory, noisy, MAP.resolution, ODOMETRY)

    def error(poses: list[Pose2D]) -> float:
        return float(np.mean([a.distance(b) for a, b in zip(poses, true, strict=True)]))

    assert error(refined) < error(noisy) / 2


def test_scans_that_are_no_keyframes_are_refined_too() -> None:
    whole, true = ring_trajectory(0.0)
    some = [frame for frame in whole.keyframes if frame.scan % 2 == 0]
    trajectory = replace(whole, keyframes=some)
    off = [pose.compose(Pose2D(0.03 * (k % 2), 0.0, 0.0)) for k, pose in enumerate(true)]
    refined = refine(trajectory, off, MAP.resolution, ODOMETRY)
    errors = [a.distance(b) for a, b in zip(refined, true, strict=True)]
    assert np.mean(errors[1::2]) < 0.01  # of 3 cm


def test_where_a_scan_leaves_its_pose_open_odometry_tells() -> None:
    # For two metres the robot sees a single wall, which says nothing of the way along it.
    whole, true = ring_trajectory(0.0)
    wall, points = range(40, 46), ScanStore()
    for k, scan in enumerate(whole.points):
        points.append(one_wall(scan) if k in wall else scan)
    steps = [None, *(a.between(b) for a, b in pairwise(true))]
    trajectory = replace(whole, points=points, steps=steps)
    rng = np.random.default_rng(0)
    off = [
        pose.compose(Pose2D(*rng.normal(0, [0.05, 0.02, 0.005]).tolist())) if k in wall else pose
        for k, pose in enumerate(true)
    ]
    refined = refine(trajectory, off, MAP.resolution, ODOMETRY)
    assert max(refined[k].distance(true[k]) for k in wall) < 0.01
    # Without odometry it stays as far off as it was along the wall.
    silent = replace(trajectory, steps=[None] * len(true), poses=off)
    alone = refine(silent, off, MAP.resolution, ODOMETRY)
    assert max(alone[k].distance(true[k]) for k in wall) > 0.03


def one_wall(points: np.ndarray) -> np.ndarray:
    """The points on the wall to the left."""
    return points[(np.abs(points[:, 0]) < 0.3) & (points[:, 1] > 0)]
