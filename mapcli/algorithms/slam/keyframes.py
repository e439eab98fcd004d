"""The trajectory that a run of Algorithm 9.2 leaves behind, and the keyframes on it.

A KEYFRAME is a scan that was written into the local map. Scans between keyframes have a pose and
points, but say nothing to the map.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.scan_store import ScanStore
from mapcli.algorithms.slam.tracked_sweeps import TrackedSweeps
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import (
    CERTAIN,
    Covariance,
    InformationMatrix,
    StandardDeviations,
    covariance_from_information,
)

TRACKING_NOISE = StandardDeviations(0.015, math.radians(0.15))
"""Floor of the process noise of a tracked pose after a metre, or after a turn of a radian: errors
of successive fits are correlated, so tracking drifts by more than single fits say."""

SHORTEST_STEP = 0.01
"""Metres (plus radians) that a step counts at least in this, so that no covariance is singular."""


TEAR_M = 30.0
"""Metres of trajectory that a tear counts as: what lies on either side is no part of the same
submap, nor of the same visit."""


@dataclass(frozen=True, slots=True, eq=False)
class Keyframe:
    """A scan that is part of the map.

    Attributes:
        scan: its number.
        pose: of the robot in the map, as tracked.
        perception: what was seen, in the robot's frame.
        covariance: of the motion since the keyframe before, in this keyframe's own frame.
        metres: driven from the first keyframe to here; where the map began anew, `TEAR_M` more.
        lost_since: where the map began anew with it (see `lost_track`), the first of the scans
            until it that the map before contradicts.
    """

    scan: int
    pose: Pose2D
    perception: Perception
    covariance: Covariance
    metres: float
    lost_since: int | None = None

    @property
    def is_first(self) -> bool:
        """Whether a piece of the trajectory begins with it."""
        return self.lost_since is not None


@dataclass
class TrackedTrajectory:
    """Every scan's pose and points, and the keyframes among them (stateful: it grows).

    Attributes:
        poses: of the robot in the map, as tracked, one for each scan.
        steps: how the robot came from the scan before to each, as its odometry was believed; None
            where that says nothing.
        points: shape (n, 2) each, float32, the hits of each scan in the robot's frame, one for
            each cell of the map.
        keyframes: in time order.
        sweeps: when the points were taken, and how the robot moved meanwhile; of no scan as long as
            all beams of a scan are taken at once.
        begins: numbers of the scans with which drives begin; there may be several drives, one
            after the other, and nothing is known of the way from one to the next.
    """

    poses: list[Pose2D] = field(default_factory=list)
    steps: list[Pose2D | None] = field(default_factory=list)
    points: ScanStore = field(default_factory=ScanStore)
    keyframes: list[Keyframe] = field(default_factory=list)
    sweeps: TrackedSweeps = field(default_factory=TrackedSweeps)
    begins: list[int] = field(default_factory=lambda: [0])

    def drive_of(self, scan: int) -> int:
        """The number of the drive that a scan belongs to."""
        return bisect_right(self.begins, scan) - 1

    def spans(self) -> list[tuple[int, int]]:
        """The first scan of each drive, and the one after its last."""
        return list(pairwise([*self.begins, len(self.poses)]))

    def gaps(self) -> list[int]:
        """The last scans of all drives but the last one: nobody knows the step from there."""
        return [begin - 1 for begin in self.begins[1:]]

    def add(self, pose: Pose2D, points: NDArray[Any], step: Pose2D | None = None) -> None:
        """The next scan."""
        self.poses.append(pose)
        self.steps.append(step)
        self.points.append(points.astype(np.float32))

    def correct_last_poses(self, poses: Sequence[Pose2D]) -> None:
        """The last scans were taken at these poses after all, since odometry had failed; keyframes
        among them move along."""
        first = len(self.poses) - len(poses)
        self.poses[first:] = poses
        for k in range(max(first, 1), len(self.poses)):
            self.steps[k] = self.poses[k - 1].between(self.poses[k])
        begin = bisect_left(self.keyframes, first, key=lambda keyframe: keyframe.scan)
        for k in range(begin, len(self.keyframes)):
            keyframe = self.keyframes[k]
            pose, metres = self.poses[keyframe.scan], 0.0
            if k:
                metres = self._metres_after(self.keyframes[k - 1], pose, keyframe.is_first)
            self.keyframes[k] = replace(keyframe, pose=pose, metres=metres)

    @staticmethod
    def _metres_after(last: Keyframe, pose: Pose2D, is_first: bool) -> float:
        return last.metres + last.pose.distance(pose) + TEAR_M * is_first

    def add_keyframe(
        self,
        perception: Perception,
        match: InformationMatrix | None,
        odometry: MotionModel,
        alone: StandardDeviations = CERTAIN,
        lost_since: int | None = None,
    ) -> None:
        """The last scan is a keyframe.

        Args:
            match: information on its pose from the local map, in its own frame; None if the scan
                was not matched.
            alone: how far off odometry alone may be, see `step_covariance`.
            lost_since: where the map begins anew with it, the first scan that was lost.
        """
        motion, metres, pose = Pose2D(), 0.0, self.poses[-1]
        if self.keyframes:
            last, is_first = self.keyframes[-1], lost_since is not None
            motion, metres = last.pose.between(pose), self._metres_after(last, pose, is_first)
        covariance = step_covariance(motion, match, odometry, alone)
        scan = len(self.poses) - 1
        self.keyframes.append(Keyframe(scan, pose, perception, covariance, metres, lost_since))


def step_covariance(
    motion: Pose2D,
    match: InformationMatrix | None,
    odometry: MotionModel,
    alone: StandardDeviations = CERTAIN,
) -> Covariance:
    """Of a motion from keyframe to keyframe, in the frame where it ends.

    Map and odometry together say where the robot is: their information adds up. Neither is better
    than tracking is at best, which is added.

    Args:
        alone: how far off odometry alone may be, at least: what has added up over scans that were
            not matched.
    """
    way = math.hypot(motion.x, motion.y) + abs(motion.theta)
    xy, theta = odometry.uncertainty(motion).deviations
    information = StandardDeviations(max(xy, alone.xy), max(theta, alone.theta)).information()
    covariance = covariance_from_information(information if match is None else information + match)
    floor: Covariance = max(way, SHORTEST_STEP) * TRACKING_NOISE.covariance()
    return covariance + floor
