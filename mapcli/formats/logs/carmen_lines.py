"""The grammar of CARMEN logs: text, one message per line, words separated by spaces.

    ODOM x y theta tv rv accel ipc_time host log_time
    FLASER n r1..rn x y theta odom_x odom_y odom_theta ipc_time host log_time
    ROBOTLASER1 type start_angle field_of_view resolution max_range accuracy remission_mode
        n r1..rn m i1..im laser_x laser_y laser_theta robot_x robot_y robot_theta
        tv rv forward_safety side_safety turn_axis ipc_time host log_time

Metres, radians, seconds. Other messages are not for us. FLASER tells no angles: beams run
counter-clockwise from -90 degrees, in steps of 180/n degrees for an even and 180/(n-1) degrees
for an odd number of beams.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from decimal import Decimal
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.model.pose import FARTHEST_M, Pose2D, rounded_angle
from mapcli.model.scan import LATEST_STAMP_S, NANOSECONDS, Odometry

_KNOWN = rb"(ODOM|[FR]LASER|OLDLASER|(ROBOT|RAW)LASER\d|TRUEPOS|PARAM|SYNC|SONAR|NMEA\w+)"
_KNOWN_START = re.compile(rb"^%b " % _KNOWN, re.MULTILINE)
_KNOWN_NAME = re.compile(_KNOWN)
_NAME = re.compile(rb"[A-Z][A-Z0-9_]{2,40}")


def message_name(line: bytes) -> str | None:
    """The word that a line starts with, if it could be a message's name."""
    words = line[:48].split(None, 1)
    if not words:
        return None
    usual = _USUAL_NAMES.get(words[0])
    if usual is not None:
        return usual
    return words[0].decode() if _NAME.fullmatch(words[0]) else None


def looks_like_carmen(start: bytes) -> bool:
    """Whether a line of the file's beginning starts with a CARMEN message's name."""
    return _KNOWN_START.search(start.replace(b"\r", b"\n")) is not None


def is_known(name: str) -> bool:
    """Whether it is the name of one of CARMEN's messages."""
    return _KNOWN_NAME.fullmatch(name.encode()) is not None


def scans_in(line: bytes, name: str) -> int:
    """How many scans were on a line that is no valid message of scans.

    They are told by their message's name, which is inside the line where the end of the line before
    was hit; or, where the name was hit, by the shape: as many words and numbers as there should be.

    Args:
        name: of the scans' message.
    """
    inside = 0
    if name.encode() in line:
        parts = line.split(name.encode() + b" ")
        inside = sum(len(part.split(None, _LEAST_WORDS)) > _LEAST_WORDS for part in parts[1:])
    if inside or line.startswith(name.encode()):
        return max(inside, 1)
    words = line.split()
    try:
        shaped = len(words) == _WORDS[name](words)
    except (ValueError, IndexError):
        return 0
    return int(shaped and sum(map(_is_number, words)) >= len(words) - _NO_NUMBERS)


def _is_number(word: bytes) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


class LaserMessage(NamedTuple):
    """A FLASER or ROBOTLASER1 line; `max_range` is 0 where the message does not tell it."""

    stamp_ns: int
    angle_min: float
    angle_increment: float
    ranges: NDArray[np.float32]
    max_range: float
    laser: Pose2D
    robot: Pose2D


Parser = Callable[[list[bytes], bool], "LaserMessage | Odometry"]


def _flaser_words(words: list[bytes]) -> int:
    """How many words the line should have."""
    return 11 + int(words[1])


def _robotlaser_words(words: list[bytes]) -> int:
    n = int(words[8])
    _expect(0 <= n < len(words) - 9)
    remissions = int(words[9 + n])
    _expect(remissions >= 0)
    return 24 + n + remissions


def parse_odom(words: list[bytes], log_time: bool) -> Odometry:
    """An ODOM line, split at spaces. Raises ValueError where it is malformed."""
    _expect(len(words) == 10)
    return Odometry(_stamp(words, log_time), _pose(words[1:4]))


