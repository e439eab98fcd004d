"""Paths as arrays, for comparing one with another: poses over time, and relations between poses.

A row of a pose array is `x, y, theta`; the arithmetic is that of `Pose2D`, for all rows at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.model.counting import counted
from mapcli.model.pose import Pose2D

Poses = NDArray[np.float64]
"""Shape (n, 3): x, y in metres, theta in radians."""

Stamps = NDArray[np.int64]
"""Shape (n,), nanoseconds."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Where a robot was, in time order.

    Attributes:
        poses: shape (n, 3).
        stamps_ns: shape (n,), never decreasing; None in formats without times, whose poses are
            known by their index only.
    """

    poses: Poses
    stamps_ns: Stamps | None = None

    def __len__(self) -> int:
        return len(self.poses)

    def seconds(self) -> NDArray[np.float64]:
        """Since the first pose, shape (n,); the indices where there are no times."""
        if self.stamps_ns is None:
            return np.arange(len(self), dtype=np.float64)
        return np.asarray(self.stamps_ns - self.stamps_ns[:1], dtype=np.float64) * 1e-9

    def span(self) -> str:
        """How many and from when to when, for people: "509 poses from 1.200 to 102.800 s"."""
        count = counted(len(self), "poses")
        if self.stamps_ns is None:
            return f"{count} without times"
        start, end = (int(self.stamps_ns[k]) * 1e-9 for k in (0, -1))
        return f"{count} from {start:.3f} to {end:.3f} s"

    def driven(self) -> NDArray[np.float64]:
        """Metres along the path up to each pose, shape (n,)."""
        steps = np.hypot(*np.diff(self.poses[:, :2], axis=0).T)
        return np.concatenate([[0.0], np.cumsum(steps)])[: len(self)]


@dataclass(frozen=True, eq=False)
class Relations:
    """Measured motions between moments: the pose at the later as seen from the one at the earlier.

    Attributes:
        from_ns, to_ns: shape (n,).
        poses: shape (n, 3).
    """

    from_ns: Stamps
    to_ns: Stamps
    poses: Poses

    def __len__(self) -> int:
        return len(self.poses)


def wrap_angles(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same angles in [-pi, pi)."""
    wrapped: NDArray[np.float64] = (angles + np.pi) % (2 * np.pi) - np.pi
    return wrapped


def compose(parents: Poses, children: Poses) -> Poses:
    """Row by row `parent.compose(child)`."""
    cos, sin = np.cos(parents[:, 2]), np.sin(parents[:, 2])
    x, y, theta = children.T
    return np.column_stack(
        [
            parents[:, 0] + cos * x - sin * y,
            parents[:, 1] + sin * x + cos * y,
            wrap_angles(parents[:, 2] + theta),
        ]
    )


def between(a: Poses, b: Poses) -> Poses:
    """Row by row `a.between(b)`: b as seen from a."""
    cos, sin = np.cos(a[:, 2]), np.sin(a[:, 2])
    x, y = (b - a)[:, :2].T
    return np.column_stack([cos * x + sin * y, cos * y - sin * x, wrap_angles(b[:, 2] - a[:, 2])])


def moved(poses: Poses, motion: Pose2D) -> Poses:
    """All poses after one rigid motion of the plane they lie in."""
    return compose(np.array([[motion.x, motion.y, motion.theta]]).repeat(len(poses), 0), poses)


def interpolated(stamps_ns: Stamps, trajectory: Trajectory) -> Poses:
    """The poses at these stamps, between those of the trajectory before and after each.

    Shape (k, 3). Straight from pose to pose, turning the shorter way; before its first and after
    its last pose the trajectory stands still.
    """
    known = trajectory.stamps_ns
    assert known is not None, "a trajectory with times"
    # Nanoseconds since the first: float64 would not hold those since 1970.
    when, at = stamps_ns - known[0], known - known[0]
    x, y = (np.interp(when, at, trajectory.poses[:, k]) for k in (0, 1))
    theta = np.interp(when, at, np.unwrap(trajectory.poses[:, 2]))
    return np.column_stack([x, y, wrap_angles(theta)])
