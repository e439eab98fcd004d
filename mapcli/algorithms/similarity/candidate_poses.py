"""The candidate poses: T of Algorithm 9.2, around where the robot takes itself to be.

The fifteen of Sect. 9.5 are the intended position and its four neighbours along the map's rows
and columns, each with the intended heading and one to either side; or a whole window.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import DataError
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.similarity import INTENDED

Floats = NDArray[np.float64]

DIRECTIONS = (("up", 0, 1), ("down", 0, -1), ("left", -1, 0), ("right", 1, 0))

MAX_POSES = 20_000_000
"""Poses of a window; more would take minutes and gigabytes."""


class CandidateFrame(NamedTuple):
    """What candidates are relative to: the intended pose in the map's frame, the size of a cell (1
    for maps without cells) and the yaw of the map's axes, radians."""

    intended: Pose2D
    cell: float = 1.0
    yaw: float = 0.0


@dataclass(frozen=True, eq=False)
class Candidates:
    """Positions times headings.

    Attributes:
        names: of the positions.
        offsets: shape (positions, 2), to the right and up in the map's own axes, in cells (of a
            points map: in its unit).
        turns_deg: degrees counter-clockwise of the intended heading.
    """

    names: tuple[str, ...]
    offsets: Floats
    turns_deg: tuple[float, ...]

    def pose(self, frame: CandidateFrame, position: int, turn: int) -> Pose2D:
        """The pose of one of them in the map's frame."""
        intended = frame.intended
        du, dv = (float(value) * frame.cell for value in self.offsets[position])
        cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
        theta = wrap_angle(intended.theta + math.radians(self.turns_deg[turn]))
        return Pose2D(
            intended.x + cos * du - sin * dv, intended.y + sin * du + cos * dv, theta
        )  # fmt: skip


def neighbour_candidates(steps: Sequence[float], turns_deg: Sequence[float]) -> Candidates:
    """The intended position and, for each step, its neighbours up, down, left and right."""
    names, offsets = [INTENDED], [(0.0, 0.0)]
    for step in steps:
        for name, du, dv in DIRECTIONS if step else ():
            names.append(name if len(steps) == 1 else f"{name} {step:g}")
            offsets.append((du * step, dv * step))
    return Candidates(tuple(names), np.array(offsets), tuple(turns_deg))


@dataclass(frozen=True)
class CandidateWindow:
    """A window of poses around the intended one.

    Attributes:
        xy: half-width in the map's unit; theta_deg: half-width in degrees.
        step_xy: between positions, rounded to whole cells; None is one cell.
        step_theta_deg: between headings.
    """

    xy: float
    theta_deg: float
    step_xy: float | None = None
    step_theta_deg: float = 0.5

    def axes(self, cell: float | None) -> tuple[Floats, Floats]:
        """Offsets along one axis, in cells (in units without cells), and turns in degrees.

        Raises:
            DataError: far too many poses.
        """
        step = self._step(cell)
        reach = math.floor(self.xy / (cell or 1.0) / step + 1e-9)
        turns = math.floor(self.theta_deg / self.step_theta_deg + 1e-9)
        if (2 * reach + 1) ** 2 * (2 * turns + 1) > MAX_POSES:
            raise DataError(
                f"the window has {(2.0 * reach + 1) ** 2 * (2 * turns + 1):,.0f} poses",
                expected=f"at most {MAX_POSES:,}; take larger steps or a smaller window",
            )
        whole = np.arange(-max(reach, turns), max(reach, turns) + 1, dtype=np.float64)
        middle = len(whole) // 2
        along = whole[middle - reach : middle + reach + 1] * step
        return along, whole[middle - turns : middle + turns + 1] * self.step_theta_deg

    def _step(self, cell: float | None) -> float:
        if cell is None:
            return self.step_xy or max(self.xy / 10, 1e-9)
        return float(max(1, round((self.step_xy or cell) / cell)))

    def candidates(self, cell: float | None) -> Candidates:
        """All poses of the window: positions row by row from below, and turns."""
        along, turns = self.axes(cell)
        du, dv = np.meshgrid(along, along)
        offsets = np.column_stack([du.ravel(), dv.ravel()])
        names = tuple(_named(*offset) for offset in offsets.tolist())
        return Candidates(names, offsets, tuple(turns.tolist()))


def _named(du: float, dv: float) -> str:
    """`right 3, up 2`."""
    parts = [
        f"{plus if value > 0 else minus} {abs(value):g}"
        for value, plus, minus in ((du, "right", "left"), (dv, "up", "down"))
        if value
    ]
    return ", ".join(parts) or INTENDED
