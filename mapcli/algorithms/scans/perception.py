"""Line 4 of Algorithm 9.2, "analyze sensor data": a scan becomes the perception map p.

The perception map holds only what the sensor saw (Sect. 9.7): where beams ended at obstacles and
what they passed on the way, all in the robot's frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.gathering import SHORT_WAY_M
from mapcli.model.pose import Pose2D
from mapcli.model.range_reading import GatheredScan
from mapcli.model.scan import RangeScan
from mapcli.model.sweep import STILL, SweepMotion

NoReturn = Literal["clear", "ignore"]
"""What a beam without return tells: `clear`, that it passed open space up to the maximum range;
`ignore`, nothing, since dark and polished things do not answer."""

FARTHEST = 250.0
"""Metres; readings beyond are taken for no return: no laser scanner for robots sees farther."""


@dataclass(frozen=True)
class PerceptionParameters:
    """Which readings of a scan are used, and for what.

    Attributes:
        range_min, range_max: metres; None takes the sensor's own limits. Nearer readings are left
            out, farther ones count as no return.
        no_return: what the beams without return tell, see `NoReturn`.
        gather_m: metres of way over which readings of several sensors with one beam each are one
            perception, see `gathering`.
    """

    range_min: float | None = None
    range_max: float | None = None
    no_return: NoReturn = "ignore"
    gather_m: float = SHORT_WAY_M


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """The beams of a perception in time.

    Attributes:
        raw: shape (n + k + 1, 2), `Perception.beams` in the robot's frame when each was taken.
        seconds: shape (n + k + 1,), when that was, after the scan's stamp.
        motion: of the robot, by which they were deskewed.
    """

    raw: NDArray[np.float64]
    seconds: NDArray[np.float64]
    motion: SweepMotion

    def perception(self, hits: int) -> Perception:
        """The beams where they were taken; the first so many are hits."""
        moved = self.motion.deskew(self.raw, self.seconds)
        return Perception(moved[:hits], moved[hits:-1], moved[-1], self)


@dataclass(frozen=True, eq=False)
class Perception:
    """What one scan tells about obstacles and open space, in the robot's frame, metres.

    Attributes:
        hits: shape (n, 2), where beams ended at an obstacle.
        open_ends: shape (k, 2), up to where beams without return passed open space.
        laser: shape (2,), where the beams start; of a sweep, in the middle of it.
        sweep: when the beams were taken, and from where; None is at once.
        readings: if it is of several sensors, what each of them told, in the same frame: their
            beams have starts of their own, and `laser` is in the middle of these.
        sensors: which of the sensors told each of the readings, from 0.
        independent: share of the hits that are evidence of their own about the robot's pose: the
            readings of one sensor along a way share its errors, and odometry's.
    """

    hits: NDArray[np.float64]
    open_ends: NDArray[np.float64]
    laser: NDArray[np.float64]
    sweep: Sweep | None = None
    readings: tuple[Perception, ...] = ()
    sensors: tuple[int, ...] = ()
    independent: float = 1.0

    def beams(self) -> NDArray[np.float64]:
        """Shape (n + k + 1, 2): where beams ended, hits first, and last where they start."""
        return np.concatenate([self.hits, self.open_ends, self.laser[None]])

    def parts(self) -> tuple[Perception, ...]:
        """The same as perceptions whose beams each have one start."""
        return self.readings or (self,)

    def deskewed(self, motion: SweepMotion) -> Perception:
        """The same beams, if the robot moved like this while they were taken."""
        if self.sweep is None:
            return self
        return replace(self.sweep, motion=motion).perception(len(self.hits))

    def moved(self, motion: Pose2D) -> Perception:
        """The same, of beams taken at once, in the parent's frame of a motion."""
        laser = motion.apply(self.laser[None])[0]
        return Perception(motion.apply(self.hits), motion.apply(self.open_ends), laser)


NOTHING_SEEN = Perception(np.empty((0, 2)), np.empty((0, 2)), np.zeros(2))
"""The perception before the first scan."""


def range_limits(scan: RangeScan, parameters: PerceptionParameters) -> tuple[float, float]:
    """The nearest and the farthest reading of a scan that count as hits, metres."""
    nearest = scan.range_min if parameters.range_min is None else parameters.range_min
    farthest = scan.range_max if parameters.range_max is None else parameters.range_max
    return nearest, min(farthest, FARTHEST)


def perceive(scan: RangeScan, parameters: PerceptionParameters) -> Perception:
    """The perception map of a scan: obstacles at the ends of its beams, and open space along them.

    Beams without return count as `parameters.no_return` says. Beams that were taken one after
    another are deskewed, if the robot's motion is known. Readings that were gathered over a short
    way are put where they were taken.
    """
    if isinstance(scan, GatheredScan):
        mounts = list(dict.fromkeys(reading.mount for reading, _ in scan.readings))
        sensors = [mounts.index(reading.mount) for reading, _ in scan.readings]
        readings = [perceive(one, parameters).moved(pose) for one, pose in scan.readings]
        return _together(readings, sensors)
    nearest, farthest = range_limits(scan, parameters)
    open_ends = np.empty((0, 2))  # `ignore`
    if parameters.no_return == "clear":
        open_ends = scan.free_ends(farthest)
    mount = scan.mount.pose
    p = Perception(scan.points(nearest, farthest), open_ends, np.array([mount.x, mount.y]))
    if scan.first_ns == scan.last_ns:
        return p
    seconds = scan.beam_seconds()
    opened = seconds[scan.ranges > farthest] if len(open_ends) else ()
    times = np.concatenate([seconds[scan.hits(nearest, farthest)], opened, [seconds.mean()]])
    return Sweep(p.beams(), times, scan.motion or STILL).perception(len(p.hits))


def _together(readings: Sequence[Perception], sensors: Sequence[int]) -> Perception:
    """One perception of what several sensors told, in the same frame."""
    telling = [k for k, one in enumerate(readings) if len(one.hits) + len(one.open_ends)]
    return Perception(
        np.concatenate([one.hits for one in readings]),
        np.concatenate([one.open_ends for one in readings]),
        np.mean([one.laser for one in readings], axis=0),
        readings=tuple(readings[k] for k in telling),
        sensors=tuple(sensors[k] for k in telling),
        independent=len(set(sensors)) / len(readings),
    )
