"""Refinement of a trajectory whose scans were taken beam by beam.

`map_refinement` takes each scan as rigid. A scan that was taken while the robot
drove is not rigid: where its last beams were taken depends on where the robot went next. So all
poses are fitted at once, each point seen from the robot's pose at its own time, between the two
scans between which it was taken (continuous-time registration, as in CT-ICP, Dellenbach et al.
2022). The steps that odometry counted are factors between the poses.

Where sweeps follow each other, the poses themselves show how the robot moved meanwhile: a cubic
through them is better than wheels whose noise over a part of a turn is large, and worse than good
wheels where a turn takes long. Both show how far they are off, and are weighed by that. After a
pause the next pose says little about the sweep before, which stays as odometry has it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels import pose_chain
from mapcli.algorithms.slam._kernels import sweep_refinement as kernels
from mapcli.algorithms.slam._kernels.pose_chain import BAND, ChainEquations
from mapcli.algorithms.slam._kernels.sweep_refinement import ALONE, Path, TimedPoints
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.surfel_map import BEARING_VARIANCE, SurfelMap
from mapcli.algorithms.slam.sweep_path import (
    odometry_steps,
    shares_of_odometry,
    velocities_at,
)
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.scan import NANOSECONDS
from mapcli.model.sweep import STILL, SweepMotion
from mapcli.model.sweep_summary import Crispness

ROUNDS, STEPS, STILL_M = 2, 4, 5e-4
"""How often the surfel map is made, and Gauss-Newton steps with each at most; a step that moves
poses by less, metres on average, is the last."""

LONGEST_PAUSE = 1.0
"""Sweeps follow each other when the pause between them is at most so many times a sweep."""

SHORTEST = 0.2
"""Of a sweep: a shorter step, to the scan of another laser, tells no speed."""

OVERLAPPING = 0.8
"""Scans that come after a smaller part of a sweep are of several lasers: a point may be taken after
the next scan or the one after that, and goes by the cubic there."""

BLOCK_SCANS, BLOCKS_IN_MEMORY = 500, 8
"""Scans whose points are taken from the store together, and blocks that are kept."""

EVERY = 5
"""The points of which one tells what deskewing was worth."""

SAMPLES = 9
"""Of the motion during the sweep of a keyframe: a cubic between nine lines is off by less than a
hundredth of what it is off a single one."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """The result of a refinement.

    Attributes:
        trajectory: with the perceptions of its keyframes deskewed anew.
        poses: of every scan.
        crispness: what deskewing was worth; None if all beams of a scan were taken at once.
    """

    trajectory: TrackedTrajectory
    poses: list[Pose2D]
    crispness: Crispness | None = None


def refine_sweeps(
    trajectory: TrackedTrajectory, poses: list[Pose2D], cell: float, odometry: MotionModel
) -> Refined:
    """Fit all poses to the surfels that the keyframes show, each point seen from where it was
    taken.

    Args:
        trajectory: with `sweeps`.
        poses: of every scan, loops closed; cell: metres along a side of a surfel's cell.
    """
    fit = _SweepFit(trajectory, poses, odometry)
    for _ in range(ROUNDS):
        surfels = fit.surfel_map(cell)
        for _ in range(STEPS):
            if fit.step(surfels) < STILL_M:
                break
    return Refined(fit.deskewed(), fit.poses(), fit.crispness(surfels))


class _SweepFit:
    """The fit of a trajectory (stateful: `step` moves its poses).

    Attributes:
        path: the robot's way, as fitted by now.
    """

    def __init__(
        self, trajectory: TrackedTrajectory, poses: list[Pose2D], odometry: MotionModel
    ) -> None:
        self._trajectory, self._sweeps = trajectory, trajectory.sweeps
        self._odometry = odometry_steps(trajectory.sweeps, odometry)
        self._odometry.information[trajectory.gaps()] = 0.0
        self._stamps_s = np.array(
            [(stamp - self._sweeps.stamps_ns[0]) / NANOSECONDS for stamp in self._sweeps.stamps_ns]
        )
        self._follows = self._following()
        steps = np.diff(self._stamps_s)
        self._overlap = bool((steps < OVERLAPPING * self._sweeps.longest_s).any())
        array = np.array([(pose.x, pose.y, pose.theta) for pose in poses])
        array[:, 2] = np.unwrap(array[:, 2])
        self._set(array)
        self._block = lru_cache(maxsize=BLOCKS_IN_MEMORY)(self._read_block)

    def _following(self) -> NDArray[np.bool_]:
        """Whether the sweep of the next scan follows that of each but the last."""
        seconds = np.diff(self._stamps_s)
        return (seconds > 0) & (seconds <= (1 + LONGEST_PAUSE) * self._sweeps.longest_s)

    def _set(self, poses: Floats) -> None:
        seconds, counted = np.diff(self._stamps_s), self._odometry.counted
        is_long = seconds >= SHORTEST * self._sweeps.longest_s
        velocities = velocities_at(poses, seconds, self._follows & is_long)
        shares = np.zeros_like(counted)
        if not self._overlap:
            shares = shares_of_odometry(poses, self._follows, self._odometry)
        self.path = Path(poses, velocities, seconds, counted, shares)

    def poses(self) -> list[Pose2D]:
        """Of every scan, as fitted by now."""
        return [Pose2D(x, y, wrap_angle(theta)) for x, y, theta in self.path.poses.tolist()]

    def step(self, surfels: SurfelMap) -> float:
        """One step of Gauss-Newton; the metres that it moves poses by, on average."""
        n = 3 * len(self.path.poses)
        equations = ChainEquations(np.zeros((n, BAND)), np.zeros(n))
        for timed in self._blocks():
            seen_from = self._seen_from(timed)
            kernels.add_points(surfels.table, timed, seen_from, BEARING_VARIANCE, equations)
        pose_chain.add_odometry(self._odometry, self.path.poses, equations)
        pose_chain.solve_banded(equations)
        moved = equations.right.reshape(-1, 3)
        self._set(self.path.poses + moved)
        return float(np.hypot(moved[:, 0], moved[:, 1]).mean())

    def _seen_from(self, timed: TimedPoints) -> Floats:
        seen_from = np.empty((len(timed.scans), 3))
        kernels.place_points(timed, self.path, seen_from)
        return seen_from

    def surfel_map(self, cell: float) -> SurfelMap:
        """The surfels that the keyframes make."""
        surfels, keys = SurfelMap(cell), {one.scan for one in self._trajectory.keyframes}
        for timed in self._blocks():
            seen_from = self._seen_from(timed)
            cos, sin = np.cos(seen_from[:, 2]), np.sin(seen_from[:, 2])
            x, y = timed.points.T
            points = seen_from[:, :2] + np.column_stack([cos * x - sin * y, sin * x + cos * y])
            bounds = np.flatnonzero(np.diff(timed.scans, prepend=-1, append=-1))
            for first, end in pairwise(bounds.tolist()):
                if timed.scans[first] in keys:
                    surfels.add(points[first:end], seen_from[first, :2])
        return surfels

    def crispness(self, surfels: SurfelMap) -> Crispness:
        """How many points lie on walls, and how many would if each scan were taken at once, from
        the middle of where it was."""
        total = crisp = skewed = 0
        for timed in self._blocks():
            seen_from = self._seen_from(timed)
            some = np.ascontiguousarray(timed.points[::EVERY])
            crisp += kernels.points_on_walls(surfels.table, some, seen_from[::EVERY].copy())
            first = np.flatnonzero(np.diff(timed.scans, prepend=-1))
            counts = np.diff(first, append=len(timed.scans))
            middle = np.add.reduceat(seen_from, first, axis=0) / counts[:, None]
            at_once = np.repeat(middle, counts, axis=0)
            skewed += kernels.points_on_walls(surfels.table, some, at_once[::EVERY].copy())
            total += len(some)
        return Crispness(crisp / max(total, 1), skewed / max(total, 1))

    def _blocks(self) -> Iterator[TimedPoints]:
        for first in range(0, len(self.path.poses), BLOCK_SCANS):
            yield self._block(first)

    def _read_block(self, first: int) -> TimedPoints:
        """The points of some scans."""
        beams = self._sweeps.beams[first : first + BLOCK_SCANS]
        scans = np.repeat(np.arange(first, first + len(beams)), [len(scan) for scan in beams])
        everything = np.concatenate(beams).astype(np.float64)
        points = np.ascontiguousarray(everything[:, :2])
        return self._timed(points, scans, everything[:, 2], everything[:, 3:])

    def _timed(
        self, points: Floats, scans: NDArray[np.int64], seconds: Floats, motions: Floats
    ) -> TimedPoints:
        """Points of scans, taken so many seconds after the stamps."""
        steps = scans - (seconds < 0)
        if self._overlap:
            times = self._stamps_s[scans] + seconds
            steps = np.searchsorted(self._stamps_s, times, side="right") - 1
        inside = (steps >= 0) & (steps < len(self._follows))
        inside[inside] = self._follows[steps[inside]]
        steps[~inside] = ALONE
        shares = np.zeros(len(scans))
        since = self._stamps_s[scans[inside]] + seconds[inside] - self._stamps_s[steps[inside]]
        shares[inside] = since / self.path.seconds[steps[inside]]
        return TimedPoints(points, scans, steps, shares, np.ascontiguousarray(motions))

    def deskewed(self) -> TrackedTrajectory:
        """The trajectory with the perceptions of its keyframes as they were seen on this path."""
        keyframes = []
        for keyframe in self._trajectory.keyframes:
            sweep = keyframe.perception.sweep
            if sweep is not None:
                motion = self._motion(keyframe.scan, sweep.seconds)
                perception = keyframe.perception.deskewed(motion)
                keyframe = replace(keyframe, perception=perception)
            keyframes.append(keyframe)
        return replace(self._trajectory, keyframes=keyframes)

    def _motion(self, scan: int, seconds: Floats) -> SweepMotion:
        """How the robot moved during a scan on this path."""
        beams = self._sweeps.beams[scan].astype(np.float64)
        beams = beams[np.argsort(beams[:, 2], kind="stable")]
        counted = SweepMotion(beams[:, 2], beams[:, 3:]) if len(beams) else STILL
        samples = np.linspace(seconds.min(), seconds.max(), SAMPLES)
        scans = np.full(SAMPLES, scan)
        timed = self._timed(np.zeros((SAMPLES, 2)), scans, samples, counted.at(samples))
        x, y, theta = (self._seen_from(timed) - self.path.poses[scan]).T
        cos, sin = np.cos(self.path.poses[scan, 2]), np.sin(self.path.poses[scan, 2])
        return SweepMotion(samples, np.column_stack([cos * x + sin * y, cos * y - sin * x, theta]))
