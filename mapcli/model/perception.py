"""What a robot perceives, to be compared with a map: the three kinds of `similarity-table`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

STEPS: tuple[float, ...] = (1.0,)
TURNS_DEG: tuple[float, ...] = (0.0, -15.0, 15.0)
"""The candidates of Sect. 9.5: one cell to each side, 15 degrees clockwise and back."""


ReadingsKind = Literal["scan", "landmarks", "readings"]

Walls = Literal["thick", "ends"]


@dataclass(frozen=True, slots=True)
class IntendedPose:
    """Where a robot takes itself to be: in metres, or in the middle of a cell.

    Attributes:
        theta: heading, radians.
        xy: metres; cell: row and column, in the place of `xy`.
    """

    theta: float
    xy: tuple[float, float] = (0.0, 0.0)
    cell: tuple[int, int] | None = None

    def pose(self, grid: GridMap | None) -> Pose2D:
        """The pose in a map.

        Raises:
            DataError: outside the map; a cell of a map that has none.
        """
        if grid is None and self.cell is not None:
            raise DataError("pose: cell", expected="x and y, because the map has no cells")
        if grid is None:
            return Pose2D(*self.xy, self.theta)
        row, column = self.cell or (int(n) for n in grid.cells_of_world([self.xy])[0])
        if not grid.contains(row, column):
            place = f"cell {row},{column}"
            if self.cell is None:
                place = f"x {self.xy[0]:g}, y {self.xy[1]:g} ({place})"
            raise DataError(
                f"pose: {place} is outside the map",
                expected=f"a place in its {grid.rows} rows and {grid.columns} columns",
            )
        x, y = self.xy if self.cell is None else grid.world_of_cells([row], [column])[0]
        return Pose2D(float(x), float(y), self.theta)


UNTOLD = IntendedPose(math.nan)
"""Of readings that are compared with a database and do not say where they were taken."""


@dataclass(frozen=True, eq=False)
class ScanPerception:
    """Kind `scan`: ranges along beams.

    Attributes:
        intended_pose: the intended pose.
        beams: shape (n, 2): bearing from the robot's heading, radians, counter-clockwise, and
            range in the map's unit; inf is no return.
        range_max: farther readings are no return.
        laser: where the beams start, in the robot's frame.
        no_return: beams without return are open space (`clear`) or say nothing (`ignore`).
        walls: one cell `thick` behind what the beams hit (Sect. 9.5), or the cells in which
            beams end (`ends`), as in maps drawn from beams.
        steps, turns_deg: candidates.
    """

    intended_pose: IntendedPose
    beams: NDArray[np.float64]
    range_max: float
    laser: Pose2D = field(default_factory=Pose2D)
    no_return: Literal["clear", "ignore"] = "clear"
    walls: Walls = "thick"
    steps: tuple[float, ...] = STEPS
    turns_deg: tuple[float, ...] = TURNS_DEG


@dataclass(frozen=True, eq=False)
class LandmarkPerception:
    """Kind `landmarks`: distances and bearings to the points of a points map.

    Attributes:
        intended_pose: the intended pose.
        measured: shape (n, 2), in the order of the points: distance in the map's unit, bearing
            in radians; NaN for a landmark that was not seen.
        steps: in the map's unit; turns_deg: degrees.
    """

    intended_pose: IntendedPose
    measured: NDArray[np.float64]
    steps: tuple[float, ...] = STEPS
    turns_deg: tuple[float, ...] = TURNS_DEG


@dataclass(frozen=True, eq=False)
class ReadingsPerception:
    """Kind `readings`: what the sensors returned, whatever that is (Activity 9.5).

    Attributes:
        intended_pose: `UNTOLD` where the file has none.
        readings: shape (n,), in the order of the sensors; NaN where one returned nothing.
    """

    intended_pose: IntendedPose
    readings: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GridCandidate:
    """The perception map of one candidate, written out.

    Attributes:
        position, turn_deg: which candidate.
        cells: shape (rows, columns), int8, top row first: -1 empty, +1 obstacle, 0 unknown.
    """

    position: str
    turn_deg: float
    cells: NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class GridPerceptions:
    """Kind `grids`: the perception maps of all candidates, as in Fig. 9.20.

    Attributes:
        candidates: all of the same size.
        corner: row and column of the map where their upper left cell lies; None if not told.
        intended_pose: the intended pose, if told.
        steps: the length of a step, if the positions are named as in the book.
    """

    candidates: tuple[GridCandidate, ...]
    corner: tuple[int, int] | None = None
    intended_pose: IntendedPose | None = None
    steps: tuple[float, ...] = STEPS


@dataclass(frozen=True, eq=False)
class ExpectedReadings:
    """What a robot expects to read at one pose.

    Attributes:
        position, turn_deg: which candidate; pose: in the map's frame, if known.
        readings: shape (n, 2): bearing and range of each beam (inf: no return), or distance and
            bearing of each landmark (NaN: not seen); radians. Of `readings`, shape (n, 1).
    """

    position: str
    turn_deg: float
    pose: Pose2D | None
    readings: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PerceptionDatabase:
    """Kind `database`: a set of readings for each pose (Activity 9.5).

    Attributes:
        of: the kind of the readings.
        range_max: of scans, where no return is.
        step: what readings that count as equal may differ by.
    """

    of: ReadingsKind
    expectations: tuple[ExpectedReadings, ...]
    range_max: float = math.inf
    step: float = 1.0


Measured = ScanPerception | LandmarkPerception | ReadingsPerception
"""Sets of readings, of the kinds that a database may hold."""


@dataclass(frozen=True)
class Trial:
    """A set of readings that was taken at a known pose of the database."""

    position: str
    turn_deg: float
    measured: Measured


@dataclass(frozen=True)
class MeasuredTrials:
    """Kind `trials`: sets of readings, several times at each pose (Activity 9.5)."""

    of: ReadingsKind
    trials: tuple[Trial, ...]


Perceived = Measured | GridPerceptions | PerceptionDatabase | MeasuredTrials
"""What a perception file holds."""


def measured_of(of: ReadingsKind, readings: NDArray[np.float64], range_max: float) -> Measured:
    """Readings in the form that a database has them in, as a perception without a pose."""
    if of == "scan":
        return ScanPerception(UNTOLD, readings, range_max)
    if of == "landmarks":
        return LandmarkPerception(UNTOLD, readings)
    return ReadingsPerception(UNTOLD, readings[:, 0])
