"""Odometry interpolated at the stamp of each scan (Algorithm 9.2, line 3 needs it there), and at
the times of its beams, where they are not taken all at once."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from operator import attrgetter

import numpy as np

from mapcli.algorithms.scans.gathering import SHORT_WAY_M, gathered
from mapcli.model.pose import Pose2D, interpolate
from mapcli.model.scan import NANOSECONDS, Odometry, RangeScan, Record
from mapcli.model.sweep import SweepMotion

PATIENCE_NS = 2_000_000_000
"""Nanoseconds: how much later than a scan records may be before its odometry is no longer waited
for."""

EXTRAPOLATION_NS = 500_000_000
"""Nanoseconds after the last odometry before a silence in which its motion is extrapolated."""


REMEMBERED = 4096
"""Records of odometry that are remembered for the beams of a scan: seconds of them."""


ScanAtOdometry = tuple[RangeScan, Pose2D | None]
"""A scan, with the odometry's pose at its stamp; None where that is silent."""


def odometry_at_scans(
    records: Iterable[Record], way_m: float = SHORT_WAY_M
) -> Iterator[ScanAtOdometry]:
    """Each scan with the odometry pose interpolated at its stamp; a scan whose beams are taken one
    after another gets the robot's `motion` meanwhile, by odometry, if that is known. Readings of
    several sensors with one beam become one scan (`gathering`).

    Args:
        records: in stamp order; poses other than odometry are passed over.
        way_m: metres of way over which readings are gathered.

    Yields:
        Scans in order. None where odometry is silent: before its first record, and from half a
        second after a record on (until then it is extrapolated) when none follows in two seconds.
    """
    return gathered(_interpolated(records), way_m)


def _interpolated(records: Iterable[Record]) -> Iterator[ScanAtOdometry]:
    waiting: deque[RangeScan] = deque()
    known = _KnownOdometry()
    for record in records:
        if isinstance(record, RangeScan):
            waiting.append(record)
        elif isinstance(record, Odometry):
            known.add(record)
        while waiting and known.suffices(waiting[0], record.stamp_ns):
            yield known.at_scan(waiting.popleft())
    for scan in waiting:
        yield known.at_scan(scan)


class _KnownOdometry:
    """The last records of odometry (stateful: `add` changes it)."""

    def __init__(self) -> None:
        self._records: deque[Odometry] = deque(maxlen=REMEMBERED)

    def add(self, record: Odometry) -> None:
        self._records.append(record)

    def suffices(self, scan: RangeScan, now_ns: int) -> bool:
        """Whether nothing that is still to come tells more about a scan."""
        if self._records and self._records[-1].stamp_ns >= scan.last_ns:
            return True
        return now_ns - scan.last_ns > PATIENCE_NS

    def at_scan(self, scan: RangeScan) -> ScanAtOdometry:
        """A scan, with its motion if its beams are not taken at once, and the pose at its stamp."""
        odom = self._pose(scan.stamp_ns)
        if odom is None or scan.first_ns == scan.last_ns:
            return scan, odom
        return replace(scan, motion=self._motion(scan, odom)), odom

    def _motion(self, scan: RangeScan, at_stamp: Pose2D) -> SweepMotion:
        """The robot's motion from the first beam to the last, as far as it is known."""
        begin, end = self._after(scan.first_ns), self._after(scan.last_ns)
        counted = [self._records[i].stamp_ns for i in range(begin, end)]
        stamps = sorted({scan.first_ns, scan.stamp_ns, *counted, scan.last_ns})
        poses = {stamp: pose for stamp in stamps if (pose := self._pose(stamp)) is not None}
        moved = [at_stamp.between(pose) for pose in poses.values()]
        return SweepMotion(
            np.array([(stamp - scan.stamp_ns) / NANOSECONDS for stamp in poses]),
            np.array([(pose.x, pose.y, pose.theta) for pose in moved]),
        )

    def _after(self, stamp_ns: int) -> int:
        """The place of the first record after a moment: nearly always that of the last one, or
        none."""
        known = self._records
        if known and known[-1].stamp_ns <= stamp_ns:
            return len(known)
        if len(known) > 1 and known[-2].stamp_ns <= stamp_ns < known[-1].stamp_ns:
            return len(known) - 1
        return bisect_right(known, stamp_ns, key=_stamp_ns)

    def _pose(self, stamp_ns: int) -> Pose2D | None:
        """The pose at a moment, as `odometry_at_scans` yields it."""
        known, i = self._records, self._after(stamp_ns)
        if i == 0:
            return None
        last = known[i - 1]
        if i < len(known):
            return _between(last, known[i], stamp_ns)
        return _extrapolated(known[i - 2] if i > 1 else last, last, stamp_ns)


def _between(before: Odometry, after: Odometry, stamp_ns: int) -> Pose2D:
    fraction = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
    return interpolate(before.pose, after.pose, fraction)


def _extrapolated(before: Odometry, last: Odometry, stamp_ns: int) -> Pose2D | None:
    """The pose after the last odometry, at the speed that it had, for a short while."""
    if stamp_ns - last.stamp_ns > EXTRAPOLATION_NS:
        return None
    if stamp_ns == last.stamp_ns or last.stamp_ns == before.stamp_ns:
        return last.pose
    fraction = (stamp_ns - before.stamp_ns) / (last.stamp_ns - before.stamp_ns)
    return interpolate(before.pose, last.pose, fraction)


_stamp_ns = attrgetter("stamp_ns")
