"""The trajectories of several drives as one, of which every drive is a piece.

To loop closure a new drive is what a robot is that was carried: nobody knows how it came from the
last scan of one drive to the first of the next, until a loop joins them (`slam.pieces`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapcli.algorithms.sessions.drive import Drive
from mapcli.algorithms.slam.keyframes import Keyframe, TrackedTrajectory
from mapcli.algorithms.slam.tracked_sweeps import COLUMNS, TrackedSweeps
from mapcli.model.scan import NANOSECONDS
from mapcli.model.se2_uncertainty import StandardDeviations

BETWEEN_DRIVES_M = 1e5
"""Metres of way that lie between two drives: a path through the graph never leads along it where
there is a loop."""

ANYWHERE = StandardDeviations(1e3, math.pi)
"""Where a drive begins, seen from the end of the one before."""

BETWEEN_DRIVES_NS = 3600 * NANOSECONDS
"""From the last scan of a drive to the first of the next, as if: no sweep goes on from one to the
other, whenever they were."""


def joined_trajectory(drives: Sequence[Drive]) -> TrackedTrajectory:
    """The scans of all drives, one drive after the other."""
    joined = TrackedTrajectory(begins=[])
    for drive in drives:
        first, part = len(joined.poses), drive.trajectory
        joined.begins.append(first)
        joined.poses += part.poses
        joined.steps += [None, *part.steps[1:]]
        for points in part.points:
            joined.points.append(points)
        joined.keyframes += _keyframes(part, first, joined.keyframes)
    if any(drive.trajectory.sweeps for drive in drives):
        joined.sweeps = _sweeps(drives)
    return joined


def _keyframes(part: TrackedTrajectory, first: int, before: list[Keyframe]) -> list[Keyframe]:
    """The keyframes of a drive whose first scan has the number `first`, after those before it."""
    way = before[-1].metres + BETWEEN_DRIVES_M if before else 0.0
    moved = [
        replace(
            one,
            scan=one.scan + first,
            metres=one.metres + way,
            lost_since=None if one.lost_since is None else one.lost_since + first,
        )
        for one in part.keyframes
    ]
    if before and moved:
        moved[0] = replace(moved[0], covariance=ANYWHERE.covariance(), lost_since=first)
    return moved


def _sweeps(drives: Sequence[Drive]) -> TrackedSweeps:
    """The points of all drives in time; where a drive took all beams of a scan at once, so."""
    joined, begin_ns = TrackedSweeps(), 0
    for drive in drives:
        own = drive.trajectory.sweeps
        stamps = own.stamps_ns or [traced.stamp_ns for traced in drive.poses]
        joined.stamps_ns += [begin_ns + stamp - stamps[0] for stamp in stamps]
        begin_ns = joined.stamps_ns[-1] + BETWEEN_DRIVES_NS
        joined.odometry += own.odometry or [traced.odom for traced in drive.poses]
        for beams in own.beams or drive.trajectory.points:
            at_once = np.zeros((len(beams), COLUMNS - beams.shape[1]), np.float32)
            joined.beams.append(np.column_stack([beams, at_once]))
        joined.longest_s = max(joined.longest_s, own.longest_s)
    return joined
