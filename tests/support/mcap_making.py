"""Making MCAP logs for tests, as recorders make them, and as they should not be."""

from __future__ import annotations

import io
import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer

from mapcli import Pose2D
from mapcli.formats.logs.ros import messages as ros

S = 10**9


@dataclass
class Sent:
    """One message on its way into a log; `data` overrides the CDR of `message`."""

    topic: str
    type: str
    message: Any
    log_ns: int
    data: bytes | None = None
    little_endian: bool = True


def scan(
    t: float,
    ranges: Any = (1.0, 2.0, 3.0),
    *,
    frame: str = "laser",
    angle_min: float = -0.5,
    angle_max: float | None = None,
    increment: float = 0.5,
    range_min: float = 0.1,
    range_max: float = 10.0,
    topic: str = "/scan",
    log: float | None = None,
    **more: Any,
) -> Sent:
    ranges = np.array(ranges, dtype=np.float32)
    if angle_max is None:
        angle_max = angle_min + increment * (len(ranges) - 1)
    message = ros.build(
        ros.LASER_SCAN, ros.header(round(t * S), frame), angle_min, angle_max, increment, 0.0, 0.0,
        range_min, range_max, ranges, np.zeros(2, dtype=np.float32),
    )  # fmt: skip
    return Sent(topic, ros.LASER_SCAN, message, round((t if log is None else log) * S), **more)


def sonar(
    t: float,
    reading: float,
    *,
    topic: str = "/sonar",
    frame: str = "sonar",
    limits: tuple[float, float] = (0.02, 2.0),
    variance: float | None = None,
    **more: Any,
) -> Sent:
    """A sensor_msgs/msg/Range; with a variance, in the layout of ROS 2 Iron and later."""
    message = ros.build(ros.RANGE, ros.header(round(t * S), frame), 0, 0.25, *limits, reading)
    data = bytes(ros.typestore().serialize_cdr(message, ros.RANGE, little_endian=True))
    if variance is not None:
        data += struct.pack("<f", variance)
    return Sent(topic, ros.RANGE, message, round(t * S), data=data, **more)


def odom(
    t: float,
    x: float = 0.0,
    y: float = 0.0,
    theta: float = 0.0,
    *,
    child: str = "base_link",
    topic: str = "/odom",
    log: float | None = None,
    **more: Any,
) -> Sent:
    zero = ros.build("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
    twist = ros.build("geometry_msgs/msg/Twist", zero, zero)
    message = ros.build(
        ros.ODOMETRY,
        ros.header(round(t * S), "odom"),
        child,
        ros.build(
            "geometry_msgs/msg/PoseWithCovariance",
            ros.pose_message(Pose2D(x, y, theta)),
            np.zeros(36),
        ),
        ros.build("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
    )
    return Sent(topic, ros.ODOMETRY, message, round((t if log is None else log) * S), **more)


def transform(
    t: float,
    parent: str,
    child: str,
    xyz: tuple[float, float, float] = (0, 0, 0),
    rpy_deg: tuple[float, float, float] = (0, 0, 0),
) -> Any:
    """One TransformStamped, turned by roll, pitch and yaw about fixed axes."""
    return ros.build(
        "geometry_msgs/msg/TransformStamped",
        ros.header(round(t * S), parent),
        child,
        ros.build(
            "geometry_msgs/msg/Transform",
            ros.build("geometry_msgs/msg/Vector3", *map(float, xyz)),
            ros.build("geometry_msgs/msg/Quaternion", *quaternion(*map(math.radians, rpy_deg))),
        ),
    )


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def tf(t: float, *transforms: Any, topic: str = "/tf", **more: Any) -> Sent:
    message = ros.build(ros.TF_MESSAGE, list(transforms))
    return Sent(topic, ros.TF_MESSAGE, message, round(t * S), **more)


def tf_static(t: float, *transforms: Any) -> Sent:
    return tf(t, *transforms, topic="/tf_static")


def mcap_bytes(
    *messages: Sent,
    encoding: str = "cdr",
    schema: bool | str = True,
    schema_encoding: str = "ros2msg",
    finish: bool = True,
    **settings: Any,
) -> bytes:
    """An MCAP file.

    Args:
        schema: False leaves channels without one; a text is put in place of the definition.
        settings: of `mcap.writer.Writer`.
    """
    settings = {"compression": CompressionType.ZSTD, "chunk_size": 2000, **settings}
    stream = io.BytesIO()
    writer = Writer(stream, **settings)
    writer.start("ros2", "test")
    channels: dict[str, int] = {}
    for sent in messages:
        if sent.topic not in channels:
            schema_id = 0
            if schema is not False:
                text = schema if isinstance(schema, str) else "a definition"
                schema_id = writer.register_schema(sent.type, schema_encoding, text.encode())
            channels[sent.topic] = writer.register_channel(sent.topic, encoding, schema_id)
        data = sent.data
        if data is None:
            data = bytes(
                ros.typestore().serialize_cdr(
                    sent.message, sent.type, little_endian=sent.little_endian
                )
            )
        writer.add_message(channels[sent.topic], sent.log_ns, data, sent.log_ns)
    if finish:
        writer.finish()
    return stream.getvalue()


def mcap_file(folder: Path, *messages: Sent, name: str = "a.mcap", **settings: Any) -> str:
    path = folder / name
    path.write_bytes(mcap_bytes(*messages, **settings))
    return str(path)
