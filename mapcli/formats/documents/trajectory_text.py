"""Pose traces for other tools, and from them: TUM, KITTI, g2o and CSV, written by suffix.

    .tum    `t x y z qx qy qz qw`, one pose a line, seconds with all nine decimals (evo, rpg)
    .kitti  the upper 3 x 4 of the pose matrix, row by row, without times (evo, KITTI devkit)
    .g2o    the poses, the steps between them, the loops, see `trace_g2o`
    .csv    the poses with all that `trace.json` says of them, see `trace_csv`

Numbers have six decimals, micrometres: finer than any laser, and the same on every machine.

They are read back by content: the head line of CSV, the words of g2o, else the number of columns;
four are `t x y theta`. Of poses in space, the part in the plane is taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np

from mapcli.errors import DataError, FormatError
from mapcli.formats.documents.text_columns import (
    Row,
    Words,
    columns,
    is_number,
    metres,
    ratio,
    rows_of_words,
    stamp_ns,
    yaw,
)
from mapcli.formats.documents.trace_csv import csv_lines, csv_rows
from mapcli.formats.documents.trace_g2o import g2o_lines, g2o_loops, g2o_rows, is_g2o
from mapcli.model.pose import FARTHEST_M, Pose2D
from mapcli.model.trace import PoseTrace, TracedPose
from mapcli.model.trajectory import Trajectory


def dump_trajectory(trace: PoseTrace, path: str | PurePath) -> bytes:
    """The trace in the format that the file's suffix names; CSV for `-`.

    Raises:
        DataError: a suffix of no known format.
    """
    suffix = ".csv" if str(path) == "-" else PurePath(path).suffix.lower()
    if suffix not in WRITERS:
        known = " ".join(WRITERS)
        raise DataError(f"{str(path)!r} says no trace format", expected=f"a name in {known}")
    return "".join(f"{line}\n" for line in WRITERS[suffix](trace)).encode()


def _tum(trace: PoseTrace) -> Iterator[str]:
    for traced in trace.poses:
        seconds, nanoseconds = divmod(traced.stamp_ns, 1_000_000_000)
        pose = traced.pose
        z, w = math.sin(pose.theta / 2), math.cos(pose.theta / 2)
        place, turn = f"{metres(pose.x)} {metres(pose.y)}", f"{ratio(z)} {ratio(w)}"
        yield f"{seconds}.{nanoseconds:09d} {place} 0 0 0 {turn}"


def _kitti(trace: PoseTrace) -> Iterator[str]:
    for traced in trace.poses:
        pose = traced.pose
        cos, sin = math.cos(pose.theta), math.sin(pose.theta)
        upper = f"{ratio(cos)} {ratio(-sin)} 0 {metres(pose.x)}"
        yield f"{upper} {ratio(sin)} {ratio(cos)} 0 {metres(pose.y)} 0 0 1 0"


WRITERS = {".tum": _tum, ".kitti": _kitti, ".g2o": g2o_lines, ".csv": csv_lines}
"""Suffix -> the lines of a file."""

TEXT_COLUMNS = {
    4: "t x y theta",
    8: "t x y z qx qy qz qw",
    12: "the upper 3 x 4 of a pose matrix, row by row",
}
NAMES = {4: "t x y theta", 8: "TUM", 12: "KITTI"}
EXPECTED = "trace.json, MCAP, CSV, g2o, or lines of 4 (t x y theta), 8 (TUM) or 12 numbers (KITTI)"


@dataclass(frozen=True)
class TextTrace:
    """A trace that was read from text.

    Attributes:
        form: the name of its format.
        trace: its poses; without times, pose k has the stamp of k seconds.
        has_times: whether the stamps are its own.
    """

    form: str
    trace: PoseTrace
    has_times: bool


def read_trajectory(data: bytes, file: str) -> Trajectory:
    """The poses of a text file in any of the formats above.

    Raises:
        FormatError: of none of them, a bad line, no poses, or stamps that go back.
    """
    return _trajectory(_checked(_read(data, file)[1], file))


def read_text_trace(data: bytes, file: str) -> TextTrace:
    """Everything that a text file in any of the formats above says.

    Raises:
        FormatError: as of `read_trajectory`; a bad loop.
    """
    form, unchecked = _read(data, file)
    rows = _checked(unchecked, file)
    loops = g2o_loops(rows_of_words(data), file) if form == "g2o" else ()
    poses = tuple(_traced(row, k) for k, row in enumerate(rows))
    return TextTrace(form, PoseTrace(poses, loops), rows[0].stamp_ns is not None)


def _traced(row: Row, index: int) -> TracedPose:
    stamp = index * 1_000_000_000 if row.stamp_ns is None else row.stamp_ns
    odom = Pose2D(*row.odom) if row.odom else None
    return TracedPose(stamp, Pose2D(*row.pose), odom, row.score, row.status)


def _read(data: bytes, file: str) -> tuple[str, Iterator[Row]]:
    """The name of the format, and the poses."""
    if b"\0" in data[:4096]:
        raise FormatError("is no text", file=file, expected=EXPECTED)
    rows = list(rows_of_words(data))
    if not rows:
        raise FormatError("has no poses", file=file, expected=EXPECTED)
    line, first = rows[0]
    if is_g2o(rows):
        return "g2o", g2o_rows(rows, file)
    if {"x", "y"} <= set(first):
        return "CSV", csv_rows(first, rows[1:], file)
    if len(first) not in TEXT_COLUMNS or not is_number(first[0]):
        problem = f"{' '.join(first)[:60]!r} is no pose"
        raise FormatError(problem, file=file, where=f"line {line}", expected=EXPECTED)
    return NAMES[len(first)], _column_rows(rows, len(first), file)


def _column_rows(rows: Iterable[Words], count: int, file: str) -> Iterator[Row]:
    """Lines of 4, 8 or 12 numbers."""
    for line, words in rows:
        where = f"line {line}"
        numbers = columns(words, count, file, where, TEXT_COLUMNS[count])
        if count == 12:
            turn = math.atan2(numbers[4], numbers[0])
            yield Row(line, None, (numbers[3], numbers[7], turn))
            continue
        stamp = stamp_ns(words[0], file, where)
        turn = numbers[3] if count == 4 else yaw(numbers[4:], file, where)
        yield Row(line, stamp, (numbers[1], numbers[2], turn))


def _checked(rows: Iterable[Row], file: str) -> list[Row]:
    """The rows, all of them sound.

    Raises:
        FormatError: no rows, a pose that is nowhere, or stamps that go back.
    """
    checked, last = list[Row](), -math.inf
    for row in rows:
        where = f"line {row.line}"
        if not max(map(abs, row.pose)) < FARTHEST_M:
            problem = f"the pose {' '.join(f'{part:g}' for part in row.pose)} is too far away"
            raise FormatError(problem, file=file, where=where, expected="metres")
        if row.stamp_ns is not None:
            if row.stamp_ns < last:
                problem = f"the time goes back from {last / 1e9:.6f} to {row.stamp_ns / 1e9:.6f} s"
                raise FormatError(problem, file=file, where=where, expected="poses in time order")
            last = row.stamp_ns
        checked.append(row)
    if not checked:
        raise FormatError("has no poses", file=file, expected=EXPECTED)
    return checked


def _trajectory(rows: list[Row]) -> Trajectory:
    """The rows as arrays."""
    stamps = [row.stamp_ns for row in rows if row.stamp_ns is not None]
    poses = np.array([row.pose for row in rows])
    return Trajectory(poses, np.array(stamps, dtype=np.int64) if stamps else None)
