"""What messages mapcli reads: the types, what a topic of each is good for, and the decoders."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from operator import itemgetter
from typing import Any, NamedTuple

from mapcli.formats.logs.mcap.frames import zstd_start
from mapcli.formats.logs.message_file import MessageFile, Stream
from mapcli.formats.logs.ros import decode, decode_ros1, foxglove, other_scans
from mapcli.formats.packed import ZSTD_MAGIC
from mapcli.model.log import Damage, Role, Topic

Decoder = Callable[[Any], Any]


class MessageKind(NamedTuple):
    """A type of messages.

    Attributes:
        role: of its topics; decoders: by encoding.
    """

    role: Role
    decoders: Mapping[str, Decoder]


_TRANSFORMS = MessageKind("tf", {
    "cdr": decode.transforms_from_cdr,
    "json": decode.transforms_from_json,
    "ros1": decode_ros1.transforms_from_ros1,
})  # fmt: skip
_POSE = MessageKind("pose", {
    "cdr": decode.pose_from_cdr,
    "ros1": decode_ros1.pose_from_ros1,
})  # fmt: skip

ROS = {
    "LaserScan": MessageKind("scan", {
        "cdr": decode.scan_from_cdr,
        "json": decode.scan_from_json,
        "ros1": decode_ros1.scan_from_ros1,
    }),
    "MultiEchoLaserScan": MessageKind("scan", {"cdr": other_scans.scan_from_multi_echo_cdr}),
    "PointCloud2": MessageKind("cloud", {"cdr": other_scans.cloud_from_cdr}),
    "Range": MessageKind("range", {
        "cdr": decode.range_from_cdr,
        "json": decode.range_from_json,
        "ros1": decode_ros1.range_from_ros1,
    }),
    "Odometry": MessageKind("odometry", {
        "cdr": decode.odometry_from_cdr,
        "json": decode.odometry_from_json,
        "ros1": decode_ros1.odometry_from_ros1,
    }),
    "PoseStamped": _POSE,
    "PoseWithCovarianceStamped": _POSE,
    "TFMessage": _TRANSFORMS,
    "tfMessage": _TRANSFORMS,
}  # fmt: skip
"""Last part of a type's name -> the kind."""

FOXGLOVE = {
    "LaserScan": MessageKind("scan", {"json": foxglove.scan_from_json}),
    "PoseInFrame": MessageKind("pose", {"json": foxglove.pose_from_json}),
    "FrameTransform": MessageKind("tf", {"json": foxglove.transforms_from_json}),
    "FrameTransforms": MessageKind("tf", {"json": foxglove.transforms_from_json}),
}
"""The same of Foxglove's own types."""

JSON_KEYS = {
    "angle_min": ROS["LaserScan"],
    "radiation_type": ROS["Range"],
    "child_frame_id": ROS["Odometry"],
    "transforms": _TRANSFORMS,
}
"""Key by which a JSON message without a schema is recognised -> its kind."""

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


def kind_of_stream(file: MessageFile, number: int, stream: Stream) -> MessageKind | None:
    """Of a stream of a file; without a type, by the keys of its first message in JSON."""
    if stream.type or stream.encoding != "json":
        return kind_of_type(stream.type)
    for message in islice(file.messages({number}, Damage()), 1):
        try:
            keys = json.loads(bytes(message.data)).keys()
        except (ValueError, AttributeError, RecursionError):
            break
        return next((kind for key, kind in JSON_KEYS.items() if key in keys), None)
    return None


def decoder_of(topic: Topic) -> Decoder:
    """What decodes the messages of a topic that has a role."""
    kind = kind_of_type(topic.type)
    if kind is None:  # without a type: by the role that the first message showed
        role = "tf" if topic.role == "tf_static" else topic.role
        kind = next(kind for kind in JSON_KEYS.values() if kind.role == role)
    return kind.decoders[topic.encoding]


def topics_of(files: Sequence[MessageFile]) -> dict[Topic, list[tuple[MessageFile, int]]]:
    """The topics of all files by name, with the streams that carry them."""
    carriers: dict[tuple[str, str, str, Role], list[tuple[MessageFile, int]]] = {}
    for file in files:
        for number, stream in file.streams.items():
            role = _role(kind_of_stream(file, number, stream), stream)
            key = stream.topic, stream.type or "no type", stream.encoding, role
            carriers.setdefault(key, []).append((file, number))
    topics = {}
    for (name, type_name, encoding, role), streams in sorted(carriers.items(), key=itemgetter(0)):
        count = sum(file.counts.get(number, 0) for file, number in streams)
        spans = [file.spans[number] for file, number in streams if number in file.spans]
        first = min((span[0] for span in spans), default=0)
        last = max((span[1] for span in spans), default=0)
        topics[Topic(name, role, type_name, encoding, count, first, last)] = streams
    return topics


def _role(kind: MessageKind | None, stream: Stream) -> Role:
    """Of a stream; `other` if its encoding cannot be decoded."""
    if kind is None or stream.encoding not in kind.decoders:
        return "other"
    if kind.role == "tf" and stream.topic.endswith("tf_static"):
        return "tf_static"
    return kind.role


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
