"""CARMEN logs and GMapping's, plain or packed (see `carmen_messages` for the grammar), as records.

What the format leaves open is decided as follows:

- FLASER tells no maximum range: readings of 80 m and more are no return (SICK's error codes in
  centimetres start at 8183), and those from what PARAM tells on, and whatever else `no_return`
  finds out. ROBOTLASER1 tells the maximum; readings that reach it are no return.
- A scan's own odometry is yielded right before it with the same stamp, besides the ODOM lines.
- The laser's pose on the robot follows from the two poses of each scan, if they differ by the same
  offset in the first 50 scans; logs whose first pose was corrected afterwards do not. Where the two
  are the same, or do not agree, PARAM tells it.
- Stamps that do not tell the time give way to the times of logging, or to the order of the lines
  (`clock_faults`); the odometry is that of the scans then, which nothing is ahead of or behind.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from heapq import merge

from mapcli.errors import DataError, FormatError
from mapcli.formats.logs.blocks import read_lines
from mapcli.formats.logs.carmen_lines import is_known, message_name, scans_in
from mapcli.formats.logs.carmen_messages import PARSERS, LaserMessage, Stamping
from mapcli.formats.logs.carmen_survey import CarmenSurvey
from mapcli.formats.logs.carmen_times import CarmenTimes
from mapcli.formats.logs.log import Log, Source
from mapcli.formats.logs.missed_scans import with_stamps
from mapcli.formats.logs.mounts import describe_mount
from mapcli.formats.logs.one_recording import Spans
from mapcli.formats.logs.rep117 import rep117, single
from mapcli.formats.logs.units import count_units, in_metres_and_radians
from mapcli.model.clock import Clock
from mapcli.model.log import Damage, Entry, LogOptions, MissedScans, Role, Topic
from mapcli.model.scan import Mount, Odometry, RangeScan

SICK_NO_RETURN_M = 80.0
OTHER_LASER_SHARE = 0.5
"""So many messages of an unknown name for each scan are no damaged scans, but another laser's."""

LASERS = ("FLASER", "ROBOTLASER1"), ("LASER_READING",), ("RLASER",)
"""Messages of scans that are read unless others are named: the first of these that there are, or
else whatever others."""

WITH_ODOMETRY = {name for name in PARSERS if not name.startswith("RAWLASER")}
"""Messages that tell the robot's odometry."""


