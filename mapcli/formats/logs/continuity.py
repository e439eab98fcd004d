"""Whether a log is one recording of one drive.

Two drives that are read as one become one map of two places, and no score tells. Within a recording
odometry goes on from where it was, over a pause of any length too. Another recording begins where
odometry goes on from somewhere else, and one of these says that the wheels are not to blame:

- nothing was recorded for a while before, neither odometry nor scans;
- stamps go back, or did before that was taken out;
- another file begins;
- the laser is elsewhere as well: the first scan after it does not lie on what the last one before
  it saw, as it would if only the wheels had jumped, or it is the log's first scan once more;
- odometry comes back to the old place and leaves it, again and again: two drives are interleaved.

A single record may be nonsense, so odometry must have gone on from the new place for a while.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from mapcli.formats.logs.odometry_track import (
    SAME_M,
    SET_BACK_S,
    SHORTEST_STEP_S,
    OdometryTrack,
    Place,
    Seen,
)
from mapcli.formats.logs.recording_break import Break, Suspicion, duration
from mapcli.model.log import Entry
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.scan import NANOSECONDS, Odometry, RangeScan

GAP_PERIODS, GAP_S = 5.0, 1.0
"""Nothing is recorded when a record is later by more than so many mean periods and seconds."""

LONG_GAP_S = 600.0
"""After so long, a robot that was driven meanwhile, unseen, is on another drive."""

FASTEST_M_S, USUAL_M_S = 10.0, 5.0
"""No robot that maps floor plans is faster than the one. Any may have driven as fast as the other
while nothing was recorded, or as fast as it was seen to."""

AT_ZERO, NEAR_ZERO, AWAY = (1e-6, 1e-6), (0.1, math.radians(5)), (0.5, math.radians(20))
"""Metres and radians. Odometry restarts at zero, or near it when it was not recorded at once.
That it was at zero says nothing where it was near before. Near zero it may also come by itself
while nothing is recorded, when it was not so far away."""

RECENT_S = 10.0
"""Interleaved drives come back within this time."""

CONFIRMING_RECORDS = 10
"""Records that go on from a new place before it counts."""

INTERLEAVED_RETURNS = 10
"""Returns to an old place that tell two interleaved drives, `SAME_M` long at least."""


@dataclass
class _Times:
    """The stamps of records of one kind, in the order of recording (mutable)."""

    count: int = 0
    first_ns: int = 0
    last_ns: int = 0

    def add(self, stamp_ns: int) -> None:
        if not self.count:
            self.first_ns = stamp_ns
        self.last_ns = stamp_ns
        self.count += 1

    def is_gap(self, seconds: float) -> bool:
        """Whether a step between two of them is much longer than the mean."""
        mean = (self.last_ns - self.first_ns) / NANOSECONDS / max(self.count - 1, 1)
        return seconds > max(GAP_S, GAP_PERIODS * mean)


class Continuity:
    """Finds the breaks in a log while it is read (stateful).

    Attributes:
        breaks: found so far.
    """

    def __init__(self) -> None:
        self.breaks: list[Break] = []
        self._odometry, self._scans = _Times(), _Times()
        # The track that odometry is on, and the one that it left.
        self._track: OdometryTrack | None = None
        self._left: OdometryTrack | None = None
        self._suspicion: Suspicion | None = None
        self._first: Seen | None = None
        # Of the scans since odometry went on: the longest step, and how many after it left.
        self._scan_step_s, self._scans_since = 0.0, 0
        self._longest_m, self._speed, self._returns = 0.0, USUAL_M_S, 0

    def watched(self, records: Iterable[Entry], place: Callable[[], Place]) -> Iterator[Entry]:
        """The records.

        Args:
            records: in the order in which they were recorded.
            place: tells where the last record was.
        """
        for record in records:
            at = place()
            if isinstance(record, Odometry) and not at.is_damaged:
                self._add_odometry(record, at)
            elif isinstance(record, RangeScan) and not at.is_damaged:
                self._add_scan(record, at.part)
            yield record

    def _add_scan(self, scan: RangeScan, part: int) -> None:
        times, stamp_ns = self._scans, scan.stamp_ns
        step_s = (stamp_ns - times.last_ns) / NANOSECONDS if times.count else 0.0
        self._scan_step_s = max(self._scan_step_s, step_s)
        self._scans_since += 1
        if self._track is None:
            self._watch_scans_alone(step_s, stamp_ns, part)
        else:
            self._track.add(scan)
            self._first = self._first or self._track.first
        times.add(stamp_ns)

    def _watch_scans_alone(self, step_s: float, stamp_ns: int, part: int) -> None:
        """Without odometry, nothing goes on over a long gap."""
        if step_s > LONG_GAP_S:
            what = f"nothing was recorded for {duration(step_s)}, and no odometry goes on over it"
            found = Break(what, self._scans.last_ns, stamp_ns, (part, part))
            self._suspicion, self._scans_since = Suspicion(found, is_gap=True), 0
        elif step_s < -SET_BACK_S:
            self._suspicion = None  # the stamp before was nonsense
        elif self._suspicion and self._scans_since == CONFIRMING_RECORDS:
            self.breaks.append(self._suspicion.found)
            self._suspicion = None

    def _add_odometry(self, odometry: Odometry, place: Place) -> None:
        track, left = self._track, self._left
        if track is None:
            self._track, self._suspicion = OdometryTrack.of(odometry, place), None
        elif self._goes_on(track, odometry, place):
            track.extend(odometry, place)
            if self._suspicion is None:
                self._scan_step_s = 0.0
            elif track.records >= CONFIRMING_RECORDS and self._scans_since:
                self._decide(self._suspicion)
        elif left is not None and self._returns_to(left, odometry, place, track):
            self._return(left, odometry, place)
        else:
            self._leave(track, odometry, place)
        self._odometry.add(odometry.stamp_ns)

    def _goes_on(self, track: OdometryTrack, odometry: Odometry, place: Place) -> bool:
        """Whether odometry goes on from where it was."""
        step_s, metres = track.seconds_to(odometry), track.pose.distance(odometry.pose)
        if _differs(track.pose, NEAR_ZERO) and not _differs(odometry.pose, AT_ZERO):
            return False
        is_near, is_set_back = metres <= SAME_M, track.is_set_back(odometry, place)
        if not is_set_back and (step_s <= GAP_S or not self._odometry.is_gap(step_s)):
            if metres > self._longest_m and is_near:
                self._longest_m = metres
                self._speed = max(self._speed, metres / max(step_s, SHORTEST_STEP_S))
            return is_near or track.reaches(odometry, FASTEST_M_S)
        if _differs(track.pose, AWAY) and not _differs(odometry.pose, NEAR_ZERO):
            return False
        is_short = not is_set_back and step_s <= LONG_GAP_S
        return is_near or (is_short and track.reaches(odometry, self._speed))

    def _returns_to(
        self, left: OdometryTrack, odometry: Odometry, place: Place, track: OdometryTrack
    ) -> bool:
        """Whether odometry goes on from the track before, after nonsense or interleaved."""
        if abs(left.seconds_to(odometry)) <= RECENT_S:
            return left.reaches(odometry, FASTEST_M_S)
        return track.records < CONFIRMING_RECORDS and self._goes_on(left, odometry, place)

    def _return(self, left: OdometryTrack, odometry: Odometry, place: Place) -> None:
        """Go back to the track before; often enough, and it is another drive."""
        track = self._track
        assert track is not None
        left.extend(odometry, place)
        self._track, self._left, self._suspicion = left, track, None
        self._returns += left.start.distance(left.pose) > SAME_M < track.start.distance(track.pose)
        if self._returns == INTERLEAVED_RETURNS:
            what = "odometry goes back and forth between two places, on from each of them"
            parts = track.place.part, place.part
            self.breaks.append(Break(what, track.stamp_ns, odometry.stamp_ns, parts, mixed=True))

    def _leave(self, track: OdometryTrack, odometry: Odometry, place: Place) -> None:
        """Begin a new track, and note what speaks for another recording."""
        self._track, self._left = OdometryTrack.of(odometry, place), track
        self._returns = self._scans_since = 0
        step_s, is_other_file = track.seconds_to(odometry), place.part != track.place.part
        is_set_back, is_gap = track.is_set_back(odometry, place), self._odometry.is_gap(step_s)
        what = "odometry starts again" + (
            f", {duration(-step_s)} before the time it had reached"
            if step_s < -SET_BACK_S
            else " where a clock was set"
            if is_set_back
            else f" after nothing was recorded for {duration(step_s)}"
            if is_gap
            else ""
        )
        if _differs(odometry.pose, NEAR_ZERO):
            what += f", {track.pose.distance(odometry.pose):,.1f} m from where it was"
        parts = track.place.part, place.part
        found = Break(what, track.stamp_ns, odometry.stamp_ns, parts, mixed=is_set_back)
        is_certain = is_set_back or is_other_file
        self._suspicion = Suspicion(found, is_gap, is_certain, track, self._track)

    def _decide(self, suspicion: Suspicion) -> None:
        is_silent = suspicion.is_gap and self._scans.is_gap(self._scan_step_s)
        if suspicion.is_certain or is_silent:
            self.breaks.append(suspicion.found)
        elif found := suspicion.by_scans(self._first):
            self.breaks.append(found)
        self._suspicion = None


def _differs(pose: Pose2D, limits: tuple[float, float]) -> bool:
    """Whether a pose is farther from zero than so many metres or radians."""
    metres, radians = limits
    return math.hypot(pose.x, pose.y) > metres or abs(wrap_angle(pose.theta)) > radians
