"""What messages without a type are, by their content.

In JSON, the names of the fields tell. Bytes tell it, too: of the definitions of the types that are
read, the one that takes all bytes of a message, not one more and not one less. What then is no
sensible message of the type is not of it: an equal length may be chance. A few may be damaged.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from mapcli.formats.logs.message_kinds import kind_of_type
from mapcli.formats.logs.ros.decode import LaserScan, RangeMessage
from mapcli.formats.logs.ros.decode_json import json_object

FIELDS = {
    "sensor_msgs/msg/LaserScan": ("header", "angle_min", "ranges"),
    "sensor_msgs/msg/MultiEchoLaserScan": ("header", "angle_min", "ranges"),
    "sensor_msgs/msg/PointCloud2": ("header", "point_step"),
    "sensor_msgs/msg/Range": ("header", "radiation_type"),
    "geometry_msgs/msg/TransformStamped": ("header", "child_frame_id", "transform"),
    "nav_msgs/msg/Odometry": ("header", "child_frame_id", "pose.pose"),
    "geometry_msgs/msg/PoseWithCovarianceStamped": ("header", "pose.pose"),
    "geometry_msgs/msg/PoseStamped": ("header", "pose.position"),
    "tf2_msgs/msg/TFMessage": ("transforms",),
    "foxglove.LaserScan": ("timestamp", "start_angle", "ranges"),
    "foxglove.PointCloud": ("timestamp", "point_stride"),
    "foxglove.FrameTransform": ("timestamp", "parent_frame_id", "translation"),
    "foxglove.FrameTransforms": ("transforms",),
    "foxglove.Odometry": ("timestamp", "pose", "linear_velocity"),
    "foxglove.PoseInFrame": ("timestamp", "pose"),
}
"""Types that are recognised, in the order in which they are tried -> fields that they have."""

FARTHEST_M = 1000.0
"""No sensor of one range reaches farther."""


def recognised(messages: Sequence[bytes], encoding: str) -> str:
    """The type of most of some messages of one stream; empty where it is not known."""
    fits = FITTING.get(encoding)
    if fits is None or not messages:
        return ""
    count = {name: sum(fits(data, name) for data in messages) for name in FIELDS}
    best = max(count, key=count.__getitem__)
    return best if 2 * count[best] > len(messages) else ""


def _fits_json(data: bytes, name: str) -> bool:
    try:
        message = json_object(data)
        return all(_has(message, path) for path in FIELDS[name]) and _is_sensible(
            data, name, "json"
        )
    except (ValueError, RecursionError):
        return False


def _has(message: Any, path: str) -> bool:
    """Whether there is a field, by its name, or by names with dots between them."""
    for name in path.split("."):
        if not isinstance(message, dict) or name not in message:
            return False
        message = message[name]
    return True


def _fits_cdr(data: bytes, name: str) -> bool:
    return _takes_all(_ros2().deserialize_cdr, data, name) and _is_sensible(data, name, "cdr")


def _fits_ros1(data: bytes, name: str) -> bool:
    return _takes_all(_ros1().deserialize_ros1, data, name) and _is_sensible(data, name, "ros1")


FITTING: dict[str, Callable[[bytes, str], bool]] = {
    "cdr": _fits_cdr,
    "json": _fits_json,
    "ros1": _fits_ros1,
}
"""Encoding -> whether a message may be of a type."""


def _takes_all(deserialize: Callable[[bytes, str], Any], data: bytes, name: str) -> bool:
    from rosbags.serde import SerdeError

    try:
        deserialize(data, name)
    except (SerdeError, KeyError, IndexError, TypeError, OverflowError, MemoryError):
        return False
    return True


def _is_sensible(data: bytes, name: str, encoding: str) -> bool:
    """Whether mapcli's own decoder takes a message, and what it tells can be."""
    kind = kind_of_type(name)
    decode = kind.decoders.get(encoding) if kind else None
    try:
        message = decode(data) if decode else None
    except ValueError:
        return False
    if isinstance(message, LaserScan):
        return math.isfinite(message.angle_min) and math.isfinite(message.angle_increment)
    if isinstance(message, RangeMessage):
        angle, low, high = message.field_of_view, message.range_min, message.range_max
        return 0.0 < angle <= math.tau and 0.0 <= low < high <= FARTHEST_M
    return message is not None


@cache
def _ros2() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.LATEST)


@cache
def _ros1() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    transforms = "geometry_msgs/TransformStamped[] transforms"
    store.register(get_types_from_msg(transforms, "tf2_msgs/msg/TFMessage"))
    return store
