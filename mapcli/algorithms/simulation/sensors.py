"""The sensors of a simulated robot: odometry with noise, systematic errors and faults; a laser."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from mapcli.algorithms.simulation.scene import Scene
from mapcli.errors import DataError
from mapcli.model.pose import Pose2D
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import NANOSECONDS, Mount, RangeScan
from mapcli.model.sweep import BeamOrder, BeamTiming

RANGE_STEP = 2.0**-10
"""Ranges are measured in steps of about a millimetre; a power of two, because that compresses."""

MOST_BEAMS = 1_000_000

FaultKind = Literal["reverse-sign", "slip", "freeze", "slip-left", "slip-right", "stale", "turn"]
FAULT_KINDS: tuple[str, ...] = get_args(FaultKind)

SPIN = 0.5
"""A wheel that slips turns this much more than it rolls."""

TURN_DEG = 15.0
"""Degrees that `turn` is about, from its begin to its end."""

TRACK = 0.3
"""Metres from wheel to wheel."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A failure of the odometry.

    Attributes:
        kind: `reverse-sign`: the wheels count metres backwards; `slip`: the wheels turn on while
            the robot stands; `freeze`: the wheels count nothing while the robot moves;
            `slip-left`, `slip-right`: that wheel turns half as much again as it rolls; `stale`:
            readings repeat the last one, then the first afterwards has all that was missed;
            `turn`: the right wheel loses its grip (Sect. 9.5), so that the robot comes where the
            wheels count but ends `TURN_DEG` clockwise of the heading that they count.
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
        delay: seconds by which readings lag behind their stamps.
        faults: when the odometry fails.

    Raises:
        DataError: a rate or a scale that is not positive, or noise that is negative.
    """

    rate: float = 20.0
    noise: tuple[float, float, float, float] = (0.02, 0.02, 0.02, 0.005)
    scale: float = 1.0
    turn_scale: float = 1.0
    drift_deg: float = 0.0
    delay: float = 0.0
    faults: tuple[Fault, ...] = ()

    def __post_init__(self) -> None:
        _check_positive(rate=self.rate, scale=self.scale, turn_scale=self.turn_scale)
        if not math.isfinite(self.drift_deg):
            raise DataError(f"drift_deg is {self.drift_deg:g}", expected="a finite number")
        if not 0 <= self.delay < math.inf:
            raise DataError(f"delay is {self.delay:g}", expected="seconds, 0 or more")
        if len(self.noise) != 4 or not all(0 <= sigma < math.inf for sigma in self.noise):
            raise DataError(f"noise {self.noise}", expected="four numbers, 0 or more")
        in_time = sorted(self.faults, key=lambda fault: fault.begin)
        for a, b in pairwise(in_time):
            if b.begin < a.end:
                raise DataError(f"faults overlap at {b.begin:g} s", expected="one at a time")
        object.__setattr__(self, "faults", tuple(in_time))

    def fault_at(self, time: float) -> FaultKind | None:
        """The fault at a time, in seconds since the start of the log."""
        fault = self._fault_at(time)
        return None if fault is None else fault.kind

    def _fault_at(self, time: float) -> Fault | None:
        return next((f for f in self.faults if f.begin <= time < f.end), None)

    def counted(self, moved: Pose2D, time: float) -> Pose2D:
        """The relative pose by which the wheels turn when the robot moves by `moved`.

        A robot that stands with both wheels slipping has no motion to tell it from.

        Args:
            time: in the midst of the motion, seconds since the start of the log.
        """
        fault = self._fault_at(time)
        match fault.kind if fault else None:
            case "turn" if fault:
                share = min(1 / (self.rate * (fault.end - fault.begin)), 1.0)
                return Pose2D(moved.x, moved.y, moved.theta + math.radians(TURN_DEG) * share)
            case "freeze":
                return Pose2D()
            case "reverse-sign":
                return Pose2D(-moved.x, -moved.y, moved.theta)
            case "slip-left":
                spin = SPIN * (moved.x - moved.theta * TRACK / 2)
                return Pose2D(moved.x + spin / 2, moved.y, moved.theta - spin / TRACK)
            case "slip-right":
                spin = SPIN * (moved.x + moved.theta * TRACK / 2)
                return Pose2D(moved.x + spin / 2, moved.y, moved.theta + spin / TRACK)
            case _:
                return moved

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
        rate: scans per second.
        turn_time: seconds of a full turn, in which the beams are taken one after another; 0 takes
            all in an instant, without skew.
        order: of the array, in which `backward` puts the beam taken first last.
        beams, fov_deg: number of beams, and degrees from the first to the last, centred ahead;
            360 spreads them over the full turn.
        range_min, range_max: metres; closer reads -inf, farther +inf (REP 117).
        no_return: what reads instead of +inf, metres: one of these, drawn for each beam.
        noise: standard deviation of a range, metres.
        dropout: share of the beams that read NaN, in [0, 1).
        stray: share of the beams that read anything within the range, in [0, 1).
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
    stray: float = 0.0
    mount: Mount = field(default_factory=Mount)
    turn_time: float = 0.0
    order: BeamOrder = "forward"
    no_return: tuple[float, ...] = ()

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
        if not 0 <= self.stray < 1:
            raise DataError(f"stray is {self.stray:g}", expected="a share in [0, 1)")
        if not 0 <= self.turn_time <= 1 / self.rate:
            raise DataError(
                f"turn_time is {self.turn_time:g}",
                expected=f"seconds, up to those from scan to scan, {1 / self.rate:g}",
            )
        if not all(0 <= code < math.inf for code in self.no_return):
            raise DataError(f"no_return is {self.no_return}", expected="metres, 0 or more")

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

    @property
    def timing(self) -> BeamTiming:
        """When the beams are taken; the stamp is that of the first."""
        return BeamTiming(self.turn_time * self.angle_increment / math.tau, "first", self.order)

    def scan(
        self, scene: Scene, robot_at: Callable[[float], Pose2D], time: float, start_ns: int,
        rng: np.random.Generator,
    ) -> RangeScan:  # fmt: skip
        """The scan whose first beam is taken at a time.

        Args:
            robot_at: pose of the robot, by seconds since the start of the log.
            time: seconds since then.
            start_ns: stamp of the start of the log.
        """
        fan = self.angle_min, self.angle_increment, self.beams
        times = time + (self.timing.after_stamp(self.beams) if self.turn_time else np.zeros(1))
        lasers = [robot_at(float(moment)).compose(self.mount.pose) for moment in times]
        ranges = scene.distances(lasers, times, fan, self.range_max)
        ranges += self.noise * rng.standard_normal(self.beams)
        ranges = np.round(ranges / RANGE_STEP) * RANGE_STEP
        ranges[ranges > self.range_max] = np.inf
        ranges[ranges < self.range_min] = -np.inf
        if self.stray:
            strays = rng.random(self.beams) < self.stray
            ranges[strays] = rng.uniform(self.range_min, self.range_max, np.count_nonzero(strays))
        ranges[rng.random(self.beams) < self.dropout] = np.nan
        if self.no_return:
            nothing = np.isposinf(ranges)
            ranges[nothing] = rng.choice(self.no_return, np.count_nonzero(nothing))
        return RangeScan(
            start_ns + round(time * NANOSECONDS), *fan[:2], ranges.astype(np.float32),
            self.range_min, self.range_max, self.mount, self.timing,
        )  # fmt: skip

    def blank(self, name: str) -> RangeReading:
        """A reading of nothing, of a range sensor of this name."""
        ranges = np.array([np.nan], dtype=np.float32)
        return RangeReading(0, 0.0, 0.0, ranges, self.range_min, self.range_max, self.mount,
                            sensor=name)  # fmt: skip

    def reading(
        self, name: str, scene: Scene, robot_at: Callable[[float], Pose2D], time: float,
        start_ns: int, rng: np.random.Generator,
    ) -> RangeReading:  # fmt: skip
        """The reading of a range sensor of this name, of one beam, see `scan`."""
        scan = self.scan(scene, robot_at, time, start_ns, rng)
        return RangeReading(**{item.name: getattr(scan, item.name) for item in fields(scan)},
                            sensor=name)  # fmt: skip


def _check_positive(**values: float) -> None:
    for name, value in values.items():
        if not 0 < value < math.inf:
            raise DataError(f"{name} is {value:g}", expected="more than 0")
