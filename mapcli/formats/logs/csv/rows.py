"""Rows of a CSV log: a time, the odometry's pose, and one reading of each sensor.

    t,x,y,theta,r1,r2
    0.0,0,0,0,35.2,80
    0.1,0.9,0,0.5,34.1,

In any order of columns. An empty field is no reading. The file is made by people and small
programs, so that whatever makes no sense is refused with its line, not skipped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from typing import NamedTuple

from mapcli.errors import FormatError
from mapcli.formats.logs.blocks import read_lines
from mapcli.formats.logs.csv.sensors_file import SensorsFile
from mapcli.formats.logs.log import Source
from mapcli.formats.number_pattern import NUMBER
from mapcli.model.log import Damage
from mapcli.model.pose import FARTHEST_M, Pose2D, rounded_angle, wrap_angle
from mapcli.model.scan import LATEST_STAMP_S, NANOSECONDS

POSE_COLUMNS = "t", "x", "y", "theta"

HEAD = "a head line `t,x,y,theta,r1,...`"


class Row(NamedTuple):
    """One line of the file.

    Attributes:
        pose: by odometry, metres and radians.
        readings: column -> metres, +inf where nothing was seen; of those that have a reading.
    """

    line: int
    stamp_ns: int
    pose: Pose2D
    readings: Mapping[str, float]


def read_rows(source: Source, told: SensorsFile, damage: Damage) -> Iterator[Row]:
    """The rows of a file, in time order.

    Raises:
        FormatError: a column is missing, or unknown; a field is no number, negative or endless; the
            time goes back.
    """
    columns: list[str] | None = None
    before = -1
    for line, words in _fields(source, damage):
        if columns is None:
            columns = words
            _check_head(columns, told, source.name)
            continue
        if len(words) != len(columns):
            raise FormatError(
                f"has {len(words)} columns", file=source.name, where=f"line {line}",
                expected=f"{len(columns)}, as the head line",
            )  # fmt: skip
        row = _row(dict(zip(columns, words, strict=True)), told, source.name, line)
        if row.stamp_ns < before:
            raise FormatError(
                f"the time goes back from {before / NANOSECONDS:g} to "
                f"{row.stamp_ns / NANOSECONDS:g} s",
                file=source.name, where=f"line {line}", expected="rows in time order",
            )  # fmt: skip
        before = row.stamp_ns
        yield row
    if columns is None:
        raise FormatError("is empty", file=source.name, expected=HEAD)


def _fields(source: Source, damage: Damage) -> Iterator[tuple[int, list[str]]]:
    """(number, fields) of the lines with content; what follows a # is none."""
    for number, line in read_lines(source, damage):
        text = line.decode("utf-8-sig", "replace").partition("#")[0].strip()
        if text:
            yield number, [word.strip().strip('"').strip() for word in text.split(",")]


def _check_head(columns: Sequence[str], told: SensorsFile, file: str) -> None:
    for name in POSE_COLUMNS:
        if name not in columns:
            raise FormatError(f"has no column {name}", file=file, where="head", expected=HEAD)
    for name in columns:
        if columns.count(name) > 1:
            raise FormatError(f"has the column {name} twice", file=file, where="head")
        known = name in POSE_COLUMNS or name in told.sensors or name in told.ignored
        if not known:
            raise FormatError(
                f"the column {name} is no sensor that {told.file} names", file=file, where="head",
                expected=f"{', '.join(told.sensors)}, or `ignore: [{name}]` there",
            )  # fmt: skip
    for name in told.sensors:
        if name not in columns:
            raise FormatError(
                f"has no column {name}, which {told.file} names", file=file, where="head"
            )


def _row(fields: Mapping[str, str], told: SensorsFile, file: str, line: int) -> Row:
    place = _Place(file, f"line {line}")
    x, y = (place.number(key, fields[key]) * told.length for key in "xy")
    theta = place.number("theta", fields["theta"]) * told.angle
    if not max(abs(x), abs(y)) < FARTHEST_M:
        raise place.error(f"x, y are {x:g}, {y:g} m", "a place on Earth")
    readings = {
        column: _reading(told, column, fields[column], place)
        for column in told.sensors
        if fields[column]
    }
    pose = Pose2D(x, y, rounded_angle(wrap_angle(theta)))
    return Row(line, place.stamp_ns(fields["t"], told.time_decimals), pose, readings)


def _reading(told: SensorsFile, column: str, word: str, place: _Place) -> float:
    """Metres, or REP 117's +inf."""
    value = place.number(column, word)
    if value == told.sensors[column].nothing:
        return math.inf
    if value < 0:
        raise place.error(f"{column} is {word}", "a distance, 0 or more")
    return value * told.range


class _Place(NamedTuple):
    """Where in which file, for errors."""

    file: str
    where: str

    def error(self, problem: str, expected: str) -> FormatError:
        return FormatError(problem, file=self.file, where=self.where, expected=expected)

    def number(self, column: str, word: str) -> float:
        """A finite number.

        Raises:
            FormatError: it is none.
        """
        value = float(word) if NUMBER.fullmatch(word) else math.nan
        if not math.isfinite(value):
            expected = "a number" if column in POSE_COLUMNS else "a distance, or nothing at all"
            raise self.error(f"{column} is {word[:40]!r}", expected)
        return value

    def stamp_ns(self, word: str, decimals: int) -> int:
        """A time as nanoseconds, exactly: a float64 would round times since 1970.

        Raises:
            FormatError: it is none, or none that ROS 2 can hold.
        """
        expected = "a time from 0 on, or since 1970, to 2038"
        if NUMBER.fullmatch(word) and math.isfinite(float(word)):
            seconds = Decimal(word).scaleb(-decimals)
            if 0 <= seconds < LATEST_STAMP_S:
                return round(seconds * NANOSECONDS)
            if seconds > 0:
                expected += "; the unit of t is told in the YAML, as in `units: {time: ms}`"
        raise self.error(f"t is {word[:40]!r}", expected)
