"""The scans of a run whose beams were taken one after another, for the refinement that puts them
where they were taken by the final poses (`sweep_refinement`)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.scan_store import ScanStore
from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan
from mapcli.model.sweep import STILL, SweepMotion

COLUMNS = 6
"""Of what is kept of a point."""


@dataclass
class TrackedSweeps:
    """The points of each scan in time (stateful: it grows; empty until a scan has a sweep).

    Attributes:
        stamps_ns: of each scan.
        odometry: its pose at each stamp, as counted; None where it is silent.
        beams: shape (n, 6) for each scan, float32: its points, metres in the robot's frame when
            each was taken; seconds after the stamp; the robot's pose then as odometry counted, in
            its frame at the stamp.
        longest_s: seconds of the longest sweep.
    """

    stamps_ns: list[int] = field(default_factory=list)
    odometry: list[Pose2D | None] = field(default_factory=list)
    beams: ScanStore = field(default_factory=lambda: ScanStore(COLUMNS))
    longest_s: float = 0.0

    def __bool__(self) -> bool:
        return bool(self.stamps_ns)

    def add(
        self,
        number: int,
        scan: RangeScan,
        odom: Pose2D | None,
        perception: Perception,
        kept: NDArray[np.int64],
    ) -> None:
        """A scan, if it has a sweep, or one before had.

        Args:
            number: of the scan; odom: the odometry's pose at its stamp.
            perception: of it, deskewed; kept: numbers of the hits that are its points.
        """
        if perception.sweep is None and not self:
            return
        while len(self.stamps_ns) < number:  # scans before that were taken at once stay as they are
            self._append(scan.stamp_ns, None, np.empty((0, COLUMNS)))
        counted = scan.motion or STILL
        self._append(scan.stamp_ns, odom, _in_time(perception, kept, counted))
        if perception.sweep is not None:
            span = float(np.ptp(perception.sweep.seconds))
            self.longest_s = max(self.longest_s, span)

    def _append(self, stamp_ns: int, odom: Pose2D | None, beams: NDArray[np.float64]) -> None:
        self.stamps_ns.append(stamp_ns)
        self.odometry.append(odom)
        self.beams.append(beams.astype(np.float32))


def _in_time(
    perception: Perception, kept: NDArray[np.int64], counted: SweepMotion
) -> NDArray[np.float64]:
    """Points with their times and the poses that odometry counted, shape (n, COLUMNS)."""
    points, sweep = perception.hits[kept], perception.sweep
    if sweep is None:
        return np.column_stack([points, np.zeros((len(points), COLUMNS - 2))])
    seconds = sweep.seconds[kept]
    return np.column_stack([sweep.raw[kept], seconds, counted.at(seconds)])
