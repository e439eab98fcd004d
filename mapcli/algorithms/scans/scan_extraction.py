"""One scan out of a log, as a perception to be scored against a map."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import chain, islice

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.odometry_interpolation import ScanAtOdometry, odometry_at_scans
from mapcli.algorithms.scans.perception import FARTHEST, PerceptionParameters, perceive
from mapcli.errors import DataError
from mapcli.model.perception import IntendedPose, ScanPerception
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.range_reading import GatheredScan
from mapcli.model.scan import RangeScan, Record
from mapcli.model.selection import select
from mapcli.model.sweep import SweepMotion
from mapcli.model.trajectory import wrap_angles


@dataclass(frozen=True, eq=False)
class ExtractedScan:
    """A scan of a log, and where odometry says it was taken.

    Attributes:
        scan: the scan; number: its place among the scans, counted from 0.
        seconds: after the log's first record.
        odom: the odometry's pose; first_odom: at the first scan, where maps start.
    """

    scan: RangeScan
    number: int
    seconds: float
    odom: Pose2D | None
    first_odom: Pose2D | None

    def pose(self) -> Pose2D:
        """Of the robot by odometry, in the map, which starts at the first scan."""
        if self.odom is None or self.first_odom is None:
            return Pose2D()
        return self.first_odom.between(self.odom)


def extract_scan(
    records: Iterable[Record],
    seconds: float,
    start_s: float | None = None,
    end_s: float | None = None,
    every: int = 1,
    settled: Callable[[Iterable[Record]], Iterable[Record]] = iter,
) -> ExtractedScan:
    """The scan nearest to a time after the log's first record; of two, the earlier one.

    Args:
        records: of the whole log, in stamp order.
        start_s, end_s, every: which of its scans are considered, see `model.selection.select`.
        settled: what finds when beams are taken where the log does not tell it
            (`slam.sweep_search`); by default, in the order of the array.

    Raises:
        DataError: the time is outside the log.
    """
    records = iter(records)
    first = list(islice(records, 1))
    start_ns = first[0].stamp_ns if first else 0
    selected = select(chain(first, records), start_s, end_s, every)
    return _nearest(odometry_at_scans(settled(selected)), start_ns, seconds)


def _nearest(scans: Iterable[ScanAtOdometry], start_ns: int, seconds: float) -> ExtractedScan:
    best: ExtractedScan | None = None
    first: Pose2D | None = None
    last = 0.0
    for number, (scan, odom) in enumerate(scans):
        first = odom if number == 0 else first
        last = (scan.stamp_ns - start_ns) * 1e-9
        if best is None or abs(last - seconds) < abs(best.seconds - seconds):
            best = ExtractedScan(scan, number, last, odom, first)
        elif last > seconds:
            return best
    if best is None:
        raise DataError("no scan in the part asked for")
    if seconds > last + 1.0:
        raise DataError(
            f"no scan at {seconds:g} s",
            expected=f"a time up to {last:.1f} s, where the last scan is",
        )
    return best


def scan_perception(
    scan: RangeScan, pose: Pose2D, parameters: PerceptionParameters | None = None
) -> ScanPerception:
    """A scan as a perception of kind `scan`; beams without a valid reading are left out, those
    taken one after another are deskewed if the robot's motion is known.

    Args:
        pose: of the robot in the map, where it intended to be.

    Raises:
        DataError: not one beam is left.
    """
    p = parameters or PerceptionParameters()
    if isinstance(scan, GatheredScan):
        return _gathered_perception(scan, pose, p)
    nearest = scan.range_min if p.range_min is None else p.range_min
    farthest = min(scan.range_max if p.range_max is None else p.range_max, FARTHEST)
    ranges = scan.ranges.astype(np.float64)
    valid = ~np.isnan(ranges) & (ranges >= nearest)
    ranges = np.where(ranges > farthest, np.inf, ranges)
    if not valid.any():
        raise DataError("the scan has no beam with a valid reading")
    mount = scan.mount.pose
    bearings = [wrap_angle(b + mount.theta) for b in scan.bearings()[valid].tolist()]
    beams = np.column_stack([bearings, ranges[valid]])
    if scan.motion is not None:
        beams = _deskewed(beams, mount, scan.beam_seconds()[valid], scan.motion)
    return ScanPerception(
        IntendedPose(pose.theta, (pose.x, pose.y)),
        beams,
        farthest,
        Pose2D(mount.x, mount.y),
        p.no_return,
        walls="ends",
    )


def _gathered_perception(
    scan: GatheredScan, pose: Pose2D, parameters: PerceptionParameters
) -> ScanPerception:
    """Readings of several sensors over a short way as they would be from the robot's middle, where
    it was at the end of it."""
    seen = perceive(scan, replace(parameters, no_return="clear"))
    ends = np.concatenate([seen.hits, seen.open_ends])
    if not len(ends):
        raise DataError("the scan has no beam with a valid reading")
    ranges = np.hypot(ends[:, 0], ends[:, 1])
    farthest = float(ranges.max())
    ranges[len(seen.hits) :] = np.inf
    beams = np.column_stack([np.arctan2(ends[:, 1], ends[:, 0]), ranges])
    return ScanPerception(
        IntendedPose(pose.theta, (pose.x, pose.y)), beams, farthest, Pose2D(),
        parameters.no_return, walls="ends",
    )  # fmt: skip


def _deskewed(
    beams: NDArray[np.float64], laser: Pose2D, seconds: NDArray[np.float64], motion: SweepMotion
) -> NDArray[np.float64]:
    """Beams taken at these times as they would be from where the laser is at the stamp, shape
    (n, 2): bearing and range. One without return keeps its direction in the map."""
    bearings, ranges = beams.T
    directions = np.column_stack([np.cos(bearings), np.sin(bearings)])
    start, hit = np.array([laser.x, laser.y]), np.isfinite(ranges)
    ends = start + directions * np.where(hit, ranges, 0.0)[:, None]
    x, y = (motion.deskew(ends, seconds) - start).T
    turned = bearings + motion.at(seconds)[:, 2]
    return np.column_stack(
        [
            np.where(hit, np.arctan2(y, x), wrap_angles(turned)),
            np.where(hit, np.hypot(x, y), ranges),
        ]
    )
