"""A simulated robot: a drive through a world becomes the log of its sensors."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.ray_casting import clearance, edges_of, is_inside
from mapcli.algorithms.simulation.drive import Drive, MotionLimits
from mapcli.algorithms.simulation.drive_plan import plan_drive
from mapcli.algorithms.simulation.people import walk_about
from mapcli.algorithms.simulation.scene import Scene, glazed
from mapcli.algorithms.simulation.sensors import Fault, LaserModel, WheelModel
from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import NANOSECONDS, Odometry, RangeScan, Record, TruePose
from mapcli.model.waypoint import Waypoint
from mapcli.model.world import World

START_NS = 1_600_000_000 * 10**9
"""Stamp of the first record unless another is asked for: the clock is no input."""

ROBOT_RADIUS = 0.15
"""Metres: a robot as wide as a vacuum cleaner."""

FIRST_SENSOR = 5
"""Number of the random generator of the first range sensor."""

POSE_STEP = 2.0**-20
"""Poses are recorded in steps of about a micrometre and a microradian, so that a log does not
depend on the last bit of a machine's sine; a power of two, because that compresses."""


@dataclass(frozen=True)
class Simulation:
    """A drive through a world, as the sensors of the robot record it.

    Attributes:
        world: polygons, or a grid map whose cells of at least 0.5 are solid.
        drive: where the robot goes, from `plan_drive`.
        odometry, laser: the sensors.
        seed: of the noise; any whole number from 0 is a seed. Wheels, lasers, people and glass
            draw from generators of their own, so that changing one leaves the noise of the others.
        sensors: range sensors with one beam each, by name, instead of the lasers.
        staggered: they fire one after another, evenly within a period, as sonars do that would
            hear each other.
        rear: a second laser, which scans half a period after the first; None for none.
        people: how many walk about, from somewhere on the robot's way.
        glass: share of what is solid that is of glass, see `glazed`.
        start_ns: stamp of the first record.

    Raises:
        DataError: a fault of the odometry that begins after the end of the drive, a rear laser
            where the first one is, less than no people, a share outside [0, 1].
    """

    world: World | GridMap
    drive: Drive
    odometry: WheelModel = field(default_factory=WheelModel)
    laser: LaserModel = field(default_factory=LaserModel)
    seed: int = 0
    rear: LaserModel | None = None
    people: int = 0
    glass: float = 0.0
    start_ns: int = START_NS
    sensors: Mapping[str, LaserModel] = field(default_factory=dict)
    staggered: bool = False

    def __post_init__(self) -> None:
        if self.people < 0:
            raise DataError(f"people is {self.people}", expected="0 or more")
        if not 0 <= self.glass <= 1:
            raise DataError(f"glass is {self.glass:g}", expected="a share in [0, 1]")
        if self.rear and self.rear.mount == self.laser.mount:
            raise DataError("both lasers sit at the same place", expected="two places")
        for fault in self.odometry.faults:
            if fault.begin >= self.duration:
                raise DataError(
                    f"the fault {fault.kind} begins at {fault.begin:g} s",
                    expected=f"a time before the end of the drive at {self.duration:.1f} s",
                )

    @cached_property
    def scene(self) -> Scene:
        """What the lasers see."""
        people, glass = self._generator(3), self._generator(4)
        edges, end = edges_of(self.world), self.duration
        starts = [self.true_pose(time) for time in people.uniform(0, end, self.people)]
        walks = (walk_about(edges, (start.x, start.y), end, people) for start in starts)
        return Scene(*glazed(self.world, self.glass, glass), tuple(walks))

    def _generator(self, number: int) -> np.random.Generator:
        """Of wheels, laser, rear laser, people, glass, and then each range sensor: each draws from
        its own."""
        seed = np.random.SeedSequence(self.seed).spawn(number + 1)[number]
        return np.random.Generator(np.random.PCG64(seed))

    @property
    def duration(self) -> float:
        """Seconds of the log: the drive, and the time that the wheels slip."""
        return self._log_time(self.drive.duration)

    @property
    def record_count(self) -> int:
        """How many records there will be."""
        return 2 * self.reading_count + self.scan_count

    def arrivals(self) -> list[float]:
        """Seconds since the start of the log at which the robot leaves each waypoint behind."""
        return [self._log_time(time) for time in self.drive.arrivals()]

    def records(self) -> Iterator[Record]:
        """The log, lazily, in the order of the stamps: true pose, odometry, scan at each."""
        streams: list[Iterator[Record]] = [
            self._true_poses(), self._odometry(self._generator(0)),
        ]  # fmt: skip
        if self.sensors:
            streams += [self._readings(number) for number in range(len(self.sensors))]
            return heapq.merge(*streams, key=lambda record: record.stamp_ns)
        streams.append(self._scans(self.laser, self._scan_times(), self._generator(1)))
        if self.rear:
            streams.append(self._scans(self.rear, self._rear_times(), self._generator(2)))
        return heapq.merge(*streams, key=lambda record: record.stamp_ns)

    def true_pose(self, time: float) -> Pose2D:
        """Where the robot really is, `time` seconds after the start of the log."""
        return self.drive.pose_at(self._driven(time))

    def _true_poses(self) -> Iterator[TruePose]:
        for time in self._odometry_times():
            yield TruePose(self._stamp(time), _rounded(self.true_pose(time)))

    def _odometry(self, rng: np.random.Generator) -> Iterator[Odometry]:
        """Odometry starts at zero wherever the robot stands, as it does on a real robot."""
        pose = reading = Pose2D()
        for time in self._odometry_times():
            if time > 0:
                motion = self._wheel_motion(time - self.odometry.delay)
                pose = pose.compose(self.odometry.measured(motion, rng))
            if self.odometry.fault_at(time) != "stale":
                reading = pose
            yield Odometry(self._stamp(time), _rounded(reading))

    def _scans(
        self, laser: LaserModel, times: Iterator[float], rng: np.random.Generator
    ) -> Iterator[RangeScan]:
        for time in times:
            yield laser.scan(self.scene, self.true_pose, time, self.start_ns, rng)

    def _readings(self, number: int) -> Iterator[RangeReading]:
        """Of one of the range sensors, which has noise of its own."""
        name, sensor = list(self.sensors.items())[number]
        rng = self._generator(FIRST_SENSOR + number)
        for time in self._firing_times(number):
            yield sensor.reading(name, self.scene, self.true_pose, time, self.start_ns, rng)

    def _firing_times(self, number: int) -> Iterator[float]:
        """Of one of the range sensors, none past the end."""
        sensors = list(self.sensors.values())
        late = number / len(sensors) / sensors[number].rate if self.staggered else 0.0
        times = (late + time for time in self._times(sensors[number]))
        return (time for time in times if time <= self.duration)

    def _times(self, sensor: LaserModel) -> Iterator[float]:
        return (i / sensor.rate for i in range(math.floor(self.duration * sensor.rate) + 1))

    def _scan_times(self) -> Iterator[float]:
        return self._times(self.laser)

    def _rear_times(self) -> Iterator[float]:
        rate = self.rear.rate if self.rear else 0.0
        return ((i + 0.5) / rate for i in range(math.floor(self.duration * rate + 0.5)))

    def _stamp(self, time: float) -> int:
        return self.start_ns + round(time * NANOSECONDS)

    @property
    def reading_count(self) -> int:
        """Odometry readings: one past the end, so that the log ends where the drive does."""
        return math.ceil(self.duration * self.odometry.rate) + 1

    @property
    def scan_count(self) -> int:
        """Scans of all lasers, or readings of all sensors, none that begins past the end."""
        if self.sensors:
            return sum(1 for k in range(len(self.sensors)) for _ in self._firing_times(k))
        return sum(1 for _ in self._scan_times()) + sum(1 for _ in self._rear_times())

    def _odometry_times(self) -> Iterator[float]:
        return (i / self.odometry.rate for i in range(self.reading_count))

    def _wheel_motion(self, time: float) -> Pose2D:
        """The relative pose since the reading before `time` by which the wheels turned."""
        step = 1 / self.odometry.rate
        middle = time - step / 2
        if self.odometry.fault_at(middle) == "slip":  # they turn on as when they lost their grip
            driven = self._driven(time)
            return self.drive.pose_at(driven - step).between(self.drive.pose_at(driven))
        moved = self.true_pose(time - step).between(self.true_pose(time))
        return self.odometry.counted(moved, middle)

    def _driven(self, time: float) -> float:
        """The part of the time that the robot did not stand with slipping wheels."""
        return time - sum(max(0.0, min(time, s.end) - s.begin) for s in self._slips())

    def _log_time(self, driven: float) -> float:
        """The time of the log at which the robot has driven so long."""
        for slip in self._slips():
            driven += slip.end - slip.begin if slip.begin < driven else 0.0
        return driven

    def _slips(self) -> list[Fault]:
        return [fault for fault in self.odometry.faults if fault.kind == "slip"]


