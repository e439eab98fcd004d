"""Submaps of a trajectory: how they are cut, how uncertain they are, how they bend."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.keyframes import (
    TRACKING,
    Keyframe,
    Submap,
    TrackedTrajectory,
    apply_corrections,
    around,
    covariance_between,
    split,
    step_covariance,
)
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.model.pose import Pose2D, wrap_angle

NOTHING = Perception(np.empty((0, 2)), np.empty((0, 2)), np.zeros(2))
WHEELS = MotionModel()
SKEWED = np.array([[4.0, 1.0, 0.5], [1.0, 2.0, -0.3], [0.5, -0.3, 1.0]]) * 1e-4


def frames(metres: list[float]) -> list[Keyframe]:
    return [Keyframe(k, Pose2D(at), NOTHING, SKEWED * (k + 1), at) for k, at in enumerate(metres)]


def winding(count: int, every: int = 1) -> TrackedTrajectory:
    """A trajectory through curves; every so many scans one is a keyframe."""
    trajectory, pose = TrackedTrajectory(), Pose2D(2, -1, 0.5)
    for k in range(count):
        trajectory.add(pose, np.empty((0, 2)))
        if k % every == 0:
            trajectory.add_keyframe(NOTHING, None, WHEELS)
        pose = pose.compose(Pose2D(0.25, 0.02, 0.2 * math.sin(k / 5)))
    return trajectory


# --- the trajectory


def test_a_track_counts_metres_between_keyframes() -> None:
    trajectory = winding(31, every=10)
    assert [frame.scan for frame in trajectory.keyframes] == [0, 10, 20, 30]
    poses = [trajectory.poses[k] for k in (0, 10, 20, 30)]
    assert [frame.pose for frame in trajectory.keyframes] == poses
    lengths = [a.distance(b) for a, b in pairwise(poses)]
    assert [frame.metres for frame in trajectory.keyframes] == pytest.approx(
        np.cumsum([0, *lengths])
    )
    for frame, (a, b) in zip(trajectory.keyframes[1:], pairwise(poses), strict=True):
        assert frame.covariance == pytest.approx(step_covariance(a.between(b), None, WHEELS))


def test_the_last_scans_are_amended() -> None:
    trajectory = winding(21, every=5)
    before, poses = list(trajectory.keyframes), list(trajectory.poses)
    moved = [Pose2D(pose.x + 1, pose.y, pose.theta) for pose in poses[8:]]
    trajectory.amend(moved)
    assert trajectory.poses == [*poses[:8], *moved]
    assert trajectory.keyframes[:2] == before[:2]  # of scans 0 and 5
    assert [frame.pose for frame in trajectory.keyframes[2:]] == [moved[2], moved[7], moved[12]]
    lengths = [a.pose.distance(b.pose) for a, b in pairwise(trajectory.keyframes)]
    assert [frame.metres for frame in trajectory.keyframes] == pytest.approx(
        np.cumsum([0, *lengths])
    )
    trajectory.amend([])
    assert trajectory.poses == [*poses[:8], *moved]


# --- split


def test_split_by_hand() -> None:
    # 5 m at least make a submap; the origin is the first in its second half.
    submaps = split(frames([0, 2, 4, 5, 6, 9, 10, 11]), 5)
    assert [(s.first, s.last, s.origin) for s in submaps] == [(0, 2, 1), (3, 5, 5), (6, 7, 7)]


@pytest.mark.parametrize("metres", [[0.0], [0.0] * 7, [0.0, 0.5, 1.0]])
def test_a_short_track_is_one_stretch(metres: list[float]) -> None:
    (submap,) = split(frames(metres), 5)
    assert (submap.first, submap.last) == (0, len(metres) - 1)
    assert submap.first <= submap.origin <= submap.last


def test_stretches_hold_every_keyframe_once() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        steps = rng.choice([0.0, 0.3, 0.7, 12.0], rng.integers(1, 60), p=[0.3, 0.4, 0.25, 0.05])
        keyframes = frames(np.cumsum(steps).tolist())
        submaps = split(keyframes, 5)
        numbers = [k for s in submaps for k in range(s.first, s.last + 1)]
        assert numbers == list(range(len(keyframes)))
        for s, after in pairwise(submaps):
            length = keyframes[after.first].metres - keyframes[s.first].metres
            assert length >= 5
            assert keyframes[s.last].metres - keyframes[s.first].metres < 5
        assert all(s.first <= s.origin <= s.last for s in submaps)


# --- around


def test_around_by_hand() -> None:
    keyframes = frames([0, 1, 2, 3.5, 5, 5, 9])
    assert list(around(keyframes, 2, 1.7)) == [1, 2, 3]
    assert list(around(keyframes, 0, 1.7)) == [0, 1]
    assert list(around(keyframes, 6, 3.9)) == [6]
    assert list(around(keyframes, 4, 0.1)) == [4, 5]
    assert list(around(keyframes, 5, 0.1)) == [4, 5]
    assert list(around(keyframes, 3, 100)) == list(range(7))


def test_an_anchor_is_always_around_itself() -> None:
    keyframes = frames([0, 1, 1, 1, 2])
    for k in range(5):
        assert k in around(keyframes, k, 0.0)


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
    gathered = covariance_between(keyframes, 1, len(keyframes) - 1)
    scale = np.sqrt(np.outer(np.diag(gathered), np.diag(gathered)))
    # 4000 draws know an entry to about sqrt(2 / 4000) = 2 % of its variances.
    assert (np.abs(np.cov(np.array(errors).T) - gathered) / scale).max() < 0.1


def test_covariance_of_one_step_is_that_of_the_keyframe() -> None:
    keyframes = frames([0, 1, 2])
    assert covariance_between(keyframes, 0, 1) == pytest.approx(keyframes[1].covariance)
    assert not covariance_between(keyframes, 1, 1).any()


def test_without_a_match_a_step_is_as_uncertain_as_the_wheels() -> None:
    motion = Pose2D(0.3, 0.4, 0.1)
    deviations, way = WHEELS.uncertainty(motion).deviations, 0.5 + 0.1
    expected = np.diag([deviations.xy**2, deviations.xy**2, deviations.theta**2])
    expected += way * np.diag([TRACKING.xy**2, TRACKING.xy**2, TRACKING.theta**2])
    assert step_covariance(motion, None, WHEELS) == pytest.approx(expected)


def test_a_match_adds_what_it_knows() -> None:
    # Along the corridor the match knows nothing, and the wheels decide; across it is the match.
    motion, match = Pose2D(0.5), np.diag([0.0, 0.01**-2, 0.002**-2])
    found = step_covariance(motion, match, WHEELS)
    alone, floor = step_covariance(motion, None, WHEELS), 0.5 * TRACKING.xy**2
    assert found[0, 0] == pytest.approx(alone[0, 0], rel=0.01)
    assert found[1, 1] == pytest.approx(0.01**2 + floor, rel=0.05)
    assert (np.diag(found) <= np.diag(alone)).all()


def test_no_match_is_better_than_tracking_can_be() -> None:
    exact = np.eye(3) * 1e12
    found = step_covariance(Pose2D(1.0), exact, WHEELS)
    assert np.sqrt(np.diag(found)) == pytest.approx([TRACKING.xy, TRACKING.xy, TRACKING.theta])
    standing = step_covariance(Pose2D(), exact, WHEELS)
    assert (np.linalg.eigvalsh(standing) > 0).all()


# --- bend


def corrected_by(
    trajectory: TrackedTrajectory, moves: list[Pose2D]
) -> tuple[list[Pose2D], list[int]]:
    """The trajectory bent by moves of its origins; the origins' scans."""
    submaps = split(trajectory.keyframes, 5)
    old = [trajectory.keyframes[s.origin].pose for s in submaps]
    new = [move.compose(pose) for move, pose in zip(moves, old, strict=True)]
    scans = [trajectory.keyframes[s.origin].scan for s in submaps]
    return apply_corrections(trajectory, submaps, new), scans


