"""Map refinement: scans are fitted to the surfels that all of them show, and none is torn away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from support.looping import MAP, ring_trajectory

from mapcli.algorithms.slam.map_refinement import RefineParameters, refine
from mapcli.algorithms.slam.scan_store import ScanStore
from mapcli.model.pose import Pose2D


def test_refinement_takes_the_noise_out_of_poses() -> None:
    trajectory, true = ring_trajectory(0.0)
    rng = np.random.default_rng(0)
    noisy = [pose.compose(Pose2D(*rng.normal(0, [0.03, 0.03, 0.01]).tolist())) for pose in true]
    noisy[0] = true[0]
    refined = refine(trajectory, noisy, MAP.resolution, RefineParameters())

    def error(poses: list[Pose2D]) -> float:
        return float(np.mean([a.distance(b) for a, b in zip(poses, true, strict=True)]))

    assert error(refined) < error(noisy) / 2


def test_no_pose_goes_far() -> None:
    trajectory, true = ring_trajectory(0.0)
    off = [pose.compose(Pose2D(0.1 * (k % 2))) for k, pose in enumerate(true)]
    # Without rounds, all scans are fitted once.
    refined = refine(trajectory, off, MAP.resolution, RefineParameters(rounds=0, farthest_m=0.02))
    assert max(a.distance(b) for a, b in zip(off, refined, strict=True)) <= 0.02
    assert refined != off


def test_scans_that_are_no_keyframes_are_refined_too() -> None:
    whole, true = ring_trajectory(0.0)
    some = [frame for frame in whole.keyframes if frame.scan % 2 == 0]
    trajectory = replace(whole, keyframes=some)
    off = [pose.compose(Pose2D(0.03 * (k % 2), 0.0, 0.0)) for k, pose in enumerate(true)]
    refined = refine(trajectory, off, MAP.resolution, RefineParameters())
    errors = [a.distance(b) for a, b in zip(refined, true, strict=True)]
    assert np.mean(errors[1::2]) < 0.01  # of 3 cm


def test_a_scan_with_few_points_stays_where_it_is() -> None:
    whole, true = ring_trajectory(0.0)
    points = ScanStore()
    for k, scan in enumerate(whole.points):
        points.append(scan[:4] if k == 60 else scan)
    trajectory = replace(whole, points=points)
    off = [pose.compose(Pose2D(0.02)) if k == 60 else pose for k, pose in enumerate(true)]
    refined = refine(trajectory, off, MAP.resolution, RefineParameters(fewest=5))
    assert refined[60] == off[60]
