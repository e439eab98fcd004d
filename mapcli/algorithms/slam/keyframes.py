"""What a run of Algorithm 9.2 leaves behind for afterwards: its trajectory, and submaps of it.

A KEYFRAME is a scan that was written into the current map. A SUBMAP is some metres of the
trajectory, rigid as it was tracked, with an ORIGIN keyframe in its middle; submaps are what loops
are closed between.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.model.pose import Pose2D, interpolate
from mapcli.model.se2_uncertainty import (
    Covariance,
    InformationMatrix,
    StandardDeviations,
    covariance_from_information,
    moved_covariance,
)


@dataclass(frozen=True, slots=True, eq=False)
class Keyframe:
    """A scan that is part of the map.

    Attributes:
        scan: its number.
        pose: as tracked.
        perception: what was seen.
        covariance: of the motion since the keyframe before, shape (3, 3), in the robot's frame.
        metres: driven until here.
    """

    scan: int
    pose: Pose2D
    perception: Perception
    covariance: Covariance
    metres: float


@dataclass
class TrackedTrajectory:
    """Every scan's pose and points, and the keyframes among them (stateful: it grows).

    Attributes:
        poses: as tracked; points: shape (n, 2) each, float32, where beams ended, in the robot's
            frame, one for each cell of the map.
    """

    poses: list[Pose2D] = field(default_factory=list)
    points: list[NDArray[np.float32]] = field(default_factory=list)
    keyframes: list[Keyframe] = field(default_factory=list)

    def add(self, pose: Pose2D, points: NDArray[np.float64]) -> None:
        """The next scan."""
        self.poses.append(pose)
        self.points.append(points.astype(np.float32))

    def amend(self, poses: Sequence[Pose2D]) -> None:
        """The last scans were taken at these poses."""
        first = len(self.poses) - len(poses)
        self.poses[first:] = poses
        begin = bisect_left(self.keyframes, first, key=lambda keyframe: keyframe.scan)
        for k in range(begin, len(self.keyframes)):
            pose, metres = self.poses[self.keyframes[k].scan], 0.0
            if k:
                last = self.keyframes[k - 1]
                metres = last.metres + last.pose.distance(pose)
            self.keyframes[k] = replace(self.keyframes[k], pose=pose, metres=metres)

    def add_keyframe(
        self, perception: Perception, match: InformationMatrix | None, wheels: MotionModel
    ) -> None:
        """The last scan is a keyframe; `match` is the information from the map, if any."""
        motion, metres, pose = Pose2D(), 0.0, self.poses[-1]
        if self.keyframes:
            last = self.keyframes[-1]
            motion, metres = last.pose.between(pose), last.metres + last.pose.distance(pose)
        covariance = step_covariance(motion, match, wheels)
        self.keyframes.append(Keyframe(len(self.poses) - 1, pose, perception, covariance, metres))


TRACKING = StandardDeviations(0.015, math.radians(0.15))
"""Standard deviations of a tracked pose after a metre, or a turn of a radian, at best."""


def step_covariance(
    motion: Pose2D, match: InformationMatrix | None, wheels: MotionModel
) -> Covariance:
    """Of a motion from keyframe to keyframe, shape (3, 3): map and wheels together say where the
    robot is, and neither is better than tracking is at best."""
    deviations = wheels.uncertainty(motion).deviations
    way = math.hypot(motion.x, motion.y) + abs(motion.theta)
    information = deviations.information()
    covariance = covariance_from_information(information if match is None else information + match)
    floor: Covariance = max(way, 0.01) * TRACKING.covariance()
    return covariance + floor


@dataclass(frozen=True, slots=True, eq=False)
class Submap:
    """Keyframes `first` to `last`, both included, and the origin among them."""

    first: int
    last: int
    origin: int


def split(keyframes: list[Keyframe], metres: float) -> list[Submap]:
    """Submaps of about so many metres, one after the other."""
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


def around(keyframes: list[Keyframe], origin: int, metres: float) -> range:
    """Keyframes at most so many metres before or after an origin."""
    at = keyframes[origin].metres
    first = bisect_left(keyframes, at - metres, key=lambda k: k.metres)
    last = bisect_right(keyframes, at + metres, key=lambda k: k.metres)
    return range(min(first, origin), max(last, origin + 1))


def covariance_between(keyframes: list[Keyframe], a: int, b: int) -> Covariance:
    """Of keyframe b's pose as tracked from keyframe a (a < b), shape (3, 3), in b's frame."""
    total, end = np.zeros((3, 3)), keyframes[b].pose
    for keyframe in keyframes[a + 1 : b + 1]:
        total += moved_covariance(keyframe.covariance, end.between(keyframe.pose))
    return total


def apply_corrections(
    trajectory: TrackedTrajectory, submaps: list[Submap], origins: list[Pose2D]
) -> list[Pose2D]:
    """Every scan's pose when the origins are moved: between two of them, each has its share."""
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
        share = (scan - scans[after - 1]) / (scans[after] - scans[after - 1])
        corrected.append(interpolate(one, other, share))
    return corrected
