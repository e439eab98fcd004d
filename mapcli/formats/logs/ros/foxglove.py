"""Foxglove's own messages in JSON: LaserScan, FrameTransform(s), PoseInFrame, as those of `decode`.

<https://docs.foxglove.dev/docs/visualization/message-schemas/introduction>. A LaserScan of
Foxglove's has neither limits of the range nor times of the beams. Every decoder raises ValueError
for bytes that do not hold its message.
"""

from __future__ import annotations

import math
from datetime import datetime
from typing import Any

import numpy as np

from mapcli.formats.logs.ros.decode import (
    Buffer,
    LaserScan,
    PoseMessage,
    Transform,
    json_object,
    refuses,
    stamp_of,
)
from mapcli.formats.logs.ros.transforms import rigid
from mapcli.model.pose import planar_pose
from mapcli.model.scan import NANOSECONDS


@refuses
def scan_from_json(data: Buffer) -> LaserScan:
    return scan_of(json_object(data))


@refuses
def pose_from_json(data: Buffer) -> PoseMessage:
    message = json_object(data)
    position, orientation = message["pose"]["position"], message["pose"]["orientation"]
    pose = planar_pose(_numbers(position, "xy"), _numbers(orientation, "xyzw"))
    return PoseMessage(_stamp(message["timestamp"]), _frame(message["frame_id"]), pose)


@refuses
def transforms_from_json(data: Buffer) -> list[Transform]:
    """A FrameTransform, or the many of FrameTransforms."""
    message = json_object(data)
    return [transform_of(one) for one in message.get("transforms", [message])]


def scan_of(message: dict[str, Any]) -> LaserScan:
    """A scan from its fields."""
    with np.errstate(over="ignore"):
        ranges = np.array(message["ranges"], dtype=np.float32)
    if ranges.ndim != 1:
        raise ValueError("ranges are no list")
    first, last = float(message["start_angle"]), float(message["end_angle"])
    turn, (x, y) = 0.0, (0.0, 0.0)
    if pose := message.get("pose"):
        placed = planar_pose(
            _numbers(pose["position"], "xy"), _numbers(pose["orientation"], "xyzw")
        )
        turn, x, y = placed.theta, placed.x, placed.y
    if math.hypot(x, y) > 1e-6:
        raise ValueError("a scan that does not start at its frame")
    step = (last - first) / max(len(ranges) - 1, 1)
    return LaserScan(
        _stamp(message["timestamp"]), _frame(message["frame_id"]), first + turn, last + turn, step,
        0.0, 0.0, math.inf, ranges,
    )  # fmt: skip


def transform_of(message: dict[str, Any]) -> Transform:
    """A transform from its fields."""
    motion = rigid(_numbers(message["translation"], "xyz"), _numbers(message["rotation"], "xyzw"))
    parent, child = _frame(message["parent_frame_id"]), _frame(message["child_frame_id"])
    return Transform(_stamp(message["timestamp"]), parent, child, motion)


def _numbers(message: dict[str, Any], names: str) -> list[float]:
    """Fields of these names; what is left out of JSON is 0, but w of a rotation."""
    return [float(message.get(name, 1.0 if name == "w" else 0.0)) for name in names]


def _frame(name: Any) -> str:
    return str(name).lstrip("/")


def _stamp(time: Any) -> int:
    """`{sec, nsec}`, or an ISO date as JSON of protobuf has it."""
    if isinstance(time, str):
        moment = datetime.fromisoformat(time)
        return stamp_of(int(moment.timestamp()), 1000 * moment.microsecond)
    nanoseconds = time.get("nsec", time.get("nanos", time.get("nanosec", 0)))
    stamp = stamp_of(time.get("sec", time.get("seconds", 0)), nanoseconds)
    if not 0 <= int(nanoseconds) < NANOSECONDS:
        raise ValueError("a stamp that is none")
    return stamp
