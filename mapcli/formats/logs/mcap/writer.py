"""Writing logs as MCAP with ROS 2 messages (profile `ros2`, `cdr` + `ros2msg`, zstd chunks).

What a log written here holds, readable by Foxglove, `ros2 bag`, rosbags and mcap-ros2-support:

    /scan          sensor_msgs/msg/LaserScan        in the laser's frame
    /odom          nav_msgs/msg/Odometry            odom -> base_link
    /tf            tf2_msgs/msg/TFMessage           the same, so that viewers can place the scans
    /range/NAME    sensor_msgs/msg/Range            of each range sensor with one beam
    /tf_static     tf2_msgs/msg/TFMessage           base_link -> laser, before its first scan
    /ground_truth  geometry_msgs/msg/PoseStamped    in map; never mistaken for odometry

A message is logged at its own stamp. The bytes depend on the records alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.writer import CompressionType, Writer

from mapcli.errors import DataError
from mapcli.formats.logs.ros import messages as ros
from mapcli.formats.logs.topics import LogNames
from mapcli.formats.output import output_file
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import (
    LATEST_STAMP_S,
    NANOSECONDS,
    Mount,
    Odometry,
    RangeScan,
    Record,
    TruePose,
)
from mapcli.version import __version__

LATCHED = """\
- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
"""Quality of service that makes `ros2 bag play` repeat /tf_static to late listeners."""


