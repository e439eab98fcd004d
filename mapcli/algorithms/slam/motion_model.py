"""Lines 2 and 3 of Algorithm 9.2: how far the robot has moved, as far as its wheels can tell."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam.odometry_calibration import CalibrationParameters, OdometryCalibration
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import StandardDeviations

HIGHEST_SPEED = 5.0
"""Metres per second; odometry that claims more (and more than a metre) has jumped."""

WINDOW_SIGMAS, SILENT_WINDOW_SIGMAS = 4.0, 2.0
"""Half-widths of the search window, in standard deviations: with odometry and without."""


@dataclass(frozen=True)
class MotionModel:
    """How far odometry may err over one step: standard deviations.

    Attributes:
        xy_floor: metres, even when the robot stands; xy_per_m, xy_per_rad: metres more per metre
            and per radian of motion.
        turn_floor_deg: degrees; turn_per_rad: radians per radian; turn_deg_per_m: degrees per
            metre.
        silent_xy, silent_turn_deg: where there is no odometry at all, and the robot is looked for
            around where it was; twice as much is as far as it can be followed.
    """

    xy_floor: float = 0.02
    xy_per_m: float = 0.1
    xy_per_rad: float = 0.05
    turn_floor_deg: float = 0.5
    turn_per_rad: float = 0.15
    turn_deg_per_m: float = 2.0
    silent_xy: float = 0.3
    silent_turn_deg: float = 10.0

    def uncertainty(self, motion: Pose2D | None) -> OdometryUncertainty:
        """What to expect after a motion; None is unknown."""
        if motion is None:
            deviations = StandardDeviations(self.silent_xy, math.radians(self.silent_turn_deg))
            return OdometryUncertainty(deviations, 0.0, SILENT_WINDOW_SIGMAS)
        metres, turn = math.hypot(motion.x, motion.y), abs(motion.theta)
        deviations = StandardDeviations(
            self.xy_floor + self.xy_per_m * metres + self.xy_per_rad * turn,
            math.radians(self.turn_floor_deg + self.turn_deg_per_m * metres)
            + self.turn_per_rad * turn,
        )
        return OdometryUncertainty(deviations, metres)


@dataclass(frozen=True, slots=True)
class OdometryUncertainty:
    """How far off a pose that odometry predicts may be.

    Attributes:
        deviations: standard deviations of the predicted pose.
        metres: driven since the pose before.
        window_sigmas: half-width of the search window, in standard deviations.
    """

    deviations: StandardDeviations
    metres: float
    window_sigmas: float = WINDOW_SIGMAS


class DeadReckoning:
    """The wheels' motions from scan to scan (stateful: it learns how wrong they usually are).

    Attributes:
        calibration: what has been learned.
        jumps: steps in which the odometry leapt and was not believed.
    """

    def __init__(
        self,
        model: MotionModel | None = None,
        calibration: CalibrationParameters | None = None,
    ) -> None:
        self.model = model or MotionModel()
        self.calibration = OdometryCalibration(calibration)
        self.jumps = 0
        self._last: tuple[int, Pose2D | None] | None = None
        self._counted: Pose2D | None = None

    def motion(self, stamp_ns: int, odom: Pose2D | None) -> Pose2D | None:
        """What the robot did since the last scan; None if it cannot be told."""
        self._counted = self._count(stamp_ns, odom)
        return None if self._counted is None else self.calibration.correct(self._counted)

    def _count(self, stamp_ns: int, odom: Pose2D | None) -> Pose2D | None:
        last, self._last = self._last, (stamp_ns, odom)
        if last is None or last[1] is None or odom is None:
            return None
        metres, seconds = last[1].distance(odom), (stamp_ns - last[0]) * 1e-9
        if metres > 1.0 + HIGHEST_SPEED * seconds:
            self.jumps += 1
            return None
        return last[1].between(odom)

    def uncertainty(self, motion: Pose2D | None) -> OdometryUncertainty:
        """How far off a predicted pose may be after a motion."""
        return self.model.uncertainty(motion)

    def calibrate(self, found: Pose2D, information: NDArray[np.float64] | None) -> None:
        """Compare the last motion with the one that the map shows, see `OdometryCalibration`."""
        if self._counted is not None and information is not None:
            self.calibration.calibrate(
                self._counted, found, information, self.model.uncertainty(self._counted).deviations
            )
