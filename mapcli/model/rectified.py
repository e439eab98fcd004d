"""A trace along walls that are straight and perpendicular (Sect. 9.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Wall:
    """A wall that the robot followed.

    Attributes:
        quarter: its direction, in quarter turns counter-clockwise from the first wall's.
        measured, length: metres along it, by the trace and after the adjustment.
        drift: radians that the heading of the trace turns along it, which the wall does not.
        corner: radians that the trace turns into the next wall; None for the last.
    """

    quarter: int
    measured: float
    length: float
    drift: float
    corner: float | None


@dataclass(frozen=True, eq=False)
class RectifiedTrace:
    """A trace along straight walls.

    Attributes:
        poses: shape (n, 3), x, y, theta.
        walls: in the order of the drive.
        corners: ends of the walls, shape (walls + 1, 2).
        is_loop: whether the end was brought to the start.
        gap_before, gap_square, gap_after: closing error of the loop, metres from the end to the
            start: in the trace, with straight walls and right angles, with the lengths adjusted.
    """

    poses: Floats
    walls: tuple[Wall, ...]
    corners: Floats
    is_loop: bool
    gap_before: float
    gap_square: float
    gap_after: float

    @property
    def corner_errors(self) -> list[float]:
        """How far the turn at each corner was from a multiple of a right angle, radians."""
        turns = [abs(wall.corner) for wall in self.walls if wall.corner is not None]
        return [abs(turn - round(turn / (math.pi / 2)) * math.pi / 2) for turn in turns]

    def document(self) -> dict[str, Any]:
        """The findings, ready for JSON, in metres and degrees with few decimals."""
        return {
            "is_loop": self.is_loop,
            "gap_before_m": round(self.gap_before, 6),
            "gap_square_m": round(self.gap_square, 6),
            "gap_after_m": round(self.gap_after, 6),
            "walls": [
                {
                    "direction_deg": 90 * (wall.quarter % 4),
                    "measured_m": round(wall.measured, 6),
                    "length_m": round(wall.length, 6),
                    "bend_deg": round(float(np.degrees(wall.drift)), 4) + 0.0,
                    "corner_deg": None
                    if wall.corner is None
                    else round(float(np.degrees(wall.corner)), 4),
                }
                for wall in self.walls
            ],
            "corners": [{"x": round(x, 6) + 0.0, "y": round(y, 6) + 0.0} for x, y in
                        self.corners.tolist()],
        }  # fmt: skip