class CountedStream:
    """A binary stream that knows its position, so that pipes can be written to."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._position = 0

    def write(self, data: bytes) -> int:
        self._stream.write(data)
        self._position += len(data)
        return len(data)

    def tell(self) -> int:
        return self._position

    def flush(self) -> None:
        self._stream.flush()


class McapLogWriter:
    """Writes records to an MCAP stream as they come (stateful; `close` or `with` completes it).

    Args:
        stream: binary, written forwards only (a pipe will do); stays open.
        names: of topics and frames.
    """

    def __init__(self, stream: BinaryIO, names: LogNames | None = None) -> None:
        self.names = names or LogNames()
        self._suffixes: dict[Mount, str] = {}
        self._sensors: set[str] = set()
        self._channels: dict[tuple[str, str], int] = {}
        self._schemas: dict[str, int] = {}
        self._sequence: dict[int, int] = {}
        self._writer = Writer(CountedStream(stream), compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        self._writer.start(profile="ros2", library=f"mapcli {__version__}")

    def __enter__(self) -> McapLogWriter:
        return self

    def __exit__(self, exception: type[BaseException] | None, *rest: object) -> None:
        if exception is None:
            self.close()

    def close(self) -> None:
        """Write the index. Without it the file counts as truncated."""
        self._writer.finish()  # type: ignore[no-untyped-call]

    def write(self, record: Record) -> None:
        """Append one record.

        Raises:
            DataError: its stamp does not fit into a ROS 2 time (years 1970 to 2038).
        """
        if isinstance(record, RangeReading):
            self._write_reading(record)
        elif isinstance(record, RangeScan):
            self._write_scan(record)
        elif isinstance(record, Odometry):
            self._write_odometry(record)
        else:
            self._write_truth(record)

    def message(
        self, topic: str, type_name: str, message: Any, stamp_ns: int, *, latched: bool = False
    ) -> None:
        """Append any ROS 2 message, built with `ros.messages.build`.

        Raises:
            DataError: the stamp does not fit into a ROS 2 time.
        """
        if not 0 <= stamp_ns < LATEST_STAMP_S * NANOSECONDS:
            raise DataError(
                f"a record is stamped {stamp_ns / NANOSECONDS:.3f} s",
                expected="a ROS 2 time, between 1970 and 2038",
            )
        channel = self._channel(topic, type_name, latched)
        sequence = self._sequence[channel] = self._sequence.get(channel, 0) + 1
        data = bytes(ros.typestore().serialize_cdr(message, type_name, little_endian=True))
        self._writer.add_message(channel, stamp_ns, data, stamp_ns, sequence)

    def _channel(self, topic: str, type_name: str, latched: bool) -> int:
        key = topic, type_name
        if key not in self._channels:
            if type_name not in self._schemas:
                text, _ = ros.typestore().generate_msgdef(type_name, ros_version=2)
                self._schemas[type_name] = self._writer.register_schema(
                    type_name, "ros2msg", text.encode()
                )
            quality = {"offered_qos_profiles": LATCHED if latched else ""}
            self._channels[key] = self._writer.register_channel(
                topic, "cdr", self._schemas[type_name], quality
            )
        return self._channels[key]

    def _write_scan(self, scan: RangeScan) -> None:
        if scan.mount not in self._suffixes:
            self._write_mount(scan.mount, scan.stamp_ns)
        suffix = self._suffixes[scan.mount]
        span = scan.angle_increment * max(len(scan.ranges) - 1, 0)
        laser_scan = ros.build(
            ros.LASER_SCAN,
            ros.header(scan.stamp_ns, f"{self.names.laser_frame}{suffix}"),
            scan.angle_min,
            scan.angle_min + span,
            scan.angle_increment,
            scan.timing.increment,
            0.0,  # between scans: not known
            scan.range_min,
            scan.range_max,
            np.ascontiguousarray(scan.ranges, dtype=np.float32),
            np.empty(0, dtype=np.float32),
        )
        topic = f"{self.names.scan_topic}{suffix if self.names.topic_per_mount else ''}"
        self.message(topic, ros.LASER_SCAN, laser_scan, scan.stamp_ns)

    def _write_mount(self, mount: Mount, stamp_ns: int) -> None:
        suffix = self._suffixes[mount] = f"_{len(self._suffixes) + 1}" if self._suffixes else ""
        self._write_transform(mount, stamp_ns, f"{self.names.laser_frame}{suffix}")

    def _write_reading(self, reading: RangeReading) -> None:
        """A reading of a range sensor, on the topic that it came from, or one of its name."""
        name = reading.sensor
        topic = name if name.startswith("/") else f"/range/{name}"
        frame = f"{topic.strip('/').replace('/', '_')}_link"
        if topic not in self._sensors:
            self._sensors.add(topic)
            self._write_transform(reading.mount, reading.stamp_ns, frame)
        message = ros.build(
            ros.RANGE, ros.header(reading.stamp_ns, frame), 0, reading.field_of_view,
            reading.range_min, reading.range_max, float(reading.ranges[0]),
        )  # fmt: skip
        self.message(topic, ros.RANGE, message, reading.stamp_ns)

    def _write_transform(self, mount: Mount, stamp_ns: int, frame: str) -> None:
        transform = ros.transform_stamped(
            stamp_ns, self.names.base_frame, frame, mount.pose, flipped=mount.flipped
        )
        tree = ros.build(ros.TF_MESSAGE, [transform])
        self.message("/tf_static", ros.TF_MESSAGE, tree, stamp_ns, latched=True)

    def _write_odometry(self, odometry: Odometry) -> None:
        stamp, pose = odometry.stamp_ns, odometry.pose
        unknown = np.zeros(36)
        zero = ros.build("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        message = ros.build(
            ros.ODOMETRY,
            ros.header(stamp, self.names.odom_frame),
            self.names.base_frame,
            ros.build("geometry_msgs/msg/PoseWithCovariance", ros.pose_message(pose), unknown),
            ros.build(
                "geometry_msgs/msg/TwistWithCovariance",
                ros.build("geometry_msgs/msg/Twist", zero, zero),
                unknown,
            ),
        )
        self.message(self.names.odom_topic, ros.ODOMETRY, message, stamp)
        transform = ros.transform_stamped(stamp, self.names.odom_frame, self.names.base_frame, pose)
        self.message("/tf", ros.TF_MESSAGE, ros.build(ros.TF_MESSAGE, [transform]), stamp)

    def _write_truth(self, truth: TruePose) -> None:
        message = ros.build(
            ros.POSE_STAMPED,
            ros.header(truth.stamp_ns, self.names.map_frame),
            ros.pose_message(truth.pose),
        )
        self.message(self.names.truth_topic, ros.POSE_STAMPED, message, truth.stamp_ns)


def save_log(
    records: Iterable[Record], path: str | Path, names: LogNames | None = None, *,
    no_clobber: bool = False,
) -> None:  # fmt: skip
    """Write records to an MCAP file with ROS 2 messages, which `mapcli.open_log` reads again.

    The file appears when it is complete. `-` is standard output.

    Raises:
        DataError: a stamp that does not fit into a ROS 2 time.
        OutputError: the file cannot be written, or exists and `no_clobber` is set.
    """
    with output_file(path, no_clobber=no_clobber) as file:
        write_log(records, file, names)


def write_log(records: Iterable[Record], file: BinaryIO, names: LogNames | None = None) -> None:
    """Write records as MCAP into an open file, see `save_log`."""
    with McapLogWriter(file, names) as writer:
        for record in records:
            writer.write(record)
