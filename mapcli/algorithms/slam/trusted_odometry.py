"""A trajectory that follows the wheels where a person knows that they were right.

What scans say of the robot's motion there counts for nothing: neither in the pose graph nor in the
refinement, for which they have no points. They are still written into the map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mapcli.algorithms.slam.keyframes import Keyframe, TrackedTrajectory, step_covariance
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.scan_store import ScanStore
from mapcli.model.pose import Pose2D


def with_trusted_odometry(
    trajectory: TrackedTrajectory,
    odometry: Sequence[Pose2D | None],
    spans: Sequence[tuple[int, int]],
    model: MotionModel,
) -> TrackedTrajectory:
    """The trajectory, in whose spans the robot moved as odometry counted; what comes after a span
    moves along.

    Args:
        odometry: the odometry's pose at each scan; where it says nothing, tracking is kept.
        spans: first and last scans.
    """
    is_trusted = [any(first < k <= last for first, last in spans) for k in range(len(odometry))]
    poses, steps = [trajectory.poses[0]], list(trajectory.steps)
    for k in range(1, len(trajectory.poses)):
        step = trajectory.poses[k - 1].between(trajectory.poses[k])
        before, here = odometry[k - 1], odometry[k]
        if is_trusted[k] and before is not None and here is not None:
            step = steps[k] = before.between(here)
        poses.append(poses[-1].compose(step))
    keyframes: list[Keyframe] = []
    for keyframe in trajectory.keyframes:
        keyframe = replace(keyframe, pose=poses[keyframe.scan])
        if is_trusted[keyframe.scan] and keyframes:
            motion = keyframes[-1].pose.between(keyframe.pose)
            keyframe = replace(
                keyframe, covariance=step_covariance(motion, None, model), lost_since=None
            )
        keyframes.append(keyframe)
    sweeps = trajectory.sweeps
    return replace(
        trajectory,
        poses=poses,
        steps=steps,
        keyframes=keyframes,
        points=_without(trajectory.points, is_trusted),
        sweeps=replace(sweeps, beams=_without(sweeps.beams, is_trusted)) if sweeps else sweeps,
    )


def _without(points: ScanStore, is_left_out: Sequence[bool]) -> ScanStore:
    """The same points, but none of some scans."""
    kept = ScanStore(points.columns)
    for one, left_out in zip(points, is_left_out, strict=True):
        kept.append(one[:0] if left_out else one)
    return kept
