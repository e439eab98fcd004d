"""The part of a log that is asked for: a window of time, and every N-th scan of it."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import inf
from typing import overload

from mapcli.model.log import Entry, MissedScans
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import Odometry, RangeScan, Record

LONGEST_WAIT_S = 10.0
"""How long `select` looks for odometry and a scan beyond the end before it gives up, seconds."""


@overload
def select(
    records: Iterable[Record],
    start_s: float | None = None,
    end_s: float | None = None,
    every: int = 1,
) -> Iterator[Record]: ...
@overload
def select(
    records: Iterable[Entry],
    start_s: float | None = None,
    end_s: float | None = None,
    every: int = 1,
) -> Iterator[Entry]: ...
def select(
    records: Iterable[Entry],
    start_s: float | None = None,
    end_s: float | None = None,
    every: int = 1,
) -> Iterator[Entry]:
    """Every `every`-th scan from `start_s` to `end_s`, with the odometry around them; of sensors
    with one beam, every so-manieth reading of each.

    Missed scans count like others: the scans chosen are those that would be, had none been missed.

    Args:
        records: in stamp order.
        start_s, end_s: seconds after the first record; None is the log's own start or end.
        every: 1 keeps all scans.

    Yields:
        The scans of that window, all odometry in it, and the last odometry before and the first
        one after it, between which the poses at the first and the last scan are interpolated.
    """
    if start_s is None and end_s is None and every == 1:
        yield from records
        return
    scans, readings = 0, Counter[str]()
    for record in _window(records, start_s, end_s):
        if isinstance(record, MissedScans):
            chosen = range(-scans % every, record.count, every)
            scans += record.count
            if chosen:
                yield replace(record, count=len(chosen))
            continue
        if isinstance(record, RangeReading):
            readings[record.sensor] += 1
            if (readings[record.sensor] - 1) % every:
                continue
        elif isinstance(record, RangeScan):
            scans += 1
            if (scans - 1) % every:
                continue
        yield record


def _window(
    records: Iterable[Entry], start_s: float | None, end_s: float | None
) -> Iterator[Entry]:
    origin: int | None = None
    before: Record | None = None
    beyond: set[type] = set()
    for record in records:
        if isinstance(record, MissedScans):
            missed = _within(record, record.stamp_ns if origin is None else origin, start_s, end_s)
            if missed.count:
                yield missed
            continue
        origin = record.stamp_ns if origin is None else origin
        elapsed = (record.stamp_ns - origin) * 1e-9
        if start_s is not None and elapsed < start_s:
            before = record if isinstance(record, Odometry) else before
            continue
        if before is not None:
            yield before
            before = None
        if end_s is None or elapsed <= end_s:
            yield record
            continue
        if isinstance(record, Odometry) and Odometry not in beyond:
            yield record
        beyond.add(RangeScan if isinstance(record, RangeScan) else type(record))
        # Before the next scan it is not known when those were taken that are missed.
        if beyond >= {Odometry, RangeScan} or elapsed > end_s + LONGEST_WAIT_S:
            return


def _within(
    missed: MissedScans, origin: int, start_s: float | None, end_s: float | None
) -> MissedScans:
    """Those in the window; maybe none."""

    def elapsed(number: int) -> float:
        return (missed.stamp_of(number) - origin) * 1e-9

    numbers = range(missed.count)
    start = bisect_left(numbers, -inf if start_s is None else start_s, key=elapsed)
    stop = bisect_right(numbers, inf if end_s is None else end_s, key=elapsed)
    return missed.part(start, max(start, stop))
