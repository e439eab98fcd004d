"""Odometry that goes on from where it was, and what lasers saw on the way."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from mapcli.model.pose import Pose2D
from mapcli.model.scan import NANOSECONDS, Mount, Odometry, RangeScan

SAME_M = 1.0
"""Odometry goes on from where it was within this, whatever the time: robots are turned and pushed.
It is also what the fastest one does in the shortest step."""

SHORTEST_STEP_S = 0.1
"""Stamps come in bursts; a step counts as at least this long."""


SET_BACK_S = 1.0
"""Stamps go back when one is before the last one by more; less is disorder."""


class Seen(NamedTuple):
    """A scan, and odometry when it was taken."""

    scan: RangeScan
    odometry: Pose2D


class Place(NamedTuple):
    """Of a record in the log.

    Attributes:
        part: number of its file.
        steps: times that a clock was set before it, which was taken out of the stamps.
        is_damaged: what was read there is no sign of another recording.
    """

    part: int = 0
    steps: int = 0
    is_damaged: bool = False


@dataclass
class OdometryTrack:
    """Odometry that goes on from where it was (mutable).

    Attributes:
        start, pose: the first pose and the last one; stamp_ns, place: of the last one.
        records: of odometry.
        first: the first scan.
        seen: the last scans of each laser before odometry went on, two at most; `_since`: and
            after it.
    """

    start: Pose2D
    pose: Pose2D
    stamp_ns: int
    place: Place
    records: int = 1
    first: Seen | None = None
    seen: dict[Mount, tuple[Seen, ...]] = field(default_factory=dict)
    _since: list[Seen] = field(default_factory=list)

    @classmethod
    def of(cls, odometry: Odometry, place: Place) -> OdometryTrack:
        return cls(odometry.pose, odometry.pose, odometry.stamp_ns, place)

    def extend(self, odometry: Odometry, place: Place) -> None:
        self.pose, self.stamp_ns, self.place = odometry.pose, odometry.stamp_ns, place
        self.records += 1
        for one in self._since:
            self.seen[one.scan.mount] = *self.seen.get(one.scan.mount, ())[-1:], one
        self._since.clear()

    def add(self, scan: RangeScan) -> None:
        """The next scan; that it was taken on this track is known when odometry goes on."""
        self._since.append(Seen(scan, self.pose))
        self.first = self.first or self._since[-1]

    def seconds_to(self, odometry: Odometry) -> float:
        return (odometry.stamp_ns - self.stamp_ns) / NANOSECONDS

    def is_set_back(self, odometry: Odometry, place: Place) -> bool:
        """Whether stamps went back, or a clock was set, since its last record."""
        return self.seconds_to(odometry) < -SET_BACK_S or place.steps != self.place.steps

    def reaches(self, odometry: Odometry, speed: float) -> bool:
        """Whether a robot of a speed, metres per second, may have driven on so."""
        seconds = max(self.seconds_to(odometry), SHORTEST_STEP_S)
        return self.pose.distance(odometry.pose) <= speed * seconds
