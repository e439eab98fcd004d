"""Decoding the messages of ROS 1: the same fields as in `decode`, one after the other without
padding, little-endian; a header begins with a counter. <http://wiki.ros.org/msg>

Every decoder raises ValueError for bytes that do not hold its message.
"""

from __future__ import annotations

import struct

import numpy as np

from mapcli.formats.logs.ros.decode import (
    Buffer,
    LaserScan,
    OdometryMessage,
    RangeMessage,
    Transform,
    refuses,
    stamp_of,
    string_at,
)
from mapcli.formats.logs.ros.transforms import rigid
from mapcli.model.pose import planar_pose

ORDER = "<"
_STAMP = struct.Struct("<4xII")
_SCAN = struct.Struct("<7fI")
_RANGE = struct.Struct("<x4f")
_POSE = struct.Struct("<7d")
_COUNT = struct.Struct("<I")


@refuses
def scan_from_ros1(data: Buffer) -> LaserScan:
    scan, n, at = ros1_scan_without_ranges(data)
    return LaserScan(*scan, ranges=np.frombuffer(data, dtype="<f4", count=n, offset=at))


def ros1_scan_without_ranges(
    data: Buffer,
) -> tuple[tuple[int, str, float, float, float, float, float, float], int, int]:
    """As `decode.scan_without_ranges`."""
    stamp, frame, at = ros1_header(data, 0)
    first, last, step, seconds, _, low, high, n = _SCAN.unpack_from(data, at)
    return (stamp, frame, first, last, step, seconds, low, high), n, at + _SCAN.size


@refuses
def range_from_ros1(data: Buffer) -> RangeMessage:
    stamp, frame, at = ros1_header(data, 0)
    return RangeMessage(stamp, frame, *_RANGE.unpack_from(data, at))


@refuses
def odometry_from_ros1(data: Buffer) -> OdometryMessage:
    """Odometry, or TransformStamped."""
    stamp, frame, at = ros1_header(data, 0)
    child, at = string_at(ORDER, data, at)
    x, y, _, *quaternion = _POSE.unpack_from(data, at)
    return OdometryMessage(stamp, frame, child, planar_pose((x, y), quaternion))


@refuses
def pose_from_ros1(data: Buffer) -> OdometryMessage:
    """PoseStamped, or PoseWithCovarianceStamped."""
    stamp, frame, at = ros1_header(data, 0)
    x, y, _, *quaternion = _POSE.unpack_from(data, at)
    return OdometryMessage(stamp, frame, "", planar_pose((x, y), quaternion))


@refuses
def transforms_from_ros1(data: Buffer) -> list[Transform]:
    (n,) = _COUNT.unpack_from(data, 0)
    transforms, at = [], _COUNT.size
    for _ in range(n):
        stamp, parent, at = ros1_header(data, at)
        child, at = string_at(ORDER, data, at)
        numbers = _POSE.unpack_from(data, at)
        transforms.append(Transform(stamp, parent, child, rigid(numbers[:3], numbers[3:])))
        at += _POSE.size
    return transforms


def ros1_header(data: Buffer, at: int) -> tuple[int, str, int]:
    """Stamp, frame and end of a std_msgs/Header."""
    seconds, nanoseconds = _STAMP.unpack_from(data, at)
    frame, at = string_at(ORDER, data, at + _STAMP.size)
    return stamp_of(seconds, nanoseconds), frame, at
