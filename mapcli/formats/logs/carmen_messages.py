"""The messages of CARMEN logs: text, one message per line, words separated by spaces.

    ODOM x y theta tv rv accel ipc_time host log_time
    FLASER n r1..rn x y theta odom_x odom_y odom_theta ipc_time host log_time     (RLASER likewise)
    ROBOTLASER1 type start_angle field_of_view resolution max_range accuracy remission_mode
        n r1..rn m i1..im laser_x laser_y laser_theta robot_x robot_y robot_theta
        tv rv forward_safety side_safety turn_axis ipc_time host log_time
    RAWLASER1 type start_angle field_of_view resolution max_range accuracy remission_mode
        n r1..rn m i1..im ipc_time host log_time
    TRUEPOS x y theta odom_x odom_y odom_theta ipc_time host log_time
    PARAM name value ipc_time host log_time

and of what GMapping writes from them (`.gfs`):

    ODOM x y theta time
    LASER_READING n r1..rn odom_x odom_y odom_theta time

Metres, radians, seconds. Other messages are not for us. FLASER tells no angles: beams run
counter-clockwise from -90 degrees, in steps of 180/n degrees for an even and 180/(n-1) degrees
for an odd number of beams.

Source: CARMEN's logwrite, GMapping's GridSlamProcessor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.model.pose import FARTHEST_M, Pose2D, rounded_angle
from mapcli.model.scan import LATEST_STAMP_S, NANOSECONDS, Odometry

Words = list[bytes]


class Stamping(NamedTuple):
    """How to read the time of a line.

    Attributes:
        source: that of the message, or of its logging where that is missing; that of the logging;
            or none, as 0.
        unit_ns: nanoseconds in its unit.
    """

    source: Literal["header", "log", "order"] = "header"
    unit_ns: int = NANOSECONDS

    def read(self, words: Words) -> int:
        """Nanoseconds, exactly. Raises ValueError where there is none."""
        if self.source == "order":
            return 0
        is_short = words[0] in SHORT or (words[0] == b"ODOM" and len(words) == GFS_ODOM_WORDS)
        if self.source == "log" or is_short:
            return self._nanoseconds(words[-1])
        return self._nanoseconds(words[-3]) or self._nanoseconds(words[-1])

    def _nanoseconds(self, word: bytes) -> int:
        if word[-7:-6] == b"." and self.unit_ns == NANOSECONDS:  # what CARMEN itself writes
            stamp = int(word[:-7] + word[-6:]) * 1000
        else:
            _expect(0 <= float(word) * self.unit_ns < LATEST_STAMP_S * NANOSECONDS)
            stamp = round(Decimal(word.decode()) * self.unit_ns)
        _expect(0 <= stamp < LATEST_STAMP_S * NANOSECONDS)
        return stamp


class LaserMessage(NamedTuple):
    """A line with a scan.

    Attributes:
        max_range: 0 where the message does not tell it.
        laser, robot: poses by odometry; None where the message does not tell them.
    """

    stamp_ns: int
    angle_min: float
    angle_increment: float
    ranges: NDArray[np.float32]
    max_range: float
    laser: Pose2D | None
    robot: Pose2D | None


Parser = Callable[[Words, Stamping], LaserMessage | Odometry]


def flaser_words(words: Words) -> int:
    """How many words the line should have."""
    return 11 + int(words[1])


def laser_reading_words(words: Words) -> int:
    return 6 + int(words[1])


def rawlaser_words(words: Words) -> int:
    n = int(words[8])
    _expect(0 <= n < len(words) - 9)
    remissions = int(words[9 + n])
    _expect(remissions >= 0)
    return 13 + n + remissions


def robotlaser_words(words: Words) -> int:
    return 11 + rawlaser_words(words)


def parse_odom(words: Words, stamping: Stamping) -> Odometry:
    """An ODOM line, split at spaces. Raises ValueError where it is malformed."""
    _expect(len(words) in (10, GFS_ODOM_WORDS))
    return Odometry(stamping.read(words), parse_pose(words[1:4]))


def parse_flaser(words: Words, stamping: Stamping) -> LaserMessage:
    """An FLASER or RLASER line, split at spaces. Raises ValueError where it is malformed."""
    n = int(words[1])
    _expect(n >= 0 and len(words) == flaser_words(words))
    laser, robot = parse_pose(words[2 + n : 5 + n]), parse_pose(words[5 + n : 8 + n])
    angles, ranges = _half_circle(n), _floats(words[2 : 2 + n])
    return LaserMessage(stamping.read(words), *angles, ranges, 0.0, laser, robot)


def parse_laser_reading(words: Words, stamping: Stamping) -> LaserMessage:
    """A LASER_READING line of GMapping. Raises ValueError where it is malformed."""
    n = int(words[1])
    _expect(n >= 0 and len(words) == laser_reading_words(words))
    robot = parse_pose(words[2 + n : 5 + n])
    angles, ranges = _half_circle(n), _floats(words[2 : 2 + n])
    return LaserMessage(stamping.read(words), *angles, ranges, 0.0, None, robot)


def parse_robotlaser(words: Words, stamping: Stamping) -> LaserMessage:
    """A ROBOTLASER line, split at spaces. Raises ValueError where it is malformed."""
    _expect(len(words) == robotlaser_words(words))
    tail = len(words) - 14
    poses = parse_pose(words[tail : tail + 3]), parse_pose(words[tail + 3 : tail + 6])
    return LaserMessage(stamping.read(words), *_laser(words), *poses)


def parse_rawlaser(words: Words, stamping: Stamping) -> LaserMessage:
    """A RAWLASER line, split at spaces. Raises ValueError where it is malformed."""
    _expect(len(words) == rawlaser_words(words))
    return LaserMessage(stamping.read(words), *_laser(words), None, None)


PARSERS: dict[str, Parser] = {
    "ODOM": parse_odom,
    "FLASER": parse_flaser,
    "ROBOTLASER1": parse_robotlaser,
    "RLASER": parse_flaser,
    **{f"ROBOTLASER{k}": parse_robotlaser for k in (0, 2, 3, 4)},
    **{f"RAWLASER{k}": parse_rawlaser for k in range(1, 6)},
    "LASER_READING": parse_laser_reading,
}
"""Message -> parser of its words."""

WORDS: dict[str, Callable[[Words], int]] = {
    "FLASER": flaser_words,
    "RLASER": flaser_words,
    "LASER_READING": laser_reading_words,
    **{f"ROBOTLASER{k}": robotlaser_words for k in range(5)},
    **{f"RAWLASER{k}": rawlaser_words for k in range(1, 6)},
}
"""Message of scans -> how many words its line should have."""

GFS_ODOM_WORDS, TRUEPOS_WORDS = 5, 10
SHORT = (b"LASER_READING",)
"""Messages that end with their only time."""

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


def _laser(words: Words) -> tuple[float, float, NDArray[np.float32], float]:
    """First bearing, step, ranges and longest range of a ROBOTLASER or RAWLASER."""
    n = int(words[8])
    start, view, step, max_range = map(float, words[2:6])
    if n > 1 and not (step > 0 and abs(view - step * (n - 1)) <= 1.5 * step):
        step = view / (n - 1)
    if not (step > 0 and math.isfinite(start + step)):
        start, step = _half_circle(n)
    return start, step, _floats(words[9 : 9 + n]), max_range if math.isfinite(max_range) else 0.0


def _half_circle(n: int) -> tuple[float, float]:
    """First bearing and step of FLASER's n beams, radians."""
    return -math.pi / 2, math.pi / max(n - n % 2, 1)


def _floats(words: Words) -> NDArray[np.float32]:
    number = _readings.__getitem__ if len(_readings) < _MOST_READINGS else float
    with np.errstate(over="ignore"):
        return np.fromiter(map(number, words), dtype=np.float32, count=len(words))


def parse_pose(words: Words) -> Pose2D:
    """x, y and theta. Raises ValueError where they are none."""
    x, y, theta = map(float, words)
    _expect(abs(x) <= FARTHEST_M and abs(y) <= FARTHEST_M and math.isfinite(theta))
    return Pose2D(x, y, rounded_angle(theta))
