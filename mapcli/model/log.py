"""What is known about a log besides its records: its topics, and what was wrong with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from mapcli.model.scan import Mount

Role = Literal["scan", "odometry", "tf", "tf_static", "other"]


@dataclass(frozen=True, slots=True)
class Topic:
    """One channel of a log.

    Attributes:
        name: as recorded, `/scan`; for CARMEN logs the message name, `FLASER`.
        role: what mapcli can use it for.
        type: message type as recorded, `sensor_msgs/msg/LaserScan`.
        encoding: `cdr`, `json`, `carmen`...
        count: messages.
        first_ns, last_ns: log times of the first and the last message (0, 0 when unknown).
    """

    name: str
    role: Role
    type: str
    encoding: str
    count: int
    first_ns: int = 0
    last_ns: int = 0


@dataclass(frozen=True)
class LogOptions:
    """How a log is to be read (`Input` in `mapcli slam-replay --help`).

    Attributes:
        scan_topic, odom_topic: by name; None finds the only candidate.
        laser_pose: overrides the mount that the log tells.
        time_source: `header` uses the stamp inside a message, `log` the time it was recorded at.
        strict: refuse a damaged log instead of using what can be read.
    """

    scan_topic: str | None = None
    odom_topic: str | None = None
    laser_pose: Mount | None = None
    time_source: Literal["header", "log"] = "header"
    strict: bool = False


@dataclass
class Damage:
    """Counts what was wrong with a log while it is read (mutable; one per reading).

    Keys are short sentences that make sense after a number: "scans with a stamp that jumps back".
    """

    counts: dict[str, int] = field(default_factory=dict)

    def add(self, what: str, times: int = 1) -> None:
        if times:
            self.counts[what] = self.counts.get(what, 0) + times

    def lines(self) -> list[str]:
        return [f"{times:,} {what}" for what, times in self.counts.items()]
