"""ROS 2 messages to be written: rosbags' definitions, and shorthands to build them."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

from mapcli.model.pose import Pose2D
from mapcli.model.scan import NANOSECONDS

LASER_SCAN = "sensor_msgs/msg/LaserScan"
RANGE = "sensor_msgs/msg/Range"
ODOMETRY = "nav_msgs/msg/Odometry"
TF_MESSAGE = "tf2_msgs/msg/TFMessage"
POSE_STAMPED = "geometry_msgs/msg/PoseStamped"


@cache
def typestore() -> Any:
    """The built-in message definitions (imported late: commands on maps do not need them)."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def build(type_name: str, *values: Any) -> Any:
    """A message of a type, its fields in the order of the definition."""
    return typestore().types[type_name](*values)


def header(stamp_ns: int, frame_id: str) -> Any:
    stamp = build("builtin_interfaces/msg/Time", *divmod(stamp_ns, NANOSECONDS))
    return build("std_msgs/msg/Header", stamp, frame_id)


def pose_message(pose: Pose2D) -> Any:
    return build("geometry_msgs/msg/Pose", point(pose), quaternion(pose.theta))


def transform_stamped(
    stamp_ns: int, parent: str, child: str, pose: Pose2D, *, flipped: bool = False
) -> Any:
    """`parent_from_child` as a message."""
    translation = build("geometry_msgs/msg/Vector3", pose.x, pose.y, 0.0)
    rotation = quaternion(pose.theta, flipped=flipped)
    return build(
        "geometry_msgs/msg/TransformStamped",
        header(stamp_ns, parent),
        child,
        build("geometry_msgs/msg/Transform", translation, rotation),
    )


def point(pose: Pose2D) -> Any:
    return build("geometry_msgs/msg/Point", pose.x, pose.y, 0.0)


def quaternion(yaw: float, *, flipped: bool = False) -> Any:
    """A turn by yaw about the vertical; `flipped` puts half a roll about x before it."""
    cos, sin = math.cos(yaw / 2), math.sin(yaw / 2)
    x, y, z, w = (cos, sin, 0.0, 0.0) if flipped else (0.0, 0.0, sin, cos)
    return build("geometry_msgs/msg/Quaternion", x, y, z, w)
