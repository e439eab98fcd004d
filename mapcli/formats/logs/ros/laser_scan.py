"""From a LaserScan message as drivers send it to a `RangeScan`, whose ranges follow REP 117."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

from mapcli.formats.logs.rep117 import rep117, sensible_limits, single
from mapcli.formats.logs.ros.decode import LaserScan
from mapcli.model.log import BeamCounts
from mapcli.model.scan import Mount, RangeScan
from mapcli.model.sweep import BeamTiming


def range_scan(
    message: LaserScan,
    stamp_ns: int,
    mount: Mount,
    beams: BeamCounts,
    note: Callable[[str], None],
) -> RangeScan | None:
    """The scan as a record; None if its beams have no usable angles, or there are none.

    Args:
        note: called with a sentence about each field that was corrected.
    """
    increment = angle_increment(message)
    if len(message.ranges) == 0 or not math.isfinite(message.angle_min) or increment is None:
        return None
    if increment != message.angle_increment:
        note("angle_increment contradicts the number of beams: taken from angle_min and angle_max")
    low, high = sensible_limits(message.range_min, message.range_max)
    if high != message.range_max:
        note(f"range_max is {message.range_max:g}: not used")
    ranges = rep117(message.ranges, low, high, beams)
    timing = _untold_order(message.time_increment)
    return RangeScan(stamp_ns, message.angle_min, increment, ranges, low, high, mount, timing)


@lru_cache(maxsize=16)
def _untold_order(increment: float) -> BeamTiming:
    """Beams of which the message does not tell the order, by the time from one to the next."""
    return BeamTiming(increment, order=None)


def angle_increment(message: LaserScan) -> float | None:
    """The angle between beams, radians; None if the message has no sensible one.

    Drivers disagree whether angle_max is the last beam's or the one's after it; both leave
    angle_increment right. Only if the two contradict each other by more than a beam does the
    number of beams decide.
    """
    increment, n = message.angle_increment, len(message.ranges)
    if n <= 1:
        return increment if math.isfinite(increment) else 0.0
    span = message.angle_max - message.angle_min
    usable = math.isfinite(increment) and increment != 0
    if usable and not abs(span - increment * (n - 1)) > 1.5 * abs(increment):
        return increment
    if math.isfinite(span) and span != 0:
        return single(span / (n - 1))
    return increment if usable else None
