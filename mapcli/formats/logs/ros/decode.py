"""Decoding LaserScan, Range, Odometry, PoseStamped and TFMessage, from CDR or from JSON of the same
shape.

Every decoder raises ValueError for bytes that do not hold its message. These messages make
up whole logs and have not changed since ROS 2 began, so their CDR is read by hand: ten times
faster than by general decoders, and no schema is needed.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, wraps
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.logs.rep117 import single
from mapcli.formats.logs.ros.transforms import Rigid, rigid
from mapcli.model.pose import Pose2D, planar_pose
from mapcli.model.scan import NANOSECONDS

MAX_NAME_BYTES = 4096

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
    time_increment: float
    range_min: float
    range_max: float
    ranges: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class RangeMessage:
    """The fields of sensor_msgs/msg/Range that matter here, as sent. It also has a `variance` since
    ROS 2 Iron, which comes last and is not read."""

    stamp_ns: int
    frame: str
    field_of_view: float
    range_min: float
    range_max: float
    reading: float


@dataclass(frozen=True, slots=True)
class OdometryMessage:
    """nav_msgs/msg/Odometry in the plane: `frame` from `child`."""

    stamp_ns: int
    frame: str
    child: str
    pose: Pose2D


@dataclass(frozen=True, slots=True)
class PoseMessage:
    """geometry_msgs/msg/PoseStamped in the plane: a pose in `frame`."""

    stamp_ns: int
    frame: str
    pose: Pose2D


@dataclass(frozen=True, slots=True, eq=False)
class Transform:
    """One element of tf2_msgs/msg/TFMessage: `parent` from `child`."""

    stamp_ns: int
    parent: str
    child: str
    motion: Rigid


def refuses(decode: Callable[[Buffer], Result]) -> Callable[[Buffer], Result]:
    """All that decoding bad bytes can raise becomes ValueError."""

    @wraps(decode)
    def guarded(data: Buffer) -> Result:
        try:
            return decode(data)
        except ValueError:  # Unicode and JSON errors are ValueErrors
            raise
        except _BAD_BYTES as error:
            raise ValueError(str(error)) from error

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
    StopIteration,
)


@refuses
def scan_from_cdr(data: Buffer) -> LaserScan:
    order, body = opened(data)
    scan, n, at = scan_without_ranges(order, body)
    ranges = np.frombuffer(body, dtype=f"{order}f4", count=n, offset=at)
    return LaserScan(*scan, ranges=ranges)


def scan_without_ranges(
    order: str, body: Buffer
) -> tuple[tuple[int, str, float, float, float, float, float, float], int, int]:
    """What LaserScan and MultiEchoLaserScan have in common: the fields of a `LaserScan` before the
    ranges, how many of these there are, and where they begin."""
    stamp, frame, at = header_at(order, body, 0)
    at += -at % 4
    first, last, step, seconds, _, low, high, n = struct.unpack_from(f"{order}7fI", body, at)
    return (stamp, frame, first, last, step, seconds, low, high), n, at + 32


@refuses
def range_from_cdr(data: Buffer) -> RangeMessage:
    order, body = opened(data)
    stamp, frame, at = header_at(order, body, 0)
    at += 1  # the kind of radiation
    return RangeMessage(stamp, frame, *struct.unpack_from(f"{order}4f", body, at + -at % 4))


@refuses
def odometry_from_cdr(data: Buffer) -> OdometryMessage:
    order, body = opened(data)
    stamp, frame, at = header_at(order, body, 0)
    child, at = _string(order, body, at)
    x, y, _, *quaternion = struct.unpack_from(f"{order}7d", body, at + -at % 8)
    return OdometryMessage(stamp, frame, child, planar_pose((x, y), quaternion))


@refuses
def pose_from_cdr(data: Buffer) -> PoseMessage:
    order, body = opened(data)
    stamp, frame, at = header_at(order, body, 0)
    x, y, _, *quaternion = struct.unpack_from(f"{order}7d", body, at + -at % 8)
    return PoseMessage(stamp, frame, planar_pose((x, y), quaternion))


@refuses
def transforms_from_cdr(data: Buffer) -> list[Transform]:
    order, body = opened(data)
    (n,) = struct.unpack_from(f"{order}I", body, 0)
    transforms, at = [], 4
    for _ in range(n):
        stamp, parent, at = header_at(order, body, at)
        child, at = _string(order, body, at)
        at += -at % 8
        numbers = struct.unpack_from(f"{order}7d", body, at)
        transforms.append(Transform(stamp, parent, child, rigid(numbers[:3], numbers[3:])))
        at += 56
    return transforms


def opened(data: Buffer) -> tuple[str, Buffer]:
    """Byte order (plain CDR, big or little endian, as the first four bytes tell), and the rest."""
    kind = bytes(data[:2])
    if kind not in (b"\0\0", b"\0\1"):
        raise ValueError("not plain CDR")
    return "<" if kind[1] else ">", data[4:]


def header_at(order: str, body: Buffer, at: int) -> tuple[int, str, int]:
    """Stamp, frame and end of a std_msgs/msg/Header. Numbers start at multiples of their size."""
    at += -at % 4
    seconds, nanoseconds = struct.unpack_from(f"{order}iI", body, at)
    frame, at = _string(order, body, at + 8)
    return stamp_of(seconds, nanoseconds), frame, at


def _string(order: str, body: Buffer, at: int) -> tuple[str, int]:
    """A frame's name and its end; its length starts at a multiple of four."""
    return string_at(order, body, at + -at % 4)


