"""CARMEN logs, plain or gzip (see `carmen_lines` for the grammar), as records.

What the format leaves open is decided as follows:

- FLASER tells no maximum range: readings of 80 m and more are no return (SICK's error codes in
  centimetres start at 8183), and whatever else `no_return` finds out.
  ROBOTLASER1 tells the maximum; readings that reach it are no return.
- A scan's own odometry is yielded right before it with the same stamp, besides the ODOM lines.
- The laser's pose on the robot follows from the two poses of each scan, if they differ by the same
  offset in the first 50 scans; logs whose first pose was corrected afterwards do not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from heapq import merge

from mapcli.errors import DataError, FormatError
from mapcli.formats.logs.blocks import read_lines
from mapcli.formats.logs.carmen_lines import (
    PARSERS,
    LaserMessage,
    is_known,
    message_name,
    scans_in,
)
from mapcli.formats.logs.log import Log, Source
from mapcli.formats.logs.missed_scans import with_stamps
from mapcli.formats.logs.mounts import describe_mount
from mapcli.formats.logs.one_recording import Spans
from mapcli.formats.logs.rep117 import rep117, single
from mapcli.formats.logs.units import count_units, in_metres_and_radians
from mapcli.model.log import Damage, Entry, LogOptions, MissedScans, Topic
from mapcli.model.pose import Pose2D, rounded_angle, wrap_angle
from mapcli.model.scan import Mount, Odometry, RangeScan

SICK_NO_RETURN_M = 80.0
OTHER_LASER_SHARE = 0.5
"""So many messages of an unknown name for each scan are no damaged scans, but another laser's."""
MOUNT_SCANS = 50
MOUNT_TOLERANCE_M, MOUNT_TOLERANCE_RAD = 0.002, math.radians(0.1)


class _Survey:
    """The first pass over a log: counts of messages, and mounts of the first scans.

    Attributes:
        counts: messages by name, whether they are well formed or not.
        offsets: name of a laser message -> its laser's pose on the robot in the first scans.
    """

    def __init__(self) -> None:
        self.counts: dict[str, int] = {}
        self.offsets: dict[str, list[Pose2D]] = {}
        self._looked_at: dict[str, int] = {}

    def wants(self, name: str) -> bool:
        """Whether the next message of this name is to be parsed."""
        return self._looked_at.get(name, 0) <= MOUNT_SCANS

    def add(self, name: str, message: LaserMessage | Odometry) -> None:
        self._looked_at[name] = self._looked_at.get(name, 0) + 1
        if isinstance(message, LaserMessage):
            offset = message.robot.between(message.laser)
            self.offsets.setdefault(name, []).append(offset)

    def mount(self, name: str) -> Mount | None:
        """The laser's pose on the robot; None if the first scans do not agree about it."""
        first, *others = self.offsets.get(name) or [Pose2D()]
        for other in others:
            turn = abs(wrap_angle(other.theta - first.theta))
            if first.distance(other) > MOUNT_TOLERANCE_M or turn > MOUNT_TOLERANCE_RAD:
                return None
        # The log's six decimals carry no more than this.
        x, y, theta = (round(value, 4) + 0.0 for value in (first.x, first.y, first.theta))
        return Mount(Pose2D(x, y, rounded_angle(theta)))


