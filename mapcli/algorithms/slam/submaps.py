"""Submaps: pieces of the trajectory that stay rigid when loops are closed.

A SUBMAP is some metres of keyframes, one after the other, as they were tracked; over so short a
way tracking hardly drifts. The pose of a submap is that of its ORIGIN, a keyframe in its middle.
The pose graph has one node for each submap, and loops are closed between them.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mapcli.algorithms.slam.keyframes import Keyframe, TrackedTrajectory
from mapcli.model.pose import Pose2D, interpolate
from mapcli.model.se2_uncertainty import Covariance, moved_covariance

SUBMAP_M = 5.0
"""Metres of trajectory in a submap. Shorter ones are more ambiguous, longer ones are bent."""


@dataclass(frozen=True, slots=True, eq=False)
class Submap:
    """Keyframes `first` to `last`, both included, and the `origin` among them (their numbers)."""

    first: int
    last: int
    origin: int


def split_into_submaps(keyframes: list[Keyframe], metres: float = SUBMAP_M) -> list[Submap]:
    """Submaps of about so many metres, one after the other; the origin of each is the first
    keyframe in its second half."""
    starts = [0]
    for k, keyframe in enumerate(keyframes):
        if keyframe.metres - keyframes[starts[-1]].metres >= metres:
            starts.append(k)
    submaps = []
    for first, after in pairwise([*starts, len(keyframes)]):
        middle = (keyframes[first].metres + keyframes[after - 1].metres) / 2
        origin = bisect_left(keyframes, middle, first, after - 1, key=lambda k: k.metres)
        submaps.append(Submap(first, after - 1, origin))
    return submaps


def keyframes_around(keyframes: list[Keyframe], origin: int, metres: float) -> range:
    """Keyframes at most so many metres of trajectory before or after a submap's origin."""
    at = keyframes[origin].metres
    first = bisect_left(keyframes, at - metres, key=lambda k: k.metres)
    last = bisect_right(keyframes, at + metres, key=lambda k: k.metres)
    return range(min(first, origin), max(last, origin + 1))


def covariance_between(keyframes: list[Keyframe], a: int, b: int) -> Covariance:
    """Of keyframe b's pose as tracked from keyframe a (a < b), in b's frame: each step's
    covariance, moved to b, added up."""
    total, end = np.zeros((3, 3)), keyframes[b].pose
    for keyframe in keyframes[a + 1 : b + 1]:
        total += moved_covariance(keyframe.covariance, end.between(keyframe.pose))
    return total


def apply_corrections(
    trajectory: TrackedTrajectory, submaps: list[Submap], origins: list[Pose2D]
) -> list[Pose2D]:
    """Every scan's pose when the submaps' origins are moved to new poses.

    Between two origins, a scan is carried along by both: its pose is interpolated between where
    the one and where the other takes it, by its number. Before the first origin and after the last
    one it is carried by that one alone; and where a piece begins, by the origin on its side.
    """
    frames = [trajectory.keyframes[s.origin] for s in submaps]
    scans = [frame.scan for frame in frames]
    corrected = []
    for scan, pose in enumerate(trajectory.poses):
        after = min(max(bisect_left(scans, scan), 1), len(scans) - 1)
        if len(scans) == 1 or scan <= scans[0] or scan >= scans[-1]:
            k = 0 if scan <= scans[0] else len(scans) - 1
            corrected.append(origins[k].compose(frames[k].pose.between(pose)))
            continue
        one, other = (origins[k].compose(frames[k].pose.between(pose)) for k in (after - 1, after))
        begins = trajectory.keyframes[submaps[after].first].lost_since
        if begins is not None:  # a piece begins, and nothing is between the two
            corrected.append(other if scan >= begins else one)
            continue
        share = (scan - scans[after - 1]) / (scans[after] - scans[after - 1])
        corrected.append(interpolate(one, other, share))
    return corrected
