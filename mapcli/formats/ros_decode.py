"""Taking LaserScan, Odometry and TFMessage apart, from CDR or from JSON of the same shape.

Every decoder raises ValueError for bytes that do not hold its message. LaserScan, of which logs
are full, is read by hand: its arrays are views of the buffer, with no object built on the way.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mapcli.formats import ros_messages as ros
from mapcli.formats.ros_frames import Rigid, rigid
from mapcli.formats.ros_messages import settled_angle
from mapcli.model.pose import Pose2D

Result = TypeVar("Result")
Buffer = bytes | memoryview


@dataclass(frozen=True, slots=True, eq=False)
class LaserScan:
    """The fields of sensor_msgs/msg/LaserScan that matter here, as sent."""

    stamp_ns: int
    frame: str
    angle_min: float
    angle_max: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class OdometryMessage:
    """nav_msgs/msg/Odometry in the plane: `frame` from `child`."""

    stamp_ns: int
    frame: str
    child: str
    pose: Pose2D


@dataclass(frozen=True, slots=True, eq=False)
class Transform:
    """One element of tf2_msgs/msg/TFMessage: `parent` from `child`."""

    stamp_ns: int
    parent: str
    child: str
    motion: Rigid


def _refuses(decode: Callable[[Buffer], Result]) -> Callable[[Buffer], Result]:
    """All that decoding bad bytes can raise becomes ValueError."""

    @wraps(decode)
    def guarded(data: Buffer) -> Result:
        try:
            return decode(data)
        except ValueError:  # Unicode and JSON errors are ValueErrors
            raise
        except _BAD_BYTES as error:
            raise ValueError(str(error)) from error
        except Exception as error:
            if type(error).__module__.startswith("rosbags."):
                raise ValueError(str(error)) from error
            raise

    return guarded


_BAD_BYTES = (
    struct.error,
    KeyError,
    IndexError,
    TypeError,
    AttributeError,
    OverflowError,
    RecursionError,
    MemoryError,
)


@_refuses
def scan_from_cdr(data: Buffer) -> LaserScan:
    order = _byte_order(data)
    body = data[4:]
    seconds, nanoseconds, letters = struct.unpack_from(f"{order}iII", body, 0)
    at = 12 + letters
    frame = bytes(body[12:at]).rstrip(b"\0").decode()
    at += -at % 4
    angle_min, angle_max, increment, _, _, low, high, n = struct.unpack_from(
        f"{order}7fI", body, at
    )
    ranges = np.frombuffer(body, dtype=f"{order}f4", count=n, offset=at + 32)
    stamp = seconds * ros.NANOSECONDS + nanoseconds
    return LaserScan(stamp, _frame(frame), angle_min, angle_max, increment, low, high, ranges)


def _byte_order(data: Buffer) -> str:
    """Of a CDR message, as its first four bytes tell: plain CDR, big or little endian."""
    kind = bytes(data[:2])
    if kind not in (b"\0\0", b"\0\1"):
        raise ValueError("not plain CDR")
    return "<" if kind[1] else ">"


@_refuses
def odometry_from_cdr(data: Buffer) -> OdometryMessage:
    message = ros.typestore().deserialize_cdr(data, ros.ODOMETRY)
    p, q = message.pose.pose.position, message.pose.pose.orientation
    return OdometryMessage(
        _stamp(message.header.stamp.sec, message.header.stamp.nanosec),
        _frame(message.header.frame_id),
        _frame(message.child_frame_id),
        planar((p.x, p.y), (q.x, q.y, q.z, q.w)),
    )


@_refuses
def transforms_from_cdr(data: Buffer) -> list[Transform]:
    message = ros.typestore().deserialize_cdr(data, ros.TF_MESSAGE)
    return [
        Transform(
            _stamp(t.header.stamp.sec, t.header.stamp.nanosec),
            _frame(t.header.frame_id),
            _frame(t.child_frame_id),
            rigid(_xyz(t.transform.translation), _xyzw(t.transform.rotation)),
        )
        for t in message.transforms
    ]


def _xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _xyzw(quaternion: Any) -> tuple[float, float, float, float]:
    return quaternion.x, quaternion.y, quaternion.z, quaternion.w


@_refuses
def scan_from_json(data: Buffer) -> LaserScan:
    message = _object(data)
    with np.errstate(over="ignore"):
        ranges = np.array(message["ranges"], dtype=np.float32)  # null and "NaN" become NaN
    if ranges.ndim != 1:
        raise ValueError("ranges are no list")
    number = {
        key: _number(message.get(key))
        for key in ("angle_min", "angle_max", "angle_increment", "range_min", "range_max")
    }
    return LaserScan(_json_stamp(message), _json_frame(message), **number, ranges=ranges)


@_refuses
def odometry_from_json(data: Buffer) -> OdometryMessage:
    message = _object(data)
    pose = message["pose"]["pose"]
    position, orientation = pose["position"], pose["orientation"]
    return OdometryMessage(
        _json_stamp(message),
        _json_frame(message),
        _frame(message.get("child_frame_id", "")),
        planar([float(position[key]) for key in "xy"], [float(orientation[key]) for key in "xyzw"]),
    )


@_refuses
def transforms_from_json(data: Buffer) -> list[Transform]:
    return [
        Transform(
            _json_stamp(t),
            _json_frame(t),
            _frame(t["child_frame_id"]),
            rigid(
                [float(t["transform"]["translation"][key]) for key in "xyz"],
                [float(t["transform"]["rotation"][key]) for key in "xyzw"],
            ),
        )
        for t in _object(data)["transforms"]
    ]


def planar(position: Any, quaternion: Any) -> Pose2D:
    """The pose in the plane. Raises ValueError where it is not finite or has no heading."""
    x, y, z, w = quaternion
    square = x * x + y * y + z * z + w * w
    if not (square > 1e-6 and math.isfinite(square + position[0] + position[1])):
        raise ValueError("no pose")
    yaw = math.atan2(2 * (x * y + z * w) / square, 1 - 2 * (y * y + z * z) / square)
    return Pose2D(float(position[0]), float(position[1]), settled_angle(yaw))


def _frame(name: str) -> str:
    """Frame names without the leading slash of old."""
    return name.lstrip("/")


def _stamp(seconds: Any, nanoseconds: Any) -> int:
    return int(seconds) * ros.NANOSECONDS + int(nanoseconds)


def _object(data: Buffer) -> dict[str, Any]:
    message = json.loads(bytes(data))
    if not isinstance(message, dict):
        raise ValueError("no JSON object")
    return message


def _json_frame(message: dict[str, Any]) -> str:
    return _frame(message["header"].get("frame_id", ""))


def _json_stamp(message: dict[str, Any]) -> int:
    """`{sec, nanosec}` (ROS 2), `{sec, nsec}` (Foxglove) or `{secs, nsecs}` (ROS 1)."""
    stamp = message["header"]["stamp"]
    seconds = next(stamp[key] for key in ("sec", "secs") if key in stamp)
    parts = (stamp[key] for key in ("nanosec", "nsec", "nsecs") if key in stamp)
    return _stamp(seconds, next(parts, 0))


def _number(value: Any) -> float:
    """A float32 field: JSON has no NaN, so null stands for it."""
    return math.nan if value is None else float(np.float32(float(value)))
