"""Submaps of a trajectory: how they are cut, how uncertain they are, how they are corrected."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from support.looping import NOTHING, winding

from mapcli.algorithms.slam.keyframes import Keyframe, TrackedTrajectory
from mapcli.algorithms.slam.submaps import (
    Submap,
    apply_corrections,
    covariance_between,
    keyframes_around,
    split_into_submaps,
)
from mapcli.model.pose import Pose2D, wrap_angle

SKEWED = np.array([[4.0, 1.0, 0.5], [1.0, 2.0, -0.3], [0.5, -0.3, 1.0]]) * 1e-4


def frames(metres: list[float]) -> list[Keyframe]:
    return [Keyframe(k, Pose2D(at), NOTHING, SKEWED * (k + 1), at) for k, at in enumerate(metres)]


# --- splitting


def test_split_by_hand() -> None:
    # 5 m at least make a submap; the origin is the first in its second half.
    submaps = split_into_submaps(frames([0, 2, 4, 5, 6, 9, 10, 11]), 5)
    assert [(s.first, s.last, s.origin) for s in submaps] == [(0, 2, 1), (3, 5, 5), (6, 7, 7)]


@pytest.mark.parametrize("metres", [[0.0], [0.0] * 7, [0.0, 0.5, 1.0]])
def test_a_short_trajectory_is_one_submap(metres: list[float]) -> None:
    (submap,) = split_into_submaps(frames(metres), 5)
    assert (submap.first, submap.last) == (0, len(metres) - 1)
    assert submap.first <= submap.origin <= submap.last


def test_submaps_hold_every_keyframe_once() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        steps = rng.choice([0.0, 0.3, 0.7, 12.0], rng.integers(1, 60), p=[0.3, 0.4, 0.25, 0.05])
        keyframes = frames(np.cumsum(steps).tolist())
        submaps = split_into_submaps(keyframes, 5)
        numbers = [k for s in submaps for k in range(s.first, s.last + 1)]
        assert numbers == list(range(len(keyframes)))
        for s, after in pairwise(submaps):
            length = keyframes[after.first].metres - keyframes[s.first].metres
            assert length >= 5
            assert keyframes[s.last].metres - keyframes[s.first].metres < 5
        assert all(s.first <= s.origin <= s.last for s in submaps)


# --- keyframes around an origin


def test_keyframes_around_by_hand() -> None:
    keyframes = frames([0, 1, 2, 3.5, 5, 5, 9])
    assert list(keyframes_around(keyframes, 2, 1.7)) == [1, 2, 3]
    assert list(keyframes_around(keyframes, 0, 1.7)) == [0, 1]
    assert list(keyframes_around(keyframes, 6, 3.9)) == [6]
    assert list(keyframes_around(keyframes, 4, 0.1)) == [4, 5]
    assert list(keyframes_around(keyframes, 5, 0.1)) == [4, 5]
    assert list(keyframes_around(keyframes, 3, 100)) == list(range(7))


def test_an_origin_is_always_around_itself() -> None:
    keyframes = frames([0, 1, 1, 1, 2])
    for k in range(5):
        assert k in keyframes_around(keyframes, k, 0.0)


# --- covariances


def as_row(pose: Pose2D) -> list[float]:
    return [pose.x, pose.y, pose.theta]


def test_covariance_between_as_if_it_were_drawn() -> None:
    keyframes = [
        Keyframe(k, pose, NOTHING, SKEWED * 0.1 * (k + 1), 0.0)
        for k, pose in enumerate(winding(60).poses[::15])
    ]
    rng, errors = np.random.default_rng(1), []
    for _ in range(4000):
        pose = keyframes[1].pose
        for one, other in pairwise(keyframes[1:]):
            off = np.linalg.cholesky(other.covariance) @ rng.normal(size=3)
            pose = pose.compose(one.pose.between(other.pose)).compose(Pose2D(*off.tolist()))
        errors.append(as_row(keyframes[-1].pose.between(pose)))
    added = covariance_between(keyframes, 1, len(keyframes) - 1)
    scale = np.sqrt(np.outer(np.diag(added), np.diag(added)))
    # 4000 draws know an entry to about sqrt(2 / 4000) = 2 % of its variances.
    assert (np.abs(np.cov(np.array(errors).T) - added) / scale).max() < 0.1


def test_covariance_of_one_step_is_that_of_the_keyframe() -> None:
    keyframes = frames([0, 1, 2])
    assert covariance_between(keyframes, 0, 1) == pytest.approx(keyframes[1].covariance)
    assert not covariance_between(keyframes, 1, 1).any()


# --- corrections


def corrected_by(
    trajectory: TrackedTrajectory, moves: list[Pose2D]
) -> tuple[list[Pose2D], list[int]]:
    """The trajectory corrected by moves of its submaps' origins; the origins' scans."""
    submaps = split_into_submaps(trajectory.keyframes, 5)
    old = [trajectory.keyframes[s.origin].pose for s in submaps]
    new = [move.compose(pose) for move, pose in zip(moves, old, strict=True)]
    scans = [trajectory.keyframes[s.origin].scan for s in submaps]
    return apply_corrections(trajectory, submaps, new), scans


def origins_of(trajectory: TrackedTrajectory) -> int:
    return len(split_into_submaps(trajectory.keyframes, 5))


def assert_same(found: Pose2D, expected: Pose2D) -> None:
    assert found.distance(expected) < 1e-9
    assert abs(wrap_angle(found.theta - expected.theta)) < 1e-9


@pytest.mark.parametrize("every", [1, 7])
def test_origins_that_stay_leave_every_pose(every: int) -> None:
    trajectory = winding(120, every)
    corrected, _ = corrected_by(trajectory, [Pose2D()] * origins_of(trajectory))
    for found, pose in zip(corrected, trajectory.poses, strict=True):
        assert_same(found, pose)


def test_the_whole_trajectory_moves_with_its_origins() -> None:
    trajectory, move = winding(120, 3), Pose2D(-4, 2, 2.0)
    corrected, _ = corrected_by(trajectory, [move] * origins_of(trajectory))
    for found, pose in zip(corrected, trajectory.poses, strict=True):
        assert_same(found, move.compose(pose))


def test_origins_land_on_their_new_poses_and_ends_are_carried_along() -> None:
    trajectory = winding(120, 3)
    rng = np.random.default_rng(0)
    moves = [Pose2D(*rng.normal(0, 0.3, 3).tolist()) for _ in range(origins_of(trajectory))]
    corrected, scans = corrected_by(trajectory, moves)
    for scan, move in zip(scans, moves, strict=True):
        assert_same(corrected[scan], move.compose(trajectory.poses[scan]))
    assert 0 < scans[0] < scans[-1] < 119
    assert_same(corrected[0], moves[0].compose(trajectory.poses[0]))
    assert_same(corrected[-1], moves[-1].compose(trajectory.poses[-1]))


def test_between_origins_the_trajectory_is_smooth() -> None:
    trajectory = winding(120, 3)
    moves = [Pose2D(0.1 * k, -0.05 * k, 0.02 * k) for k in range(origins_of(trajectory))]
    corrected, scans = corrected_by(trajectory, moves)
    # An origin moves by no more than this against the one before, shared by the scans between.
    for (one, other), (a, b) in zip(pairwise(moves), pairwise(scans), strict=True):
        frame = [move.compose(trajectory.poses[b]) for move in (one, other)]
        share = (frame[0].distance(frame[1]) + 5 * 0.02 + 0.02) / (b - a)
        for k in range(a, b):
            step = corrected[k].between(corrected[k + 1])
            tracked = trajectory.poses[k].between(trajectory.poses[k + 1])
            assert math.hypot(step.x - tracked.x, step.y - tracked.y) < 2 * share
            assert abs(wrap_angle(step.theta - tracked.theta)) == pytest.approx(0.02 / (b - a))


def test_one_origin_carries_everything() -> None:
    trajectory, move = winding(5), Pose2D(1, 2, 3)
    (pose,) = (trajectory.keyframes[2].pose,)
    corrected = apply_corrections(trajectory, [Submap(0, 4, 2)], [move.compose(pose)])
    for found, old in zip(corrected, trajectory.poses, strict=True):
        assert_same(found, move.compose(old))