def origins_of(trajectory: TrackedTrajectory) -> int:
    return len(split(trajectory.keyframes, 5))


def assert_same(found: Pose2D, expected: Pose2D) -> None:
    assert found.distance(expected) < 1e-9
    assert abs(wrap_angle(found.theta - expected.theta)) < 1e-9


@pytest.mark.parametrize("every", [1, 7])
def test_anchors_that_stay_leave_every_pose(every: int) -> None:
    trajectory = winding(120, every)
    corrected, _ = corrected_by(trajectory, [Pose2D()] * origins_of(trajectory))
    for found, pose in zip(corrected, trajectory.poses, strict=True):
        assert_same(found, pose)


def test_the_whole_track_moves_with_its_anchors() -> None:
    trajectory, move = winding(120, 3), Pose2D(-4, 2, 2.0)
    corrected, _ = corrected_by(trajectory, [move] * origins_of(trajectory))
    for found, pose in zip(corrected, trajectory.poses, strict=True):
        assert_same(found, move.compose(pose))


def test_anchors_land_on_their_new_poses_and_ends_are_carried_along() -> None:
    trajectory = winding(120, 3)
    rng = np.random.default_rng(0)
    moves = [Pose2D(*rng.normal(0, 0.3, 3).tolist()) for _ in range(origins_of(trajectory))]
    corrected, scans = corrected_by(trajectory, moves)
    for scan, move in zip(scans, moves, strict=True):
        assert_same(corrected[scan], move.compose(trajectory.poses[scan]))
    assert 0 < scans[0] < scans[-1] < 119
    assert_same(corrected[0], moves[0].compose(trajectory.poses[0]))
    assert_same(corrected[-1], moves[-1].compose(trajectory.poses[-1]))


def test_between_anchors_the_way_is_smooth() -> None:
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


def test_one_anchor_carries_everything() -> None:
    trajectory, move = winding(5), Pose2D(1, 2, 3)
    (pose,) = (trajectory.keyframes[2].pose,)
    corrected = apply_corrections(trajectory, [Submap(0, 4, 2)], [move.compose(pose)])
    for found, old in zip(corrected, trajectory.poses, strict=True):
        assert_same(found, move.compose(old))
