"""Logs of messages, ROS 2 in CDR or in JSON of the same shape, or ROS 1, as records."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence

from mapcli.errors import DataError
from mapcli.formats.logs.decoded_messages import Decoded, decoded
from mapcli.formats.logs.log import Log, Source
from mapcli.formats.logs.message_clock import MessageClocks
from mapcli.formats.logs.message_file import MessageFile
from mapcli.formats.logs.message_kinds import (
    kind_of_type,
)
from mapcli.formats.logs.mounts import describe_mount
from mapcli.formats.logs.one_recording import Spans
from mapcli.formats.logs.range_topics import RangeTopics
from mapcli.formats.logs.ros.decode import LaserScan, Transform
from mapcli.formats.logs.ros.laser_scan import range_scan
from mapcli.formats.logs.ros.point_cloud import Band, scan_of_cloud
from mapcli.formats.logs.ros.robot import Robot, TfOdometry, find_robot
from mapcli.formats.logs.ros.robots import Robots, namespace_of
from mapcli.formats.logs.ros.segments import TurnAssembler
from mapcli.formats.logs.stream_topics import topics_of
from mapcli.formats.logs.topics import SCANS, choose_odom_topic, considered_scan_topics
from mapcli.formats.logs.units import count_units, in_metres_and_radians
from mapcli.model.log import Damage, Entry, LogOptions, MissedScans, Role, Topic
from mapcli.model.scan import LATEST_STAMP_S, NANOSECONDS, Mount, Odometry, RangeScan

TRANSFORMS: tuple[Role, Role] = "tf_static", "tf"

Place = tuple[Topic, str, tuple[float, ...]]
"""Topic of scans, their frame, and where they say that they are in it."""


class MessageLog(Log):
    """One recording in one or several files of messages.

    Raises:
        FormatError: damaged, and `strict` is set.
    """

    scans_are = "a topic of sensor_msgs/msg/LaserScan, MultiEchoLaserScan, PointCloud2 or Range"

    def __init__(
        self,
        sources: Sequence[Source],
        options: LogOptions,
        container: Callable[[Source, Damage], MessageFile],
    ) -> None:
        super().__init__(sources, options)
        self._structure: Damage = type(self.damage)()
        self._files = [container(source, self._structure) for source in sources]
        named = {*options.scan_topics, *filter(None, [options.odom_topic])}
        self._topics = topics_of(self._files, named)
        self._robot: Robot | None = None
        self._robots = Robots([*self._topics], self._frame, self._transforms)

    def topics(self) -> list[Topic]:
        return list(self._topics)

    def require_scan_topics(self) -> list[Topic]:
        foreign = [t for t in self._topics if t.role == "other" and _would_be_scans(t)]
        if foreign and not any(topic.role in SCANS for topic in self._topics):
            raise DataError(
                f"{foreign[0].name} holds {foreign[0].type} in {foreign[0].encoding}",
                file=self.sources[0].name,
                expected=f"{self.scans_are} in cdr, json or ros1; Foxglove's in json or protobuf",
            )
        try:
            name, wanted = self.sources[0].name, self.options.scan_topics
            considered = considered_scan_topics(self.topics(), wanted, name)
            if len(considered) > 1:
                self._robots.refuse_several(considered, name)
            return super().require_scan_topics()
        except DataError as error:
            error.where = "; ".join(self._structure.lines()) or None
            raise

    def find_odom_topic(self) -> Topic | None:
        named, topics = self.options.odom_topic, self.topics()
        if named is None and self.scan_topics:
            topics = self._robots.own_odometry(self.require_scan_topics()[0])
        topic = choose_odom_topic(topics, named, self.sources[0].name)
        if topic is not None and topic.role == "tf" and self.scan_topics:
            robot = self._known_robot(topic)
            if robot.odom_frame is None:
                return None
            moving = [topic] if named else [one for one in topics if one.role == "tf"]
            return self._robots.carrying(robot.moving_child, moving)
        return topic

    def _known_robot(self, odom: Topic | None) -> Robot:
        """The frames, read ahead of the records."""
        if self._robot is None:
            scan = self.require_scan_topics()[0]
            child = self._frame(odom) if odom and odom.role != "tf" else ""
            static, moving = (self._robots.transform_topics(scan, role) for role in TRANSFORMS)
            named = bool(odom and odom.role == "tf" and self.options.odom_topic)
            if odom and named and odom not in moving:
                moving.append(odom)
            self._robot = find_robot(
                self._frame(scan), child, self._transforms(static), self._transforms(moving),
                namespace=namespace_of(scan.name), any_frame=named,
            )  # fmt: skip
        return self._robot

    def _frame(self, topic: Topic) -> str:
        """The frame in the first message of a topic; of odometry, the child."""
        attribute = "frame" if topic.role in SCANS else "child"
        for _, _, message, _, _ in self._messages([topic], Damage()):
            if not isinstance(message, MissedScans):
                return str(getattr(message, attribute))
        return ""

    def _transforms(self, topics: Sequence[Topic]) -> Iterator[Transform]:
        for _, _, message, _, _ in self._messages(topics, Damage()):
            yield from message

    def _messages(self, topics: Sequence[Topic], damage: Damage) -> Iterator[Decoded]:
        return decoded(self._files, {topic: self._topics[topic] for topic in topics}, damage)

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
        for topic, carriers in self._topics.items():
            told = {file.streams[number].type for file, number in carriers}
            if topic.role != "other" and told != {topic.type}:
                self.note(f"{topic.name}: read as {topic.type}, as its content shows")
        odom = self.find_odom_topic()
        wanted = [*self.require_scan_topics(), *filter(None, [odom])]
        clocks = MessageClocks(self.clock, self.options.time_source == "auto", wanted)
        self.delays = clocks.delays
        for other in self._robots.others_odometry(wanted[0]) if not self.options.odom_topic else ():
            self.note(f"{other.name} is not used: it seems to be another robot's odometry")
        robot = self._known_robot(odom)
        mounts: dict[Place, Mount] = {}
        turns = defaultdict[Topic, TurnAssembler](TurnAssembler)
        sensors = RangeTopics(self, robot)
        clocks.look_at(self._followed(wanted, robot, Damage()))
        for stamp, topic, message, part, doubtful in clocks.timed(
            self._followed(wanted, robot, self.damage)
        ):
            self.part, self.is_damaged = part, doubtful
            if isinstance(message, MissedScans):
                yield message
                continue
            if not 0 <= stamp < LATEST_STAMP_S * NANOSECONDS:
                missed = self._impossible(stamp, topic)
                if topic.role in SCANS:
                    yield missed
                continue
            if topic.role not in SCANS:
                yield Odometry(stamp, message.pose)
                continue
            if topic.role == "range":
                reading = sensors.reading(message, stamp, topic)
                if reading is not None:
                    yield reading
                continue
            place = topic, message.frame, message.origin
            if place not in mounts:
                if any(place[:2] == other[:2] for other in mounts):
                    raise DataError(
                        f"the scans' own pose in {message.frame!r} moves",
                        file=self.sources[0].name, where=topic.name,
                        expected="the pose of the laser on the robot",
                    )  # fmt: skip
                mounts[place] = self._mount(robot, place)
            if topic.role == "cloud":
                message = scan_of_cloud(message, Band(*self.options.cloud_height))
            if stamp != message.stamp_ns:
                message = message._replace(stamp_ns=stamp)
            for scan in turns[topic].add(message):
                yield self._scan(scan, mounts[topic, scan.frame, scan.origin], topic)
        for topic, assembler in turns.items():
            for scan in assembler.rest():
                yield self._scan(scan, mounts[topic, scan.frame, scan.origin], topic)
            if assembler.segments > 1:
                self.note(f"{topic.name}: {assembler.segments} messages make one turn")

    def _followed(self, wanted: Sequence[Topic], robot: Robot, damage: Damage) -> Iterator[Decoded]:
        """The messages; of transforms, the robot's poses by odometry that they make."""
        transforms = TfOdometry(robot) if any(topic.role == "tf" for topic in wanted) else None
        for log_time, topic, message, part, doubtful in self._messages(wanted, damage):
            if transforms is not None and topic.role == "tf":
                message = transforms.follow(message)
                if message is None:
                    continue
            yield log_time, topic, message, part, doubtful

    def _impossible(self, stamp_ns: int, topic: Topic) -> MissedScans:
        what = f"messages on {topic.name} with an impossible stamp, dropped"
        where = f"at {stamp_ns / NANOSECONDS:g} s"
        return self._missed_scan(what, self.sources[0].name, where)

    def _mount(self, robot: Robot, place: Place) -> Mount:
        topic, frame, origin = place
        if self.laser_pose is not None:
            return self.laser_pose
        try:
            name = robot.tree.named(frame, namespace_of(topic.name))
            mount, remark = robot.mount(name, origin)
        except DataError as error:
            raise DataError(
                error.problem, file=self.sources[0].name, where=topic.name, expected=error.expected
            ) from error
        if remark is not None:
            self.note(f"laser {topic.name}: {remark}")
        if mount is None:
            self._refuse_unknown_among_others(frame, topic)
            self.unknown_mounts.add(topic.name)
            return Mount()
        if mount != Mount():
            self.note(describe_mount(topic.name, mount))
        return mount

    def _refuse_unknown_among_others(self, frame: str, topic: Topic) -> None:
        """Several lasers cannot all be at the robot's centre."""
        if any(self._frame(one) != frame for one in self.require_scan_topics()):
            raise DataError(
                f"nothing tells where the laser {frame!r} sits", file=self.sources[0].name,
                where=topic.name, expected="transforms to each of several lasers, or one "
                "--scan-topic",
            )  # fmt: skip

    def _scan(self, message: LaserScan, mount: Mount, topic: Topic) -> RangeScan | MissedScans:
        stamp = message.stamp_ns
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


def _would_be_scans(topic: Topic) -> bool:
    """Whether a topic that is not read would be one of scans in another encoding."""
    kind = kind_of_type(topic.type)
    return kind is not None and kind.role in SCANS
