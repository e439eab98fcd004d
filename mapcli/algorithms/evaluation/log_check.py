"""The quality of a log before mapping: timing of scans and odometry, gaps, jumps, repetitions."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.mount_check import MountCheck, MountFinding
from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.algorithms.slam.laser_calibration import LaserCalibration, LaserEstimate
from mapcli.algorithms.slam.sweep_search import SweepSearch
from mapcli.model.pose import wrap_angle
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import Odometry, RangeScan, Record
from mapcli.model.sweep import BeamOrder
from mapcli.model.sweep_summary import turn_time

GAP_PERIODS = 5.0
"""A gap is longer than this many periods (the longer of median and mean)..."""
GAP_S = 1.0
"""...and more than this, seconds."""

FASTEST_M_S, FASTEST_RAD_S = 10.0, 2 * math.tau
"""Faster odometry is a jump. Robots that map floor plans do 2 m/s."""
SHORTEST_STEP_S = 0.1
"""Stamps come in bursts; a step counts as at least this long."""


@dataclass(frozen=True)
class Timing:
    """The timing of records of one kind.

    Attributes:
        count, first_ns, last_ns: records, and their stamps.
        period_s: median time between two; 0 for fewer than two.
        gaps: times without records, much longer than the period.
        longest_gap_s, longest_gap_at_s: the longest of them, and when it starts, counted from
            the log's first record; 0 without gaps.
        same_stamps: records with the stamp of the one before.
    """

    count: int
    first_ns: int
    last_ns: int
    period_s: float
    gaps: int
    longest_gap_s: float
    longest_gap_at_s: float
    same_stamps: int


@dataclass(frozen=True)
class LogCheck:
    """The quality of a log, in metres, seconds and radians.

    Attributes:
        start_ns, end_ns: stamps of the first and the last record.
        scans, odometry: their timing.
        beams: fewest and most beams of a scan.
        bearings: least and greatest bearing in the laser's frame.
        turn_time_s: of a full turn of the laser, at most; sweep_time_s: from the first beam of a
            scan to the last; 0 if all beams are taken at once.
        turn_time_found: the log tells no times of beams; its scans show them.
        beam_order: in which the beams of the array are taken; None if that is not known.
        range_limits: least `range_min` and greatest `range_max` of the scans.
        repeated_scans: scans with the same ranges as the one before.
        scans_outside_odometry: scans before the first or after the last odometry.
        distance_m: length of the path by odometry, without jumps.
        turned_rad: sum of all turns by odometry, without jumps.
        mount: where the laser sits, if not where the log says; laser: if the log does not say, and
            it seems to be elsewhere than at the robot's centre.
        jumps: steps of the odometry faster than any robot that maps floor plans.
        first_jump_at_s: when, counted from the first record; None without jumps.
    """

    start_ns: int
    end_ns: int
    scans: Timing
    odometry: Timing
    beams: tuple[int, int]
    bearings: tuple[float, float]
    range_limits: tuple[float, float]
    turn_time_s: float
    sweep_time_s: float
    turn_time_found: bool
    beam_order: BeamOrder | None
    repeated_scans: int
    scans_outside_odometry: int
    distance_m: float
    turned_rad: float
    mount: MountFinding | None
    laser: LaserEstimate | None
    jumps: int
    first_jump_at_s: float | None


_description = attrgetter("angle_min", "angle_increment", "range_min", "range_max", "timing")


class _LogFacts:
    """Gathers the facts of records one by one; keeps eight bytes of each (stateful)."""

    def __init__(self, calibration: LaserCalibration | None) -> None:
        self.calibration = calibration
        self.start: int | None = None
        self.end = 0
        self.scan_stamps, self.odometry_stamps = array("q"), array("q")
        self.beams = [math.inf, 0.0]
        self.bearings = [math.inf, -math.inf]
        self.limits = [math.inf, 0.0]
        self.turn_s = self.sweep_s = 0.0
        self.repeated = self.jumps = 0
        self.distance = self.turned = 0.0
        self.first_jump_at_s: float | None = None
        self.mount, self.sweeps = MountCheck(), SweepSearch()
        self.order: BeamOrder | None = None
        self._last_scan: RangeScan | None = None
        self._last_description: tuple[object, ...] = ()
        self._last_odometry: Odometry | None = None

    def added(self, records: Iterable[Record]) -> Iterator[Record]:
        """The records, gathering their facts; scans with the times of their beams."""
        for record in self.sweeps.settled(records):
            self.add(record)
            yield record

    def add(self, record: Record) -> None:
        self.start = record.stamp_ns if self.start is None else self.start
        self.end = record.stamp_ns
        if isinstance(record, RangeScan):
            self._add_scan(record)
        elif isinstance(record, Odometry):
            self._add_odometry(record)

    def _add_scan(self, scan: RangeScan) -> None:
        if self._is_of_next_moment(scan):
            self.scan_stamps.append(scan.stamp_ns)
        description = len(scan.ranges), *_description(scan)
        if description != self._last_description:  # it seldom is
            self._describe(scan)
            self._last_description = description
        if scan.timing.increment:
            self.order = self.sweeps.order if self.sweeps.was_needed else scan.timing.order
        self.repeated += self._repeats(scan)
        self._last_scan = scan

    def _repeats(self, scan: RangeScan) -> bool:
        """Whether a scan has the very ranges of the one before. Ranges that follow REP 117 have one
        NaN and no zeros, so that equal ones have the same bytes."""
        if self._last_scan is None or isinstance(scan, RangeReading):
            return False  # of a sensor's readings the next may well be the same
        return self._last_scan.ranges.tobytes() == scan.ranges.tobytes()

    def _describe(self, scan: RangeScan) -> None:
        """Take what a scan says of its beams."""
        n = len(scan.ranges)
        ends = scan.angle_min, scan.angle_min + scan.angle_increment * (n - 1)
        for extremes, least, most in (
            (self.beams, n, n),
            (self.bearings, min(ends), max(ends)),
            (self.limits, scan.range_min, scan.range_max),
        ):
            extremes[0], extremes[1] = min(extremes[0], least), max(extremes[1], most)
        self.turn_s = max(self.turn_s, turn_time(scan))
        self.sweep_s = max(self.sweep_s, scan.timing.span(n))

    def _is_of_next_moment(self, scan: RangeScan) -> bool:
        """Range sensors that read at the same time are looked at as one."""
        before = self._last_scan
        if not (isinstance(scan, RangeReading) and isinstance(before, RangeReading)):
            return True
        return scan.stamp_ns != before.stamp_ns or scan.sensor == before.sensor

    def _add_odometry(self, odometry: Odometry) -> None:
        self.odometry_stamps.append(odometry.stamp_ns)
        last, self._last_odometry = self._last_odometry, odometry
        if last is None:
            return
        distance = last.pose.distance(odometry.pose)
        turn = abs(wrap_angle(odometry.pose.theta - last.pose.theta))
        time = max((odometry.stamp_ns - last.stamp_ns) * 1e-9, SHORTEST_STEP_S)
        if distance > FASTEST_M_S * time or turn > FASTEST_RAD_S * time:
            self.jumps += 1
            if self.first_jump_at_s is None:
                self.first_jump_at_s = (odometry.stamp_ns - (self.start or 0)) * 1e-9
        else:
            self.distance += distance
            self.turned += turn

    def result(self) -> LogCheck:
        start = self.start or 0
        scans, odometry = np.array(self.scan_stamps), np.array(self.odometry_stamps)
        outside = 0
        if len(odometry):
            outside = int(np.count_nonzero((scans < odometry[0]) | (scans > odometry[-1])))
        return LogCheck(
            start,
            self.end,
            _timing(scans, start),
            _timing(odometry, start),
            (int(min(self.beams)) if len(scans) else 0, int(self.beams[1])),
            (self.bearings[0], self.bearings[1]) if len(scans) else (0.0, 0.0),
            (self.limits[0], self.limits[1]) if len(scans) else (0.0, 0.0),
            self.turn_s,
            self.sweep_s,
            self.sweeps.turn_s > 0,
            self.order,
            self.repeated,
            outside,
            self.distance,
            self.turned,
            self.mount.finding(),
            self.calibration.estimate(self.mount) if self.calibration else None,
            self.jumps,
            self.first_jump_at_s,
        )


def check_log(records: Iterable[Record], calibration: LaserCalibration | None = None) -> LogCheck:
    """Check the scans and the odometry of a log.

    Args:
        records: in stamp order; read once, never held.
        calibration: finds out where the laser sits.
    """
    facts = _LogFacts(calibration)
    scans = facts.mount.watched(odometry_at_scans(facts.added(records)))
    for _ in calibration.watched(scans) if calibration else scans:
        pass
    return facts.result()


def _timing(stamps: NDArray[np.int64], start_ns: int) -> Timing:
    if len(stamps) == 0:
        return Timing(0, 0, 0, 0.0, 0, 0.0, 0.0, 0)
    first, last = int(stamps[0]), int(stamps[-1])
    steps = np.diff(stamps) * 1e-9
    period = float(np.median(steps)) if len(steps) else 0.0
    # Where stamps come in bursts, the mean says more about the period than the median.
    longer = max(period, (last - first) * 1e-9 / max(len(steps), 1))
    gaps = np.flatnonzero(steps > max(GAP_PERIODS * longer, GAP_S))
    longest, at = 0.0, 0.0
    if len(gaps):
        widest = gaps[np.argmax(steps[gaps])]
        longest, at = float(steps[widest]), float(stamps[widest] - start_ns) * 1e-9
    same = int(np.count_nonzero(steps == 0))
    return Timing(len(stamps), first, last, period, len(gaps), longest, at, same)
