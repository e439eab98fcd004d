"""When the clocks of a log do not tell the time.

Lines of text carry a stamp, and many the time at which they were logged as well. Programs that
print numbers with six digits leave one stamp for hours (`1.13486e+09`), others print zeros, or
milliseconds; and clocks are set while a robot drives. What the stamps are worth shows in the order
of the lines, which were written one after another.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from mapcli.formats.logs.odometry_track import SET_BACK_S
from mapcli.formats.logs.recording_break import duration
from mapcli.model.clock import Clock
from mapcli.model.scan import LATEST_STAMP_S

FEWEST = 9
"""Records of a kind that tell something about a clock."""

REPEATED_SHARE = 0.05
"""A clock is too coarse if it stood still before more of the records. It does once in a while where
records come in bursts."""

LEAP_AHEAD_S = 600.0
"""A clock that goes ahead by more, where another one does not, was set."""

APART_S = 1.0
"""Clocks that are apart by more are not the same; no network is so slow."""

LONGEST_PERIOD_S = 10.0
"""Between two scans, for a robot that can be mapped; where it is longer, stamps are no seconds."""

UNITS = {1.0: "seconds", 1e-3: "milliseconds", 1e-6: "microseconds", 1e-9: "nanoseconds"}

Seconds = NDArray[np.float64]


@dataclass
class LineStamps:
    """The stamps on the lines of one kind, as they are written (mutable)."""

    lines: array[int] = field(default_factory=lambda: array("q"))
    header: array[float] = field(default_factory=lambda: array("d"))
    log: array[float] = field(default_factory=lambda: array("d"))

    def add(self, line: int, header: float, log: float) -> None:
        self.lines.append(line)
        self.header.append(header)
        self.log.append(log)

    def scaled(self, unit_s: float) -> Columns:
        columns = (np.array(one, dtype=np.float64) for one in (self.header, self.log))
        header, log = (column * unit_s for column in columns)
        return Columns(np.array(self.lines, dtype=np.int64), header, log)


class Columns(NamedTuple):
    """Numbers of lines, and the stamps on them by either clock, seconds."""

    lines: NDArray[np.int64]
    header: Seconds
    log: Seconds


def unit_of(stamps: LineStamps) -> float:
    """Seconds in the unit of the stamps of scans: they are too far apart, or too late, for others.

    A clock that is coarse says nothing: most of its steps are none at all.
    """
    seconds = np.array(stamps.header, dtype=np.float64)
    if len(seconds) < FEWEST:
        return 1.0
    step, latest = float(np.median(np.diff(seconds))), float(np.median(seconds))
    fits = (u for u in UNITS if step * u <= LONGEST_PERIOD_S and latest * u < LATEST_STAMP_S)
    return next(fits, 1.0)


def choose_clock(scans: Columns, odometry: Columns | None, what: str = "scans") -> Clock:
    """The stamps in the lines; the times of logging where only these tell the time; or the order of
    the lines. Where nothing is wrong but that both were set meanwhile, that is to be taken out of
    the stamps (there is a `why`).

    Args:
        odometry: of lines of their own; None if the scans carry all there is.
        what: the scans are called.
    """
    if len(scans.lines) < FEWEST:
        return Clock()
    why = _fault(scans.header, scans.log, what) or _apart(scans, odometry)
    if not why:
        return Clock()
    if not _fault(scans.log, scans.header) and not _odd_lines(scans, odometry, "log"):
        return Clock("log", why)
    if _repeated(scans.header) > REPEATED_SHARE or _apart(scans, odometry):
        return Clock("order", why)
    return Clock("header", f"{why}, which is taken out")


def _repeated(stamps: Seconds) -> float:
    """Share of the stamps that are those before them."""
    return float(np.mean(np.diff(stamps) == 0))


def _fault(stamps: Seconds, other: Seconds, what: str = "scans") -> str:
    """What is wrong with a clock; empty if nothing is."""
    repeated = _repeated(stamps)
    if repeated > REPEATED_SHARE:
        return f"{repeated:.0%} of the {what} have the stamp of the one before"
    steps, others = np.diff(smoothed(stamps)), np.diff(smoothed(other))
    if (steps < -SET_BACK_S).any():
        return f"a clock was set back by {duration(-float(steps.min()))}"
    ahead = steps[(steps > LEAP_AHEAD_S) & (others < LEAP_AHEAD_S / 2)]
    return f"a clock was set ahead by {duration(float(ahead.max()))}" if len(ahead) else ""


def smoothed(stamps: Seconds) -> Seconds:
    """The median of each stamp and the two to either side: stamps that were hit do not count."""
    windows = sliding_window_view(np.pad(stamps, 2, mode="edge"), 5)
    return np.asarray(np.median(windows, axis=1))


def _apart(scans: Columns, odometry: Columns | None) -> str:
    """Whether scans and odometry have clocks that are apart."""
    if odometry is None or len(odometry.lines) < FEWEST:
        return ""
    late = [np.median(one.log - one.header) for one in (scans, odometry)]
    apart = float(late[0] - late[1])
    if abs(apart) <= APART_S:
        return _odd_lines(scans, odometry, "header")
    return f"stamps of scans and odometry are {duration(abs(apart))} apart"


def _odd_lines(scans: Columns, odometry: Columns | None, clock: Literal["header", "log"]) -> str:
    """Whether scans and the lines of odometry before them are always as far apart.

    Lines that were put in another order since are so by various times.
    """
    if odometry is None or len(odometry.lines) < FEWEST:
        return ""
    before = np.searchsorted(odometry.lines, scans.lines) - 1
    known = before >= 0
    if not known.any():
        return ""
    later = getattr(scans, clock)[known] - getattr(odometry, clock)[before[known]]
    low, middle, high = np.percentile(later, (5, 50, 95))
    if abs(middle) <= APART_S or high - low > APART_S:
        return ""
    return f"stamps of scans and odometry are {duration(abs(float(middle)))} apart"
