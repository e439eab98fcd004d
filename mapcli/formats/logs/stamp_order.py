"""Records waiting to be given out in the order of their stamps."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from operator import attrgetter

from mapcli.model.log import Entry
from mapcli.model.scan import Odometry, RangeScan, Record


class InStampOrder(deque[Entry]):
    """Records sorted by stamp, equal ones in the order of their arrival (`add`)."""

    def add(self, record: Entry) -> None:
        if not self or self[-1].stamp_ns <= record.stamp_ns:
            self.append(record)  # as nearly all come
        else:
            self.insert(bisect_right(self, record.stamp_ns, key=_stamp_ns), record)


_stamp_ns = attrgetter("stamp_ns")


def plural_of(record: Record) -> str:
    """What such records are called."""
    if isinstance(record, RangeScan):
        return "scans"
    return "odometry records" if isinstance(record, Odometry) else "poses"
