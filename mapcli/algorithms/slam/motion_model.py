"""Lines 2 and 3 of Algorithm 9.2: how far the robot has moved by its odometry (dead reckoning), and
the odometry noise model: standard deviations per metre and per radian."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from mapcli.algorithms.slam.odometry_calibration import OdometryCalibration
from mapcli.algorithms.slam.stale_odometry import StaleOdometry
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import (
    CERTAIN,
    AxisDeviations,
    InformationMatrix,
    StandardDeviations,
)

HIGHEST_SPEED = 5.0
"""Metres per second; odometry that claims more (and more than a metre) has jumped."""

WINDOW_SIGMAS, SILENT_WINDOW_SIGMAS = 4.0, 2.0
"""Half-widths of the search window, in standard deviations: with odometry, whose errors have heavy
tails, and without, where twice the deviation is as far as a robot can be followed."""

AGREES_SIGMAS = 3.0
"""Standard deviations of odometry within which a counted motion is the one that was found."""


MODEL_NOISE = StandardDeviations(1.0, 1.0)
"""As shares of the model's deviations: odometry errs as the model says."""

FAILURE_COST = 20.0
"""Nats: what it costs at most to believe that odometry erred. Wheels fail at one scan of a thousand
(6.9), and of the poses within some metres a scan tells some hundred thousand apart (12 to 13), one
of which always fits by chance."""

SIDEWAYS = 0.3
"""By what share of its deviation ahead a step is off to the side: wheels roll ahead. What leads
aside is the error of the heading on the way (1 mm in 0.1 m), a frame that is turned by a degree or
two (4 mm) and odometry that comes late in a bend (5 mm), where 30 mm may be missing ahead."""

PRIOR_STEPS = 10
"""Steps that the prior, that odometry errs as the model says, is worth."""

