"""The robot in the transforms of a log: its base frame, the mounts of its lasers, its odometry."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise

from mapcli.errors import DataError
from mapcli.formats.logs.ros.decode import OdometryMessage, Transform
from mapcli.formats.logs.ros.transforms import (
    IDENTITY,
    MAX_TILT_DEG,
    FrameTree,
    Rigid,
    is_base,
    is_odom,
    mount_of,
    prefix_of,
    rigid,
)
from mapcli.model.scan import Mount

MOVING_TRANSFORMS = 5000
"""Transforms of /tf that are read to find the frames."""


@dataclass(frozen=True)
class Robot:
    """The robot's frames, as seen before the records are read.

    Attributes:
        tree: all of /tf_static, and what it takes of /tf, each frame where it was seen first.
        frame: what the mounts and the odometry refer to, `base_link`.
        odom_frame: what /tf measures it in; None if it does not.
    """

    tree: FrameTree
    frame: str
    odom_frame: str | None = None

    @property
    def moving_child(self) -> str:
        """The frame whose parent is the `odom_frame`, on the way down to the robot."""
        line = self.tree.ancestry(self.frame)
        return line[line.index(self.odom_frame or "") - 1]

    def placed(self, frame: str) -> tuple[Rigid | None, str | None]:
        """Where a sensor's frame is on the robot, None if no transform tells, and a note for the
        user, or None."""
        motion, remark = self.tree.lookup(self.frame, frame), None
        if motion is None:
            base = _first(is_base, self.tree.ancestry(frame))
            motion = self.tree.lookup(base, frame) if base else None
            remark = f"mount taken from {base}, as no transform leads to {self.frame!r}"
        if motion is None or (frame == self.frame and frame not in self.tree):
            return None, None
        return motion, remark

    def mount(
        self, laser_frame: str, origin: Sequence[float] = ()
    ) -> tuple[Mount | None, str | None]:
        """The mount of a laser, None if no transform tells, and a note for the user, or None.

        Args:
            origin: of its scans in its frame, as of `LaserScan`.

        Raises:
            DataError: the laser does not look along the floor.
        """
        motion, remark = self.placed(laser_frame)
        if motion is None and not origin:
            missing = f"no transform from {self.frame!r} to {laser_frame!r}"
            if self.frame == laser_frame:
                missing = f"no transform to {laser_frame!r}"
            return None, f"{missing}: mount unknown, assumed at the robot's centre"
        motion = motion or IDENTITY
        if origin:
            motion = motion.compose(rigid(origin[:3], origin[3:]))
        mount = mount_of(motion)
        if mount is None:
            raise DataError(
                f"the laser {laser_frame!r} is tilted by more than {MAX_TILT_DEG:g} degrees",
                expected="one that scans along the floor, or --laser-pose",
            )
        return mount, remark


def find_robot(
    laser_frame: str,
    odom_child: str,
    static: Iterable[Transform],
    moving: Iterable[Transform],
    *,
    namespace: str = "",
    any_frame: bool = False,
) -> Robot:
    """Find the base frame of the robot and, where /tf has it, the odometry frame.

    Args:
        laser_frame: of the scans.
        odom_child: the child frame of odometry messages; empty where there are none.
        static, moving: the transforms of /tf_static and /tf that may be of this robot. The latter
            is read as far as needed.
        namespace: of the scans' topic.
        any_frame: odometry may be measured in a frame of any name: the first one up from the laser
            in which something moves.
    """
    tree = FrameTree()
    for transform in static:
        tree.add(transform.parent, transform.child, transform.motion)
    body, laser = tree.named(odom_child, namespace), tree.named(laser_frame, namespace)
    if odom_child and tree.lookup(body, laser) is not None:
        return Robot(tree, body)
    still = set(tree.children())
    for transform in islice(moving, MOVING_TRANSFORMS):
        if transform.child not in tree.children():
            tree.add(transform.parent, transform.child, transform.motion)
    body, laser = tree.named(odom_child, namespace), tree.named(laser_frame, namespace)
    if odom_child:
        return Robot(tree, body)
    names = {prefix_of(laser_frame), namespace} - {""} or {""}
    robot = _robot_below_odom(tree, laser, still, names)
    if robot.odom_frame is not None or not any_frame:
        return robot
    line = tree.ancestry(laser)
    moving_frame = _first(lambda frame: frame not in still, line[:-1])
    if moving_frame is None:
        return robot
    return replace(robot, frame=moving_frame, odom_frame=tree.parent(moving_frame))


def _robot_below_odom(tree: FrameTree, laser_frame: str, still: set[str], names: set[str]) -> Robot:
    """The robot in a tree that may hold `odom`: the base, or the last frame that moves.

    Args:
        names: that the robot may have; those of others are before the frames of others.
    """
    line = tree.ancestry(laser_frame)
    odom = _first(is_odom, line[1:])
    if odom is not None:
        body = line[: line.index(odom)]
        moving = _first(lambda frame: frame not in still, body)
        return Robot(tree, _first(is_base, body) or moving or body[-1], odom)
    # No transform connects the laser to odometry: look for the robot without it.
    bodies = [child for child in tree.children() if is_odom(tree.parent(child))]
    own = [body for body in bodies if prefix_of(body) in names]
    if not own and len({prefix_of(body) for body in bodies}) == 1:
        is_named_otherwise = prefix_of(bodies[0]) and prefix_of(laser_frame)
        own = [] if is_named_otherwise else bodies
    if own:
        body_frame = _first(is_base, own) or own[0]
        return Robot(tree, body_frame, tree.parent(body_frame))
    return Robot(tree, _first(is_base, line) or line[-1])


class TfOdometry:
    """Follows the robot along the moving transforms (stateful).

    Args:
        robot: with an `odom_frame`.
    """

    def __init__(self, robot: Robot) -> None:
        assert robot.odom_frame is not None
        self._odom, self._frame = robot.odom_frame, robot.frame
        self._tree = robot.tree.copy()
        line = self._tree.ancestry(self._frame)
        self._parents = dict(pairwise(line[: line.index(self._odom) + 1]))

    def follow(self, transforms: Iterable[Transform]) -> OdometryMessage | None:
        """Where the robot is after a message; None if it tells nothing about it."""
        stamp = None
        for transform in transforms:
            if self._parents.get(transform.child) == transform.parent:
                self._tree.add(transform.parent, transform.child, transform.motion)
                stamp = max(stamp or 0, transform.stamp_ns)
        motion = self._tree.lookup(self._odom, self._frame)
        if stamp is None or motion is None:
            return None
        return OdometryMessage(stamp, self._odom, self._frame, motion.pose())


def _first(condition: Callable[[str], bool], frames: Iterable[str]) -> str | None:
    return next((frame for frame in frames if condition(frame)), None)
