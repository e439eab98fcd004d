"""The base class of all log readers: choice of topics, order of stamps, damage, strictness."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mapcli.errors import DataError, FormatError
from mapcli.formats.logs.beam_times import with_beam_times
from mapcli.formats.logs.continuity import Continuity
from mapcli.formats.logs.missed_scans import with_stamps
from mapcli.formats.logs.mounts import rounded_mount
from mapcli.formats.logs.no_return import NoReturnFilter
from mapcli.formats.logs.odometry_track import Place
from mapcli.formats.logs.one_recording import Part, Spans, refuse_breaks, refuse_overlap
from mapcli.formats.logs.range_sensors import sensor_lines
from mapcli.formats.logs.recording_break import Break
from mapcli.formats.logs.stamp_order import InStampOrder, plural_of
from mapcli.formats.logs.topics import check_sensors, choose_odom_topic, choose_scan_topics
from mapcli.model.clock import Clock, Delay, ScansOutside
from mapcli.model.log import (
    BeamCounts,
    Damage,
    Entry,
    LogOptions,
    MissedScans,
    SensorCounts,
    StrictDamage,
    Topic,
    UnitCounts,
)
from mapcli.model.scan import RangeScan, Record
from mapcli.model.selection import select

REORDER_RECORDS = 2000
"""Records held back to put stamps in order: some 10 s of a usual robot, a few MB of scans."""


@dataclass(frozen=True)
class Source:
    """One input file.

    Attributes:
        name: what the user typed (`-` for standard input); goes into messages.
        path: where the bytes are (a temporary file for standard input).
        keeps: the temporary file, which is deleted with the last reference to it.
    """

    name: str
    path: Path
    keeps: object = None


class Log(ABC):
    """A recording, open for reading. Records stream: the log is never held in memory as a whole.

    Stateful: damage, notes and beams are filled while the records are read.

    Attributes:
        name: the first input's file name.
        damage: what was wrong, counted.
        notes: what the user should know about how the log is understood.
        beams: what became of the beams of the scans yielded so far; units: what these scans say
            about their units.
        sensors: range sensors with one beam, by name, and what they read so far.
        disordered: scans and odometry records that came after one of a later stamp.
        unknown_mounts: topics of scans of which nothing tells where their laser sits.
        delays: topic -> how much later than stamped its messages were recorded.
        clock: which times the records have.
        outside: scans, of those asked for, that odometry says nothing about.
        part: number of the file of the last record as recorded; is_damaged: there.
        scans_are: what scans look like in this format, for messages.
    """

    scans_are = "range scans"

    def __init__(self, sources: Sequence[Source], options: LogOptions) -> None:
        self.sources = tuple(sources)
        self.options = options
        self.name = Path(sources[0].name).name or sources[0].name
        self.damage: Damage = StrictDamage() if options.strict else Damage()
        self.notes: list[str] = []
        self.beams, self.units = BeamCounts(), UnitCounts()
        self.sensors: dict[str, SensorCounts] = {}
        self.disordered, self.unknown_mounts = 0, set[str]()
        self.delays: dict[str, Delay] = {}
        self.outside = ScansOutside()
        self.clock = Clock()
        self.part, self.is_damaged, self._start_ns = 0, False, 0
        self._continuity = Continuity()
        self.laser_pose = options.laser_pose and rounded_mount(options.laser_pose)

    @abstractmethod
    def topics(self) -> list[Topic]:
        """All topics, in order of first appearance or name."""

    @property
    def scan_topics(self) -> list[str]:
        """The topics that scans are read from; none when there is none or no obvious one."""
        try:
            return [topic.name for topic in self.require_scan_topics()]
        except (DataError, FormatError):
            return []

    @property
    def odom_topic(self) -> str | None:
        """The topic that odometry is read from; None when there is none or no obvious one."""
        try:
            topic = self.find_odom_topic()
        except DataError:
            return None
        return topic.name if topic else None

    @property
    def scan_count(self) -> int | None:
        """Scans on the chosen topics, as far as the log tells before it is read."""
        names = self.scan_topics
        counts = [topic.count for topic in self.topics() if topic.name in names]
        return sum(counts) if counts else None

    @property
    def record_count(self) -> int | None:
        """About how many records there will be, for a progress bar."""
        names = *self.scan_topics, self.odom_topic
        return sum(topic.count for topic in self.topics() if topic.name in names) or None

    def require_scan_topics(self) -> list[Topic]:
        """The topics of the scans, one for each laser.

        Raises:
            DataError: none, or several and no --scan-topic; several, and a --laser-pose, which
                tells of one; a --sensor that is none of them.
        """
        wanted, name = self.options.scan_topics, self.sources[0].name
        topics = choose_scan_topics(self.topics(), wanted, name, self.scans_are)
        check_sensors([sensor for sensor, _ in self.options.sensors], topics, name)
        if len(topics) > 1 and self.laser_pose is not None:
            raise DataError(
                f"{len(topics)} lasers, and one --laser-pose for them", file=name,
                expected="one --scan-topic, or mounts that the log tells",
            )  # fmt: skip
        return topics

    def find_odom_topic(self) -> Topic | None:
        """The topic of the odometry, or None.

        Raises:
            DataError: several and no --odom-topic, or it does not exist.
        """
        return choose_odom_topic(self.topics(), self.options.odom_topic, self.sources[0].name)

    def note(self, text: str) -> None:
        """Add to `notes`, once."""
        if text not in self.notes:
            self.notes.append(text)

    def digests(self) -> dict[str, str]:
        """File name -> SHA-256 of its bytes, hexadecimal, for every part in the order given."""
        digests: dict[str, str] = {}
        for number, source in enumerate(self.sources, start=1):
            name = Path(source.name).name or source.name
            with source.path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
            digests[f"{name} (part {number})" if name in digests else name] = digest
        return digests

    @property
    def breaks(self) -> Sequence[Break]:
        """Where another recording begins, as far as the log was read."""
        return self._continuity.breaks

    def records(
        self, start_s: float | None = None, end_s: float | None = None, every: int = 1
    ) -> Iterator[Record]:
        """Odometry and scans in the order of their stamps.

        Records of equal stamps keep the order of the log; a scan that carries its own odometry
        comes right after it. Ranges follow REP 117. May be called again to read once more.

        Args:
            start_s, end_s, every: the part asked for, see `model.selection.select`; `damage`
                accounts for its scans.

        Raises:
            DataError: no scan topic or no obvious one; recordings that are not one, unless
                `options.one_recording`.
            FormatError: nothing can be read, or the log is damaged and `strict` is set.
        """
        self._continuity = Continuity()
        records = self._accounted(select(self._all_records(), start_s, end_s, every))
        if self.options.one_recording:
            return records
        names = [source.name for source in self.sources]
        return refuse_breaks(records, self.breaks, names, lambda: self._start_ns)

    def _accounted(self, entries: Iterable[Entry]) -> Iterator[Record]:
        """The records of what was asked for; scans are counted, also those that are missed."""
        for entry in entries:
            if isinstance(entry, MissedScans):
                self.damage.miss(entry)
                continue
            if isinstance(entry, RangeScan):
                self.damage.scans_read += 1
            self.outside.add(entry)
            yield entry

    def _all_records(self) -> Iterator[Entry]:
        self.damage.clear()
        self.beams, self.units = BeamCounts(), UnitCounts()
        self.disordered, self.unknown_mounts, self.delays, self.sensors = 0, set(), {}, {}
        self.clock, self.outside = self._clock(), ScansOutside()
        self.require_scan_topics()
        if self.find_odom_topic() is None:
            self.note("no odometry: poses come from matching scans alone")
        if len(self.sources) > 1 and not self.options.one_recording:
            parts = zip(self.sources, self._part_spans(), strict=True)
            refuse_overlap([Part(source.name, source.path, spans) for source, spans in parts])
        scans, self._start_ns, codes = 0, -1, NoReturnFilter()
        watched = self._continuity.watched(
            with_stamps(self._records()),
            lambda: Place(self.part, self.clock.steps, self.is_damaged),
        )
        try:
            ordered = codes.records(self._in_stamp_order(watched), self.beams)
            for record in with_beam_times(ordered, self.options, self.note):
                if self._start_ns < 0 and not isinstance(record, MissedScans):
                    self._start_ns = record.stamp_ns
                scans += isinstance(record, RangeScan)
                yield record
        except OSError as error:
            raise FormatError(str(error.strerror or error).lower(), file=self.name) from error
        finally:
            for line in codes.lines():
                self.note(f"{', '.join(self.scan_topics)}: {line}")
            if self.clock.why:
                self.note(self.clock.note())
            for line in sensor_lines(self.sensors.values()):
                self.note(line)
        if not scans:
            reasons = f" ({'; '.join(self.damage.lines())})" if self.damage.counts else ""
            raise FormatError(f"not one scan can be read{reasons}", file=self.sources[0].name)

    def _clock(self) -> Clock:
        """Which times the records have, as far as that is known before they are read."""
        return Clock("log" if self.options.time_source == "log" else "header")

    @abstractmethod
    def _part_spans(self) -> list[Spans]:
        """For each file, when it was recorded: of the scans and the odometry that are read."""

    @abstractmethod
    def _records(self) -> Iterator[Entry]:
        """The records in the order of recording, roughly that of their stamps; sets `part`."""

    def _missed_scan(
        self, what: str, file: str, where: str, *, lost: bool = False, stamp_ns: int | None = None
    ) -> MissedScans:
        """A scan that cannot be used, after it was counted as damage."""
        self.damage.add(what, file=file, where=where)
        return MissedScans(what, lost, first_ns=stamp_ns, last_ns=stamp_ns)

    def _in_stamp_order(self, records: Iterable[Entry]) -> Iterator[Entry]:
        """The records sorted by stamp within a window of `REORDER_RECORDS`; equal ones stay.

        A record that comes later than that with a stamp before one already given out is dropped
        and counted: after a clock was set back, mapcli cannot know which of two moments is meant.
        A single stamp far in the future does no harm: its record is given out at the end.
        """
        waiting = InStampOrder()
        given, latest = -1, dict[type, int]()
        for record in records:
            stamp, kind = record.stamp_ns, type(record)
            if isinstance(record, MissedScans):
                if stamp < given:
                    yield record
                else:
                    waiting.add(record)
                continue
            if stamp < latest.get(kind, 0):
                self.disordered += 1
            else:
                latest[kind] = stamp
            if stamp < given:
                what = f"{plural_of(record)} with a stamp that jumps back, dropped"
                where = f"at {stamp * 1e-9:.3f} s"
                missed = self._missed_scan(what, self.sources[0].name, where, stamp_ns=stamp)
                if self.clock.source == "header":
                    self.note("a clock was set back; --time-source log uses times of recording")
                if isinstance(record, RangeScan):
                    yield missed
                continue
            waiting.add(record)
            if len(waiting) > REORDER_RECORDS:
                ready = waiting.popleft()
                given = ready.stamp_ns
                yield ready
        yield from waiting