MOST_SIGMAS = 2.0
"""Standard deviations of the model that an error counts at most: failures are no noise."""


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
        sideways: the deviation to the left, as a share of that ahead, see `SIDEWAYS`.
    """

    xy_floor: float = 0.02
    xy_per_m: float = 0.1
    xy_per_rad: float = 0.05
    turn_floor_deg: float = 0.5
    turn_per_rad: float = 0.15
    turn_deg_per_m: float = 2.0
    silent_xy: float = 0.3
    silent_turn_deg: float = 10.0
    sideways: float = SIDEWAYS

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
        sideways = max(self.sideways, abs(motion.y) / metres) if metres > 0 else self.sideways
        return OdometryUncertainty(deviations, metres, sideways=sideways)


@dataclass(frozen=True, slots=True)
class OdometryUncertainty:
    """How far off a pose that odometry predicts may be.

    Attributes:
        deviations: standard deviations of the predicted pose.
        metres: driven since the pose before.
        window_sigmas: half-width of the search window, in standard deviations.
        usual: standard deviations of what odometry usually errs by in this log, as shares of
            `deviations`, which have to do for all robots.
        is_suspect: no robot moves as odometry counted.
        since_known: standard deviations of the pose before, as they have added up since the map
            told it last.
        sideways: the deviation to the left, as a share of that ahead; robots that drive sideways
            count that, and err by as much.
    """

    deviations: StandardDeviations
    metres: float
    window_sigmas: float = WINDOW_SIGMAS
    usual: StandardDeviations = MODEL_NOISE
    is_suspect: bool = False
    since_known: StandardDeviations = CERTAIN
    sideways: float = 1.0

    def along_axes(self, factor: float = 1.0) -> AxisDeviations:
        """The deviations ahead, to the left and of the heading, so many times as large."""
        return self.deviations.scaled(factor).along_axes(self.sideways)

    def separates(self, predicted: Pose2D, pose: Pose2D, sigmas: float) -> bool:
        """Whether two poses differ by more than so many standard deviations, in position or in
        heading."""
        turn = abs(predicted.between(pose).theta)
        far = predicted.distance(pose) > sigmas * self.deviations.xy
        return far or turn > sigmas * self.deviations.theta

    def cost(self, predicted: Pose2D, pose: Pose2D) -> float:
        """How unlikely it is that odometry errs so much: its negative log-likelihood, nats, up to
        that of a failure."""
        xy = predicted.distance(pose) / (self.deviations.xy * self.usual.xy)
        theta = predicted.between(pose).theta / (self.deviations.theta * self.usual.theta)
        return min((xy**2 + theta**2) / 2, FAILURE_COST)


class OdometryNoise:
    """How far off odometry is in this log, as shares of the model's deviations (stateful: a running
    mean of squared errors)."""

    def __init__(self) -> None:
        self._steps, self._xy, self._theta = PRIOR_STEPS, 1.0, 1.0

    @property
    def shares(self) -> StandardDeviations:
        return StandardDeviations(math.sqrt(self._xy), math.sqrt(self._theta))

    def update(self, counted: Pose2D, found: Pose2D, deviations: StandardDeviations) -> None:
        """Compare a counted motion, calibrated, with the one found in the map."""
        error = counted.between(found)
        xy = min(math.hypot(error.x, error.y) / deviations.xy, MOST_SIGMAS)
        theta = min(abs(error.theta) / deviations.theta, MOST_SIGMAS)
        self._steps += 1
        self._xy += (xy**2 / 2 - self._xy) / self._steps  # two axes, so half for each
        self._theta += (theta**2 - self._theta) / self._steps


class DeadReckoning:
    """Odometry's motion from scan to scan (stateful: it calibrates itself, and knows what was
    delivered late).

    Attributes:
        calibration: odometry's systematic errors, as far as they are known; None leaves it as it
            is counted.
        jumps: steps that were rejected because no robot moves so fast.
        catch_ups: steps that delivered what had not been counted when the robot did it.
    """

    def __init__(self, model: MotionModel | None = None, *, calibrate: bool = True) -> None:
        self.model = model or MotionModel()
        self.calibration = OdometryCalibration() if calibrate else None
        self.noise, self.jumps, self.catch_ups = OdometryNoise(), 0, 0
        self._last: tuple[int, Pose2D | None] | None = None
        # The last motion as counted, and calibrated; None if it came late, or not at all.
        self._increment: Pose2D | None = None
        self._step: Pose2D | None = None
        self._step_s, self._stale = 0.0, StaleOdometry()
        self._late: Pose2D | None = None  # all that was counted late, if the last step caught up

    def motion(self, stamp_ns: int, odom: Pose2D | None) -> Pose2D | None:
        """What the robot did since the last scan, in its frame then; None if it cannot be told.

        Args:
            odom: the odometry's pose at the scan's stamp; None where it is silent.
        """
        last, self._last = self._last, (stamp_ns, odom)
        self._increment = self._step = self._late = None
        self._step_s = (stamp_ns - last[0]) * 1e-9 if last else 0.0
        if last is None or last[1] is None or odom is None:
            return None
        increment = last[1].between(odom)
        step = self.calibration.correct(increment) if self.calibration else increment
        rest = self._stale.rest(step, self._step_s)
        if rest is not None:
            self.catch_ups += 1
            self._late = self._stale.counted.compose(step)
            return rest
        if last[1].distance(odom) > 1.0 + HIGHEST_SPEED * self._step_s:
            self.jumps += 1
            return None
        self._increment, self._step = increment, step
        return step

    def uncertainty(self, motion: Pose2D | None) -> OdometryUncertainty:
        """How far off a predicted pose may be after a motion; after what was late, all of it."""
        if motion is None:
            return self.model.uncertainty(None)
        uncertainty = self.model.uncertainty(motion if self._late is None else self._late)
        suspect = self._step is not None and self._stale.is_impossible(self._step, self._step_s)
        return replace(uncertainty, usual=self.noise.shares, is_suspect=suspect)

    def compare(self, found: Pose2D) -> None:
        """Hold the last motion against that between the matched poses, see `StaleOdometry`."""
        step, agrees = self._step, True
        if step is not None:
            agrees = not self.model.uncertainty(step).separates(step, found, AGREES_SIGMAS)
        self._stale.update(step, found, self._step_s, agrees=agrees)

    def calibrate(self, found: Pose2D, information: InformationMatrix | None) -> None:
        """Compare the last motion with the one found in the map, see `OdometryCalibration`."""
        if self.calibration and self._increment is not None and information is not None:
            deviations = self.model.uncertainty(self._increment).deviations
            self.calibration.update(self._increment, found, information, deviations)
        if self._step is not None:
            self.noise.update(self._step, found, self.model.uncertainty(self._step).deviations)
