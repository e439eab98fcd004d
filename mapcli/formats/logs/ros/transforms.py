"""Rigid transforms in space, and the tree of frames of /tf and /tf_static."""

from __future__ import annotations

import math
from collections.abc import Iterable, KeysView
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.model.pose import FARTHEST_M, Pose2D, rounded_angle
from mapcli.model.scan import Mount

MAX_TILT_DEG = 20.0
"""A laser tilted by more than this does not measure the floor plan."""

BASE_FRAMES = ("base_link", "base_footprint")


@dataclass(frozen=True, eq=False)
class Rigid:
    """A rigid transform in space, `parent_from_child`.

    Attributes:
        rotation: shape (3, 3).
        translation: shape (3,), metres.
    """

    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]

    def compose(self, child: Rigid) -> Rigid:
        return Rigid(
            self.rotation @ child.rotation, self.translation + self.rotation @ child.translation
        )

    def inverse(self) -> Rigid:
        back = self.rotation.T
        return Rigid(back, -back @ self.translation)

    def pose(self) -> Pose2D:
        """The part of it in the plane: where it puts the child, and where its x axis points."""
        yaw = math.atan2(self.rotation[1, 0], self.rotation[0, 0])
        x, y = self.translation[:2]
        return Pose2D(float(x), float(y), rounded_angle(yaw))


IDENTITY = Rigid(np.eye(3), np.zeros(3))


def rigid(translation: Iterable[float], quaternion: Iterable[float]) -> Rigid:
    """From metres and a quaternion x, y, z, w of any length but zero.

    Raises:
        ValueError: not finite, or a quaternion without direction.
    """
    position = np.array(list(translation), dtype=np.float64)
    x, y, z, w = quaternion
    square = x * x + y * y + z * z + w * w
    if not (square > 1e-6 and math.isfinite(square) and (np.abs(position) <= FARTHEST_M).all()):
        raise ValueError("no rotation")
    s = 2.0 / square
    return Rigid(
        np.array(
            [
                [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
                [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
                [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
            ]
        ),
        position,
    )


def mount_of(robot_from_laser: Rigid) -> Mount | None:
    """The mount in the plane; None if the laser is tilted by more than `MAX_TILT_DEG`.

    It is upside down when the laser's z axis points down.
    """
    upwards = robot_from_laser.rotation[2, 2]
    if abs(upwards) < math.cos(math.radians(MAX_TILT_DEG)):
        return None
    return Mount(_placed(robot_from_laser), bool(upwards < 0))


def mount_of_axis(robot_from_sensor: Rigid) -> Mount | None:
    """The mount in the plane of a sensor that looks along its x axis, however it is turned about
    that; None if it looks up or down by more than `MAX_TILT_DEG`."""
    if abs(robot_from_sensor.rotation[2, 0]) > math.sin(math.radians(MAX_TILT_DEG)):
        return None
    return Mount(_placed(robot_from_sensor))


def _placed(motion: Rigid) -> Pose2D:
    """In the plane. Composing transforms leaves rounding errors far below a micrometre."""
    pose = motion.pose()
    return Pose2D(round(pose.x, 9) + 0.0, round(pose.y, 9) + 0.0, pose.theta)


class FrameTree:
    """The tree of frames: each by name, with its parent (stateful: `add`)."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Rigid]] = {}

    def __contains__(self, frame: str) -> bool:
        parents = (parent for parent, _ in self._parents.values())
        return frame in self._parents or frame in parents

    def children(self) -> KeysView[str]:
        """The frames that have a parent, in the order they were added."""
        return self._parents.keys()

    def copy(self) -> FrameTree:
        other = FrameTree()
        other._parents = dict(self._parents)
        return other

    def add(self, parent: str, child: str, parent_from_child: Rigid) -> None:
        self._parents[child] = parent, parent_from_child

    def named(self, frame: str, namespace: str) -> str:
        """The frame that is meant by a name in a message on a topic of a namespace: the tf_prefix
        of ROS 1, which is left out in messages, is put before it if that makes it known."""
        while namespace:
            if f"{namespace}/{frame}" in self:
                return f"{namespace}/{frame}"
            namespace = namespace.rpartition("/")[0]
        return frame

    def parent(self, child: str) -> str:
        """The parent of one of the `children`."""
        return self._parents[child][0]

    def ancestry(self, frame: str) -> list[str]:
        """The frame, its parent, and so on up to the root (or once around a loop)."""
        line = {frame: None}  # in order
        while frame in self._parents:
            frame = self.parent(frame)
            if frame in line:
                break
            line[frame] = None
        return list(line)

    def lookup(self, target: str, source: str) -> Rigid | None:
        """`target_from_source`; None if no chain of frames connects them."""
        target_line, source_line = self.ancestry(target), self.ancestry(source)
        above = set(target_line)
        common = next((frame for frame in source_line if frame in above), None)
        if common is None:
            return None
        up = self._climb(source_line[: source_line.index(common)])
        down = self._climb(target_line[: target_line.index(common)])
        return down.inverse().compose(up)

    def _climb(self, line: list[str]) -> Rigid:
        """From the first frame of an ancestry into the parent of its last."""
        motion = IDENTITY
        for frame in line:
            motion = self._parents[frame][1].compose(motion)
        return motion


def is_odom(frame: str) -> bool:
    """Whether a frame is named like one that odometry is measured in."""
    return "odom" in frame.rpartition("/")[2].lower()


def is_base(frame: str) -> bool:
    """Whether a frame is named like the robot's body."""
    return frame.rpartition("/")[2] in BASE_FRAMES


def prefix_of(frame: str) -> str:
    """Of `robot1/base_link`: `robot1`; empty without one."""
    return frame.rpartition("/")[0]
