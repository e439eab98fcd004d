"""When the messages of a CARMEN log are from."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from mapcli.formats.logs.carmen_messages import Stamping
from mapcli.formats.logs.carmen_survey import CarmenSurvey
from mapcli.formats.logs.clock_faults import (
    UNITS,
    Columns,
    LineStamps,
    choose_clock,
    unit_of,
)
from mapcli.formats.logs.line_clock import Leaps, LineClock, leaps_of, line_clock
from mapcli.formats.logs.one_recording import Spans
from mapcli.model.clock import Clock
from mapcli.model.log import LogOptions
from mapcli.model.scan import LATEST_STAMP_S, NANOSECONDS


class CarmenTimes:
    """The clock of a log, by the stamps on its lines.

    Args:
        scans: name of the messages that hold them.
    """

    def __init__(self, survey: CarmenSurvey, scans: str, options: LogOptions) -> None:
        self._scans, self._odometry = scans, options.odom_topic or "ODOM"
        self._stamps = survey.stamps
        self._chosen = options.time_source
        units = [unit_of(one[scans]) for one in self._stamps if scans in one]
        self._unit_s = min(units, default=1.0)

    @cached_property
    def clock(self) -> Clock:
        """That of all files: the worst that one of them needs."""
        if self._chosen != "auto":
            return Clock(self._chosen)
        clocks = [Clock()]
        for scans in map(self._columns, range(len(self._stamps))):
            if scans is not None:
                clocks.append(choose_clock(*scans))
        return max(clocks, key=_badness)

    @property
    def _is_mended(self) -> bool:
        """Whether the stamps are not taken as they are."""
        return self._chosen == "auto" and bool(self.clock.why)

    @property
    def stamping(self) -> Stamping:
        """How to read the times of lines."""
        return Stamping(self.clock.source, round(self._unit_s * NANOSECONDS))

    def _columns(self, part: int) -> tuple[Columns, Columns | None] | None:
        """The stamps of the scans and of the lines of odometry in a file; None without scans."""
        stamps = self._stamps[part]
        if self._scans not in stamps:
            return None
        odometry = stamps.get(self._odometry)
        own = odometry is None or self._odometry == self._scans
        return (
            stamps[self._scans].scaled(self._unit_s),
            None if own or odometry is None else odometry.scaled(self._unit_s),
        )

    @cached_property
    def line_clocks(self) -> Sequence[LineClock | None]:
        """Of each file, if the order of the lines is to tell the time; files follow each other."""
        clocks: list[LineClock | None] = []
        last: LineClock | None = None
        for part in range(len(self._stamps)):
            columns = self._columns(part) if self.clock.source == "order" else None
            if columns is None:
                clocks.append(None)
                continue
            scans = columns[0]
            finer = max(scans.header, scans.log, key=lambda one: len(np.unique(one)))
            clock = line_clock(scans.lines, finer)
            last = clock.after(last) if last is not None else clock
            clocks.append(last)
        return clocks

    @cached_property
    def leaps(self) -> Sequence[Leaps]:
        """Of each file, where its clock was set, which the times do not show."""
        return [self._leaps(part) for part in range(len(self._stamps))]

    def _leaps(self, part: int) -> Leaps:
        columns = self._columns(part)
        if not self._is_mended or columns is None:
            return Leaps([], [0])
        scans, odometry = columns
        if odometry is None or self.clock.source == "order":
            return leaps_of(scans.lines, scans.header)
        lines = np.concatenate([scans.lines, odometry.lines])
        in_order = np.argsort(lines)
        stamps = np.concatenate([scans.header, odometry.header])
        return leaps_of(lines[in_order], stamps[in_order])

    def time(self, part: int, line: int, stamp_ns: int) -> int:
        """When the message on a line is from, nanoseconds, if it has a stamp."""
        clock, leaps = self.line_clocks[part], self.leaps[part]
        if clock is not None:
            return clock.at(line)
        if not leaps.lines or self.clock.source == "log":
            return stamp_ns
        return max(stamp_ns + leaps.shifts_ns[bisect_right(leaps.lines, line)], 0)

    def times_set(self, part: int, line: int) -> int:
        """How often a clock was set before a line."""
        return bisect_right(self.leaps[part].lines, line)

    def spans(self) -> list[Spans]:
        """For each file, message -> times of its first and its last line, nanoseconds."""
        return [
            {name: self._span(one, part) for name, one in stamps.items()}
            for part, stamps in enumerate(self._stamps)
        ]

    def _span(self, stamps: LineStamps, part: int) -> tuple[int, int]:
        column = stamps.log if self.clock.source == "log" else stamps.header
        first, last = (
            self.time(part, stamps.lines[k], self._nanoseconds(column[k])) for k in (0, -1)
        )
        return min(first, last), max(first, last)

    @property
    def unit(self) -> str:
        """What the stamps are in; empty for seconds."""
        return "" if self._unit_s == 1 else UNITS[self._unit_s]

    def _nanoseconds(self, stamp: float) -> int:
        return round(min(max(stamp * self._unit_s, 0.0), LATEST_STAMP_S) * NANOSECONDS)


def _badness(clock: Clock) -> tuple[int, bool]:
    return ("header", "log", "order").index(clock.source), bool(clock.why)
