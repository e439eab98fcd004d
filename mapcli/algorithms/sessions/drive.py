"""A drive: one recording that has been tracked by itself, ready to be joined with others."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.model.summary import ReplaySummary
from mapcli.model.trace import TracedPose


@dataclass(frozen=True, eq=False)
class Drive:
    """What is known of a drive before it is joined with others.

    Attributes:
        name: short, and no other drive's.
        inputs: the files that it was read from, name -> SHA-256.
        parameters: on which the drive as tracked depends.
        trajectory: as tracked; the first pose is where the drive begins, in its own frame.
        poses: the same with stamps, odometry and scores.
        summary: of the drive by itself, with all loops of its own closed.
    """

    name: str
    inputs: Mapping[str, str]
    parameters: Mapping[str, Any]
    trajectory: TrackedTrajectory
    poses: tuple[TracedPose, ...]
    summary: ReplaySummary

    @property
    def span_ns(self) -> tuple[int, int]:
        """The stamps of the first scan and of the last one."""
        stamps = [traced.stamp_ns for traced in self.poses]
        return min(stamps), max(stamps)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the stamps and points of all scans: equal for the same drive, wherever its
        file lies and whatever that is called."""
        found = hashlib.sha256()
        found.update(np.array([one.stamp_ns for one in self.poses], np.int64).tobytes())
        for points in self.trajectory.points:
            found.update(np.ascontiguousarray(points, np.float32).tobytes())
        return found.hexdigest()


def by_age(drives: Sequence[Drive]) -> list[Drive]:
    """The oldest first, by the stamps of their first scans."""
    return sorted(drives, key=lambda drive: (drive.span_ns, drive.digest))


def do_overlap(drives: Sequence[Drive]) -> bool:
    """Whether some were under way at the same time, so that none is the newest."""
    spans = sorted(drive.span_ns for drive in drives)
    return any(begin <= max(end for _, end in spans[:k]) for k, (begin, _) in enumerate(spans) if k)


def without_repeats(drives: Sequence[Drive]) -> tuple[list[Drive], list[tuple[Drive, Drive]]]:
    """The drives, each once, and those that were left out, each with the one that it repeats."""
    first: dict[str, Drive] = {}
    repeats = []
    for drive in drives:
        if drive.digest in first:
            repeats.append((drive, first[drive.digest]))
        first.setdefault(drive.digest, drive)
    return list(first.values()), repeats
