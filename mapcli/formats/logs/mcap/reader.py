"""Logs of messages, ROS 2 in CDR or in JSON of the same shape, or ROS 1, as records."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from heapq import merge
from itertools import islice
from operator import itemgetter
from typing import Any

from mapcli.errors import DataError
from mapcli.formats.logs.log import Log, Source
from mapcli.formats.logs.losses import LOST_SCANS
from mapcli.formats.logs.mcap.frames import zstd_start
from mapcli.formats.logs.mcap.range_topics import RangeTopics
from mapcli.formats.logs.message_file import MessageFile, Stream
from mapcli.formats.logs.mounts import describe_mount
from mapcli.formats.logs.one_recording import Spans
from mapcli.formats.logs.ros import decode, decode_ros1
from mapcli.formats.logs.ros.decode import LaserScan, Transform
from mapcli.formats.logs.ros.laser_scan import range_scan
from mapcli.formats.logs.ros.robot import Robot, TfOdometry, find_robot
from mapcli.formats.logs.units import count_units, in_metres_and_radians
from mapcli.model.log import Damage, Delay, Entry, LogOptions, MissedScans, Role, Topic
from mapcli.model.scan import LATEST_STAMP_S, NANOSECONDS, Mount, Odometry, RangeScan

MAX_MESSAGE_BYTES = 1 << 28
"""Of an unpacked message; a cloud of a million points has a tenth of it."""

ROLES: dict[str, Role] = {
    "LaserScan": "scan",
    "Range": "range",
    "Odometry": "odometry",
    "TFMessage": "tf",
    "tfMessage": "tf",
}
"""Last part of a message type's name -> role of its topic."""

JSON_KEYS: dict[str, Role] = {
    "angle_min": "scan",
    "radiation_type": "range",
    "child_frame_id": "odometry",
    "transforms": "tf",
}
"""Key by which a JSON message without a schema is recognised -> role of its topic."""

DECODERS: dict[tuple[Role, str], Callable[[Any], Any]] = {
    ("scan", "cdr"): decode.scan_from_cdr,
    ("range", "cdr"): decode.range_from_cdr,
    ("range", "json"): decode.range_from_json,
    ("odometry", "cdr"): decode.odometry_from_cdr,
    ("tf", "cdr"): decode.transforms_from_cdr,
    ("tf_static", "cdr"): decode.transforms_from_cdr,
    ("scan", "json"): decode.scan_from_json,
    ("odometry", "json"): decode.odometry_from_json,
    ("tf", "json"): decode.transforms_from_json,
    ("tf_static", "json"): decode.transforms_from_json,
    ("scan", "ros1"): decode_ros1.scan_from_ros1,
    ("range", "ros1"): decode_ros1.range_from_ros1,
    ("odometry", "ros1"): decode_ros1.odometry_from_ros1,
    ("tf", "ros1"): decode_ros1.transforms_from_ros1,
    ("tf_static", "ros1"): decode_ros1.transforms_from_ros1,
}

SCANS: tuple[Role, ...] = "scan", "range"
"""Roles of topics whose messages are scans."""

Decoded = tuple[int, Topic, Any, int]
"""Log time, topic, message or missed scans, number of the file."""


