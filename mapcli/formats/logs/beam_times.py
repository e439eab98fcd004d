"""When the beams of a log's scans are taken: what its `time_increment` is worth.

Drivers that know the time from beam to beam publish it; others leave it 0, and some publish
nonsense: days, or seconds as if they were milliseconds. All beams count as taken at once then,
unless the scans show otherwise (`algorithms.slam.sweep_search`) or somebody says how long a turn
takes.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from mapcli.model.log import Entry, LogOptions
from mapcli.model.scan import NANOSECONDS, Mount, RangeScan
from mapcli.model.sweep import BeamTiming
from mapcli.model.sweep_summary import turn_time

CHECKED_SCANS = 100
"""Scans whose stamps tell how often scans come."""

LONGEST_SWEEP = 1.1
"""A sweep takes at most so many times what is between two stamps: no laser begins the next one
before it has ended the last."""

SHORTEST_TURN_S = 1e-3
"""No laser turns a thousand times a second; those on robots turn 5 to 100 times."""


def with_beam_times(
    records: Iterable[Entry], options: LogOptions, note: Callable[[str], None]
) -> Iterator[Entry]:
    """The records, scans with the times at which their beams are taken.

    Args:
        records: in stamp order; scans with the log's own time from beam to beam.
        options: `scan_stamp`, `turn_time` and `beam_order`.
        note: called with a sentence about times that are not used.
    """
    if options.turn_time is not None:  # 0: all at once, which is not searched for then
        for record in records:
            yield _turning(record, options.turn_time, options)
        return
    untold = BeamTiming(0.0, options.scan_stamp, None)
    records = iter(records)
    for record in records:
        if isinstance(record, RangeScan) and record.timing.increment != 0:
            held = [record, *_next_scans(records)]
            check = _IncrementCheck(held, options, note)
            yield from map(check.timed, held)
            yield from map(check.timed, records)
        elif isinstance(record, RangeScan) and record.timing.order is None:
            yield record if record.timing == untold else replace(record, timing=untold)
        else:
            yield record


def _turning(record: Entry, turn_time: float, options: LogOptions) -> Entry:
    """A scan of a laser whose full turn takes so many seconds."""
    if not isinstance(record, RangeScan):
        return record
    increment = turn_time * abs(record.angle_increment) / math.tau
    return replace(record, timing=_timing(increment, options))


def _timing(increment: float, options: LogOptions) -> BeamTiming:
    order = options.beam_order if increment else "forward"
    return BeamTiming(increment, options.scan_stamp, order)


def _next_scans(records: Iterator[Entry]) -> Iterator[Entry]:
    """The records until there were scans enough to tell how often they come."""
    scans = 0
    while scans < CHECKED_SCANS and (some := list(islice(records, 1))):
        scans += isinstance(some[0], RangeScan)
        yield some[0]


def _periods(records: Iterable[Entry]) -> defaultdict[Mount, float]:
    """Median seconds from scan to scan of each laser; 0 where that is not known."""
    stamps = defaultdict[Mount, list[int]](list)
    for record in records:
        if isinstance(record, RangeScan):
            stamps[record.mount].append(record.stamp_ns)
    steps = {mount: np.diff(times) / NANOSECONDS for mount, times in stamps.items()}
    medians = {mount: float(np.median(some)) for mount, some in steps.items() if len(some)}
    return defaultdict(float, medians)


class _IncrementCheck:
    """Whether times from beam to beam can be believed (stateful: it says once that they cannot)."""

    def __init__(
        self, records: list[Entry], options: LogOptions, note: Callable[[str], None]
    ) -> None:
        self._periods = _periods(records)
        self._options, self._note = options, note
        self._is_said = False

    def timed(self, record: Entry) -> Entry:
        """A scan with the times of its beams; without any if those of the log make no sense."""
        if not isinstance(record, RangeScan) or record.timing.increment == 0:
            return record
        increment = record.timing.increment
        span, period = record.timing.span(len(record.ranges)), self._periods[record.mount]
        if span <= LONGEST_SWEEP * period and turn_time(record) >= SHORTEST_TURN_S:
            return replace(record, timing=_timing(increment, self._options))
        self._say(increment, span, period)
        return replace(record, timing=BeamTiming(0.0, self._options.scan_stamp, None))

    def _say(self, increment: float, span: float, period: float) -> None:
        if self._is_said:
            return
        self._is_said = True
        self._note(
            f"time_increment is {increment:g} s, {span:,.4g} s from the first beam to the last "
            f"where scans come every {period:.4g} s: not used, all beams count as taken at once "
            "unless the scans show otherwise"
        )
