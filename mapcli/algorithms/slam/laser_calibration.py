"""Where the laser sits on the robot, found from the log, for logs that do not tell.

A laser ahead of the centre moves sideways while the robot turns. Pairs of scans are matched, and
the laser's motions compared with the robot's by odometry (`hand_eye`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mapcli.algorithms.scans.mount_check import MountCheck, has_moved, is_far
from mapcli.algorithms.scans.odometry_interpolation import ScanAtOdometry
from mapcli.algorithms.scans.perception import PerceptionParameters, perceive
from mapcli.algorithms.slam.hand_eye import Floats, Motions, jackknife, solve
from mapcli.model.pose import Pose2D, rounded_angle, wrap_angle
from mapcli.model.range_reading import GatheredScan
from mapcli.model.scan import Mount, RangeScan

CELL_M = 0.25
"""Side of a cell of surfels: what the turn of a pair moves a laser by is less than that."""
POINT_M = 0.05
"""Of the points of a scan, one of each cell of this side is fitted."""

MOST_PAIRS, FEWEST_PAIRS = 256, 60
"""Pairs of scans that are kept, spread over the drive, and that tell something, at least."""

ROUNDS = 3
"""Of fitting: beams that are taken one after another are deskewed by the mount that was found."""

FEWEST_POINTS, LEAST_MATCHED = 20, 0.5
"""Of a scan, and the share of them that meet those of the other."""

WHEELS = 0.01, 0.01, math.radians(0.3)
"""Standard deviations of x, y and yaw that no scatter shows: wheels of unequal size, or that slip
in turns, move the centre that odometry turns about."""

LEAST, SIGNIFICANT = (0.05, 0.05, math.radians(2)), 4.0
"""Metres, and an angle, by which a laser sits elsewhere than assumed, to be told, and up to which
that must be known: less is not seen in a map. And so many standard deviations."""

AGREEING = 0.8
"""Share of all turns in which scans and wheels turn the same way, at least; or else the other way,
where the laser is seen from the wrong side. In between, wheels tell nothing."""

MOST_SCALE, MOST_UNEXPLAINED = 1.5, 0.2
"""Odometry that counts so much too much or too little tells nothing, nor does one by which so much
of the laser's motions is not explained. On drives that were measured it is 0.11 at most, and 0.29
where scans and odometry are of different times (`benchmarks/RESULTS.md`)."""


class LaserEstimate(NamedTuple):
    """Where the laser seems to sit.

    Attributes:
        mount: to the centimetre and a tenth of a degree; in the middle, and along an axis of the
            robot, as far as errors allow.
        found: x, y (metres) and yaw (radians) as they came out; errors: their standard deviations.
    """

    mount: Mount
    found: tuple[float, float, float]
    errors: tuple[float, float, float]


class _Pair(NamedTuple):
    before: RangeScan
    after: RangeScan
    motion: Pose2D
    """Of the robot between them, by odometry, in its frame at the first."""


class LaserCalibration:
    """Keeps pairs of scans of a log with odometry between them (stateful).

    Args:
        is_wanted: whether the mount is unknown; asked when the first scans have come.
    """

    def __init__(self, is_wanted: Callable[[], bool]) -> None:
        self.is_wanted = is_wanted
        self._pairs = list[_Pair]()
        self._before: ScanAtOdometry | None = None
        self._seen, self._stride = 0, 1

    def watched(self, scans: Iterable[ScanAtOdometry]) -> Iterator[ScanAtOdometry]:
        """The scans with odometry at their stamps, in order."""
        for scan, odom in scans:
            if self.is_wanted() and not isinstance(scan, GatheredScan):
                self._add(scan, odom)
            yield scan, odom

    def _add(self, scan: RangeScan, odom: Pose2D | None) -> None:
        before, at = self._before or (scan, None)
        if at is None or odom is None:
            self._before = scan, odom
            return
        motion = at.between(odom)
        if not has_moved(motion):
            return
        self._before = scan, odom
        if is_far(motion):
            return
        if self._seen % self._stride == 0:
            self._pairs.append(_Pair(before, scan, motion))
            if len(self._pairs) > MOST_PAIRS:
                del self._pairs[1::2]
                self._stride *= 2
        self._seen += 1

    def estimate(self, check: MountCheck) -> LaserEstimate | None:
        """Where the laser sits; None where the log does not show that it is elsewhere than at the
        centre or looks elsewhere than ahead.

        Args:
            check: of the same scans; tells about where it looks, and whether it is upside down.
        """
        if len(self._pairs) < FEWEST_PAIRS:
            return None
        finding = check.finding()
        start = finding.right if finding else self._pairs[0].before.mount
        if _matched(self._pairs, start).agreeing_turns() < 1 - AGREEING:
            start = replace(start, flipped=not start.flipped)
        mount = start
        for _ in range(ROUNDS):
            motions = _matched(self._pairs, mount)
            if len(motions.turns) < FEWEST_PAIRS or motions.agreeing_turns() < AGREEING:
                return None
            solution = solve(motions)
            if not 1 / MOST_SCALE < solution.scale < MOST_SCALE:
                return None
            mount = _mount(solution.pose, start)
        if solution.unexplained > MOST_UNEXPLAINED:
            return None
        return _told(solution.pose, np.hypot(jackknife(motions), WHEELS), start)


def _told(found: Floats, errors: Floats, start: Mount) -> LaserEstimate | None:
    """The estimate, if it is something else than a laser at the centre that looks ahead."""
    if (errors > LEAST).any() or (np.abs(found) < np.maximum(LEAST, SIGNIFICANT * errors)).all():
        return None
    quarter = math.pi / 2
    usual = np.array([0.0, 0.0, round(found[2] / quarter) * quarter])
    rounded = np.append(np.round(found[:2], 2), np.radians(np.round(np.degrees(found[2]), 1)))
    sure = np.where(np.abs(found - usual) > SIGNIFICANT * errors, rounded, usual)
    return LaserEstimate(_mount(sure, start), _three(found), _three(errors))


def _three(numbers: Floats) -> tuple[float, float, float]:
    x, y, yaw = (float(number) for number in numbers)
    return x, y, yaw


def _mount(found: Floats, start: Mount) -> Mount:
    x, y, yaw = _three(found)
    return Mount(Pose2D(x, y, rounded_angle(wrap_angle(yaw))), start.flipped)


def _matched(pairs: Iterable[_Pair], mount: Mount) -> Motions:
    """How the laser moved between the scans of each pair, if it is mounted so."""
    # Most logs tell, and need no compiled loops then: `mapcli info` is fast.
    from mapcli.algorithms.slam.surfel_map import BEARING_VARIANCE, SurfelMap

    laser, robot, turns, variances = [], [], [], []
    into_laser = mount.pose.inverse()
    for before, after, motion in pairs:
        seen, again = (_points(scan, mount) for scan in (before, after))
        if min(len(seen), len(again)) < FEWEST_POINTS:
            continue
        surfels = SurfelMap(CELL_M)
        surfels.add(seen)
        start = into_laser.compose(motion).compose(mount.pose)
        fit = surfels.fit(again, start, bearing_variance=BEARING_VARIANCE)
        if fit.matched < LEAST_MATCHED * len(again):
            continue
        laser.append(complex(fit.pose.x, fit.pose.y))
        robot.append(complex(motion.x, motion.y))
        turns.append((fit.pose.theta, motion.theta))
        variances.append(np.linalg.inv(fit.information + np.eye(3))[:2, :2])  # at most 1 m
    by_scans, by_wheels = np.array(turns).reshape(-1, 2).T
    shape = len(turns), 2, 2
    return Motions(
        np.array(laser), np.array(robot), by_scans, by_wheels, np.array(variances).reshape(shape)
    )


def _points(scan: RangeScan, mount: Mount) -> Floats:
    """Where its beams ended, in the frame of the laser, seen from above."""
    from mapcli.algorithms.slam.scan_points import voxel_filtered

    hits = perceive(replace(scan, mount=mount), PerceptionParameters()).hits
    return voxel_filtered(mount.pose.inverse().apply(hits), POINT_M)