class MessageLog(Log):
    """One recording in one or several files of messages.

    Raises:
        FormatError: damaged, and `strict` is set.
    """

    scans_are = "a topic of sensor_msgs/msg/LaserScan or Range"

    def __init__(
        self,
        sources: Sequence[Source],
        options: LogOptions,
        container: Callable[[Source, Damage], MessageFile],
    ) -> None:
        super().__init__(sources, options)
        self._structure: Damage = type(self.damage)()
        self._files = [container(source, self._structure) for source in sources]
        self._topics = topics_of(self._files)
        self._robot: Robot | None = None

    def topics(self) -> list[Topic]:
        return list(self._topics)

    def require_scan_topics(self) -> list[Topic]:
        foreign = [t for t in self._topics if t.role == "other" and role_of_type(t.type) in SCANS]
        if foreign and not any(topic.role in SCANS for topic in self._topics):
            raise DataError(
                f"{foreign[0].name} holds {foreign[0].type} in {foreign[0].encoding}",
                file=self.sources[0].name,
                expected=f"{self.scans_are} in cdr, json or ros1",
            )
        try:
            return super().require_scan_topics()
        except DataError as error:
            error.where = "; ".join(self._structure.lines()) or None
            raise

    def find_odom_topic(self) -> Topic | None:
        topic = super().find_odom_topic()
        if topic is not None and topic.role == "tf" and self.scan_topics:
            return topic if self._known_robot(topic).odom_frame else None
        return topic

    def _known_robot(self, odom: Topic | None) -> Robot:
        """The frames, read ahead of the records."""
        if self._robot is None:
            child = self._first(odom, "child") if odom and odom.role == "odometry" else ""
            frame = self._first(self.require_scan_topics()[0], "frame")
            static, moving = self._transforms("tf_static"), self._transforms("tf")
            self._robot = find_robot(frame, child, static, moving)
        return self._robot

    def _first(self, topic: Topic, attribute: str) -> str:
        """A frame's name in the first message of the topic."""
        for _, _, message, _ in self._messages([topic], Damage()):
            if not isinstance(message, MissedScans):
                return str(getattr(message, attribute))
        return ""

    def _transforms(self, role: Role) -> Iterator[Transform]:
        topics = [topic for topic in self._topics if topic.role == role]
        for _, _, message, _ in self._messages(topics, Damage()):
            yield from message

    def _messages(self, topics: Sequence[Topic], damage: Damage) -> Iterator[Decoded]:
        """The messages of these topics, decoded, by log time over all files."""
        parts = [self._decoded(part, topics, damage) for part in range(len(self._files))]
        return merge(*parts, key=itemgetter(0)) if len(parts) > 1 else parts[0]

    def _decoded(self, part: int, topics: Sequence[Topic], damage: Damage) -> Iterator[Decoded]:
        file = self._files[part]
        carried = {
            number: (topic, DECODERS[topic.role, topic.encoding])
            for topic in topics
            for carrier, number in self._topics[topic]
            if carrier is file
        }
        scans = {number for number, (topic, _) in carried.items() if topic.role in SCANS}
        for log_time, number, data, lost in file.messages(set(carried), damage, scans):
            topic, decoder = carried[number]
            if lost:
                yield log_time, topic, MissedScans(LOST_SCANS, lost=True, count=lost), part
                continue
            try:
                yield log_time, topic, decoder(unpacked(data)), part
            except ValueError:
                where = f"at {log_time / NANOSECONDS:.3f} s"
                what = f"messages on {topic.name} without readable content"
                damage.add(what, file=file.source.name, where=where)
                if topic.role in SCANS:
                    yield log_time, topic, MissedScans(what, lost=True), part

    def _part_spans(self) -> list[Spans]:
        wanted = [*self.require_scan_topics(), *filter(None, [self.find_odom_topic()])]
        return [
            {
                topic.name: file.spans[number]
                for topic in wanted
                for carrier, number in self._topics[topic]
                if carrier is file and number in file.spans
            }
            for file in self._files
        ]

    def _records(self) -> Iterator[Entry]:
        for what, times in self._structure.counts.items():
            self.damage.add(what, times, where=self._structure.first.get(what))
        if not all(file.complete for file in self._files):
            self.note("how many scans the damaged log held is not known")
        odom = self.find_odom_topic()
        wanted = [*self.require_scan_topics(), *filter(None, [odom])]
        self.delays = {topic.name: Delay() for topic in wanted}
        robot = self._known_robot(odom)
        transforms = TfOdometry(robot) if odom and odom.role == "tf" else None
        mounts: dict[str, Mount] = {}
        sensors = RangeTopics(self, robot)
        for log_time, topic, message, part in self._messages(wanted, self.damage):
            self.part = part
            if isinstance(message, MissedScans):
                yield message
                continue
            if transforms is not None and topic is odom:
                message = transforms.follow(message)
                if message is None:
                    continue
            stamp = self._stamp(message.stamp_ns, log_time, topic)
            if not 0 <= stamp < LATEST_STAMP_S * NANOSECONDS:
                missed = self._impossible(stamp, topic)
                if topic.role in SCANS:
                    yield missed
                continue
            self.delays[topic.name].add(log_time - stamp)
            if topic.role not in SCANS:
                yield Odometry(stamp, message.pose)
                continue
            if topic.role == "range":
                reading = sensors.reading(message, stamp, topic)
                if reading is not None:
                    yield reading
                continue
            if message.frame not in mounts:
                mounts[message.frame] = self._mount(robot, message.frame, topic)
            yield self._scan(message, stamp, mounts[message.frame], topic)

    def _stamp(self, stamp_ns: int, log_time_ns: int, topic: Topic) -> int:
        """The stamp to use, nanoseconds, by `options.time_source`; it may be impossible."""
        if self.options.time_source == "log":
            return log_time_ns
        if stamp_ns == 0 and log_time_ns:
            self.note(f"{topic.name}: stamps of 0, the time of recording is used")
        return stamp_ns or log_time_ns

    def _impossible(self, stamp_ns: int, topic: Topic) -> MissedScans:
        what = f"messages on {topic.name} with an impossible stamp, dropped"
        where = f"at {stamp_ns / NANOSECONDS:g} s"
        return self._missed_scan(what, self.sources[0].name, where)

    def _mount(self, robot: Robot, frame: str, topic: Topic) -> Mount:
        if self.laser_pose is not None:
            return self.laser_pose
        try:
            mount, remark = robot.mount(frame)
        except DataError as error:
            raise DataError(
                error.problem, file=self.sources[0].name, where=topic.name, expected=error.expected
            ) from error
        if remark is not None:
            self.note(f"laser {topic.name}: {remark}")
        if mount != Mount():
            self.note(describe_mount(topic.name, mount))
        return mount

    def _scan(
        self, message: LaserScan, stamp: int, mount: Mount, topic: Topic
    ) -> RangeScan | MissedScans:
        message = in_metres_and_radians(message, self.options)
        count_units(message.ranges, message.angle_increment, self.units)
        record = range_scan(
            message, stamp, mount, self.beams, lambda text: self.note(f"{topic.name}: {text}")
        )
        if record is not None:
            return record
        what = f"scans without {'angles' if len(message.ranges) else 'beams'}, skipped"
        where = f"at {stamp / NANOSECONDS:.3f} s"
        return self._missed_scan(what, self.sources[0].name, where, stamp_ns=stamp)


