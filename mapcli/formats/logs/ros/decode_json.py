"""Decoding the messages of ROS from JSON of the same shape.

Every decoder raises ValueError for bytes that do not hold its message.
"""

from __future__ import annotations

import json
import math
from base64 import b64decode
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.logs.rep117 import single
from mapcli.formats.logs.ros.decode import (
    Buffer,
    LaserScan,
    OdometryMessage,
    RangeMessage,
    Transform,
    bare_frame,
    refuses,
    stamp_of,
)
from mapcli.formats.logs.ros.point_cloud import NUMBER_TYPES, Layout, PointCloud
from mapcli.formats.logs.ros.transforms import rigid
from mapcli.model.pose import Pose2D, planar_pose


@refuses
def scan_from_json(data: Buffer) -> LaserScan:
    message = json_object(data)
    return LaserScan(*_scan_fields(message), ranges=json_ranges(message["ranges"]))


@refuses
def multi_echo_from_json(data: Buffer) -> LaserScan:
    """MultiEchoLaserScan: the first echo of each beam, and no return without."""
    message = json_object(data)
    echoes = (beam["echoes"] for beam in message["ranges"])
    ranges = json_ranges([beam[0] if beam else math.inf for beam in echoes])
    return LaserScan(*_scan_fields(message), ranges=ranges)


def _scan_fields(
    message: dict[str, Any],
) -> tuple[int, str, float, float, float, float, float, float]:
    """The fields of a `LaserScan` before the ranges."""
    first, last, step, low, high = (
        _number(message.get(key))
        for key in ("angle_min", "angle_max", "angle_increment", "range_min", "range_max")
    )
    seconds = _number(message.get("time_increment", 0.0))
    return _stamp(message), _frame(message), first, last, step, seconds, low, high


def json_ranges(values: Any) -> NDArray[np.float32]:
    """Ranges, as a list or array; null and "NaN" become NaN."""
    with np.errstate(over="ignore"):
        ranges = np.array(values, dtype=np.float32)
    if ranges.ndim != 1:
        raise ValueError("ranges are no list")
    return ranges


@refuses
def cloud_from_json(data: Buffer) -> PointCloud:
    """PointCloud2; its data may be numbers, or base64 as rosbridge writes it."""
    message = json_object(data)
    layout = Layout(
        [(field["name"], NUMBER_TYPES[field["datatype"]], field["offset"])
         for field in message["fields"] if field.get("count", 1) == 1],
        message["height"], message["width"], message["point_step"], message["row_step"],
        ">" if message["is_bigendian"] else "<",
    )  # fmt: skip
    return PointCloud(_stamp(message), _frame(message), layout.points(json_bytes(message["data"])))


def json_bytes(value: Any) -> bytes:
    """Bytes, which in JSON are base64 or a list of numbers."""
    return b64decode(value) if isinstance(value, str) else bytes(value)


@refuses
def range_from_json(data: Buffer) -> RangeMessage:
    message = json_object(data)
    keys = "field_of_view", "min_range", "max_range", "range"
    numbers = [_number(message.get(key)) for key in keys]
    return RangeMessage(_stamp(message), _frame(message), *numbers)


@refuses
def odometry_from_json(data: Buffer) -> OdometryMessage:
    message = json_object(data)
    child, pose = bare_frame(message.get("child_frame_id", "")), _pose(message["pose"]["pose"])
    return OdometryMessage(_stamp(message), _frame(message), child, pose)


@refuses
def pose_from_json(data: Buffer) -> OdometryMessage:
    """PoseStamped, or PoseWithCovarianceStamped."""
    message = json_object(data)
    pose = message["pose"]
    return OdometryMessage(_stamp(message), _frame(message), "", _pose(pose.get("pose", pose)))


def _pose(pose: dict[str, Any]) -> Pose2D:
    return planar_pose(_numbers(pose["position"], "xy"), _numbers(pose["orientation"], "xyzw"))


@refuses
def transform_from_json(data: Buffer) -> OdometryMessage:
    """TransformStamped, by itself."""
    transform = _transform(json_object(data))
    return OdometryMessage(
        transform.stamp_ns, transform.parent, transform.child, transform.motion.pose()
    )


@refuses
def transforms_from_json(data: Buffer) -> list[Transform]:
    return [_transform(one) for one in json_object(data)["transforms"]]


def _transform(message: dict[str, Any]) -> Transform:
    motion = message["transform"]
    moved = rigid(_numbers(motion["translation"], "xyz"), _numbers(motion["rotation"], "xyzw"))
    return Transform(_stamp(message), _frame(message), bare_frame(message["child_frame_id"]), moved)


def json_object(data: Buffer) -> dict[str, Any]:
    message = json.loads(bytes(data))
    if not isinstance(message, dict):
        raise ValueError("no JSON object")
    return message


def _frame(message: dict[str, Any]) -> str:
    return bare_frame(message["header"].get("frame_id", ""))


def _stamp(message: dict[str, Any]) -> int:
    """`{sec, nanosec}` (ROS 2), `{sec, nsec}` (Foxglove) or `{secs, nsecs}` (ROS 1)."""
    stamp = message["header"]["stamp"]
    seconds = next(stamp[key] for key in ("sec", "secs") if key in stamp)
    parts = (stamp[key] for key in ("nanosec", "nsec", "nsecs") if key in stamp)
    return stamp_of(seconds, next(parts, 0))


def _numbers(message: dict[str, Any], names: str) -> list[float]:
    return [float(message[name]) for name in names]


def _number(value: Any) -> float:
    """A float32 field: JSON has no NaN, so null stands for it."""
    return math.nan if value is None else single(float(value))
