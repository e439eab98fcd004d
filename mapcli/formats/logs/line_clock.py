"""Times by the order of lines, for logs whose clocks do not tell them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.logs.clock_faults import LEAP_AHEAD_S, Seconds, smoothed
from mapcli.formats.logs.odometry_track import SET_BACK_S
from mapcli.model.scan import NANOSECONDS

PERIOD_S = 0.2
"""Between two scans, where nothing tells: how fast a robot was is not known then."""

FEWEST_TICKS = 3
"""Of a coarse clock, that tell how long a scan takes."""


@dataclass(frozen=True, eq=False)
class LineClock:
    """Time as a function of the line.

    Attributes:
        lines, times_ns: of the scans, shape (n,), both ascending.
    """

    lines: NDArray[np.int64]
    times_ns: NDArray[np.int64]

    def at(self, line: int) -> int:
        """Nanoseconds; of a line between two scans in proportion."""
        k = int(np.searchsorted(self.lines, line))
        if k < len(self.lines) and self.lines[k] == line:
            return int(self.times_ns[k])
        return round(float(np.interp(line, self.lines, self.times_ns - self.times_ns[0]))) + int(
            self.times_ns[0]
        )

    def after(self, other: LineClock) -> LineClock:
        """The same, begun when another one has ended."""
        start = int(other.times_ns[-1]) + round(PERIOD_S * NANOSECONDS)
        return LineClock(self.lines, self.times_ns + max(start - int(self.times_ns[0]), 0))


def line_clock(lines: NDArray[np.int64], stamps: Seconds) -> LineClock:
    """Times of scans that never go back, and stand still nowhere.

    Scans with one stamp lie evenly between that and the next. If there are too few stamps for that,
    all scans lie evenly. Where the clock was set, the next scan follows as others do.

    Args:
        lines, stamps: of the scans, shape (n,), in the order of the lines; seconds.
    """
    steps, leaps = np.diff(stamps), is_leap(np.diff(stamps))
    forward = np.where(leaps, _usual(steps[(steps > 0) & ~is_leap(steps)]), np.maximum(steps, 0.0))
    running = np.concatenate([[0.0], np.cumsum(forward)])
    ticks = 1 + np.flatnonzero((steps > 0) & ~leaps)
    scans = np.arange(len(stamps))
    if len(ticks) < FEWEST_TICKS:
        seconds = PERIOD_S * scans
    else:
        seconds = np.interp(scans, ticks, running[ticks])
        a_scan = (running[ticks[-1]] - running[ticks[0]]) / (ticks[-1] - ticks[0])
        seconds += a_scan * (np.minimum(scans - ticks[0], 0) + np.maximum(scans - ticks[-1], 0))
        seconds -= min(float(seconds[0]), 0.0)
    start = round(float(stamps[0]) * NANOSECONDS)
    return LineClock(lines, start + np.round(seconds * NANOSECONDS).astype(np.int64))


class Leaps(NamedTuple):
    """Where a clock was set.

    Attributes:
        lines: of the first stamps after it.
        shifts_ns: to add to stamps before any, after the first, and so on, so that time goes on.
    """

    lines: list[int]
    shifts_ns: list[int]


def leaps_of(lines: NDArray[np.int64], stamps: Seconds) -> Leaps:
    """Args:
    lines, stamps: of all records, in the order of the lines; seconds.
    """
    steps, leaps = np.diff(stamps), is_leap(np.diff(smoothed(stamps)))
    missing = _usual(steps[(steps > 0) & ~leaps]) - steps[leaps]
    shifts = np.concatenate([[0.0], np.cumsum(missing)]) * NANOSECONDS
    return Leaps(lines[1:][leaps].tolist(), [round(shift) for shift in shifts.tolist()])


def is_leap(steps: Seconds) -> NDArray[np.bool_]:
    """Which steps of a clock from one scan to the next are none of time."""
    return (steps < -SET_BACK_S) | (steps > LEAP_AHEAD_S)


def _usual(steps: Seconds) -> float:
    return float(np.median(steps)) if len(steps) else PERIOD_S
