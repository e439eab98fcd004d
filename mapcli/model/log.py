"""What is known about a log besides its records: its topics, and what was wrong with it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal

from mapcli.model.counting import counted
from mapcli.model.scan import Mount, Odometry, RangeScan, Record

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
        one_recording: read what seems to be several recordings as one, instead of refusing it.
    """

    scan_topic: str | None = None
    odom_topic: str | None = None
    laser_pose: Mount | None = None
    time_source: Literal["header", "log"] = "header"
    strict: bool = False
    one_recording: bool = False


class Loss(Enum):
    """What a piece of damage cost."""

    SCAN = "a scan that was read and cannot be used"
    LOST_SCAN = "a scan that was in the log and cannot be read"
    OTHER = "anything else"


@dataclass
class Damage:
    """Counts what was wrong with a log while it is read (mutable; one per reading).

    Keys are plural nouns with what is wrong with them, without a verb that would have to agree
    with the number: "scans with a stamp that jumps back".

    Attributes:
        scans_read: good scans, of the whole log as far as it was read.
    """

    counts: dict[str, int] = field(default_factory=dict)
    first: dict[str, str] = field(default_factory=dict)
    losses: dict[str, Loss] = field(default_factory=dict)
    scans_read: int = 0

    def add(
        self, what: str, times: int = 1, *, loss: Loss = Loss.OTHER,
        file: str | None = None, where: str | None = None,
    ) -> None:  # fmt: skip
        """Count `what`; `where` in `file` is remembered for the first of a kind."""
        if times:
            self.counts[what] = self.counts.get(what, 0) + times
            self.losses[what] = loss
            if where is not None:
                self.first.setdefault(what, where)

    def clear(self) -> None:
        self.counts.clear()
        self.first.clear()
        self.losses.clear()
        self.scans_read = 0

    def unusable_scans(self) -> dict[str, int]:
        """What cost scans -> how many."""
        return self._scans(Loss.SCAN, Loss.LOST_SCAN)

    @property
    def lost_share(self) -> float:
        """Share of the log's scans that were lost to damage, as far as is known."""
        lost = sum(self._scans(Loss.LOST_SCAN).values())
        return lost / (self.scans_read + sum(self.unusable_scans().values())) if lost else 0.0

    def _scans(self, *losses: Loss) -> dict[str, int]:
        return {what: times for what, times in self.counts.items() if self.losses[what] in losses}

    def lines(self) -> list[str]:
        """What was wrong, one sentence per kind: "3 lines without a valid message (line 17)"."""
        return [
            f"{counted(times, what)}{self._place(what, times)}"
            for what, times in self.counts.items()
        ]

    def _place(self, what: str, times: int) -> str:
        if what not in self.first:
            return ""
        return f" ({'first: ' if times > 1 else ''}{self.first[what]})"


@dataclass
class BeamCounts:
    """What became of the beams of the scans read so far (mutable; REP 117's kinds).

    Attributes:
        total: all beams.
        no_return: nothing within the sensor's range (+inf).
        too_close: something nearer than the sensor can measure (-inf).
        invalid: no reading (NaN, zero or negative in the log).
    """

    total: int = 0
    no_return: int = 0
    too_close: int = 0
    invalid: int = 0


@dataclass
class Delay:
    """How much later than stamped messages were recorded, nanoseconds (mutable)."""

    count: int = 0
    total_ns: int = 0
    least_ns: int = 0
    most_ns: int = 0

    def add(self, delay_ns: int) -> None:
        if delay_ns < self.least_ns or not self.count:
            self.least_ns = delay_ns
        if delay_ns > self.most_ns or not self.count:
            self.most_ns = delay_ns
        self.count += 1
        self.total_ns += delay_ns

    @property
    def mean_s(self) -> float:
        return self.total_ns / max(self.count, 1) * 1e-9


def select(
    records: Iterable[Record],
    start_s: float | None = None,
    end_s: float | None = None,
    every: int = 1,
) -> Iterator[Record]:
    """Every `every`-th scan from `start_s` to `end_s`, with the odometry around them.

    Args:
        records: in stamp order.
        start_s, end_s: seconds after the first record; None is the log's own start or end.
        every: 1 keeps all scans.

    Yields:
        The scans of that window, all odometry in it, and the last odometry before and the first
        one after it, between which the poses at the first and the last scan are interpolated.
    """
    scans = 0
    for record in _window(records, start_s, end_s):
        if isinstance(record, RangeScan):
            scans += 1
            if (scans - 1) % every:
                continue
        yield record


def _window(
    records: Iterable[Record], start_s: float | None, end_s: float | None
) -> Iterator[Record]:
    origin: int | None = None
    before: Record | None = None
    for record in records:
        origin = record.stamp_ns if origin is None else origin
        elapsed = (record.stamp_ns - origin) * 1e-9
        if start_s is not None and elapsed < start_s:
            before = record if isinstance(record, Odometry) else before
            continue
        if before is not None:
            yield before
            before = None
        if end_s is None or elapsed <= end_s:
            yield record
        elif isinstance(record, Odometry):
            yield record
            return
        elif elapsed > end_s + LAST_ODOMETRY_S:
            return


LAST_ODOMETRY_S = 10.0
"""How long `select` looks for odometry beyond the end before it gives up, seconds."""
