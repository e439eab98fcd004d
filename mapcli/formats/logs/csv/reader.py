"""CSV logs of educational robots as records: odometry and readings of range sensors."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from heapq import merge
from pathlib import Path

from mapcli.errors import DataError
from mapcli.formats.input import read_file
from mapcli.formats.logs.clock_faults import LineStamps, choose_clock, unit_of
from mapcli.formats.logs.csv.rows import Row, read_rows
from mapcli.formats.logs.csv.sensors_file import SensorsFile, read_sensors_file, sensors_file_of
from mapcli.formats.logs.line_clock import LineClock, line_clock
from mapcli.formats.logs.log import Log, Source
from mapcli.formats.logs.one_recording import Spans
from mapcli.model.clock import Clock
from mapcli.model.log import Damage, Entry, LogOptions, Topic
from mapcli.model.scan import NANOSECONDS, Mount, Odometry

ODOMETRY = "x,y,theta"
"""The name of the columns with the odometry."""


@dataclass
class _Survey:
    """What a file's rows tell before they are read (mutable).

    Attributes:
        count: rows; first, last: line and stamp, nanoseconds.
        moves: the stamps of the rows at which the robot is somewhere else than at the one before.
    """

    count: int = 0
    first: tuple[int, int] | None = None
    last: tuple[int, int] | None = None
    moves: LineStamps = field(default_factory=LineStamps)

    @cached_property
    def why(self) -> str:
        """What is wrong with the stamps; empty if nothing is."""
        return choose_clock(self.moves.scaled(1.0), None, "rows").why

    @cached_property
    def clock(self) -> LineClock | None:
        """Times by the order of the rows, if their stamps are too coarse to tell them."""
        rows = self.moves.scaled(1.0)
        return line_clock(rows.lines, rows.header) if self.why else None


class CsvLog(Log):
    """A CSV log, read in two passes: a survey when it is opened, then the records.

    Raises:
        FormatError: it, or the YAML about it, makes no sense.
    """

    scans_are = "a column of a range sensor"

    def __init__(self, sources: Sequence[Source], options: LogOptions) -> None:
        super().__init__(sources, options)
        self._told = [self._sensors_file(source) for source in self.sources]
        self._surveys = [self._survey(number) for number in range(len(self.sources))]

    def _sensors_file(self, source: Source) -> SensorsFile:
        given = self.options.sensors_file
        if given is None and source.name == "-":
            raise DataError(
                "nothing says where its sensors sit", file="-", expected="--sensors, a YAML file"
            )
        name = given or sensors_file_of(source.name)
        if given is None and not Path(name).exists():
            raise DataError(
                "nothing says where its sensors sit", file=source.name,
                expected=f"a file {name}, or --sensors",
            )  # fmt: skip
        return read_sensors_file(name)

    def _rows(self, number: int, damage: Damage) -> Iterator[Row]:
        return read_rows(self.sources[number], self._told[number], damage)

    def _survey(self, number: int) -> _Survey:
        survey, pose = _Survey(), None
        for row in self._rows(number, Damage()):
            survey.count += 1
            survey.last = row.line, row.stamp_ns
            survey.first = survey.first or survey.last
            if row.pose != pose:  # rows of one moment tell one sensor each, it may be
                pose, seconds = row.pose, row.stamp_ns / NANOSECONDS
                survey.moves.add(row.line, seconds, seconds)
        return survey

    def _time(self, number: int, line: int, stamp_ns: int) -> int:
        """When a row is from, nanoseconds."""
        clock = self._surveys[number].clock
        by_order = clock is not None and self.options.time_source == "auto"
        return clock.at(line) if clock is not None and by_order else stamp_ns

    def _clock(self) -> Clock:
        coarse = (one.why for one in self._surveys if one.clock is not None)
        why = next(coarse, "") if self.options.time_source == "auto" else ""
        return Clock("order", why) if why else super()._clock()

    def _span(self, number: int) -> tuple[int, int]:
        """The times of the first and the last row of a file."""
        survey = self._surveys[number]
        assert survey.first is not None
        assert survey.last is not None
        return self._time(number, *survey.first), self._time(number, *survey.last)

    def topics(self) -> list[Topic]:
        count = sum(survey.count for survey in self._surveys)
        found = [self._span(number) for number, one in enumerate(self._surveys) if one.count]
        first, last = (end(span[k] for span in found) if found else 0
                       for k, end in enumerate((min, max)))  # fmt: skip
        columns = dict.fromkeys(column for told in self._told for column in told.sensors)
        names = *((column, "range") for column in columns), (ODOMETRY, "odometry")
        return [
            Topic(
                name, "range" if role == "range" else "odometry", "CSV", "csv", count, first, last
            )
            for name, role in names
        ]

    def digests(self) -> dict[str, str]:
        """Those of the YAML files, too."""
        digests = super().digests()
        for told in self._told:
            data = read_file(Path(told.file))
            digests[Path(told.file).name] = hashlib.sha256(data).hexdigest()
        return digests

    def _part_spans(self) -> list[Spans]:
        wanted = *self.scan_topics, ODOMETRY
        return [
            dict.fromkeys(wanted, self._span(number)) if survey.count else {}
            for number, survey in enumerate(self._surveys)
        ]

    def _records(self) -> Iterator[Entry]:
        wanted = {topic.name for topic in self.require_scan_topics()}
        if any(unit_of(survey.moves) != 1 for survey in self._surveys):
            self.note("rows are far apart: is t in another unit than the YAML tells (units: time)?")
        parts = [self._timed_rows(number) for number in range(len(self.sources))]
        mounts = dict(self.options.sensors)
        for row, self.part in merge(*parts, key=lambda item: item[0].stamp_ns):
            yield Odometry(row.stamp_ns, row.pose)
            for column, value in row.readings.items():
                if column in wanted:
                    yield from self._reading(column, value, row.stamp_ns, mounts)

    def _timed_rows(self, number: int) -> Iterator[tuple[Row, int]]:
        for row in self._rows(number, self.damage):
            time = self._time(number, row.line, row.stamp_ns)
            yield row._replace(stamp_ns=time), number

    def _reading(
        self, column: str, value: float, stamp_ns: int, mounts: dict[str, Mount]
    ) -> Iterator[Entry]:
        sensor = self._told[self.part].sensors[column].sensor
        sensor = replace(sensor, mount=mounts.get(column, self.laser_pose or sensor.mount))
        counts = self.sensors.setdefault(column, sensor.counts())
        reading = sensor.reading(value, stamp_ns, self.beams, counts)
        if reading is not None:
            yield reading