class CarmenLog(Log):
    """A CARMEN log, read in two passes: a survey when it is opened, then the records.

    Raises:
        FormatError: not one valid message.
    """

    scans_are = "FLASER, ROBOTLASER1 or RAWLASER1 lines"

    def __init__(self, sources: Sequence[Source], options: LogOptions) -> None:
        super().__init__(sources, options)
        self._survey = CarmenSurvey()
        for source in self.sources:
            self._look_over(source)
        if not any(self._survey.stamps):
            raise FormatError(
                "holds no valid message",
                file=self.sources[0].name,
                expected="ODOM, FLASER or ROBOTLASER1 lines",
            )
        self._lasers = lasers_of(self._survey.counts, bool(options.scan_topics))
        scans = next((name for name in options.scan_topics if name in self._lasers), None)
        self._times = CarmenTimes(self._survey, scans or next(iter(self._lasers), ""), options)

    def _look_over(self, source: Source) -> None:
        survey = self._survey
        survey.stamps.append({})
        for number, name, line in self._lines(source, Damage()):
            if name is None:
                continue
            survey.counts[name] = survey.counts.get(name, 0) + 1
            if name == "PARAM":
                survey.add_parameter(line)
            if name not in PARSERS:
                continue
            if survey.wants(name):
                message = self._parse(name, line, Stamping("order"))
                if message is None:
                    continue
                survey.add(name, message)
            survey.add_stamps(name, number, line)

    def _clock(self) -> Clock:
        return replace(self._times.clock)

    def _part_spans(self) -> list[Spans]:
        wanted = self._wanted()
        return [
            {name: spans[name] for name in spans if name in wanted} for spans in self._times.spans()
        ]

    def topics(self) -> list[Topic]:
        spans = self._times.spans()
        return [
            Topic(name, self._role(name), "CARMEN", "carmen", count, *joined(spans, name))
            for name, count in sorted(self._survey.counts.items())
        ]

    def _role(self, name: str) -> Role:
        return "odometry" if name == "ODOM" else "scan" if name in self._lasers else "other"

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
        if own is None or own.name not in WITH_ODOMETRY:
            return super().find_odom_topic()
        by_order = self._times.clock.source == "order" and self.options.odom_topic is None
        if by_order or self.options.odom_topic == own.name:
            return own
        return super().find_odom_topic() or own

    def _records(self) -> Iterator[Entry]:
        scan_name = self.require_scan_topics()[0].name
        mount, limit = self._mount(scan_name), self._survey.max_range(scan_name)
        if self._times.unit:
            self.note(f"stamps are taken as {self._times.unit}")
        parts = [
            (
                (record, number)
                for record in with_stamps(self._part(number, scan_name, mount, limit))
            )
            for number in range(len(self.sources))
        ]
        for record, part in merge(*parts, key=lambda item: item[0].stamp_ns):
            self.part = part
            yield record

    def _wanted(self) -> set[str]:
        """The names of the messages that are read."""
        odometry = self.find_odom_topic()
        scan_name = self.require_scan_topics()[0].name
        return {scan_name, *([odometry.name] if odometry else [])}

    def _part(self, part: int, scan_name: str, mount: Mount, limit: float) -> Iterator[Entry]:
        source, own_odometry = self.sources[part], self.options.odom_topic in (None, scan_name)
        for number, message in self._messages(part, self._wanted()):
            self.clock.steps = self._times.times_set(part, number)
            if not isinstance(message, LaserMessage):
                yield message
                continue
            if own_odometry and message.robot is not None:
                yield Odometry(message.stamp_ns, message.robot)
            if len(message.ranges):
                yield self._scan(message, mount, message.max_range or limit)
            else:
                what, where = "scans without beams, skipped", f"line {number}"
                yield self._missed_scan(what, source.name, where, stamp_ns=message.stamp_ns)

    def _scan(self, message: LaserMessage, mount: Mount, declared: float) -> RangeScan:
        count_units(message.ranges, message.angle_increment, self.units)
        limit = single(_no_return(declared))
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
        self, part: int, wanted: set[str]
    ) -> Iterator[tuple[int, LaserMessage | Odometry | MissedScans]]:
        """(line, message) of the messages wanted; those that were hit are counted."""
        scan_name, source = self.require_scan_topics()[0].name, self.sources[part]
        times, stamping = self._times, self._times.stamping
        for number, name, line in self._lines(source, self.damage):
            if name in wanted:
                message = self._parse(name, line, stamping)
                if message is not None:
                    stamp = times.time(part, number, message.stamp_ns)
                    is_same = stamp == message.stamp_ns
                    yield number, message if is_same else _at(message, stamp)
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
        if scan_name.encode() in line[len(name) :]:
            return True
        counts = self._survey.counts
        often = counts.get(name, 0) >= OTHER_LASER_SHARE * counts.get(scan_name, 0)
        return not (often or is_known(name))

    def _parse(self, name: str, line: bytes, stamping: Stamping) -> LaserMessage | Odometry | None:
        """The message on a line; None where it is malformed."""
        try:
            message = PARSERS[name](line.split(), stamping)
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
                "(a corrected log?); mount unknown, assumed at the robot's centre"
            )
            self.unknown_mounts.add(scan_name)
        elif mount != Mount():
            self.note(describe_mount(scan_name, mount))
        return mount or Mount()


def lasers_of(counts: Mapping[str, int], by_name: bool) -> list[str]:
    """The messages of a log that scans may be read from; all if they are named."""
    there = [name for name in PARSERS if name in counts and name != "ODOM"]
    usual = ([name for name in group if name in there] for group in LASERS)
    return there if by_name else next(filter(None, usual), there)


def joined(parts: Sequence[Spans], name: str) -> tuple[int, int]:
    """The span of a message in all files together; (0, 0) where it is not known."""
    spans = [spans[name] for spans in parts if name in spans]
    if not spans:
        return 0, 0
    return min(first for first, _ in spans), max(last for _, last in spans)


def _at(message: LaserMessage | Odometry, stamp_ns: int) -> LaserMessage | Odometry:
    """The message at another time."""
    if isinstance(message, LaserMessage):
        return message._replace(stamp_ns=stamp_ns)
    return replace(message, stamp_ns=stamp_ns)


def _no_return(declared: float) -> float:
    """The reading from which a beam counts as no return, metres; `declared` is the laser's maximum
    as the message has it, 0 where it does not."""
    sick = not declared > 0 or SICK_NO_RETURN_M <= declared < SICK_NO_RETURN_M + 2
    return SICK_NO_RETURN_M if sick else declared
