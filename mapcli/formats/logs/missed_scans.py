"""When scans were taken that cannot be read: between the scans around them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from mapcli.model.log import Entry, MissedScans
from mapcli.model.scan import RangeScan


def with_stamps(records: Iterable[Entry]) -> Iterator[Entry]:
    """The records, with stamps for missed scans that have none.

    They lie evenly between the scan before and the one after; at the end of the log they follow
    each other as the last scans did, at its start they come with the first scan.
    """
    waiting: list[MissedScans] = []
    last, period = None, 0
    for record in records:
        if isinstance(record, MissedScans) and record.first_ns is None:
            waiting.append(record)
            continue
        if isinstance(record, (RangeScan, MissedScans)):
            stamp = record.stamp_ns
            start = stamp if last is None else min(last, stamp)
            if waiting:
                count = sum(missed.count for missed in waiting)
                yield from _evenly(waiting, start, (stamp - start) / (count + 1))
                waiting.clear()
            elif last is not None:
                period = max(stamp - last, 0)
            last = stamp
        yield record
    yield from _evenly(waiting, last or 0, period)


def _evenly(waiting: Iterable[MissedScans], start: int, period: float) -> Iterator[MissedScans]:
    """Missed scans that follow each other from one period after `start` on, nanoseconds."""
    number = 1
    for missed in waiting:
        first, last = (start + round(period * k) for k in (number, number + missed.count - 1))
        yield replace(missed, first_ns=first, last_ns=last)
        number += missed.count