def topics_of(files: Sequence[MessageFile]) -> dict[Topic, list[tuple[MessageFile, int]]]:
    """The topics of all files by name, with the streams that carry them."""
    carriers: dict[tuple[str, str, str, Role], list[tuple[MessageFile, int]]] = {}
    for file in files:
        for number, stream in file.streams.items():
            role = role_of_stream(file, number, stream)
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


ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""How a message begins that rosbag2 has packed (`--compression-mode message`); CDR begins with
two bytes of which the first is 0."""


def unpacked(data: memoryview) -> memoryview | bytes:
    """A message, unpacked if it was packed by itself.

    Raises:
        ValueError: it is broken.
    """
    if data[:4] != ZSTD_MAGIC:
        return data
    content = zstd_start(bytes(data), MAX_MESSAGE_BYTES)
    if not content:
        raise ValueError("a packed message that is broken")
    return content


def role_of_stream(file: MessageFile, number: int, stream: Stream) -> Role:
    """The role of a stream; `other` if its encoding cannot be decoded."""
    role = role_of_type(stream.type)
    if not stream.type and stream.encoding == "json":
        role = _role_of_json(file, number)
    if role == "tf" and stream.topic.endswith("tf_static"):
        role = "tf_static"
    readable = (role, stream.encoding) in DECODERS and "foxglove" not in stream.type
    return role if readable else "other"


def role_of_type(type_name: str) -> Role:
    """By the last part."""
    return ROLES.get(kind_of_type(type_name), "other")


def kind_of_type(type_name: str) -> str:
    """The last part: of `sensor_msgs/msg/LaserScan`, `sensor_msgs::msg::dds_::LaserScan_`."""
    return re.split(r"[/:.]+", type_name)[-1].rstrip("_")


def _role_of_json(file: MessageFile, number: int) -> Role:
    """By the keys of the stream's first message."""
    for message in islice(file.messages({number}, Damage()), 1):
        try:
            keys = json.loads(bytes(message.data)).keys()
        except (ValueError, AttributeError, RecursionError):
            break
        return next((role for key, role in JSON_KEYS.items() if key in keys), "other")
    return "other"
