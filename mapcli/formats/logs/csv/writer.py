"""Writing the log of a robot with range sensors as CSV, and the YAML about its sensors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any

from mapcli.errors import DataError
from mapcli.formats.logs.csv.sensors_file import sensors_file_of
from mapcli.formats.output import output_set
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import NANOSECONDS, Odometry, Record


def save_csv_log(
    records: Iterable[Record], sensors: Mapping[str, RangeReading], path: str, *,
    no_clobber: bool = False,
) -> None:  # fmt: skip
    """Write odometry and the readings of range sensors as CSV, and where the sensors sit as YAML
    beside it. `mapcli.open_log` reads them again. Other records are left out.

    Args:
        records: in stamp order; readings at times of odometry, which a row has in common.
        sensors: a reading of each, by its column.

    Raises:
        DataError: a reading at another time.
        OutputError: a file cannot be written, or exists and `no_clobber` is set.
    """
    with output_set(no_clobber=no_clobber) as files:
        files.write(path, (line.encode() for line in _lines(records, list(sensors))))
        files.write(beside(path), _yaml(sensors).encode())


def beside(path: str) -> str:
    """The YAML of a CSV log."""
    return sensors_file_of(path)


def _lines(records: Iterable[Record], columns: list[str]) -> Iterator[str]:
    yield ",".join(["t", "x", "y", "theta", *columns]) + "\n"
    for stamp, group in groupby(records, key=attrgetter("stamp_ns")):
        at_once = list(group)
        readings = {one.sensor: one for one in at_once if isinstance(one, RangeReading)}
        odometry = next((one for one in at_once if isinstance(one, Odometry)), None)
        if odometry is None and readings:
            raise DataError(
                f"a reading at {stamp / NANOSECONDS:.3f} s, between two of odometry",
                expected="odometry at the time of each reading, for CSV",
            )
        if odometry is not None:
            yield ",".join(_fields(odometry, readings, columns)) + "\n"


def _fields(
    odometry: Odometry, readings: Mapping[str, RangeReading], columns: Iterable[str]
) -> Iterator[str]:
    seconds, nanoseconds = divmod(odometry.stamp_ns, NANOSECONDS)
    yield f"{seconds}.{nanoseconds:09d}".rstrip("0").rstrip(".")
    for value in (odometry.pose.x, odometry.pose.y, odometry.pose.theta):
        yield repr(value)
    for column in columns:
        yield _distance(readings[column]) if column in readings else ""


def _distance(reading: RangeReading) -> str:
    """Metres; nothing where there is no reading. REP 117's infinities become distances outside the
    sensor's limits."""
    value = float(reading.ranges[0])
    if math.isnan(value):
        return ""
    if math.isinf(value):
        return repr(reading.range_max if value > 0 else reading.range_min / 2)
    return repr(value)


def _yaml(sensors: Mapping[str, RangeReading]) -> str:
    lines = ["units: {time: s, length: m, angle: rad, range: m}", "sensors:"]
    for column, reading in sensors.items():
        pose = reading.mount.pose
        keys: dict[str, Any] = {
            "x": pose.x, "y": pose.y, "yaw_deg": round(math.degrees(pose.theta), 9) + 0.0,
            "range_min": reading.range_min, "range_max": reading.range_max,
        }  # fmt: skip
        said = ", ".join(f"{key}: {value!r}" for key, value in keys.items())
        lines.append(f"  {column}: {{{said}}}")
    return "\n".join(lines) + "\n"


def is_csv(path: str) -> bool:
    """Whether a log is to be written as CSV."""
    return Path(path).suffix.lower() == ".csv"
