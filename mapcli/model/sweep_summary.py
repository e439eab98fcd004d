"""What a replay tells of scans whose beams were taken one after another."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from mapcli.model.scan import RangeScan
from mapcli.model.sweep import BeamOrder


@dataclass(frozen=True, slots=True)
class Crispness:
    """Shares of the points of all scans that lie on walls of the map, within what lasers err by.

    Attributes:
        deskewed: each point seen from where it was taken.
        at_once: all points of a scan seen from one place.
    """

    deskewed: float
    at_once: float


LOOKS_TURNING = "looks as if a turn took {:.3g} s (used; --turn-time 0 takes all beams at once)"
"""What is said of seconds of a turn that were found."""


@dataclass(frozen=True, slots=True)
class SweepSummary:
    """How long scans took, and what it was worth to know that.

    Attributes:
        turn_time_s: seconds of a full turn of the laser; sweep_time_s: from the first beam of a
            scan to the last.
        order: in which the beams of the array were taken, as told or found; None if the log does
            not show it, and they count as taken forward.
        crispness: None if the poses were not refined.
        is_found: the log tells no times; they are found from its scans.
    """

    turn_time_s: float
    sweep_time_s: float
    order: BeamOrder | None
    crispness: Crispness | None = None
    is_found: bool = False

    def document(self) -> dict[str, Any]:
        """For a file."""
        c = self.crispness
        return {
            "turn_time_s": round(self.turn_time_s, 6),
            "sweep_time_s": round(self.sweep_time_s, 6),
            "turn_time_found": self.is_found,
            "beam_order": self.order,
            "points_on_walls": None if c is None else round(c.deskewed, 4),
            "points_on_walls_at_once": None if c is None else round(c.at_once, 4),
        }

    def text(self) -> str:
        """For a person."""
        text = f"a turn takes {self.turn_time_s:.3g} s, {beams_text(self.order)}"
        if self.is_found:
            text = f"{LOOKS_TURNING.format(self.turn_time_s)}, {beams_text(self.order)}"
        if self.crispness is None:
            return text
        deskewed, at_once = 100 * self.crispness.deskewed, 100 * self.crispness.at_once
        return (
            f"{text}; deskewed, {deskewed:.1f} % of the points lie on walls, else {at_once:.1f} %"
        )


def beams_text(order: BeamOrder | None) -> str:
    """In which order beams are taken; None is not known."""
    return f"beams {order}" if order else "beams forward, as far as the log shows"


def turn_time(scan: RangeScan) -> float:
    """Seconds of a full turn of the laser, by the time from beam to beam; 0 if all beams are taken
    at once."""
    if not scan.angle_increment:
        return 0.0
    return scan.timing.increment * math.tau / abs(scan.angle_increment)