class CarmenLog(Log):
    """A CARMEN log, read in two passes: a survey when it is opened, then the records.

    Raises:
        FormatError: not one valid message.
    """

    scans_are = "FLASER or ROBOTLASER1 lines"

    def __init__(self, sources: Sequence[Source], options: LogOptions) -> None:
        super().__init__(sources, options)
        self._survey = _Survey()
        self._spans = [self._look_over(source) for source in self.sources]
        if not any(self._spans):
            raise FormatError(
                "holds no valid message",
                file=self.sources[0].name,
                expected="ODOM, FLASER or ROBOTLASER1 lines",
            )

    def _look_over(self, source: Source) -> dict[str, tuple[int, int]]:
        """Survey one file; name -> the stamps of its first and its last message."""
        survey, last = self._survey, dict[str, bytes]()
        spans: dict[str, tuple[int, int]] = {}
        for _, name, line in self._lines(source, Damage()):
            if name is None:
                continue
            survey.counts[name] = survey.counts.get(name, 0) + 1
            if name in PARSERS:
                last[name] = line
                if survey.wants(name) or name not in spans:
                    self._look_at(name, line, spans, survey.add if survey.wants(name) else None)
        for name, line in last.items():
            self._look_at(name, line, spans)
        return spans

    def _look_at(
        self,
        name: str,
        line: bytes,
        spans: dict[str, tuple[int, int]],
        add: Callable[[str, LaserMessage | Odometry], None] | None = None,
    ) -> None:
        message = self._parse(name, line)
        if message is not None:
            first, last = spans.get(name, (message.stamp_ns, message.stamp_ns))
            spans[name] = min(first, message.stamp_ns), max(last, message.stamp_ns)
            if add is not None:
                add(name, message)

    def _span(self, name: str) -> tuple[int, int]:
        """Of all files together; (0, 0) where it is not known."""
        spans = [spans[name] for spans in self._spans if name in spans]
        if not spans:
            return 0, 0
        return min(first for first, _ in spans), max(last for _, last in spans)

    def _part_spans(self) -> list[Spans]:
        wanted = self._wanted()
        return [{name: spans[name] for name in spans if name in wanted} for spans in self._spans]

    def topics(self) -> list[Topic]:
        return [
            Topic(
                name,
                "odometry" if name == "ODOM" else "scan" if name in PARSERS else "other",
                "CARMEN",
                "carmen",
                count,
                *self._span(name),
            )
            for name, count in sorted(self._survey.counts.items())
        ]

    @property
    def record_count(self) -> int | None:
        return (super().record_count or 0) + (self.scan_count or 0)

    def require_scan_topics(self) -> list[Topic]:
        """The message that holds the scans: one, since a CARMEN log does not tell where other
        lasers sit.

        Raises:
            DataError: as of every log; several.
        """
        topics = super().require_scan_topics()
        if len(topics) > 1:
            raise DataError(
                f"{len(topics)} lasers in a CARMEN log, which does not tell where they sit",
                file=self.sources[0].name,
                expected="one --scan-topic",
            )
        return topics

    def find_odom_topic(self) -> Topic | None:
        """ODOM, or the scans themselves, which carry their odometry."""
        own = next((topic for topic in self.topics() if topic.name in self.scan_topics), None)
        if own is not None and self.options.odom_topic == own.name:
            return own
        return super().find_odom_topic() or own

    def _records(self) -> Iterator[Entry]:
        scan_name = self.require_scan_topics()[0].name
        own_odometry = self.options.odom_topic in (None, scan_name)
        mount = self._mount(scan_name)
        parts = [
            ((record, number) for record in with_stamps(self._part(source, own_odometry, mount)))
            for number, source in enumerate(self.sources)
        ]
        for record, part in merge(*parts, key=lambda item: item[0].stamp_ns):
            self.part = part
            yield record

    def _wanted(self) -> set[str]:
        """The names of the messages that are read."""
        scan_name = self.require_scan_topics()[0].name
        return {scan_name, "ODOM"} if self.options.odom_topic != scan_name else {scan_name}

    def _part(self, source: Source, own_odometry: bool, mount: Mount) -> Iterator[Entry]:
        for number, message in self._messages(source, self._wanted()):
            if not isinstance(message, LaserMessage):
                yield message
                continue
            if own_odometry:
                yield Odometry(message.stamp_ns, message.robot)
            if len(message.ranges):
                yield self._scan(message, mount)
            else:
                what, where = "scans without beams, skipped", f"line {number}"
                yield self._missed_scan(what, source.name, where, stamp_ns=message.stamp_ns)

    def _scan(self, message: LaserMessage, mount: Mount) -> RangeScan:
        count_units(message.ranges, message.angle_increment, self.units)
        limit = single(_no_return(message.max_range))
        return RangeScan(
            message.stamp_ns,
            single(message.angle_min),
            single(message.angle_increment),
            rep117(message.ranges, 0.0, limit, self.beams),
            0.0,
            limit,
            mount,
        )

    def _messages(
        self, source: Source, wanted: set[str]
    ) -> Iterator[tuple[int, LaserMessage | Odometry | MissedScans]]:
        """(line, message) of the messages wanted; those that were hit are counted."""
        scan_name = self.require_scan_topics()[0].name
        for number, name, line in self._lines(source, self.damage):
            if name in wanted:
                message = self._parse(name, line)
                if message is not None:
                    yield number, message
                    continue
            elif name is not None and not self._may_be_hit(name, line, scan_name):
                continue
            lost = scans_in(line, scan_name)
            if lost or name in wanted:
                what = f"lines without a valid {scan_name if lost else name} message"
            elif name is None:
                what = "lines of nonsense, skipped"
            else:
                continue
            self.damage.add(what, file=source.name, where=f"line {number}")
            if lost:
                yield number, MissedScans(what, lost=True, count=lost)

    def _may_be_hit(self, name: str, line: bytes, scan_name: str) -> bool:
        """Whether a line of another message may hold a scan: after it, or under its name."""
        if scan_name.encode() in line:
            return True
        counts = self._survey.counts
        often = counts.get(name, 0) >= OTHER_LASER_SHARE * counts.get(scan_name, 0)
        return not (often or is_known(name))

    def _parse(self, name: str, line: bytes) -> LaserMessage | Odometry | None:
        """The message on a line; None where it is malformed."""
        try:
            message = PARSERS[name](line.split(), self.options.time_source == "log")
            if isinstance(message, LaserMessage):
                return in_metres_and_radians(message, self.options)
            return message
        except (ValueError, IndexError, ArithmeticError):
            return None

    @staticmethod
    def _lines(source: Source, damage: Damage) -> Iterator[tuple[int, str | None, bytes]]:
        """(number, name, line) of the lines with content; no name where none starts a line."""
        for number, line in read_lines(source, damage):
            name = message_name(line)
            if name is not None or (line.strip() and not line.lstrip().startswith(b"#")):
                yield number, name, line

    def _mount(self, scan_name: str) -> Mount:
        if self.laser_pose is not None:
            return self.laser_pose
        mount = self._survey.mount(scan_name)
        if mount is None:
            self.note(
                f"{scan_name}: the laser's and the robot's poses differ by no constant offset "
                "(a corrected log?); laser assumed at the robot's centre"
            )
        elif mount != Mount():
            self.note(describe_mount(scan_name, mount))
        return mount or Mount()


def _no_return(declared: float) -> float:
    """The reading from which a beam counts as no return, metres; `declared` is the laser's maximum
    as the message has it, 0 where it does not."""
    sick = not declared > 0 or SICK_NO_RETURN_M <= declared < SICK_NO_RETURN_M + 2
    return SICK_NO_RETURN_M if sick else declared
