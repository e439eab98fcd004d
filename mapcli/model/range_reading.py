"""What a robot with a few range sensors measures: readings of one beam each, and several of them
gathered over a short way.

A sonar, an infrared sensor or a switch looks along one line. Alone its reading says hardly more
than that there is something; the readings of a ring of them, over the way that a robot drives in
a moment, are a scan with few beams, each from a place and a time of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan


@dataclass(frozen=True, eq=False)
class RangeReading(RangeScan):
    """A reading of a sensor with one beam, as a scan of one beam: `ranges` has shape (1,), and the
    bearing is 0 in the frame of its mount.

    Attributes:
        sensor: its name, a topic or a column.
        field_of_view: radians, of its cone; what it sees counts as lying on the axis.
    """

    sensor: str = ""
    field_of_view: float = 0.0

    @property
    def is_switch(self) -> bool:
        """Whether the sensor only tells if something is within its distance (REP 117)."""
        return self.range_min == self.range_max


class PlacedReading(NamedTuple):
    """A reading, and where the robot was when it was taken, in its own frame at the stamp of the
    scan that the reading is part of."""

    reading: RangeReading
    pose: Pose2D


@dataclass(frozen=True, eq=False)
class GatheredScan(RangeScan):
    """Readings of several sensors over a short way, as one scan in the robot's frame.

    The stamp is that of the last reading; `ranges`, shape (n,), are theirs in the order in which
    they were taken. Their bearings are no even fan, so only `readings` tells where they lead.
    """

    readings: tuple[PlacedReading, ...] = ()
