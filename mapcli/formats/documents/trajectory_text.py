"""Pose traces for other tools, and from them: TUM, KITTI, g2o and CSV, written by suffix.

    .tum    `t x y z qx qy qz qw`, one pose a line, seconds with all nine decimals (evo, rpg)
    .kitti  the upper 3 x 4 of the pose matrix, row by row, without times (evo, KITTI devkit)
    .g2o    VERTEX_SE2 and EDGE_SE2: the poses, the steps between them, the loops (g2o, GTSAM);
            an edge ends with the upper triangle of its information matrix
    .csv    everything that `trace.json` has, with a head line

Numbers have six decimals, micrometres: finer than any laser, and the same on every machine.

They are read back by content: the head line of CSV, the words of g2o, else the number of columns;
four are `t x y theta`. Of poses in space, the part in the plane is taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from decimal import Decimal
from itertools import pairwise
from pathlib import PurePath

import numpy as np

from mapcli.errors import DataError, FormatError
from mapcli.model.pose import FARTHEST_M, Pose2D, planar_pose
from mapcli.model.se2_uncertainty import InformationTriangle
from mapcli.model.trace import PoseTrace
from mapcli.model.trajectory import Trajectory

CSV_HEAD = "stamp_ns,x,y,theta,odom_x,odom_y,odom_theta,score,status"
STEP_INFORMATION: InformationTriangle = (10_000, 0, 0, 10_000, 0, 40_000)
"""Of an edge of which nothing is known: 1 cm and 0.3 degrees of standard deviation."""


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
        place, turn = f"{_metres(pose.x)} {_metres(pose.y)}", f"{_ratio(z)} {_ratio(w)}"
        yield f"{seconds}.{nanoseconds:09d} {place} 0 0 0 {turn}"


def _kitti(trace: PoseTrace) -> Iterator[str]:
    for traced in trace.poses:
        pose = traced.pose
        cos, sin = math.cos(pose.theta), math.sin(pose.theta)
        upper = f"{_ratio(cos)} {_ratio(-sin)} 0 {_metres(pose.x)}"
        yield f"{upper} {_ratio(sin)} {_ratio(cos)} 0 {_metres(pose.y)} 0 0 1 0"


def _g2o(trace: PoseTrace) -> Iterator[str]:
    poses = [traced.pose for traced in trace.poses]
    for k, pose in enumerate(poses):
        yield f"VERTEX_SE2 {k} {_numbers(pose)}"
    steps = trace.steps or [a.between(b) for a, b in pairwise(poses)]
    for k, step in enumerate(steps):
        yield _edge(k, k + 1, step, STEP_INFORMATION)
    for loop in trace.loops:
        yield _edge(loop.from_, loop.to, loop.pose, loop.information or STEP_INFORMATION)


def _edge(start: int, end: int, motion: Pose2D, information: InformationTriangle) -> str:
    weights = " ".join(f"{value:.10g}" for value in information)
    return f"EDGE_SE2 {start} {end} {_numbers(motion)} {weights}"


def _csv(trace: PoseTrace) -> Iterator[str]:
    yield CSV_HEAD
    for traced in trace.poses:
        odom = _numbers(traced.odom, ",") if traced.odom else ",,"
        score = "" if traced.score is None else f"{traced.score:.4f}"
        yield f"{traced.stamp_ns},{_numbers(traced.pose, ',')},{odom},{score},{traced.status}"


def _numbers(pose: Pose2D, separator: str = " ") -> str:
    return separator.join(_metres(value) for value in (pose.x, pose.y, pose.theta))


def _metres(value: float) -> str:
    return f"{round(value, 6) + 0.0:.6f}"  # + 0.0: no "-0.000000", whose sign is noise


def _ratio(value: float) -> str:
    return f"{round(value, 9) + 0.0:.9f}"


WRITERS = {".tum": _tum, ".kitti": _kitti, ".g2o": _g2o, ".csv": _csv}
"""Suffix -> the lines of a file."""


LATEST_S = 2**63 // 10**9
"""Seconds that nanoseconds in an int64 can hold."""

TEXT_COLUMNS = {
    4: "t x y theta",
    8: "t x y z qx qy qz qw",
    12: "the upper 3 x 4 of a pose matrix, row by row",
}
EXPECTED = "trace.json, MCAP, CSV, g2o, or lines of 4 (t x y theta), 8 (TUM) or 12 numbers (KITTI)"

Words = tuple[int, list[str]]
"""A line's number, and what is on it."""

Row = tuple[int, int | None, tuple[float, float, float]]
"""A line's number, the stamp in nanoseconds, and x, y, theta."""


def read_trajectory(data: bytes, file: str) -> Trajectory:
    """The poses of a text file in any of the formats above.

    Raises:
        FormatError: of none of them, a bad line, no poses, or stamps that go back.
    """
    if b"\0" in data[:4096]:
        raise FormatError("is no text", file=file, expected=EXPECTED)
    rows = list(rows_of_words(data))
    if not rows:
        raise FormatError("has no poses", file=file, expected=EXPECTED)
    line, first = rows[0]
    if any("VERTEX_SE" in words[0] for _, words in rows[:50]):
        return _checked(_g2o_rows(rows, file), file)
    if {"x", "y"} <= set(first):
        return _checked(_csv_rows(first, rows[1:], file), file)
    if len(first) not in TEXT_COLUMNS or not _is_number(first[0]):
        problem = f"{' '.join(first)[:60]!r} is no pose"
        raise FormatError(problem, file=file, where=f"line {line}", expected=EXPECTED)
    return _checked(_column_rows(rows, len(first), file), file)


