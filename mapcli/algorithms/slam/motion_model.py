"""Lines 2 and 3 of Algorithm 9.2: how far the robot has moved by its odometry (dead reckoning), and
the odometry noise model: standard deviations per metre and per radian."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mapcli.algorithms.slam.odometry_calibration import OdometryCalibration
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import InformationMatrix, StandardDeviations

HIGHEST_SPEED = 5.0
"""Metres per second; odometry that claims more (and more than a metre) has jumped."""

WINDOW_SIGMAS, SILENT_WINDOW_SIGMAS = 4.0, 2.0
"""Half-widths of the search window, in standard deviations: with odometry, whose errors have heavy
tails, and without, where twice the deviation is as far as a robot can be followed."""


@dataclass(frozen=True)
class MotionModel:
    """How far odometry may err over one step: standard deviations.

    Attributes:
        xy_floor: metres, even when the robot stands; xy_per_m, xy_per_rad: metres more per metre
            and per radian of motion.
        turn_floor_deg: degrees; turn_per_rad: radians per radian; turn_deg_per_m: degrees per
            metre.
        silent_xy, silent_turn_deg: where there is no odometry at all, and the robot is searched
            for around where it was.
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
        """Of the pose after a motion, in the robot's frame before it; None is an unknown motion."""
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

    def separates(self, predicted: Pose2D, pose: Pose2D, sigmas: float) -> bool:
        """Whether two poses differ by more than so many standard deviations, in position or in
        heading."""
        turn = abs(predicted.between(pose).theta)
        far = predicted.distance(pose) > sigmas * self.deviations.xy
        return far or turn > sigmas * self.deviations.theta


class DeadReckoning:
    """Odometry's motion from scan to scan (stateful: it calibrates itself).

    Attributes:
        calibration: odometry's systematic errors, as far as they are known; None leaves it as it
            is counted.
        jumps: steps that were rejected because no robot moves so fast.
    """

    def __init__(self, model: MotionModel | None = None, *, calibrate: bool = True) -> None:
        self.model = model or MotionModel()
        self.calibration = OdometryCalibration() if calibrate else None
        self.jumps = 0
        self._last: tuple[int, Pose2D | None] | None = None
        self._increment: Pose2D | None = None

    def motion(self, stamp_ns: int, odom: Pose2D | None) -> Pose2D | None:
        """What the robot did since the last scan, in its frame then; None if it cannot be told.

        Args:
            odom: the odometry's pose at the scan's stamp; None where it is silent.
        """
        self._increment = raw = self._raw_increment(stamp_ns, odom)
        if raw is None or self.calibration is None:
            return raw
        return self.calibration.correct(raw)

    def _raw_increment(self, stamp_ns: int, odom: Pose2D | None) -> Pose2D | None:
        """The odometry's motion since the last scan; None where it is silent, or jumps."""
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

    def calibrate(self, found: Pose2D, information: InformationMatrix | None) -> None:
        """Compare the last motion with the one found in the map, see `OdometryCalibration`."""
        if self.calibration and self._increment is not None and information is not None:
            deviations = self.model.uncertainty(self._increment).deviations
            self.calibration.update(self._increment, found, information, deviations)
