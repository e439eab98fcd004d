"""What is done when the log has ended: the whole way round is put right, and nothing is torn."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from support.looping import (
    MAP,
    blind,
    drifted,
    laps,
    log_of,
    ring,
    ring_trajectory,
    scan_at,
    see,
    trajectory_of,
    worst,
)

from mapcli.algorithms.slam.back_end import (
    BackEndResult,
    finalise,
)
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.loop_closure import LoopParameters
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.slam import Slam, SlamParameters
from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan
from mapcli.model.trace import TracedPose

ORIGIN = Pose2D()


def finalised(trajectory: TrackedTrajectory) -> BackEndResult:
    return finalise(trajectory, MAP, LoopParameters(), MotionModel())


@pytest.mark.parametrize("drift", [0.1, -0.15, 0.2])
def test_the_whole_way_round_is_put_right(drift: float) -> None:
    trajectory, true = ring_trajectory(drift)
    result = finalised(trajectory)
    before = worst(trajectory.poses, true)
    assert before > 0.45
    assert len(result.loops) >= 2
    assert worst(result.poses, true) < before / 8
    assert len(result.poses) == len(true)


def test_the_first_pose_stays_where_it_is() -> None:
    start = Pose2D(20.0, -7.0, 2.0)
    trajectory, true = ring_trajectory(0.1, start)
    result = finalised(trajectory)
    assert result.poses[0] == start
    assert worst(result.poses, true) < 0.06


def test_loops_are_between_scans() -> None:
    trajectory, true = ring_trajectory(0.1)
    for loop in finalised(trajectory).loops:
        off = true[loop.from_].between(true[loop.to]).between(loop.pose)
        assert math.hypot(off.x, off.y) < 0.1
        assert 0.5 <= loop.score <= 1
        assert loop.information is not None


def test_walls_are_thin_afterwards() -> None:
    # A map of poses that are half a metre off has walls twice; the one that is made has not.
    trajectory, true = ring_trajectory(0.2)
    torn = cells_of(trajectory, trajectory.poses)
    right = cells_of(trajectory, [trajectory.poses[0].compose(true[0].between(p)) for p in true])
    made = int((finalised(trajectory).grid.log_odds > 0).sum())
    assert torn > 1.3 * right
    assert made < 1.1 * right


def cells_of(trajectory: TrackedTrajectory, poses: list[Pose2D]) -> int:
    """Occupied cells of the map that these poses make."""
    one = Slam().map
    for keyframe in trajectory.keyframes:
        one.integrate(poses[keyframe.scan], keyframe.perception)
    return int((one.log_odds > 0).sum())


def test_two_runs_give_the_same_bytes() -> None:
    trajectory, _ = ring_trajectory(0.2)
    one, other = finalised(trajectory), finalised(trajectory)
    assert one.poses == other.poses
    assert one.loops == other.loops
    assert one.grid.log_odds.tobytes() == other.grid.log_odds.tobytes()


def test_one_scan_is_a_trajectory() -> None:
    trajectory = trajectory_of([Pose2D(1, 2, 3)], [see(ring(), laps(1)[0])])
    result = finalised(trajectory)
    assert result.poses == [Pose2D(1, 2, 3)]
    assert result.loops == ()
    assert (result.grid.log_odds > 0).any()


# --- whole runs


def run(
    scans: list[RangeScan], odom: list[Pose2D]
) -> tuple[Slam, list[TracedPose], BackEndResult | None]:
    slam = Slam()
    found = list(slam.replay(log_of(scans, odom)))
    return slam, found, slam.finalise()


@cache
def ring_scans() -> tuple[list[RangeScan], list[Pose2D]]:
    world, true = ring(), laps(48, 0.25)
    return [scan_at(world, pose, k) for k, pose in enumerate(true)], true


def test_a_run_with_poor_wheels_comes_home() -> None:
    scans, true = ring_scans()
    odom = drifted(true, 1.03, 1.0)
    assert worst(odom, true) > 3
    _, found, result = run(scans, odom)
    assert result is not None
    assert result.loops
    assert worst(result.poses, true) < 0.02
    assert worst(result.poses, true) <= worst([traced.pose for traced in found], true)


def test_a_blind_hall_on_the_way_tears_nothing() -> None:
    scans, true = ring_scans()
    hall = [blind(scan) if 60 <= k < 90 else scan for k, scan in enumerate(scans)]
    # Over 7.5 m, wheels that drift by 0.3 degrees and count 1 % too much.
    _, found, result = run(hall, drifted(true, 1.01, 0.3))
    assert result is not None
    assert {traced.status for traced in found[60:90]} == {"odometry"}
    assert worst(result.poses, true) < 0.15


def test_a_log_that_never_sees_has_nothing_to_finalise() -> None:
    scans, true = ring_scans()
    slam, found, result = run([blind(scan) for scan in scans], true)
    assert result is None
    assert slam.submap_count == 0
    assert found[0].pose == Pose2D()


def test_without_loops_there_is_nothing_to_finalise() -> None:
    scans, true = ring_scans()
    slam = Slam(SlamParameters(loops=None))
    list(slam.replay(log_of(scans[:20], true[:20])))
    assert slam.finalise() is None
    assert slam.trajectory.poses == []


@pytest.mark.parametrize("ahead", [50, 90])
def test_a_kidnapped_robot_keeps_the_map_from_before(ahead: int) -> None:
    # It is carried on by a third or by two thirds of the way round; the wheels do not notice.
    scans, true = ring_scans()
    world, way = ring(), [*true[:80], *true[80 + ahead :]]
    scans = [scan_at(world, pose, k) for k, pose in enumerate(way)]
    rest = true[80 + ahead :]
    odom = [*true[:80], *(true[79].compose(rest[0].between(pose)) for pose in rest)]
    _, found, result = run(scans, odom)
    assert result is not None
    assert worst(result.poses[:80], way[:80]) < 0.03
    # What comes after is whole in itself, and that something was odd shows in the scores.
    assert worst(result.poses[90:], way[90:]) < 0.1
    usual = np.mean([traced.score for traced in found[40:80] if traced.score is not None])
    odd = [traced.score or 0.0 for traced in found[80:85]]
    assert min(odd) < 0.85 * usual
