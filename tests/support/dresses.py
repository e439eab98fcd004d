"""The messages of a fixture in other dresses: encodings, types, containers, by others' writers."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.writer import CompressionType, Writer
from mcap_protobuf.writer import Writer as ProtobufWriter
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mapcli.formats.logs.log import Source
from mapcli.formats.logs.mcap.container import McapFile
from mapcli.model.log import Damage
from mapcli.model.scan import RangeScan, Record

HUMBLE = get_typestore(Stores.ROS2_HUMBLE)
NOETIC = get_typestore(Stores.ROS1_NOETIC)
TRANSFORMS = "geometry_msgs/TransformStamped[] transforms"
NOETIC.register(get_types_from_msg(TRANSFORMS, "tf2_msgs/msg/TFMessage"))


class Said(NamedTuple):
    """A message of a log: topic, type, time of recording in nanoseconds, and what it says."""

    topic: str
    type: str
    time: int
    message: Any

    def dressed(self, message: Any, topic: str | None = None) -> Said:
        """Another message in its place."""
        return Said(topic or self.topic, message.__msgtype__, self.time, message)


def said_in(path: Path, seconds: float = math.inf, *topics: str) -> list[Said]:
    """The messages of the first seconds of a log of ROS 2 in MCAP."""
    file = McapFile(Source(path.name, path), Damage())
    start = min(first for first, _ in file.spans.values())
    wanted = {k for k, one in file.streams.items() if not topics or one.topic in topics}
    return [
        Said(stream.topic, stream.type, time, HUMBLE.deserialize_cdr(bytes(data), stream.type))
        for time, number, data, *_ in file.messages(wanted, Damage())
        if time - start < seconds * 1e9
        for stream in [file.streams[number]]
    ]


def cdr(message: Any) -> bytes:
    return bytes(HUMBLE.serialize_cdr(message, message.__msgtype__))


def ros1(message: Any) -> bytes:
    return bytes(NOETIC.serialize_ros1(_noetic(message), message.__msgtype__))


def _noetic(value: Any) -> Any:
    """A message of ROS 2 with the counter that headers of ROS 1 have."""
    if isinstance(value, list):
        return [_noetic(one) for one in value]
    if not hasattr(value, "__msgtype__"):
        return value
    made = {name: _noetic(one) for name, one in _fields(value)}
    if value.__msgtype__ == "std_msgs/msg/Header":
        made = {"seq": 0, **made}
    return NOETIC.types[value.__msgtype__](**made)


def as_json(message: Any) -> bytes:
    return json.dumps(_plain(message)).encode()


def _plain(value: Any) -> Any:
    if hasattr(value, "__msgtype__"):
        return {name: _plain(one) for name, one in _fields(value)}
    if isinstance(value, np.ndarray | list):
        return [_plain(one) for one in value]
    return value.item() if isinstance(value, np.generic) else value


def _fields(message: Any) -> Iterable[tuple[str, Any]]:
    names = (name for name in message.__dataclass_fields__ if not name.startswith("__"))
    return ((name, getattr(message, name)) for name in names)


ENCODE: dict[str, Callable[[Any], bytes]] = {"cdr": cdr, "ros1": ros1, "json": as_json}


def write_mcap(
    path: Path,
    said: Iterable[Said],
    encoding: str = "cdr",
    schema: str = "ros2msg",
    named: Callable[[str], str] = str,
) -> Path:
    """An MCAP file in an encoding of ROS.

    Args:
        schema: its encoding; empty for channels without one. named: what makes its name of a type.
    """
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, chunk_size=1 << 16)
        writer.start("", "test")
        channels: dict[str, int] = {}
        for topic, type_name, time, message in said:
            if topic not in channels:
                number = writer.register_schema(named(type_name), schema, b"") if schema else 0
                channels[topic] = writer.register_channel(topic, encoding, number)
            writer.add_message(channels[topic], time, ENCODE[encoding](message), time)
        writer.finish()
    return path


def write_foxglove(path: Path, said: Iterable[Said], encoding: str, schema: bool = True) -> Path:
    """An MCAP file of Foxglove's messages: `message` is one of protobuf."""
    with path.open("wb") as stream:
        if encoding == "protobuf":
            with ProtobufWriter(stream) as protobuf:
                for topic, _, time, message in said:
                    protobuf.write_message(topic, message, time, time)
            return path
        from google.protobuf.json_format import MessageToJson

        writer = Writer(stream)
        writer.start("", "test")
        channels: dict[str, int] = {}
        for topic, type_name, time, message in said:
            if topic not in channels:
                number = writer.register_schema(type_name, "jsonschema", b"{}") if schema else 0
                channels[topic] = writer.register_channel(topic, "json", number)
            text = MessageToJson(message, preserving_proto_field_name=True)
            writer.add_message(channels[topic], time, text.encode(), time)
        writer.finish()
    return path


def write_ros1(
    path: Path, said: Iterable[Said], compression: str | None = None, chunk_bytes: int = 1 << 15
) -> Path:
    """A ROS 1 bag, its chunks packed by `lz4` or `bz2`."""
    writer = Bag1Writer(path)
    if compression:
        writer.set_compression(getattr(writer.CompressionFormat, compression.upper()))
    writer.chunk_threshold = chunk_bytes
    with writer:
        connections: dict[str, Any] = {}
        for topic, type_name, time, message in said:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, type_name, typestore=NOETIC)
            writer.write(connections[topic], time, ros1(message))
    return path


def write_ros2(
    folder: Path,
    said: Iterable[Said],
    mode: CompressionMode | None = None,
    plugin: StoragePlugin = StoragePlugin.SQLITE3,
) -> Path:
    """A ROS 2 bag with its metadata."""
    writer = Bag2Writer(folder, version=8, storage_plugin=plugin)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for topic, type_name, time, message in said:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, type_name, typestore=HUMBLE)
            writer.write(connections[topic], time, cdr(message))
    return folder


def same(found: list[Record], wanted: list[Record]) -> None:
    """Whether records are those that are wanted, to the last bit."""
    assert len(found) == len(wanted)
    for one, other in zip(found, wanted, strict=True):
        assert type(one) is type(other)
        assert one.stamp_ns == other.stamp_ns
        if isinstance(one, RangeScan) and isinstance(other, RangeScan):
            assert one.ranges.tobytes() == other.ranges.tobytes()
            assert one.mount == other.mount
        else:
            assert one == other
