"""What the log itself tells about its odometry: how far off the wheels count, on the whole.

Wheels count too much or too little of every metre and of every turn, and drift to one side
(Borenstein and Feng 1996: systematic errors). Where the map fixes the robot's motion, that is
learned from it, and helps where the map does not: along corridors and in wide halls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.se2_uncertainty import (
    InformationMatrix,
    StandardDeviations,
    covariance_from_information,
)


@dataclass(frozen=True)
class CalibrationParameters:
    """How soon odometry's systematic errors are believed.

    Attributes:
        metres, turns_deg: how much motion it takes to believe it as much as what is usual, that
            wheels count right.
        floor, floor_deg: metres and degrees by which two matched poses are off at best.
        doubt: a motion farther off than this many standard deviations is a failure of the wheels
            or of the match, and teaches nothing.
    """

    metres: float = 1.0
    turns_deg: float = 90.0
    floor: float = 0.01
    floor_deg: float = 0.3
    turning_deg: float = 4.0
    doubt: float = 3.0


class OdometryCalibration:
    """Factors on what odometry says (stateful: `calibrate` changes them).

    Attributes:
        metres: metres driven for each one counted; turns: the same for turns.
        drift: radians of turn for each metre counted.
    """

    def __init__(self, parameters: CalibrationParameters | None = None) -> None:
        self.parameters = p = parameters or CalibrationParameters()
        self.metres, self.turns, self.drift = 1.0, 1.0, 0.0
        self._counted = self._driven = p.metres / p.floor**2
        turning = math.radians(p.turns_deg) / math.radians(p.floor_deg) ** 2
        driving = p.metres / math.radians(p.floor_deg) ** 2
        self._normal, self._right = ((turning, 0.0), (0.0, driving)), (turning, 0.0)

    def correct(self, motion: Pose2D) -> Pose2D:
        """A motion as odometry counts it, as it probably was."""
        turn = self.turns * motion.theta + self.drift * motion.x
        return Pose2D(self.metres * motion.x, self.metres * motion.y, wrap_angle(turn))

    def calibrate(
        self,
        counted: Pose2D,
        found: Pose2D,
        information: InformationMatrix,
        deviations: StandardDeviations,
    ) -> None:
        """Compare a counted motion with the one found in the map.

        Args:
            information: on the pose found, shape (3, 3), in the robot's frame, from the map alone.
            deviations: standard deviations of odometry for this motion, metres and radians.
        """
        p = self.parameters
        expected = self.correct(counted)
        off, turned = found.distance(expected), abs(wrap_angle(found.theta - expected.theta))
        if off > p.doubt * deviations.xy or turned > p.doubt * deviations.theta:
            return
        covariance = covariance_from_information(information).tolist()
        # Signs as instruments: squares of what the wheels count would count their noise as well.
        ahead = math.copysign(1, counted.x)
        weight = ahead / (covariance[0][0] + p.floor**2)
        self._counted += weight * counted.x
        self._driven += weight * found.x
        self.metres = self._driven / self._counted
        weight = 1 / (covariance[2][2] + math.radians(p.floor_deg) ** 2)
        turning = abs(counted.theta) > math.radians(p.turning_deg)
        turn, found_turn = math.copysign(turning, counted.theta), wrap_angle(found.theta)
        (a, b), (c, d) = self._normal
        self._normal = (
            (a + weight * turn * counted.theta, b + weight * turn * counted.x),
            (c + weight * ahead * counted.theta, d + weight * ahead * counted.x),
        )
        x, y = self._right
        self._right = x + weight * turn * found_turn, y + weight * ahead * found_turn
        self._solve()

    def _solve(self) -> None:
        (a, b), (c, d) = self._normal
        x, y = self._right
        determinant = a * d - b * c
        self.turns, self.drift = (d * x - b * y) / determinant, (a * y - c * x) / determinant