def parse_flaser(words: list[bytes], log_time: bool) -> LaserMessage:
    """An FLASER line, split at spaces. Raises ValueError where it is malformed."""
    n = int(words[1])
    _expect(n >= 0 and len(words) == _flaser_words(words))
    angle_min, increment = _half_circle(n)
    return LaserMessage(
        _stamp(words, log_time),
        angle_min,
        increment,
        _floats(words[2 : 2 + n]),
        0.0,
        _pose(words[2 + n : 5 + n]),
        _pose(words[5 + n : 8 + n]),
    )


def parse_robotlaser(words: list[bytes], log_time: bool) -> LaserMessage:
    """A ROBOTLASER1 line, split at spaces. Raises ValueError where it is malformed."""
    n = int(words[8])
    _expect(len(words) == _robotlaser_words(words))
    tail = len(words) - 14
    start, view, step, max_range = map(float, words[2:6])
    if n > 1 and not (step > 0 and abs(view - step * (n - 1)) <= 1.5 * step):
        step = view / (n - 1)
    if not (step > 0 and math.isfinite(start + step)):
        start, step = _half_circle(n)
    return LaserMessage(
        _stamp(words, log_time),
        start,
        step,
        _floats(words[9 : 9 + n]),
        max_range if math.isfinite(max_range) else 0.0,
        _pose(words[tail : tail + 3]),
        _pose(words[tail + 3 : tail + 6]),
    )


PARSERS: dict[str, Parser] = {
    "ODOM": parse_odom,
    "FLASER": parse_flaser,
    "ROBOTLASER1": parse_robotlaser,
}
"""Message -> parser of its words; the second argument asks for the time of logging."""

_USUAL_NAMES = {name.encode(): name for name in PARSERS}
"""Nearly every line starts with one of these, and is spared the pattern."""

_WORDS: dict[str, Callable[[list[bytes]], int]] = {
    "FLASER": _flaser_words,
    "ROBOTLASER1": _robotlaser_words,
}
_LEAST_WORDS = 10
"""That follow the name of such a message."""
_NO_NUMBERS = 3
"""Words of such a message that are none: its name, the host, and one that was hit as well."""

_MOST_READINGS = 1 << 15
"""Known readings; a centimetre each, they would do for 328 m."""

_LONGEST_READING = 12


class _Readings(dict[bytes, float]):
    """Word -> number. A laser repeats a few thousand readings, and looking one up takes a third
    of the time that it takes to convert it."""

    def __missing__(self, word: bytes) -> float:
        number = float(word)
        if len(word) <= _LONGEST_READING:
            self[word] = number
        return number


_readings = _Readings()


def _expect(condition: bool) -> None:
    if not condition:
        raise ValueError


def _half_circle(n: int) -> tuple[float, float]:
    """First bearing and step of FLASER's n beams, radians."""
    return -math.pi / 2, math.pi / max(n - n % 2, 1)


def _floats(words: list[bytes]) -> NDArray[np.float32]:
    number = _readings.__getitem__ if len(_readings) < _MOST_READINGS else float
    with np.errstate(over="ignore"):
        return np.fromiter(map(number, words), dtype=np.float32, count=len(words))


def _pose(words: list[bytes]) -> Pose2D:
    x, y, theta = map(float, words)
    _expect(abs(x) <= FARTHEST_M and abs(y) <= FARTHEST_M and math.isfinite(theta))
    return Pose2D(x, y, rounded_angle(theta))


def _stamp(words: list[bytes], log_time: bool) -> int:
    """Nanoseconds: the time of the message, or of its logging where that is missing or wanted."""
    return (not log_time and _nanoseconds(words[-3])) or _nanoseconds(words[-1])


def _nanoseconds(word: bytes) -> int:
    """`12.345678` in nanoseconds, exactly."""
    if word[-7:-6] == b".":  # what CARMEN itself writes
        stamp = int(word[:-7] + word[-6:]) * 1000
    else:
        _expect(0 <= float(word) < LATEST_STAMP_S)
        stamp = round(Decimal(word.decode()) * NANOSECONDS)
    _expect(0 <= stamp < LATEST_STAMP_S * NANOSECONDS)
    return stamp
