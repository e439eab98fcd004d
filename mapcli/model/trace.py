"""The pose trace: what a replay found out about every scan."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import InformationTriangle
from mapcli.model.trajectory import Trajectory

Status = Literal["first", "matched", "odometry"]
STATUSES: dict[str, Status] = {word: word for word in get_args(Status)}


@dataclass(frozen=True, slots=True)
class TracedPose:
    """Where the robot was at one scan.

    Attributes:
        stamp_ns: the scan's stamp.
        pose: `map_from_robot`.
        odom: `odom_from_robot` at that stamp; None where odometry is silent.
        score: how well the scan agrees with the map where they overlap, 0 to 1; None when it was
            not compared.
        status: `first` starts the map, `matched` was found in it, `odometry` was carried on by
            odometry alone, because the scan said too little; None in traces of other programs.
    """

    stamp_ns: int
    pose: Pose2D
    odom: Pose2D | None
    score: float | None
    status: Status | None


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop closure: the pose at index `to` as seen from the one at index `from_`.

    Attributes:
        score: how well the scan at `to` agrees with what was seen around `from_`, 0 to 1; None in
            traces of other programs.
        information: how certain the match is, in the frame of the pose at `to`; None if unknown.
    """

    from_: int
    to: int
    pose: Pose2D
    score: float | None
    information: InformationTriangle | None = None


@dataclass(frozen=True)
class PoseTrace:
    """The poses of a replay in time order, and the loops that were closed.

    Attributes:
        steps: the motions from each pose to the next as they were measured, before loops were
            closed; empty where they are those of the poses themselves.
    """

    poses: tuple[TracedPose, ...]
    loops: tuple[Loop, ...] = ()
    steps: tuple[Pose2D, ...] = ()

    def trajectory(self) -> Trajectory:
        """The poses as arrays."""
        poses = [(traced.pose.x, traced.pose.y, traced.pose.theta) for traced in self.poses]
        stamps = np.array([traced.stamp_ns for traced in self.poses], dtype=np.int64)
        return Trajectory(np.array(poses, dtype=np.float64).reshape(-1, 3), stamps)

    def distance(self) -> float:
        """Metres driven."""
        return sum(a.pose.distance(b.pose) for a, b in pairwise(self.poses))

    def mean_score(self) -> float | None:
        """Mean score of the poses that have one."""
        scores = [pose.score for pose in self.poses if pose.score is not None]
        return sum(scores) / len(scores) if scores else None
