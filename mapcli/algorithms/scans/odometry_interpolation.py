"""Odometry interpolated at the stamp of each scan (Algorithm 9.2, line 3 needs it there)."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator

from mapcli.model.pose import Pose2D, interpolate
from mapcli.model.scan import Odometry, RangeScan, Record

PATIENCE_NS = 2_000_000_000
"""Nanoseconds: how much later than a scan records may be before its odometry is no longer waited
for."""

EXTRAPOLATION_NS = 500_000_000
"""Nanoseconds after the last odometry before a silence in which its motion is extrapolated."""


def odometry_at_scans(records: Iterable[Record]) -> Iterator[tuple[RangeScan, Pose2D | None]]:
    """Each scan with the odometry pose interpolated at its stamp.

    Args:
        records: in stamp order; poses other than odometry are passed over.

    Yields:
        Scans in order. None where odometry is silent: before its first record, and from half a
        second after a record on (until then it is extrapolated) when none follows in two seconds.
    """
    waiting: deque[RangeScan] = deque()
    known: deque[Odometry] = deque(maxlen=2)
    for record in records:
        if isinstance(record, RangeScan):
            waiting.append(record)
        elif isinstance(record, Odometry):
            while waiting and waiting[0].stamp_ns < record.stamp_ns:
                scan = waiting.popleft()
                yield scan, _between(known, record, scan.stamp_ns)
            known.append(record)
        while waiting and _need_not_wait(waiting[0], known, record.stamp_ns):
            scan = waiting.popleft()
            yield scan, _after(known, scan.stamp_ns)
    for scan in waiting:
        yield scan, _after(known, scan.stamp_ns)


def _need_not_wait(scan: RangeScan, known: deque[Odometry], now_ns: int) -> bool:
    exact = bool(known) and known[-1].stamp_ns == scan.stamp_ns
    return exact or now_ns - scan.stamp_ns > PATIENCE_NS


def _between(known: deque[Odometry], after: Odometry, stamp_ns: int) -> Pose2D | None:
    """The pose interpolated between the last known odometry and the next; None without both."""
    if not known:
        return None
    before = known[-1]
    fraction = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
    return interpolate(before.pose, after.pose, fraction)


def _after(known: deque[Odometry], stamp_ns: int) -> Pose2D | None:
    """The pose after the last known odometry, extrapolated at its last speed for a short while."""
    if not known or stamp_ns - known[-1].stamp_ns > EXTRAPOLATION_NS:
        return None
    last = known[-1]
    if len(known) == 1 or stamp_ns == last.stamp_ns or last.stamp_ns == known[0].stamp_ns:
        return last.pose
    fraction = (stamp_ns - known[0].stamp_ns) / (last.stamp_ns - known[0].stamp_ns)
    return interpolate(known[0].pose, last.pose, fraction)
