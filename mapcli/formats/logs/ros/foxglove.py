"""Foxglove's own messages: LaserScan, PointCloud, FrameTransform(s), PoseInFrame and Odometry.

<https://docs.foxglove.dev/docs/sdk/schemas>. They come in JSON and in protobuf, with the same names
of fields; so every function takes a mapping, and `of_json` makes a decoder of it. A LaserScan of
Foxglove's has neither limits of the range nor times of the beams. What cannot be made a record
raises ValueError, or another error that `refuses` turns into one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Any, TypeVar

from mapcli.formats.logs.ros.decode import (
    Buffer,
    LaserScan,
    OdometryMessage,
    Transform,
    bare_frame,
    refuses,
    stamp_of,
)
from mapcli.formats.logs.ros.decode_json import json_bytes, json_object, json_ranges
from mapcli.formats.logs.ros.point_cloud import Layout, PointCloud
from mapcli.formats.logs.ros.transforms import rigid
from mapcli.model.pose import planar_pose
from mapcli.model.scan import NANOSECONDS

Fields = Mapping[str, Any]
Result = TypeVar("Result")

NUMBER_TYPES = {
    number: numpy_name
    for numbers, numpy_name in (
        ((1, "UINT8"), "u1"),
        ((2, "INT8"), "i1"),
        ((3, "UINT16"), "u2"),
        ((4, "INT16"), "i2"),
        ((5, "UINT32"), "u4"),
        ((6, "INT32"), "i4"),
        ((7, "FLOAT32"), "f4"),
        ((8, "FLOAT64"), "f8"),
    )
    for number in numbers
}
"""foxglove.PackedElementField: `type`, which JSON may name -> numpy's name for it."""


def of_json(decode: Callable[[Fields], Result]) -> Callable[[Buffer], Result]:
    """The decoder of JSON, from what takes its fields."""
    return refuses(lambda data: decode(json_object(data)))


def scan_of(message: Fields) -> LaserScan:
    ranges = json_ranges(message["ranges"])
    first, last = (float(message.get(f"{end}_angle", 0.0)) for end in ("start", "end"))
    step = (last - first) / max(len(ranges) - 1, 1)
    return LaserScan(
        _stamp(message), _frame(message), first, last, step, 0.0, 0.0, math.inf, ranges,
        _origin(message),
    )  # fmt: skip


def cloud_of(message: Fields) -> PointCloud:
    data, stride = json_bytes(message["data"]), int(message["point_stride"])
    fields = [(one["name"], NUMBER_TYPES[one["type"]], one.get("offset", 0))
              for one in message["fields"]]  # fmt: skip
    count = len(data) // stride if stride > 0 else 0
    points = Layout(fields, 1, count, stride, len(data)).points(data)
    return PointCloud(_stamp(message), _frame(message), points, _origin(message))


def pose_of(message: Fields) -> OdometryMessage:
    """A PoseInFrame, or an Odometry, which also tells whose pose it is."""
    child = message.get("body_frame_id") or message.get("child_frame_id") or ""
    x, y, _, *quaternion = _numbers(message.get("pose") or {})
    pose = planar_pose((x, y), quaternion)
    return OdometryMessage(_stamp(message), _frame(message), bare_frame(child), pose)


def transforms_of(message: Fields) -> list[Transform]:
    """A FrameTransform, or the many of FrameTransforms."""
    return [_transform(one) for one in message.get("transforms", [message])]


def _transform(message: Fields) -> Transform:
    pose = {"position": message.get("translation"), "orientation": message.get("rotation")}
    numbers = _numbers(pose)
    parent, child = (bare_frame(message[f"{end}_frame_id"]) for end in ("parent", "child"))
    return Transform(_stamp(message), parent, child, rigid(numbers[:3], numbers[3:]))


def _frame(message: Fields) -> str:
    return bare_frame(message.get("frame_id", ""))


def _origin(message: Fields) -> tuple[float, ...]:
    """Where a scan's or a cloud's own frame is in its `frame_id`; empty where they are one."""
    numbers = _numbers(message.get("pose") or {})
    rigid(numbers[:3], numbers[3:])
    return numbers if any(numbers[:6]) else ()


def _numbers(pose: Fields) -> tuple[float, ...]:
    """x, y, z, and a quaternion x, y, z, w. What is left out is 0, as in protobuf; but w, if
    left out or if all are 0, is what makes a rotation of it: {} is none, {z: 1} half a turn."""
    position, rotation = pose.get("position") or {}, pose.get("orientation") or {}
    place = [float(position.get(name, 0.0)) for name in "xyz"]
    axis = [float(rotation.get(name, 0.0)) for name in "xyz"]
    w = rotation.get("w")
    if w is None or not any((*axis, w)):
        w = math.sqrt(max(1.0 - sum(value * value for value in axis), 0.0))
    return *place, *axis, float(w)


def _stamp(message: Fields) -> int:
    """Of `{sec, nsec}`, `{seconds, nanos}` as protobuf has it, or a date as its JSON has; 0 where
    there is none."""
    time = message.get("timestamp") or {}
    if isinstance(time, str):
        moment = datetime.fromisoformat(time)
        return stamp_of(int(moment.timestamp()), 1000 * moment.microsecond)
    nanoseconds = time.get("nsec", time.get("nanos", time.get("nanosec", 0)))
    if not 0 <= int(nanoseconds) < NANOSECONDS:
        raise ValueError("a stamp that is none")
    return stamp_of(time.get("sec", time.get("seconds", 0)), nanoseconds)
