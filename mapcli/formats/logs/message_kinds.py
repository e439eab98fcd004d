"""What messages mapcli reads: the types, what a topic of each is good for, and the decoders."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from mapcli.formats.logs.mcap.frames import zstd_start
from mapcli.formats.logs.message_file import Stream
from mapcli.formats.logs.ros import decode, decode_json, decode_ros1, foxglove, other_scans
from mapcli.formats.packed import ZSTD_MAGIC
from mapcli.model.log import Role, Topic

Decoder = Callable[[Any], Any]

PROTOBUF = "protobuf"


class MessageKind(NamedTuple):
    """A type of messages.

    Attributes:
        role: of its topics; decoders: by encoding.
    """

    role: Role
    decoders: Mapping[str, Decoder]


_TRANSFORMS = MessageKind("tf", {
    "cdr": decode.transforms_from_cdr,
    "json": decode_json.transforms_from_json,
    "ros1": decode_ros1.transforms_from_ros1,
})  # fmt: skip
_POSE = MessageKind("pose", {
    "cdr": decode.pose_from_cdr,
    "json": decode_json.pose_from_json,
    "ros1": decode_ros1.pose_from_ros1,
})  # fmt: skip

ROS = {
    "LaserScan": MessageKind("scan", {
        "cdr": decode.scan_from_cdr,
        "json": decode_json.scan_from_json,
        "ros1": decode_ros1.scan_from_ros1,
    }),
    "MultiEchoLaserScan": MessageKind("scan", {
        "cdr": other_scans.multi_echo_from_cdr,
        "json": decode_json.multi_echo_from_json,
        "ros1": other_scans.multi_echo_from_ros1,
    }),
    "PointCloud2": MessageKind("cloud", {
        "cdr": other_scans.cloud_from_cdr,
        "json": decode_json.cloud_from_json,
        "ros1": other_scans.cloud_from_ros1,
    }),
    "Range": MessageKind("range", {
        "cdr": decode.range_from_cdr,
        "json": decode_json.range_from_json,
        "ros1": decode_ros1.range_from_ros1,
    }),
    "Odometry": MessageKind("odometry", {
        "cdr": decode.odometry_from_cdr,
        "json": decode_json.odometry_from_json,
        "ros1": decode_ros1.odometry_from_ros1,
    }),
    "TransformStamped": MessageKind("pose", {
        "cdr": decode.odometry_from_cdr,
        "json": decode_json.transform_from_json,
        "ros1": decode_ros1.odometry_from_ros1,
    }),
    "PoseStamped": _POSE,
    "PoseWithCovarianceStamped": _POSE,
    "TFMessage": _TRANSFORMS,
    "tfMessage": _TRANSFORMS,
}  # fmt: skip
"""Last part of a type's name -> the kind."""


def _of_foxglove(role: Role, decode_fields: Callable[[foxglove.Fields], Any]) -> MessageKind:
    """A kind of Foxglove's; in protobuf, the fields are found by the channel's schema."""
    return MessageKind(role, {"json": foxglove.of_json(decode_fields), PROTOBUF: decode_fields})


FOXGLOVE = {
    "LaserScan": _of_foxglove("scan", foxglove.scan_of),
    "PointCloud": _of_foxglove("cloud", foxglove.cloud_of),
    "Odometry": _of_foxglove("odometry", foxglove.pose_of),
    "PoseInFrame": _of_foxglove("pose", foxglove.pose_of),
    "FrameTransform": _of_foxglove("tf", foxglove.transforms_of),
    "FrameTransforms": _of_foxglove("tf", foxglove.transforms_of),
}
"""The same of Foxglove's own types."""

MAX_MESSAGE_BYTES = 1 << 28
"""Of an unpacked message; a cloud of a million points has a tenth of it."""


def kind_of_type(type_name: str) -> MessageKind | None:
    """Of `sensor_msgs/msg/LaserScan`, `sensor_msgs::msg::dds_::LaserScan_`, `foxglove.LaserScan`;
    None of a type that is not read."""
    kinds = FOXGLOVE if "foxglove" in type_name else ROS
    return kinds.get(last_part(type_name))


def last_part(type_name: str) -> str:
    """Of a type's name: `LaserScan`."""
    return re.split(r"[/:.]+", type_name)[-1].rstrip("_")


def decoder_of(topic: Topic, stream: Stream) -> Decoder:
    """What decodes the messages of a stream that carries a topic with a role."""
    kind = kind_of_type(topic.type)
    assert kind is not None, "only what is read has a role"
    decoder = kind.decoders[topic.encoding]
    if topic.encoding != PROTOBUF:
        return decoder
    from mapcli.formats.logs.protobuf import decoder_of_fields

    return decoder_of_fields(stream.type, stream.schema, decoder)


def unpacked(data: memoryview) -> memoryview | bytes:
    """A message, unpacked if rosbag2 has packed it by itself (`--compression-mode message`): CDR
    begins with two bytes of which the first is 0.

    Raises:
        ValueError: it is broken.
    """
    if data[:4] != ZSTD_MAGIC:
        return data
    content = zstd_start(bytes(data), MAX_MESSAGE_BYTES)
    if not content:
        raise ValueError("a packed message that is broken")
    return content
