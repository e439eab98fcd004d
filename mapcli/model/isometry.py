"""Isometries of the plane: rigid motions, with or without a reflection."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mapcli.model.pose import Pose2D, wrap_angle


@dataclass(frozen=True, slots=True)
class Isometry:
    """Takes a point p to R(theta) M p + (x, y), where M turns y around when `mirrored`."""

    pose: Pose2D = field(default_factory=Pose2D)
    mirrored: bool = False

    def apply(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points, shape (n, 2)."""
        return self.pose.apply(points * (1.0, -1.0) if self.mirrored else points)

    def apply_pose(self, pose: Pose2D) -> Pose2D:
        """The pose after the isometry; a reflection turns the sign of its heading."""
        turned = _mirror(pose) if self.mirrored else pose
        return self.pose.compose(turned)

    def after(self, first: Isometry) -> Isometry:
        """The composition: `first`, then this."""
        inner = _mirror(first.pose) if self.mirrored else first.pose
        return Isometry(self.pose.compose(inner), self.mirrored != first.mirrored)


def _mirror(pose: Pose2D) -> Pose2D:
    return Pose2D(pose.x, -pose.y, wrap_angle(-pose.theta))
