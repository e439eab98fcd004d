"""Whether two scans may have been taken at the same place, a little way apart.

The ends of each scan's beams are laid over the other scan, at every pose to which the robot may
have moved between them. Where they lie in front of the other's reading in the same direction, they
were seen through; at the right pose most of them lie on it. Consecutive scans of real logs have 0.8
and more at their best pose, scans of different places 0.3 in the middle (`benchmarks/RESULTS.md`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan

STEP_M, STEP_RAD = 0.2, math.radians(3)
"""Between the poses that are tried, metres and radians."""

TOLERANCE_M = 0.25
"""An end lies on a reading within this, about a step of the poses; it was seen through where it is
nearer by twice as much."""

POINTS, FEWEST_POINTS = 40, 12
"""Ends that are compared, at most and at least."""

FARTHEST_M = 15.0
"""Metres from the laser; what is farther is sparse, and moves much with the heading."""

LEAST_SEEN = 0.4
"""Share of the ends of each of which the other must tell something."""


def likeness(
    before: RangeScan, after: RangeScan, motion: Pose2D, metres: float, radians: float
) -> float | None:
    """The share of the ends of two scans that lie on what the other one sees, of those that it sees
    at all, at the best of the poses that they may have been taken at, 0 to 1; None where there are
    too few ends to tell.

    Args:
        motion: of the robot between them, as far as it is known; metres, radians: by how much it
            may be wrong.
    """
    old, new = _ends(before), _ends(after)
    if min(len(old), len(new)) < FEWEST_POINTS:
        return None
    steps, turns = int(metres / STEP_M), int(min(radians, math.pi) / STEP_RAD)
    line = np.arange(-steps, steps + 1) * STEP_M
    places = (line[:, None] + 1j * line).ravel()
    places = places[np.abs(places) <= steps * STEP_M, None] + complex(motion.x, motion.y)
    best = 0.0
    for angle in motion.theta + np.arange(-turns, turns + 1) * STEP_RAD:
        heading = np.exp(1j * angle)
        there = _Met.of(new * heading + places, before)
        back = _Met.of((old - places) / heading, after)
        shares = (there.met + back.met) / np.maximum(there.seen + back.seen, 1)
        tells = (there.seen >= LEAST_SEEN * len(new)) & (back.seen >= LEAST_SEEN * len(old))
        best = max(best, float(np.where(tells, shares, 0.0).max()))
    return best


class _Met(NamedTuple):
    """How many ends, at each of some poses, lie on what a scan sees, and how many it sees at all:
    these and those that it saw through."""

    met: NDArray[np.int64]
    seen: NDArray[np.int64]

    @classmethod
    def of(cls, ends: NDArray[np.complex128], scan: RangeScan) -> _Met:
        """Of ends in the scan's robot frame, shape (poses, ends)."""
        behind = _behind(ends, scan)
        met = (np.abs(behind) <= TOLERANCE_M).sum(axis=1)
        return cls(met, met + (behind > 2 * TOLERANCE_M).sum(axis=1))


def _ends(scan: RangeScan) -> NDArray[np.complex128]:
    """Ends of beams, x + yi in the robot's frame."""
    points = scan.points(farthest=FARTHEST_M)
    points = points[np.linspace(0, len(points) - 1, min(len(points), POINTS)).astype(np.int64)]
    return np.asarray(points[:, 0] + 1j * points[:, 1])


def _behind(points: NDArray[np.complex128], scan: RangeScan) -> NDArray[np.float64]:
    """How far behind each point, in the robot's frame, the reading in its direction is, metres;
    nan where there is none."""
    laser = scan.mount.pose
    points = (points - complex(laser.x, laser.y)) * np.exp(-1j * laser.theta)
    points = points.conj() if scan.mount.flipped else points
    circle = math.tau / abs(scan.angle_increment)
    beams = np.rint((np.angle(points) - scan.angle_min) / scan.angle_increment % circle)
    readings = np.append(scan.ranges, np.nan)[np.minimum(beams, len(scan.ranges)).astype(np.int64)]
    return np.asarray(readings - np.abs(points), dtype=np.float64)
