"""Readings that mean "nothing seen", told by how often a log has them.

Many drivers write a number where no echo came: 65.535, a metre more than the maximum, or something
that spreads over some centimetres below it. Taken for ends of beams these are walls around the
robot wherever it goes. They stand out of a log's readings as a heap: narrow, near the largest
reading, and more than all readings of the tenth of the range below it, where real ones grow rarer
smoothly. A wall can heap up like that only while the robot stands still, or within the few degrees
around its normal. So scans are surveyed at places some way apart, and a heap means no return if it
is seen from many of them, or in arcs too wide for a wall (without odometry only these tell). A
sensor with one beam tells neither: beside a wall it reads the same all the way.

This is the one place that knows such codes: `Log.records` passes all scans through it.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.logs.rep117 import single
from mapcli.model.log import BeamCounts, Entry
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount, Odometry, RangeScan

BIN_M = 0.01
"""Width of a bin of the histogram, metres: about what lasers and logs resolve."""
BINS = 25_000
"""Up to 250 m, beyond which no laser for robots sees."""

PLACE_M, PLACE_NS = 0.5, 1_000_000_000
"""One scan is surveyed for each half metre of way by odometry; without any, one for each second.
After each look at the histogram places are twice as far apart: a log of any length costs little."""
PLACES = 200
"""Places from one look at the histogram to the next."""
MOST_SCANS, MOST_RECORDS = 1000, 10_000
"""So many are held back at most until the first look: some MB."""

HALF_WIDTH = 0.003
"""Of a heap, as a share of the reading: 15 cm at 50 m."""
TAIL = 0.1
"""How far below a heap readings are compared with it, as a share of the reading."""
LEAST_BEAMS, LEAST_PLACES = 20, 5
"""A heap has so many beams, and is seen from so many places, or in arcs that begin at so many."""
BEYOND = 0.1
"""Readings beyond a heap, as a share of it, at most: stray ones. Where there are more, the sensor
really sees farther."""
STANDS_OUT = 10
"""Of a heap those readings are codes that are so many times as usual as those in its tail."""

WALL_ARC = 2 * math.acos(1 / (1 + 2 * HALF_WIDTH))
"""Radians: a flat wall is equally far, to the width of a heap, across no wider an angle."""


class _Histogram:
    """How often each reading occurs, by bins, shape (BINS,) each (stateful).

    Attributes:
        beams: with that reading; arcs: of these, where an arc begins that no wall explains.
        places: where there was such a beam.
    """

    def __init__(self) -> None:
        self.beams = np.zeros(BINS, np.int64)
        self.arcs = np.zeros(BINS, np.int64)
        self.places = np.zeros(BINS, np.int64)

    def add(self, scan: RangeScan, *, is_elsewhere: bool) -> None:
        """Count the readings of a scan; `is_elsewhere`: from another place than those before."""
        bins = _bins(scan.ranges)
        np.add.at(self.beams, bins, 1)
        np.add.at(self.arcs, _bins(_arcs(scan.ranges, scan.angle_increment)), 1)
        self.places[bins] += is_elsewhere

    def heaps(self) -> list[tuple[int, int]]:
        """The first and the last bin of each heap of readings that mean no return, from the
        farthest heap to the nearest."""
        found, end = list[tuple[int, int]](), BINS
        while heap := self._heap_below(end):
            found.append(heap)
            end = heap[0]
        return found

    def _heap_below(self, end: int) -> tuple[int, int] | None:
        """The heap with the most usual reading of all below a bin."""
        below = np.concatenate([[0], np.cumsum(self.beams[:end])])  # readings below each bin
        middle = np.arange(end)
        first = middle - np.ceil(HALF_WIDTH * middle).astype(np.int64)
        after = np.minimum(2 * middle - first + 1, end)
        tail_first = np.floor((1 - TAIL) * middle).astype(np.int64)
        heap, tail = below[after] - below[first], below[first] - below[tail_first]
        stands_out = (heap >= LEAST_BEAMS) & (heap > tail)
        stands_out &= below[end] - below[after] <= BEYOND * heap
        for peak in sorted(np.flatnonzero(stands_out), key=lambda peak: -self.beams[peak]):
            part = slice(int(first[peak]), int(after[peak]))
            if self.places[part].max() >= LEAST_PLACES or self.arcs[part].sum() >= LEAST_BEAMS:
                usual = STANDS_OUT * tail[peak] / max(part.start - tail_first[peak], 1)
                codes = part.start + np.flatnonzero(self.beams[part] > usual)
                return int(codes[0]), int(codes[-1])
        return None


def _bins(ranges: NDArray[np.float32]) -> NDArray[np.int64]:
    """The bins of those readings that are distances."""
    distances = ranges[(ranges > 0) & (ranges < (BINS - 1) * BIN_M)]
    bins: NDArray[np.int64] = np.rint(distances / BIN_M).astype(np.int64)
    return bins


def _arcs(ranges: NDArray[np.float32], increment: float) -> NDArray[np.float32]:
    """The readings that begin an arc of equal ones, wider than a wall's."""
    width = math.ceil(WALL_ARC / abs(increment)) if increment else len(ranges)
    first = ranges[: max(len(ranges) - width, 0)]
    tried = sorted({width * quarter // 4 for quarter in (1, 2, 3, 4)})
    with np.errstate(invalid="ignore"):  # inf - inf
        equal = [np.abs(ranges[k : k + len(first)] - first) <= HALF_WIDTH * first for k in tried]
    return first[np.logical_and.reduce(equal)]


class NoReturnCodes:
    """The codes of one laser, found out while its scans pass (stateful).

    Attributes:
        looked: the histogram has been looked at.
        codes: (least, greatest) reading of each kind of code, metres, from the nearest on.
    """

    def __init__(self) -> None:
        self.looked = False
        self.codes: list[tuple[float, float]] = []
        self._limit = math.inf
        self._histogram, self._waiting = _Histogram(), list[tuple[RangeScan, bool]]()
        self._spacing = 1
        self._last: tuple[int, Pose2D | None] = (-PLACE_NS, None)

    def survey(self, scan: RangeScan, odometry: Pose2D | None) -> None:
        """Have a scan counted if it was taken at another place than the last one that was."""
        stamp_ns, pose = self._last
        if odometry is None:
            is_new = scan.stamp_ns - stamp_ns >= PLACE_NS * self._spacing
        else:
            is_new = pose is None or pose.distance(odometry) >= PLACE_M * self._spacing
        if is_new:
            self._last = scan.stamp_ns, odometry
            self._waiting.append((scan, odometry is not None))
            if len(self._waiting) == PLACES:
                self.look()
                self._spacing *= 2

    def look(self) -> None:
        """Find out the codes from the scans surveyed so far."""
        for scan, is_elsewhere in self._waiting:
            self._histogram.add(scan, is_elsewhere=is_elsewhere)
        self._waiting.clear()
        self.looked = True
        heaps = self._histogram.heaps()
        self._limit = single((heaps[-1][0] - 0.5) * BIN_M) if heaps else math.inf
        self.codes = [(first * BIN_M, last * BIN_M) for first, last in reversed(heaps)]

    def translated(self, scan: RangeScan, beams: BeamCounts) -> RangeScan:
        """The scan with +inf from the least code on, as REP 117 has it."""
        if not self._limit < scan.range_max:
            return scan
        far = (scan.ranges >= self._limit) & (scan.ranges < np.inf)
        beams.no_return += int(np.count_nonzero(far))
        ranges = np.where(far, np.float32(np.inf), scan.ranges)
        return replace(scan, ranges=ranges, range_max=single(self.codes[0][0]))


class NoReturnFilter:
    """Puts +inf for the codes in the scans of a log, of each laser its own (stateful)."""

    def __init__(self) -> None:
        self.lasers = defaultdict[Mount, NoReturnCodes](NoReturnCodes)
        self._last: tuple[Mount | None, NoReturnCodes] = None, NoReturnCodes()

    def records(self, records: Iterable[Entry], beams: BeamCounts) -> Iterator[Entry]:
        """The records in their order.

        The first are held back until enough of the log is known; what the lasers' codes are is
        found out anew as it goes on.

        Args:
            beams: what became of the beams; the codes are added.
        """
        held, scans, odometry, has_looked = deque[Entry](), 0, None, False
        for record in records:
            if isinstance(record, Odometry):
                odometry = record.pose
            elif isinstance(record, RangeScan) and len(record.ranges) > 1:
                scans += 1
                laser = self._laser(record.mount)
                laser.survey(record, odometry)
                has_looked = laser.looked and (has_looked or self._have_looked())
            if has_looked and not held:
                yield self._translated(record, beams)
                continue
            held.append(record)
            if has_looked or scans >= MOST_SCANS or len(held) >= MOST_RECORDS:
                yield from self._released(held, beams)
                has_looked = bool(self.lasers)
        yield from self._released(held, beams)

    def _have_looked(self) -> bool:
        return all(laser.looked for laser in self.lasers.values())

    def _released(self, held: deque[Entry], beams: BeamCounts) -> Iterator[Entry]:
        for laser in self.lasers.values():
            if not laser.looked:
                laser.look()
        while held:
            yield self._translated(held.popleft(), beams)

    def _translated(self, record: Entry, beams: BeamCounts) -> Entry:
        if isinstance(record, RangeScan) and len(record.ranges) > 1:
            return self._laser(record.mount).translated(record, beams)
        return record

    def _laser(self, mount: Mount) -> NoReturnCodes:
        """That of a mount; the scans of a laser share theirs, which need not be looked up then."""
        if mount is not self._last[0]:
            self._last = mount, self.lasers[mount]
        return self._last[1]

    def lines(self) -> Iterator[str]:
        """What is taken for no return, a sentence for each laser that has codes."""
        for laser in self.lasers.values():
            if laser.codes:
                readings = " and ".join(_span(*code) for code in laser.codes)
                yield f"readings of {readings} are taken for no return"


def _span(least: float, greatest: float) -> str:
    return f"{least:.2f} m" if least == greatest else f"{least:.2f} to {greatest:.2f} m"
