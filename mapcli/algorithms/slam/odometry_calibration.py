"""Online calibration of odometry: its systematic errors, estimated from the log itself.

Odometry counts too much or too little of every metre and of every turn, and drifts to one side
(Borenstein and Feng 1996: systematic errors). Where the map fixes the robot's motion, the factors
are estimated from it, and they help where the map does not: along corridors and in wide halls.
"""

from __future__ import annotations

import math

from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.se2_uncertainty import (
    InformationMatrix,
    StandardDeviations,
    covariance_from_information,
)

PRIOR_M, PRIOR_TURN = 1.0, math.radians(90.0)
"""Metres and radians of motion that the prior, that odometry counts right, is worth: after so much
a measured factor has the same weight."""

MATCH_FLOOR = StandardDeviations(0.01, math.radians(0.3))
"""By how much two matched poses are off at best."""

TURNING = math.radians(4.0)
"""A motion that turns by less says nothing about the factor of turns: there heading noise would
pass for turning."""

OUTLIER_SIGMAS = 3.0
"""A motion farther off than this many standard deviations of odometry is a failure of the odometry
or of the match: an outlier, which is left out."""


class OdometryCalibration:
    """Factors on what odometry counts (stateful: `update` changes them).

    true motion = (metres * x, metres * y, turns * theta + drift * x) for a counted one (x, y,
    theta), estimated by instrumental variables: the instruments are the signs of what is counted,
    since least squares would take its noise for motion and underestimate the factors.

    Attributes:
        metres: metres driven for each one counted; turns: the same for turns.
        drift: radians of turn for each metre counted.
    """

    def __init__(self) -> None:
        self.metres, self.turns, self.drift = 1.0, 1.0, 0.0
        self._counted = self._driven = PRIOR_M / MATCH_FLOOR.xy**2
        turning = PRIOR_TURN / MATCH_FLOOR.theta**2
        driving = PRIOR_M / MATCH_FLOOR.theta**2
        # Of (turns, drift): normal @ (turns, drift) = right.
        self._normal, self._right = ((turning, 0.0), (0.0, driving)), (turning, 0.0)

    def correct(self, motion: Pose2D) -> Pose2D:
        """A motion as odometry counts it, as it probably was."""
        turn = self.turns * motion.theta + self.drift * motion.x
        return Pose2D(self.metres * motion.x, self.metres * motion.y, wrap_angle(turn))

    def update(
        self,
        counted: Pose2D,
        found: Pose2D,
        information: InformationMatrix,
        deviations: StandardDeviations,
    ) -> None:
        """Compare a counted motion with the one found in the map, unless it is an outlier.

        Args:
            information: on the pose found, in the robot's frame, from the map alone.
            deviations: standard deviations of odometry for this motion.
        """
        expected = self.correct(counted)
        off, turned = found.distance(expected), abs(wrap_angle(found.theta - expected.theta))
        if off > OUTLIER_SIGMAS * deviations.xy or turned > OUTLIER_SIGMAS * deviations.theta:
            return
        covariance = covariance_from_information(information).tolist()
        self._update_metres(counted, found, covariance[0][0] + MATCH_FLOOR.xy**2)
        self._update_turns(counted, found, covariance[2][2] + MATCH_FLOOR.theta**2)

    def _update_metres(self, counted: Pose2D, found: Pose2D, variance: float) -> None:
        weight = math.copysign(1, counted.x) / variance
        self._counted += weight * counted.x
        self._driven += weight * found.x
        self.metres = self._driven / self._counted

    def _update_turns(self, counted: Pose2D, found: Pose2D, variance: float) -> None:
        """Factor of turns and drift together; the instruments are the sign of a turn, if it is one,
        and the sign of the way ahead."""
        weight, ahead = 1 / variance, math.copysign(1, counted.x)
        turning = abs(counted.theta) > TURNING
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
