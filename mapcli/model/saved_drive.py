"""What is kept of a drive, so that others can be joined with it later: plain records of arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.model.pose import Pose2D
from mapcli.model.summary import ReplaySummary
from mapcli.model.trace import TracedPose

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SavedSweep:
    """The beams of a keyframe in time, as of `scans.perception.Sweep`.

    Attributes:
        raw: shape (n, 2), where beams ended, metres in the robot's frame when each was taken.
        seconds: shape (n,), when that was, after the scan's stamp.
        motion_seconds, motion_poses: shapes (m,) and (m, 3), how the robot moved meanwhile.
    """

    raw: Floats
    seconds: Floats
    motion_seconds: Floats
    motion_poses: Floats


@dataclass(frozen=True, slots=True, eq=False)
class SavedKeyframe:
    """A scan that is part of the map.

    Attributes:
        hits, open_ends: shapes (n, 2) and (k, 2), metres in the robot's frame: where beams ended at
            obstacles, and up to where those without return passed.
        laser: shape (2,), where the beams start.
        covariance: shape (3, 3), of the motion since the keyframe before, in the robot's frame.
        metres: driven since the first keyframe.
        lost_since: number of the scan since which the robot was lost, where the map began anew.
        sweep: None if all beams were taken at once.
    """

    hits: Floats
    open_ends: Floats
    laser: Floats
    covariance: Floats
    metres: float
    lost_since: int | None = None
    sweep: SavedSweep | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SavedScan:
    """A scan of a drive.

    Attributes:
        traced: its pose as tracked, its stamp, odometry and score.
        step: how the robot came from the scan before, as its odometry was believed.
        points: shape (n, 2), float32, its hits, one for each cell of the map.
        beams: shape (n, 6), float32, the same in time, see `slam.tracked_sweeps`; None if no scan
            of the drive was taken beam by beam.
        keyframe: None if the scan is no part of the map.
    """

    traced: TracedPose
    step: Pose2D | None
    points: NDArray[np.float32]
    beams: NDArray[np.float32] | None = None
    keyframe: SavedKeyframe | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SavedDrive:
    """A drive.

    Attributes:
        name: short; inputs: the files that it was read from, name -> SHA-256.
        parameters: on which the drive as tracked depends.
        summary: of the drive by itself.
        longest_sweep_s: seconds of the longest sweep.
        scans: in the order in which they were tracked.
    """

    name: str
    inputs: Mapping[str, str]
    parameters: Mapping[str, Any]
    summary: ReplaySummary
    longest_sweep_s: float
    scans: Iterable[SavedScan]
