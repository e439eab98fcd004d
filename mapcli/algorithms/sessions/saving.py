"""A drive as a record that can be written to a file, and back again, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mapcli.algorithms.scans.perception import Perception, Sweep
from mapcli.algorithms.sessions.drive import Drive
from mapcli.algorithms.slam.keyframes import Keyframe, TrackedTrajectory
from mapcli.model.saved_drive import SavedDrive, SavedKeyframe, SavedScan, SavedSweep
from mapcli.model.sweep import SweepMotion


def saved(drive: Drive) -> SavedDrive:
    """The record of a drive; its scans are made as they are asked for."""
    return SavedDrive(
        drive.name,
        drive.inputs,
        drive.parameters,
        drive.summary,
        drive.trajectory.sweeps.longest_s,
        _Scans(drive),
    )


def restored(record: SavedDrive) -> Drive:
    """The drive of a record."""
    trajectory, poses = TrackedTrajectory(), []
    sweeps = trajectory.sweeps
    for number, scan in enumerate(record.scans):
        poses.append(scan.traced)
        trajectory.add(scan.traced.pose, scan.points, scan.step)
        if scan.beams is not None:
            sweeps.stamps_ns.append(scan.traced.stamp_ns)
            sweeps.odometry.append(scan.traced.odom)
            sweeps.beams.append(scan.beams)
        if scan.keyframe is not None:
            trajectory.keyframes.append(_keyframe(number, scan, scan.keyframe))
    sweeps.longest_s = record.longest_sweep_s
    return Drive(
        record.name, record.inputs, record.parameters, trajectory, tuple(poses), record.summary
    )


class _Scans:
    """The scans of a drive as records."""

    def __init__(self, drive: Drive) -> None:
        self._drive = drive

    def __iter__(self) -> Iterator[SavedScan]:
        trajectory = self._drive.trajectory
        keyframes = {one.scan: one for one in trajectory.keyframes}
        for k, traced in enumerate(self._drive.poses):
            keyframe = keyframes.get(k)
            yield SavedScan(
                traced,
                trajectory.steps[k],
                trajectory.points[k],
                trajectory.sweeps.beams[k] if trajectory.sweeps else None,
                None if keyframe is None else _saved_keyframe(keyframe),
            )


def _saved_keyframe(keyframe: Keyframe) -> SavedKeyframe:
    seen = keyframe.perception
    sweep = None
    if seen.sweep is not None:
        motion = seen.sweep.motion
        sweep = SavedSweep(seen.sweep.raw, seen.sweep.seconds, motion.seconds, motion.poses)
    return SavedKeyframe(
        seen.hits,
        seen.open_ends,
        seen.laser,
        keyframe.covariance,
        keyframe.metres,
        keyframe.lost_since,
        sweep,
    )


def _keyframe(number: int, scan: SavedScan, one: SavedKeyframe) -> Keyframe:
    sweep: Any = None
    if one.sweep is not None:
        motion = SweepMotion(one.sweep.motion_seconds, one.sweep.motion_poses)
        sweep = Sweep(one.sweep.raw, one.sweep.seconds, motion)
    seen = Perception(one.hits, one.open_ends, one.laser, sweep)
    return Keyframe(number, scan.traced.pose, seen, one.covariance, one.metres, one.lost_since)
