"""The trajectory and its keyframes: what they count, and how uncertain steps are."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from support.looping import ODOMETRY, winding

from mapcli.algorithms.slam.keyframes import TRACKING_NOISE, step_covariance
from mapcli.model.pose import Pose2D

# --- the trajectory


def test_a_trajectory_counts_metres_between_keyframes() -> None:
    trajectory = winding(31, every=10)
    assert [frame.scan for frame in trajectory.keyframes] == [0, 10, 20, 30]
    poses = [trajectory.poses[k] for k in (0, 10, 20, 30)]
    assert [frame.pose for frame in trajectory.keyframes] == poses
    lengths = [a.distance(b) for a, b in pairwise(poses)]
    assert [frame.metres for frame in trajectory.keyframes] == pytest.approx(
        np.cumsum([0, *lengths])
    )
    for frame, (a, b) in zip(trajectory.keyframes[1:], pairwise(poses), strict=True):
        assert frame.covariance == pytest.approx(step_covariance(a.between(b), None, ODOMETRY))


def test_the_poses_of_the_last_scans_are_corrected() -> None:
    trajectory = winding(21, every=5)
    before, poses = list(trajectory.keyframes), list(trajectory.poses)
    moved = [Pose2D(pose.x + 1, pose.y, pose.theta) for pose in poses[8:]]
    trajectory.correct_last_poses(moved)
    assert trajectory.poses == [*poses[:8], *moved]
    assert trajectory.keyframes[:2] == before[:2]  # of scans 0 and 5
    assert [frame.pose for frame in trajectory.keyframes[2:]] == [moved[2], moved[7], moved[12]]
    lengths = [a.pose.distance(b.pose) for a, b in pairwise(trajectory.keyframes)]
    assert [frame.metres for frame in trajectory.keyframes] == pytest.approx(
        np.cumsum([0, *lengths])
    )
    trajectory.correct_last_poses([])
    assert trajectory.poses == [*poses[:8], *moved]


# --- steps


def test_without_a_match_a_step_is_as_uncertain_as_odometry() -> None:
    motion = Pose2D(0.3, 0.4, 0.1)
    deviations, way = ODOMETRY.uncertainty(motion).deviations, 0.5 + 0.1
    expected = np.diag([deviations.xy**2, deviations.xy**2, deviations.theta**2])
    expected += way * np.diag([TRACKING_NOISE.xy**2, TRACKING_NOISE.xy**2, TRACKING_NOISE.theta**2])
    assert step_covariance(motion, None, ODOMETRY) == pytest.approx(expected)


def test_a_match_adds_what_it_knows() -> None:
    # Along the corridor the match knows nothing, and the wheels decide; across it is the match.
    motion, match = Pose2D(0.5), np.diag([0.0, 0.01**-2, 0.002**-2])
    found = step_covariance(motion, match, ODOMETRY)
    alone, floor = step_covariance(motion, None, ODOMETRY), 0.5 * TRACKING_NOISE.xy**2
    assert found[0, 0] == pytest.approx(alone[0, 0], rel=0.01)
    assert found[1, 1] == pytest.approx(0.01**2 + floor, rel=0.05)
    assert (np.diag(found) <= np.diag(alone)).all()


def test_no_match_is_better_than_tracking_can_be() -> None:
    exact = np.eye(3) * 1e12
    found = step_covariance(Pose2D(1.0), exact, ODOMETRY)
    assert np.sqrt(np.diag(found)) == pytest.approx(
        [TRACKING_NOISE.xy, TRACKING_NOISE.xy, TRACKING_NOISE.theta]
    )
    standing = step_covariance(Pose2D(), exact, ODOMETRY)
    assert (np.linalg.eigvalsh(standing) > 0).all()
