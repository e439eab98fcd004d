"""Poses in the plane: position in metres, heading in radians, counter-clockwise from +x."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FARTHEST_M = 1e9
"""Coordinates beyond are taken for damage: there is no such place on Earth, and cells could not be
told apart there."""


def wrap_angle(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % math.tau - math.pi


def rounded_angle(angle: float) -> float:
    """The angle in (-pi, pi), rounded to 1e-9 rad so that it survives a trip through a quaternion.

    Every log reader passes its headings through here; that is why a CARMEN log and its import to
    MCAP give the same poses to the last bit. Rounding may lead out of the circle at pi, hence the
    second turn.
    """
    rounded = round(angle, 9) + 0.0  # no -0.0
    if -3.1415926 < rounded < 3.1415926:
        return rounded
    return round(wrap_angle(round(wrap_angle(angle), 9)), 9)


@dataclass(frozen=True, slots=True)
class Pose2D:
    """A pose `x, y, theta`, or the rigid motion that takes a child frame into its parent.

    `map_from_robot.compose(robot_from_laser)` is `map_from_laser`, and
    `map_from_a.between(map_from_b)` is `a_from_b`, the pose of b as a sees it.
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0

    def compose(self, child: Pose2D) -> Pose2D:
        """This motion after `child`: the pose of `child`'s child in this pose's parent."""
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        return Pose2D(
            self.x + cos * child.x - sin * child.y,
            self.y + sin * child.x + cos * child.y,
            wrap_angle(self.theta + child.theta),
        )

    def inverse(self) -> Pose2D:
        """The motion that undoes this one."""
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        return Pose2D(
            -cos * self.x - sin * self.y, sin * self.x - cos * self.y, wrap_angle(-self.theta)
        )

    def between(self, other: Pose2D) -> Pose2D:
        """`other` as seen from this pose: `self.compose(self.between(other)) == other`."""
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        x, y = other.x - self.x, other.y - self.y
        return Pose2D(cos * x + sin * y, cos * y - sin * x, wrap_angle(other.theta - self.theta))

    def apply(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points, shape (n, 2), from this pose's frame into its parent's."""
        if self == IDENTITY:
            return points.astype(np.float64)
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        x, y = points[:, 0], points[:, 1]
        # Written out: a matrix product would go through BLAS, whose rounding varies by machine.
        moved = np.empty((len(points), 2))
        moved[:, 0] = cos * x - sin * y + self.x
        moved[:, 1] = sin * x + cos * y + self.y
        return moved

    def distance(self, other: Pose2D) -> float:
        """Metres between the two positions."""
        return math.hypot(other.x - self.x, other.y - self.y)


IDENTITY = Pose2D()
"""Most lasers are mounted like this."""


def planar_pose(position: Sequence[float], quaternion: Sequence[float]) -> Pose2D:
    """The pose in the plane of a pose in space: its x, y and yaw.

    Args:
        position: x, y in metres; what follows is not used.
        quaternion: x, y, z, w, of any length but zero.

    Raises:
        ValueError: not finite, too far, or a quaternion of length zero, which has no heading.
    """
    x, y, z, w = quaternion
    square = x * x + y * y + z * z + w * w
    near = abs(position[0]) <= FARTHEST_M and abs(position[1]) <= FARTHEST_M
    if not (near and square > 1e-6 and math.isfinite(square)):
        raise ValueError("no pose")
    yaw = math.atan2(2 * (x * y + z * w) / square, 1 - 2 * (y * y + z * z) / square)
    return Pose2D(float(position[0]), float(position[1]), rounded_angle(yaw))


def interpolate(a: Pose2D, b: Pose2D, fraction: float) -> Pose2D:
    """The pose `fraction` of the way from a to b, turning the shorter way.

    Fractions outside [0, 1] extrapolate. 0 and 1 give a and b exactly.
    """
    if fraction in (0.0, 1.0):
        return b if fraction else a
    return Pose2D(
        a.x + fraction * (b.x - a.x),
        a.y + fraction * (b.y - a.y),
        wrap_angle(a.theta + fraction * wrap_angle(b.theta - a.theta)),
    )
