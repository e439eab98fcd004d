"""When the beams of a scan are taken, found from the log.

Messages do not tell which end of the array is the oldest: many drivers of lasers that spin
clockwise flip it. Many do not tell that beams are taken one after another at all. But scans that
were taken while the robot moved show it: deskewed as they should not be, they do not fit the map
that they make. So the first scans that the robot moves under are tracked by themselves, under one
assumption and under another (`sweep_trial`), and their scores tell which is right. Where the log
tells no times, none are assumed unless scans fit better with them beyond doubt.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, TypeGuard

from mapcli.algorithms.scans.apparent_motion import MOVED_M, metres_moved
from mapcli.algorithms.scans.odometry_interpolation import ScanAtOdometry, odometry_at_scans
from mapcli.model.scan import RangeScan, Record, in_order, turning
from mapcli.model.sweep import BeamOrder

if TYPE_CHECKING:
    from mapcli.algorithms.slam.slam import SlamParameters
    from mapcli.algorithms.slam.sweep_hypotheses import OrderSearch, TimeSearch

BEFORE = 5
"""Scans before the first under which the robot moves, which show what is there."""

MOST_SEARCHES = 10
"""Searches after which the log counts as one that shows nothing."""


class SweepSearch:
    """The search for the times of a log's beams (stateful).

    Attributes:
        was_needed: whether there were scans whose order was not known.
        order: the order that the log shows; None before, and where it shows none.
        turn_s: seconds of a turn that the scans show where the log tells none; 0 if they do not.
    """

    def __init__(self, parameters: SlamParameters | None = None) -> None:
        self._parameters = parameters
        self.was_needed = False
        self.order: BeamOrder | None = None
        self.turn_s = 0.0
        self._searches = 0

    def settled(self, records: Iterable[Record]) -> Iterator[Record]:
        """The records; those scans whose order is not known get the times that are found, and are
        held back until they are."""
        records = iter(records)
        for record in records:
            if not (_is_open(record) and self._is_on()):
                yield self._timed(record)
                continue
            held, stopped = deque[Record]([record]), None
            try:
                yield from self._search(held, records)
            except KeyboardInterrupt as interrupt:  # what was read is not lost
                stopped = interrupt
            yield from map(self._timed, held)
            if stopped is not None:
                raise stopped

    def _is_on(self) -> bool:
        """Whether there is still something to find, now that there is a scan of unknown order."""
        self.was_needed = True
        return self.order is None and self._searches < MOST_SEARCHES

    def _search(self, held: deque[Record], records: Iterator[Record]) -> Iterator[Record]:
        """One search; yields the records of the time before the robot moves. What was read beyond
        is left in `held`."""
        # Most logs tell, and need no compiled loops then: `mapcli info` is fast.
        from mapcli.algorithms.slam.sweep_hypotheses import TimeSearch, search_for

        search: OrderSearch | TimeSearch | None = None
        some = deque[ScanAtOdometry](maxlen=BEFORE + 1)
        for one in odometry_at_scans(_kept(records, held)):
            some.append(one)
            if search is not None:
                search.step(*one)
            elif _may_move(some):
                search = search_for(one[0], self._parameters)
                for each in some:
                    search.step(*each)
            if search is not None and search.is_over:
                break
            while search is None and held[0].stamp_ns < some[0][0].stamp_ns:
                yield self._timed(held.popleft())
        self._searches += 1
        if search is not None:
            self.order, self.turn_s = search.result(held)
            if isinstance(search, TimeSearch) and search.is_over:
                self._searches = MOST_SEARCHES  # the log has shown that there is nothing to find

    def _timed(self, record: Record) -> Record:
        """A scan with the times that were found; all other records as they are."""
        if not _is_open(record):
            return record
        order = self.order or "forward"
        return (
            in_order(record, order)
            if record.timing.increment
            else turning(record, self.turn_s, order)
        )


def _is_open(record: Record) -> TypeGuard[RangeScan]:
    """Whether a record is a scan whose order is not known."""
    return isinstance(record, RangeScan) and record.timing.order is None


def _kept(records: Iterator[Record], held: deque[Record]) -> Iterator[Record]:
    """What is held, and the records that follow, which are held then."""
    yield from list(held)
    for record in records:
        held.append(record)
        yield record


def _may_move(some: Sequence[ScanAtOdometry]) -> bool:
    """Whether the robot moves between the last two of some scans, as far as odometry tells; without
    any, when there are scans before."""
    (_, before), (scan, now) = some[max(len(some) - 2, 0)], some[-1]
    if before is None or now is None:
        return len(some) > BEFORE and all(odom is None for _, odom in some)
    return metres_moved(scan, before.between(now)) >= MOVED_M
