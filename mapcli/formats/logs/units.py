"""Scans whose readings are no metres, or whose angles are no radians, as some drivers send them."""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.logs.carmen_messages import LaserMessage
from mapcli.formats.logs.rep117 import single
from mapcli.formats.logs.ros.decode import LaserScan
from mapcli.model.log import LogOptions, UnitCounts

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
RADIANS = {"rad": 1.0, "deg": math.pi / 180}

FARTHEST_LIMIT_M = 300.0
"""A laser's maximum beyond this is in the unit of its readings; drivers may send it in metres
whatever the readings are in."""

SAMPLED = 16
"""Every so many scans are looked at; a unit does not change within a log."""

MIDDLE_M = 100.0
"""The middle reading of no scan is so far: in centimetres that is a metre."""

LEAST_MILLIMETRES = 600.0
"""The middle reading of scans is 0.6 to 6 m as a rule: less than this in centimetres, and more in
millimetres."""

LEAST_READINGS = 10
"""Different readings that a scan must have: codes for no return are few."""

MOST_TURNS = 2
"""Scanners do not turn so often for one scan."""

Message = TypeVar("Message", LaserScan, LaserMessage)


def in_metres_and_radians(message: Message, options: LogOptions) -> Message:
    """The scan as sent, in the units that the tool computes in."""
    to_metres, to_radians = METRES[options.range_unit], RADIANS[options.angle_unit]
    if to_metres == 1 == to_radians:
        return message
    changes: dict[str, Any] = {"ranges": (message.ranges * np.float32(to_metres))}
    names = ["angle_min", "angle_increment"]
    if isinstance(message, LaserScan):
        names.append("angle_max")
        limit = _limit_factor(message.range_max, to_metres)
        changes["range_min"] = message.range_min * limit
        changes["range_max"] = message.range_max * limit
    else:
        changes["max_range"] = message.max_range * _limit_factor(message.max_range, to_metres)
    changes |= {name: single(getattr(message, name) * to_radians) for name in names}
    return message._replace(**changes)


def _limit_factor(limit: float, to_metres: float) -> float:
    return to_metres if limit > FARTHEST_LIMIT_M else 1.0


def count_units(ranges: NDArray[np.float32], angle_increment: float, counts: UnitCounts) -> None:
    """Look at a scan now and then, before its limits hide what it reads.

    Args:
        ranges: as sent, in what should be metres; angle_increment: in what should be radians.
    """
    counts.scans += 1
    if counts.scans % SAMPLED != 1:
        return
    counts.sampled += 1
    turns = abs(angle_increment) * len(ranges) / math.tau
    if MOST_TURNS < turns < math.inf:
        counts.turning += 1
        counts.turns = turns
    readings = ranges[np.isfinite(ranges) & (ranges > 0)]
    if not len(readings) or readings.max() <= MIDDLE_M:
        return
    readings = np.unique(readings)
    if len(readings) >= LEAST_READINGS and (middle := float(np.median(readings))) > MIDDLE_M:
        counts.too_far += 1
        counts.millimetres += middle >= LEAST_MILLIMETRES
        counts.middle = middle
