"""CSV logs of educational robots as records: odometry and readings of range sensors."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from heapq import merge
from pathlib import Path

from mapcli.errors import DataError
from mapcli.formats.input import read_file
from mapcli.formats.logs.csv.rows import Row, read_rows
from mapcli.formats.logs.csv.sensors_file import SensorsFile, read_sensors_file, sensors_file_of
from mapcli.formats.logs.log import Log, Source
from mapcli.formats.logs.one_recording import Spans
from mapcli.model.log import Damage, Entry, LogOptions, Topic
from mapcli.model.scan import Mount, Odometry

ODOMETRY = "x,y,theta"
"""The name of the columns with the odometry."""


class CsvLog(Log):
    """A CSV log, read in two passes: a survey when it is opened, then the records.

    Raises:
        FormatError: it, or the YAML about it, makes no sense.
    """

    scans_are = "a column of a range sensor"

    def __init__(self, sources: Sequence[Source], options: LogOptions) -> None:
        super().__init__(sources, options)
        self._told = [self._sensors_file(source) for source in self.sources]
        self._spans = [self._survey(number) for number in range(len(self.sources))]

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

    def _survey(self, number: int) -> tuple[int, int, int]:
        """Rows of a file, and its first and its last stamp."""
        count = first = last = 0
        for row in self._rows(number, Damage()):
            first = row.stamp_ns if not count else first
            count, last = count + 1, row.stamp_ns
        return count, first, last

    def topics(self) -> list[Topic]:
        found = [span for span in self._spans if span[0]]
        count = sum(span[0] for span in found)
        first = min((span[1] for span in found), default=0)
        last = max((span[2] for span in found), default=0)
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
        return [dict.fromkeys(wanted, (first, last)) for _, first, last in self._spans]

    def _records(self) -> Iterator[Entry]:
        wanted = {topic.name for topic in self.require_scan_topics()}
        parts = [
            ((row, number) for row in self._rows(number, self.damage))
            for number in range(len(self.sources))
        ]
        mounts = dict(self.options.sensors)
        for row, self.part in merge(*parts, key=lambda item: item[0].stamp_ns):
            yield Odometry(row.stamp_ns, row.pose)
            for column, value in row.readings.items():
                if column in wanted:
                    yield from self._reading(column, value, row.stamp_ns, mounts)

    def _reading(
        self, column: str, value: float, stamp_ns: int, mounts: dict[str, Mount]
    ) -> Iterator[Entry]:
        sensor = self._told[self.part].sensors[column].sensor
        sensor = replace(sensor, mount=mounts.get(column, self.laser_pose or sensor.mount))
        counts = self.sensors.setdefault(column, sensor.counts())
        reading = sensor.reading(value, stamp_ns, self.beams, counts)
        if reading is not None:
            yield reading
