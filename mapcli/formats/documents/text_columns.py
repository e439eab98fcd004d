"""Numbers in columns of text: what the formats of traces and relations have in common."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from decimal import Decimal
from typing import NamedTuple

from mapcli.errors import FormatError
from mapcli.model.pose import Pose2D, planar_pose
from mapcli.model.trace import Status

LATEST_S = 2**63 // 10**9
"""Seconds that nanoseconds in an int64 can hold."""

Words = tuple[int, list[str]]
"""A line's number, and what is on it."""


class Row(NamedTuple):
    """A pose in a text file; None where its format, or the file, does not say.

    Attributes:
        line: counted from 1; stamp_ns: nanoseconds; pose: x, y, theta.
        odom, score, status: see `TracedPose`.
    """

    line: int
    stamp_ns: int | None
    pose: tuple[float, float, float]
    odom: tuple[float, float, float] | None = None
    score: float | None = None
    status: Status | None = None


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
    return [finite(word, file, where, expected) for word in words]


def finite(word: str, file: str, where: str, expected: str) -> float:
    """A finite number.

    Raises:
        FormatError: it is none.
    """
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        problem = f"{word!r} is no finite number"
        raise FormatError(problem, file=file, where=where, expected=expected)
    return number


def is_number(word: str) -> bool:
    """Whether Python takes it for one."""
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


def yaw(quaternion: Sequence[float], file: str, where: str) -> float:
    """The turn about the z axis.

    Raises:
        FormatError: no rotation.
    """
    try:
        return planar_pose((0.0, 0.0), quaternion).theta
    except ValueError:
        shown = " ".join(f"{part:g}" for part in quaternion)
        expected = "a quaternion qx qy qz qw of length 1"
        raise FormatError(
            f"{shown} is no rotation", file=file, where=where, expected=expected
        ) from None


def pose_text(pose: Pose2D, separator: str = " ") -> str:
    """x, y and theta."""
    return separator.join(metres(value) for value in (pose.x, pose.y, pose.theta))


def metres(value: float) -> str:
    """Six decimals, micrometres."""
    return f"{round(value, 6) + 0.0:.6f}"  # + 0.0: no "-0.000000", whose sign is noise


def ratio(value: float) -> str:
    """Nine decimals, for parts of a rotation."""
    return f"{round(value, 9) + 0.0:.9f}"