def rows_of_words(data: bytes) -> Iterator[Words]:
    """The lines that are not empty, split at blanks or commas; `#` begins a comment."""
    for line, text in enumerate(data.decode("utf-8-sig", "replace").splitlines(), start=1):
        words = text.split("#")[0]
        if words.strip():
            # An empty field between two commas is a field.
            yield line, [w.strip() for w in words.split(",")] if "," in words else words.split()


def columns(words: Sequence[str], count: int, file: str, where: str, expected: str) -> list[float]:
    """So many finite numbers.

    Raises:
        FormatError: more or fewer words, or one that is no number.
    """
    if len(words) != count:
        problem = f"has {len(words)} columns"
        raise FormatError(problem, file=file, where=where, expected=f"{count}: {expected}")
    return [_number(word, file, where, expected) for word in words]


def _number(word: str, file: str, where: str, expected: str) -> float:
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        problem = f"{word!r} is no finite number"
        raise FormatError(problem, file=file, where=where, expected=expected)
    return number


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def stamp_ns(word: str, file: str, where: str) -> int:
    """A time in seconds as nanoseconds, exactly: a float64 would round times since 1970.

    Raises:
        FormatError: no number, or none that fits.
    """
    try:
        seconds = Decimal(word)
        if abs(seconds) < LATEST_S:
            return round(seconds * 1_000_000_000)
    except ArithmeticError:  # no number, or an exponent of a thousand million
        pass
    raise FormatError(f"{word!r} is no time", file=file, where=where, expected="seconds")


def _column_rows(rows: Iterable[Words], count: int, file: str) -> Iterator[Row]:
    """Lines of 4, 8 or 12 numbers."""
    for line, words in rows:
        where = f"line {line}"
        numbers = columns(words, count, file, where, TEXT_COLUMNS[count])
        if count == 12:
            turn = math.atan2(numbers[4], numbers[0])
            yield line, None, (numbers[3], numbers[7], turn)
            continue
        stamp = stamp_ns(words[0], file, where)
        turn = numbers[3] if count == 4 else _yaw(numbers[4:], file, where)
        yield line, stamp, (numbers[1], numbers[2], turn)


def _yaw(quaternion: Sequence[float], file: str, where: str) -> float:
    try:
        return planar_pose((0.0, 0.0), quaternion).theta
    except ValueError:
        shown = " ".join(f"{part:g}" for part in quaternion)
        expected = "a quaternion qx qy qz qw of length 1"
        raise FormatError(
            f"{shown} is no rotation", file=file, where=where, expected=expected
        ) from None


def _g2o_rows(rows: Iterable[Words], file: str) -> Iterator[Row]:
    """The vertices by their ids; edges are passed over."""
    found: dict[int, Row] = {}
    for line, words in rows:
        if not words[0].startswith("VERTEX_SE"):
            continue
        where, flat = f"line {line}", words[0] == "VERTEX_SE2"
        expected = "id x y theta" if flat else "id x y z qx qy qz qw"
        numbers = columns(words[1:], 4 if flat else 8, file, where, expected)
        turn = numbers[3] if flat else _yaw(numbers[4:], file, where)
        vertex = int(numbers[0])
        if vertex in found:
            raise FormatError(f"vertex {vertex} comes twice", file=file, where=where)
        found[vertex] = line, None, (numbers[1], numbers[2], turn)
    for vertex in sorted(found):
        yield found[vertex]


def _csv_rows(head: Sequence[str], rows: Iterable[Words], file: str) -> Iterator[Row]:
    """Columns by their names: `stamp_ns` or `t` (or neither), `x`, `y`, `theta`."""
    missing = [name for name in ("x", "y", "theta") if name not in head]
    if missing:
        raise FormatError(f"has no column {missing[0]}", file=file, expected=CSV_HEAD)
    places = [head.index(name) for name in ("x", "y", "theta")]
    for line, words in rows:
        where = f"line {line}"
        if len(words) != len(head):
            problem = f"has {len(words)} columns"
            raise FormatError(problem, file=file, where=where, expected=f"{len(head)}, as the head")
        x, y, theta = (_number(words[k], file, where, "x, y and theta") for k in places)
        stamp = None
        if "stamp_ns" in head:
            word = words[head.index("stamp_ns")]
            stamp = stamp_ns(f"{word}e-9", file, where)
        elif "t" in head:
            stamp = stamp_ns(words[head.index("t")], file, where)
        yield line, stamp, (x, y, theta)


def _checked(rows: Iterable[Row], file: str) -> Trajectory:
    """The rows as arrays.

    Raises:
        FormatError: no rows, a pose that is nowhere, or stamps that go back.
    """
    poses, stamps = list[tuple[float, float, float]](), list[int]()
    for line, stamp, pose in rows:
        if not max(map(abs, pose)) < FARTHEST_M:
            problem = f"the pose {' '.join(f'{part:g}' for part in pose)} is too far away"
            raise FormatError(problem, file=file, where=f"line {line}", expected="metres")
        if stamp is not None:
            if stamps and stamp < stamps[-1]:
                problem = f"the time goes back from {stamps[-1] / 1e9:.6f} to {stamp / 1e9:.6f} s"
                expected = "poses in time order"
                raise FormatError(problem, file=file, where=f"line {line}", expected=expected)
            stamps.append(stamp)
        poses.append(pose)
    if not poses:
        raise FormatError("has no poses", file=file, expected=EXPECTED)
    return Trajectory(np.array(poses), np.array(stamps, dtype=np.int64) if stamps else None)
