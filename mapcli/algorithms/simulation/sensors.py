"""The sensors of a simulated robot: odometry with noise, systematic errors and faults; a laser."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.ray_casting import cast
from mapcli.errors import DataError
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount, RangeScan

RANGE_STEP = 2.0**-10
"""Ranges are measured in steps of about a millimetre; a power of two, because that compresses."""

MOST_BEAMS = 1_000_000

FaultKind = Literal["reverse-sign", "slip", "freeze"]
FAULT_KINDS: tuple[str, ...] = get_args(FaultKind)


@dataclass(frozen=True, slots=True)
class Fault:
    """A failure of the odometry.

    Attributes:
        kind: `reverse-sign`: the wheels count metres backwards; `slip`: the wheels turn on while
            the robot stands; `freeze`: the wheels count nothing while the robot moves.
        begin, end: seconds since the start of the log.

    Raises:
        DataError: another kind, or a time that does not end after it began.
    """

    kind: FaultKind
    begin: float
    end: float

    def __post_init__(self) -> None:
        if self.kind not in FAULT_KINDS:
            raise DataError(f"fault {self.kind!r}", expected=" or ".join(FAULT_KINDS))
        if not 0 <= self.begin < self.end < math.inf:
            raise DataError(
                f"fault from {self.begin:g} to {self.end:g} s", expected="an end after its begin"
            )


@dataclass(frozen=True, slots=True)
class WheelModel:
    """The odometry of wheels.

    The noise grows with the square root of the distance, a random walk, so that it does not
    depend on how often the wheels are read (the alphas of Thrun's odometry model would make it
    vanish at high rates).

    Attributes:
        rate: readings per second.
        noise: standard deviations: of the heading, radians, after one radian turned and after
            one metre driven; of the distance, metres, after one metre driven and after one radian
            turned. Thrun's alphas 1 to 4 in their order.
        scale, turn_scale: factors on metres and radians; 1 is right.
        drift_deg: degrees turned per metre that the wheels do not measure.
        faults: when the odometry fails.

    Raises:
        DataError: a rate or a scale that is not positive, or noise that is negative.
    """

    rate: float = 20.0
    noise: tuple[float, float, float, float] = (0.02, 0.02, 0.02, 0.005)
    scale: float = 1.0
    turn_scale: float = 1.0
    drift_deg: float = 0.0
    faults: tuple[Fault, ...] = ()

    def __post_init__(self) -> None:
        _check_positive(rate=self.rate, scale=self.scale, turn_scale=self.turn_scale)
        if not math.isfinite(self.drift_deg):
            raise DataError(f"drift_deg is {self.drift_deg:g}", expected="a finite number")
        if len(self.noise) != 4 or not all(0 <= sigma < math.inf for sigma in self.noise):
            raise DataError(f"noise {self.noise}", expected="four numbers, 0 or more")
        in_time = sorted(self.faults, key=lambda fault: fault.begin)
        for a, b in pairwise(in_time):
            if b.begin < a.end:
                raise DataError(f"faults overlap at {b.begin:g} s", expected="one at a time")
        object.__setattr__(self, "faults", tuple(in_time))

    def fault_at(self, time: float) -> FaultKind | None:
        """The fault at a time, in seconds since the start of the log."""
        return next((f.kind for f in self.faults if f.begin <= time < f.end), None)

    def measured(self, moved: Pose2D, rng: np.random.Generator) -> Pose2D:
        """The relative pose that the wheels measure when the robot really moves by `moved`."""
        distance, turn = math.hypot(moved.x, moved.y), abs(moved.theta)
        alpha1, alpha2, alpha3, alpha4 = self.noise
        distance_sigma = math.sqrt(alpha3**2 * distance + alpha4**2 * turn)
        turn_sigma = math.sqrt(alpha1**2 * turn + alpha2**2 * distance)
        distance_error, turn_error = rng.standard_normal(2) * (distance_sigma, turn_sigma)
        return Pose2D(
            moved.x * self.scale + distance_error,  # wheels do not slide sideways
            moved.y * self.scale,
            moved.theta * self.turn_scale + turn_error - math.radians(self.drift_deg) * distance,
        )


@dataclass(frozen=True, slots=True)
class LaserModel:
    """A range sensor.

    Attributes:
        rate: scans per second. A scan is taken in an instant, without skew.
        beams, fov_deg: number of beams, and degrees from the first to the last, centred ahead;
            360 spreads them over the full turn.
        range_min, range_max: metres; closer reads -inf, farther +inf (REP 117).
        noise: standard deviation of a range, metres.
        dropout: share of the beams that read NaN, in [0, 1).
        mount: where the laser sits on the robot.

    Raises:
        DataError: a value outside its bounds.
    """

    rate: float = 10.0
    beams: int = 360
    fov_deg: float = 360.0
    range_min: float = 0.0
    range_max: float = 12.0
    noise: float = 0.01
    dropout: float = 0.0
    mount: Mount = field(default_factory=Mount)

    def __post_init__(self) -> None:
        _check_positive(rate=self.rate, beams=self.beams, range_max=self.range_max)
        if self.beams > MOST_BEAMS:
            raise DataError(f"beams is {self.beams}", expected=f"at most {MOST_BEAMS:,}")
        if not 0 < self.fov_deg <= 360:
            raise DataError(f"fov_deg is {self.fov_deg:g}", expected="degrees, up to 360")
        if not 0 <= self.range_min < self.range_max:
            raise DataError(f"range_min is {self.range_min:g}", expected="less than range_max")
        if not 0 <= self.noise < math.inf:
            raise DataError(f"noise is {self.noise:g}", expected="metres, 0 or more")
        if not 0 <= self.dropout < 1:
            raise DataError(f"dropout is {self.dropout:g}", expected="a share in [0, 1)")

    @property
    def angle_min(self) -> float:
        if self.beams == 1:
            return 0.0  # the middle of its field of view
        return -math.radians(self.fov_deg) / 2

    @property
    def angle_increment(self) -> float:
        # A full turn must not measure straight back twice.
        gaps = self.beams if self.fov_deg == 360 else max(self.beams - 1, 1)
        return math.radians(self.fov_deg) / gaps

    def scan(
        self, edges: NDArray[np.float64], robot: Pose2D, stamp_ns: int, rng: np.random.Generator
    ) -> RangeScan:
        """The scan from a robot at a pose.

        Args:
            edges: of the obstacles, as of `edges_of`.
        """
        fan = self.angle_min, self.angle_increment
        laser = robot.compose(self.mount.pose)
        ranges = cast(edges, laser, *fan, self.beams, self.range_max)
        ranges += self.noise * rng.standard_normal(self.beams)
        ranges = np.round(ranges / RANGE_STEP) * RANGE_STEP
        ranges[ranges > self.range_max] = np.inf
        ranges[ranges < self.range_min] = -np.inf
        ranges[rng.random(self.beams) < self.dropout] = np.nan
        limits = self.range_min, self.range_max
        return RangeScan(stamp_ns, *fan, ranges.astype(np.float32), *limits, self.mount)


def _check_positive(**values: float) -> None:
    for name, value in values.items():
        if not 0 < value < math.inf:
            raise DataError(f"{name} is {value:g}", expected="more than 0")
