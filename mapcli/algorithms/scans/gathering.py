"""Readings of a few sensors, taken at different moments, become one perception over a short way.

Algorithm 9.2 begins its turn with "move a short distance": a robot that looks along five lines
sees a piece of wall only while it moves. So the readings are gathered until the robot has come a
short way, and odometry, which errs little on it, says where each was taken.

A lone sensor has nothing to be gathered with: its readings stay scans of one beam.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.range_reading import GatheredScan, PlacedReading, RangeReading
from mapcli.model.scan import NANOSECONDS, RangeScan

SHORT_WAY_M = 0.3
"""Metres over which readings are gathered, unless another way is asked for: as far as scans of
lasers are apart that are written into the map."""

SHORT_TURN = math.radians(17)
"""Radians, in the same way."""

LONGEST_NS = 10 * NANOSECONDS
"""...and no longer than this: a robot that stands sees nothing new, and memory is bounded."""

TakenAt = tuple[RangeReading, Pose2D]
"""A reading, and the odometry's pose at its stamp."""


def gathered(
    scans: Iterable[tuple[RangeScan, Pose2D | None]], way_m: float = SHORT_WAY_M
) -> Iterator[tuple[RangeScan, Pose2D | None]]:
    """The scans, with readings of several sensors over a short way as one `GatheredScan`, at the
    stamp and the odometry of the last one.

    Readings without odometry stay alone, since nothing says how they lie to each other. So does
    the first one: the map begins where it was taken.

    Args:
        scans: with the odometry's pose at each stamp, in stamp order.
        way_m: metres of way that are gathered at most; 0 gathers readings of one place only.
    """
    held, has_begun = list[TakenAt](), False
    for scan, odom in scans:
        if not isinstance(scan, RangeReading) or odom is None or not has_begun:
            yield from _as_one(held)
            held, has_begun = [], True
            yield scan, odom
            continue
        if held and _ends(held[0], scan, odom, way_m):
            yield from _as_one(held)
            held = []
        held.append((scan, odom))
    yield from _as_one(held)


def _ends(first: TakenAt, reading: RangeReading, odom: Pose2D, way_m: float) -> bool:
    """Whether a reading is too far from the first one to be gathered with it."""
    before, start = first
    far = start.distance(odom) > way_m or abs(wrap_angle(odom.theta - start.theta)) > SHORT_TURN
    return far or reading.stamp_ns - before.stamp_ns > LONGEST_NS


def _as_one(held: list[TakenAt]) -> Iterator[tuple[RangeScan, Pose2D | None]]:
    """What was gathered, as one scan; readings of a lone sensor as they are."""
    if len({reading.mount for reading, _ in held}) < 2:
        yield from held
        return
    last, here = held[-1]
    ranges = np.concatenate([reading.ranges for reading, _ in held])
    placed = tuple(PlacedReading(reading, here.between(pose)) for reading, pose in held)
    yield GatheredScan(last.stamp_ns, 0.0, 0.0, ranges, readings=placed), here