def string_at(order: str, body: Buffer, at: int) -> tuple[str, int]:
    """A frame's name that begins right there, and its end."""
    (letters,) = struct.unpack_from(f"{order}I", body, at)
    at += 4
    if letters > MAX_NAME_BYTES:
        raise ValueError("no frame's name")
    return _decoded(bytes(body[at : at + letters])), at + letters


@lru_cache(maxsize=64)
def _decoded(name: bytes) -> str:
    return _frame(name.rstrip(b"\0").decode())


@refuses
def scan_from_json(data: Buffer) -> LaserScan:
    message = json_object(data)
    with np.errstate(over="ignore"):
        ranges = np.array(message["ranges"], dtype=np.float32)  # null and "NaN" become NaN
    if ranges.ndim != 1:
        raise ValueError("ranges are no list")
    number = {
        key: _number(message.get(key))
        for key in ("angle_min", "angle_max", "angle_increment", "range_min", "range_max")
    }
    number["time_increment"] = _number(message.get("time_increment", 0.0))
    return LaserScan(_json_stamp(message), _json_frame(message), **number, ranges=ranges)


@refuses
def range_from_json(data: Buffer) -> RangeMessage:
    message = json_object(data)
    keys = "field_of_view", "min_range", "max_range", "range"
    numbers = [_number(message.get(key)) for key in keys]
    return RangeMessage(_json_stamp(message), _json_frame(message), *numbers)


@refuses
def odometry_from_json(data: Buffer) -> OdometryMessage:
    message = json_object(data)
    pose = message["pose"]["pose"]
    position, orientation = pose["position"], pose["orientation"]
    return OdometryMessage(
        _json_stamp(message),
        _json_frame(message),
        _frame(message.get("child_frame_id", "")),
        planar_pose(
            [float(position[key]) for key in "xy"], [float(orientation[key]) for key in "xyzw"]
        ),
    )


@refuses
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
        for t in json_object(data)["transforms"]
    ]


def _frame(name: str) -> str:
    """Frame names without the leading slash of old."""
    return name.lstrip("/")


def stamp_of(seconds: Any, nanoseconds: Any) -> int:
    stamp = int(seconds) * NANOSECONDS + int(nanoseconds)
    if abs(stamp) >= 1 << 63:  # JSON has numbers of any length
        raise ValueError(f"a stamp of {stamp.bit_length()} bits")
    return stamp


def json_object(data: Buffer) -> dict[str, Any]:
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
    return stamp_of(seconds, next(parts, 0))


def _number(value: Any) -> float:
    """A float32 field: JSON has no NaN, so null stands for it."""
    return math.nan if value is None else single(float(value))
