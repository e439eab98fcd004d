"""What a person knows of drives, by the numbers of their scans, and whether it is so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from mapcli.algorithms.slam.contradictions import compare_scans
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.known_places import KnownPlaces, SameScans
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.scan_sample import sample_of_keyframes
from mapcli.algorithms.slam.trusted_odometry import with_trusted_odometry
from mapcli.algorithms.slam.verdict import CONTRADICTED, FEWEST
from mapcli.errors import DataError
from mapcli.model.knowledge import Knowledge, Moment, scan_at
from mapcli.model.pose import Pose2D
from mapcli.model.trace import TracedPose


@dataclass(frozen=True, eq=False)
class PersonsView:
    """What a person knows of the scans of one drive, or of several, one after the other.

    Attributes:
        places: that are one, or are not.
        trusted: spans of scans in which odometry is right, and what was typed.
        odometry: its pose at each scan.
    """

    places: KnownPlaces
    trusted: tuple[tuple[int, int, str], ...]
    odometry: tuple[Pose2D | None, ...]

    @classmethod
    def of(
        cls, knowledge: Knowledge, drives: Sequence[tuple[str, Sequence[TracedPose]]]
    ) -> PersonsView:
        """The same by the numbers of scans.

        Args:
            drives: name and scans of each; the name of an only one is empty.

        Raises:
            DataError: a time or a drive that there is not.
        """
        begins = [0, *accumulate(len(poses) for _, poses in drives)]
        stamps = {name: [one.stamp_ns for one in poses] for name, poses in drives}
        first = dict(zip(stamps, begins, strict=False))

        def number(moment: Moment) -> int:
            if moment.drive not in stamps:
                known = ", ".join(f"{name}:SECONDS" for name in stamps if name) or "SECONDS"
                raise DataError(f"{moment} is a time of no drive", expected=known)
            return first[moment.drive] + scan_at(moment, stamps[moment.drive])

        same = []
        for told in knowledge.same:
            one, other, pose = number(told.one), number(told.other), told.pose
            if one > other:
                one, other, pose = other, one, pose and pose.inverse()
            same.append(SameScans(one, other, pose, str(told)))
        apart = tuple((number(told.one), number(told.other)) for told in knowledge.apart)
        trusted = tuple(
            (number(told.first), number(told.last), str(told)) for told in knowledge.trusted
        )
        odometry = tuple(one.odom for _, poses in drives for one in poses)
        return cls(KnownPlaces(tuple(same), apart), trusted, odometry)

    def followed(
        self, trajectory: TrackedTrajectory, model: MotionModel
    ) -> tuple[TrackedTrajectory, list[str]]:
        """The trajectory that follows odometry where that is right, and what was typed of spans in
        which it is not: scans contradict it there, and do not contradict tracking."""
        wrong = []
        for first, last, line in self.trusted:
            span = [(first, last)]
            trusting = with_trusted_odometry(trajectory, self.odometry, span, model)
            if _torn(trusting) > _torn(trajectory) + FEWEST:
                wrong.append(line)
            else:
                trajectory = trusting
        return trajectory, wrong


def _torn(trajectory: TrackedTrajectory) -> int:
    """How many scans those taken shortly before and after contradict."""
    sample = sample_of_keyframes(trajectory.keyframes)
    agreements = compare_scans(sample, trajectory.poses, trajectory.begins)
    return sum((one.near or 0.0) > CONTRADICTED for one in agreements)