def simulate(
    world: World | GridMap,
    waypoints: Sequence[Waypoint],
    *,
    limits: MotionLimits | None = None,
    wheels: WheelModel | None = None,
    laser: LaserModel | None = None,
    robot_radius: float = ROBOT_RADIUS,
    seed: int = 0,
) -> Simulation:
    """Drive a simulated robot along waypoints; its log is `records()` of the result, lazily.

    Args:
        world: polygons, or a grid map whose cells of at least 0.5 are solid.
        waypoints: the first is the start.
        limits, wheels, laser: of the robot; None for the defaults.
        robot_radius: metres to keep from obstacles, more than 0.
        seed: of the noise.

    Raises:
        DataError: as of `plan_drive`, `check_clearance` and `Simulation`.
    """
    drive = plan_drive(waypoints, limits)
    check_clearance(world, drive, robot_radius)
    return Simulation(world, drive, wheels or WheelModel(), laser or LaserModel(), seed)


def check_clearance(world: World | GridMap, drive: Drive, radius: float = ROBOT_RADIUS) -> None:
    """Refuse a drive with a collision.

    Args:
        radius: of the robot, metres, more than 0.

    Raises:
        DataError: the robot starts in an obstacle, or comes closer to one than its radius; it
            names the waypoint.
    """
    start = drive.pose_at(0.0)
    if is_inside(world, start.x, start.y):
        raise DataError(f"waypoint 1 ({start.x:g}, {start.y:g}) lies in an obstacle")
    edges, apart = edges_of(world), max(radius / 2, 0.001)
    for times in _in_blocks(drive, apart):
        # Far from all obstacles, one pose speaks for its block.
        first, reach = drive.pose_at(times[0]), radius + BLOCK * apart
        if clearance(edges, np.array([(first.x, first.y)]), reach)[0] == np.inf:
            continue
        poses = [drive.pose_at(time) for time in times]
        gaps = clearance(edges, np.array([(pose.x, pose.y) for pose in poses]), radius)
        hit = int(np.argmax(gaps < radius))
        if gaps[hit] < radius:
            pose, waypoint = poses[hit], drive.waypoint_at(times[hit])
            raise DataError(
                f"at ({pose.x:.2f}, {pose.y:.2f}), on the way to waypoint {waypoint + 1}, "
                f"the robot is {gaps[hit]:.2f} m from an obstacle",
                expected=f"at least its radius, {radius:g} m",
            )


BLOCK = 64
"""Poses that are checked for collisions at a time."""


def _in_blocks(drive: Drive, metres: float) -> Iterator[NDArray[np.float64]]:
    """Times at most so many metres of driving apart, in blocks of `BLOCK`."""
    step = metres / max(profile.peak for profile in drive.profiles)
    for first in range(0, math.ceil(drive.duration / step) + 1, BLOCK):
        yield np.minimum(np.arange(first, first + BLOCK) * step, drive.duration)


def _rounded(pose: Pose2D) -> Pose2D:
    values = pose.x, pose.y, wrap_angle(pose.theta)
    return Pose2D(*(round(value / POSE_STEP) * POSE_STEP for value in values))
