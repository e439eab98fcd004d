"""Decoding LaserScan, Range, Odometry, PoseStamped, TransformStamped and TFMessage from CDR, and
the records that they become.

Every decoder raises ValueError for bytes that do not hold its message. These messages make
up whole logs and have not changed since ROS 2 began, so their CDR is read by hand: ten times
faster than by general decoders, and no schema is needed.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, wraps
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.logs.ros.transforms import Rigid, rigid
from mapcli.model.pose import Pose2D, planar_pose
from mapcli.model.scan import NANOSECONDS

MAX_NAME_BYTES = 4096

_ORDERS = {b"\0\0": ">", b"\0\1": "<"}
"""First bytes of plain CDR -> byte order."""
_STAMP = {order: struct.Struct(f"{order}iI") for order in "<>"}
_COUNT = {order: struct.Struct(f"{order}I") for order in "<>"}
_SCAN = {order: struct.Struct(f"{order}7fI") for order in "<>"}
_POSE = {order: struct.Struct(f"{order}7d") for order in "<>"}
FLOATS = {order: np.dtype(f"{order}f4") for order in "<>"}
"""Byte order -> the layout of numbers in it, each worked out once."""

Result = TypeVar("Result")
Buffer = bytes | memoryview


class LaserScan(NamedTuple):
    """The fields of sensor_msgs/msg/LaserScan that matter here, as sent.

    Attributes:
        origin: where the scan's own frame is in `frame`: x, y, z, and a quaternion x, y, z, w;
            empty where they are one, as they are but in messages of Foxglove's.
    """

    stamp_ns: int
    frame: str
    angle_min: float
    angle_max: float
    angle_increment: float
    time_increment: float
    range_min: float
    range_max: float
    ranges: NDArray[np.float32]
    origin: tuple[float, ...] = ()


class RangeMessage(NamedTuple):
    """The fields of sensor_msgs/msg/Range that matter here, as sent. It also has a `variance` since
    ROS 2 Iron, which comes last and is not read."""

    stamp_ns: int
    frame: str
    field_of_view: float
    range_min: float
    range_max: float
    reading: float


class OdometryMessage(NamedTuple):
    """nav_msgs/msg/Odometry in the plane: `frame` from `child`, or another message that tells a
    pose; PoseStamped does not tell whose, and `child` is empty."""

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
    return LaserScan(*scan, np.frombuffer(body, FLOATS[order], n, at))


def scan_without_ranges(
    order: str, body: Buffer
) -> tuple[tuple[int, str, float, float, float, float, float, float], int, int]:
    """What LaserScan and MultiEchoLaserScan have in common: the fields of a `LaserScan` before the
    ranges, how many of these there are, and where they begin."""
    stamp, frame, at = header_at(order, body, 0)
    at += -at % 4
    first, last, step, seconds, _, low, high, n = _SCAN[order].unpack_from(body, at)
    return (stamp, frame, first, last, step, seconds, low, high), n, at + 32


@refuses
def range_from_cdr(data: Buffer) -> RangeMessage:
    order, body = opened(data)
    stamp, frame, at = header_at(order, body, 0)
    at += 1  # the kind of radiation
    return RangeMessage(stamp, frame, *struct.unpack_from(f"{order}4f", body, at + -at % 4))


@refuses
def odometry_from_cdr(data: Buffer) -> OdometryMessage:
    """Odometry, or TransformStamped: up to the pose they are laid out alike."""
    order, body = opened(data)
    stamp, frame, at = header_at(order, body, 0)
    child, at = _string(order, body, at)
    x, y, _, *quaternion = _POSE[order].unpack_from(body, at + -at % 8)
    return OdometryMessage(stamp, frame, child, planar_pose((x, y), quaternion))


@refuses
def pose_from_cdr(data: Buffer) -> OdometryMessage:
    """PoseStamped, or PoseWithCovarianceStamped."""
    order, body = opened(data)
    stamp, frame, at = header_at(order, body, 0)
    x, y, _, *quaternion = _POSE[order].unpack_from(body, at + -at % 8)
    return OdometryMessage(stamp, frame, "", planar_pose((x, y), quaternion))


@refuses
def transforms_from_cdr(data: Buffer) -> list[Transform]:
    order, body = opened(data)
    (n,) = struct.unpack_from(f"{order}I", body, 0)
    transforms, at = [], 4
    for _ in range(n):
        stamp, parent, at = header_at(order, body, at)
        child, at = _string(order, body, at)
        at += -at % 8
        numbers = _POSE[order].unpack_from(body, at)
        transforms.append(Transform(stamp, parent, child, rigid(numbers[:3], numbers[3:])))
        at += 56
    return transforms


def opened(data: Buffer) -> tuple[str, Buffer]:
    """Byte order (plain CDR, big or little endian, as the first four bytes tell), and the rest."""
    order = _ORDERS.get(bytes(data[:2]))
    if order is None:
        raise ValueError("not plain CDR")
    return order, data[4:]


def header_at(order: str, body: Buffer, at: int) -> tuple[int, str, int]:
    """Stamp, frame and end of a std_msgs/msg/Header. Numbers start at multiples of their size."""
    at += -at % 4
    seconds, nanoseconds = _STAMP[order].unpack_from(body, at)
    frame, at = string_at(order, body, at + 8)
    return seconds * NANOSECONDS + nanoseconds, frame, at


def _string(order: str, body: Buffer, at: int) -> tuple[str, int]:
    """A frame's name and its end; its length starts at a multiple of four."""
    return string_at(order, body, at + -at % 4)


def string_at(order: str, body: Buffer, at: int) -> tuple[str, int]:
    """A frame's name that begins right there, and its end."""
    (letters,) = _COUNT[order].unpack_from(body, at)
    at += 4
    if letters > MAX_NAME_BYTES:
        raise ValueError("no frame's name")
    return _decoded(bytes(body[at : at + letters])), at + letters


@lru_cache(maxsize=64)
def _decoded(name: bytes) -> str:
    return bare_frame(name.rstrip(b"\0").decode())


def bare_frame(name: str) -> str:
    """Frame names without the leading slash of old."""
    return name.lstrip("/")


def stamp_of(seconds: Any, nanoseconds: Any) -> int:
    stamp = int(seconds) * NANOSECONDS + int(nanoseconds)
    if abs(stamp) >= 1 << 63:  # JSON has numbers of any length
        raise ValueError(f"a stamp of {stamp.bit_length()} bits")
    return stamp
