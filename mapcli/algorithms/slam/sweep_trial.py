"""Some scans tracked by themselves: how well they fit the map that they make, and what they ask for
as the time that a turn of the laser takes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mapcli.algorithms.scans.apparent_motion import MOVED_M, metres_moved
from mapcli.algorithms.scans.odometry_interpolation import ScanAtOdometry
from mapcli.algorithms.scans.perception import Perception, range_limits
from mapcli.algorithms.slam._kernels.gauss_newton import LEAST_INFORMATION
from mapcli.algorithms.slam._kernels.sweep_time import TimeEquations, add_scan
from mapcli.algorithms.slam.local_map import MIDDLE, LocalMap
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.scan_points import points_of
from mapcli.algorithms.slam.slam import Slam, SlamParameters
from mapcli.algorithms.slam.surfel_map import BEARING_VARIANCE, INDEPENDENT_SHARE
from mapcli.model.pose import Pose2D
from mapcli.model.scan import NANOSECONDS, Mount, RangeScan

FEWEST = 10
"""Scans under which the robot moves that trials are compared by, at least."""

CERTAIN = 4.0
"""Standard errors of the mean by which the scores of a trial exceed those of another beyond
doubt."""


class TimeEstimate(NamedTuple):
    """Seconds of a turn that scans ask for beyond those that they are deskewed by; negative if the
    array holds the last beam first.

    Attributes:
        error: its standard deviation; inf as long as nothing is known.
    """

    seconds: float
    error: float


class SweepTrial:
    """Scans tracked with the times that their beams have (stateful: `step`)."""

    def __init__(self, parameters: SlamParameters) -> None:
        # Scans that are bent by a turn seem to have been taken a little aside.
        odometry = replace(parameters.odometry, sideways=1.0)
        self._parameters = p = replace(parameters, loops=None, odometry=odometry)
        self._slam = Slam(p)
        self._slam.local_map = _WatchedMap(p, self._ask)
        self._scan: RangeScan | None = None
        self._last = dict[Mount, tuple[int, Pose2D]]()
        self._scores, self._moved = list[float](), list[bool]()
        self._periods_s, self._asked = list[float](), list[tuple[float, float]]()

    def step(self, scan: RangeScan, odom: Pose2D | None) -> None:
        """Track a scan."""
        self._scan = scan
        self._moved.append(False)
        traced = self._slam.step(scan, odom)
        self._scores.append(traced.score or 0.0)
        self._last[scan.mount] = scan.stamp_ns, traced.pose

    def steps(self, scans: Iterable[ScanAtOdometry]) -> SweepTrial:
        """Track scans, and be done."""
        for scan, odom in scans:
            self.step(scan, odom)
        return self

    def has_moved(self, scans: int) -> bool:
        """Whether the robot moved under so many scans, or hardly at all under four times as
        many."""
        return max(sum(self._moved), len(self._moved) / 4) >= scans

    @property
    def mean_score(self) -> float:
        """Of all scans."""
        return float(np.mean(self._scores))

    @property
    def period_s(self) -> float:
        """Median seconds from a scan of a laser to its next one; 0 is not known."""
        return float(np.median(self._periods_s)) if self._periods_s else 0.0

    def is_better_than(self, other: SweepTrial, sigmas: float = CERTAIN) -> bool:
        """Whether scans that were taken while the robot moved fit better than in a trial that began
        with the same scan, by so many standard errors."""
        pairs = zip(self._scores, other._scores, self._moved, other._moved, strict=False)
        gains = [mine - its for mine, its, moved, also in pairs if moved or also]
        if len(gains) < FEWEST:
            return False
        return float(np.mean(gains)) > sigmas * float(np.std(gains)) / math.sqrt(len(gains))

    def estimate(self) -> TimeEstimate:
        """What the scans ask for.

        The map is made of scans that are bent as well, and in the same way as long as the robot
        goes on as before; so this has the right sign, and is 0 where nothing is missing, but else
        a tenth to a half of it.
        """
        information, right = np.array(self._asked).reshape(-1, 2).T
        total = float(information.sum())
        if not total > 0:
            return TimeEstimate(0.0, math.inf)
        seconds = float(right.sum()) / total
        scatter = math.sqrt(float(((right - seconds * information) ** 2).sum())) / total
        return TimeEstimate(seconds, max(scatter, (INDEPENDENT_SHARE * total) ** -0.5))

    def _ask(self, pose: Pose2D, perception: Perception, grid: OccupancyGrid) -> None:
        """Note what a scan asks for, at its pose in a map that it is no part of yet."""
        scan = self._scan
        if scan is None or scan.mount not in self._last:
            return
        stamp_ns, before = self._last[scan.mount]
        seconds, moved = (scan.stamp_ns - stamp_ns) / NANOSECONDS, before.between(pose)
        if seconds <= 0 or metres_moved(scan, moved) < MOVED_M:
            return
        self._moved[-1] = True
        self._periods_s.append(seconds)
        points = points_of(perception, self._parameters.map.resolution)
        beams = scan.hits(*range_limits(scan, self._parameters.perception))[points.numbers]
        shares = beams.astype(np.float64) * (abs(scan.angle_increment) / math.tau)
        velocity = np.array([moved.x, moved.y, moved.theta]) / seconds
        equations = TimeEquations(LEAST_INFORMATION * np.eye(4), np.zeros(4))
        at, table = np.array([pose.x, pose.y, pose.theta]), grid.surfels.table
        add_scan(table, points.metres, shares, at, velocity, BEARING_VARIANCE, equations)
        self._asked.append(_of_time(equations))


class _WatchedMap(LocalMap):
    """A local map that shows what comes to it before it is written to."""

    def __init__(
        self,
        parameters: SlamParameters,
        watch: Callable[[Pose2D, Perception, OccupancyGrid], None],
    ) -> None:
        super().__init__(OccupancyGrid(parameters.map), parameters.local_map)
        self._watch = watch

    def update(self, pose: Pose2D, perception: Perception, laser: Mount = MIDDLE) -> bool:
        self._watch(pose, perception, self.grid)
        return super().update(pose, perception, laser)


def _of_time(equations: TimeEquations) -> tuple[float, float]:
    """Information and right side of the time alone, whatever the pose is (Schur complement)."""
    normal, right = equations
    shares = np.linalg.solve(normal[:3, :3], normal[:3, 3])
    return float(normal[3, 3] - normal[3, :3] @ shares), float(right[3] - right[:3] @ shares)
