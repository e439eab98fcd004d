"""What files are good for, and what they are called."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Role(Enum):
    """What a file is good for; the value says which command reads it."""

    LOG = "make a map of it with mapcli slam-replay"
    MAP = "draw it with mapcli render, or go on with it with mapcli slam-replay LOG --known"
    WORLD = "make a grid map of it with mapcli rasterize"
    STATE = "go on from it with mapcli slam-replay LOG --continue"
    TRACE = "draw it with mapcli render MAP --trace, compare it with mapcli evaluate"
    RELATIONS = "hold a trace against it with mapcli evaluate"
    PERCEPTION = "compare it with a map with mapcli similarity-table"
    WAYPOINTS = "have a robot drive along it with mapcli simulate --path"
    SENSORS = "name it with --sensors where the log is read, as in mapcli slam-replay LOG.csv"
    DOCUMENT = "see what is in it with mapcli info"
    PICTURE = "mapcli reads PNG and PGM, as maps"
    ARCHIVE = "unpack it first"
    OTHER = "mapcli does not read it"


@dataclass(frozen=True)
class FileKind:
    """What a file is.

    Attributes:
        name: with its article, for people: "an MCAP log".
        role: what it is good for.
        advice: what to do with it, when that is not what the role says.
    """

    name: str
    role: Role
    advice: str = ""

    def __str__(self) -> str:
        return f"{self.name}; {self.advice or self.role.value}"


class LogFormat(Enum):
    """A format of logs; the value names one, as `FileKind.name`."""

    MCAP = "an MCAP log"
    BAG = "a ROS 1 bag"
    SQLITE = "a ROS 2 bag in SQLite"
    CARMEN = "a CARMEN log"
    CSV = "a CSV log of a robot"

    @property
    def kind(self) -> FileKind:
        return FileKind(self.value, Role.LOG)


MCAP_MAGIC = b"\x89MCAP0\r\n"
"""How an MCAP file begins and ends; the end of line is there to be broken by what converts text."""

LOG_MAGIC = {
    MCAP_MAGIC.rstrip(): LogFormat.MCAP,
    b"#ROSBAG V": LogFormat.BAG,
    b"SQLite format 3": LogFormat.SQLITE,
}
"""First bytes of a log of messages -> its format. CARMEN logs and CSV are text."""


def log_format_of(start: bytes) -> LogFormat | None:
    """The format of a log of messages that begins so; None of another file."""
    return next((one for magic, one in LOG_MAGIC.items() if start.startswith(magic)), None)
