"""What is known about a log besides its records: its topics, and what was wrong with it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

from mapcli.errors import FormatError
from mapcli.model.counting import counted
from mapcli.model.scan import Mount, Record
from mapcli.model.sweep import BeamOrder, ScanStamp

SensorKind = Literal["distance", "switch", "ground"]
Role = Literal["scan", "range", "cloud", "odometry", "pose", "tf", "tf_static", "other"]
"""What a topic can be used for. Clouds are read as scans where there are no others; poses as
odometry where they are named as such, since they may be the truth, or another tool's estimate."""


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

    def __hash__(self) -> int:
        """Of the name alone: topics are looked up for every message."""
        return hash(self.name)


ALL_TOPICS = "all"
"""In the place of a name: every topic of scans."""


@dataclass(frozen=True)
class LogOptions:
    """How a log is to be read (`Input` in `mapcli slam-replay --help`).

    Attributes:
        scan_topics: by name, one for each laser, or `ALL_TOPICS`; empty finds the only candidate.
        odom_topic: by name; None finds the only candidate.
        laser_pose: overrides the mount that the log tells.
        cloud_height: metres above the sensor of a cloud between which its points count.
        sensors: (topic, mount) of range sensors, instead of what the log tells.
        sensors_file: YAML that says where the sensors of a CSV log sit; None looks beside it.
        time_source: `header` uses the stamp inside a message, `log` the time it was recorded at;
            `auto` stamps, unless they are evidently worse.
        strict: refuse a damaged log instead of using what can be read.
        range_unit, angle_unit: of the readings and the angles of scans.
        one_recording: read what seems to be several recordings as one, instead of refusing it.
        scan_stamp: which beam the stamp of a scan is of.
        turn_time: seconds of a full turn of the laser; None takes the times that the log tells.
        beam_order: in which the beams of the array are taken; None is found out.
    """

    scan_topics: tuple[str, ...] = ()
    odom_topic: str | None = None
    laser_pose: Mount | None = None
    cloud_height: tuple[float, float] = (-0.1, 0.1)
    sensors: tuple[tuple[str, Mount], ...] = ()
    sensors_file: str | None = None
    time_source: Literal["auto", "header", "log"] = "auto"
    strict: bool = False
    one_recording: bool = False
    range_unit: Literal["m", "cm", "mm"] = "m"
    angle_unit: Literal["rad", "deg"] = "rad"
    scan_stamp: ScanStamp = "first"
    turn_time: float | None = None
    beam_order: BeamOrder | None = None


@dataclass(frozen=True, slots=True)
class MissedScans:
    """Scans of a log that cannot be used, in the place where they would be among its records.

    Attributes:
        what: why not; a plural noun.
        lost: to damage of the log. Otherwise they were read, and hold nothing of use.
        count: how many.
        first_ns, last_ns: stamps of the first and the last one; the others lie evenly between
            them. None while they are not known.
    """

    what: str
    lost: bool
    count: int = 1
    first_ns: int | None = None
    last_ns: int | None = None

    @property
    def stamp_ns(self) -> int:
        """Of the first one; its place among the records."""
        assert self.first_ns is not None
        return self.first_ns

    def stamp_of(self, number: int) -> int:
        """Stamp of one of them, nanoseconds; `number` counts from 0."""
        assert self.first_ns is not None
        assert self.last_ns is not None
        return self.first_ns + (self.last_ns - self.first_ns) * number // max(self.count - 1, 1)

    def part(self, start: int, stop: int) -> MissedScans:
        """Those from a number to before another."""
        first, last = self.stamp_of(start), self.stamp_of(max(stop - 1, start))
        return replace(self, count=stop - start, first_ns=first, last_ns=last)


Entry = Record | MissedScans
"""What a log holds in one place."""


@dataclass
class Damage:
    """Counts what was wrong with a log while it is read (mutable; one per reading).

    Keys are plural nouns with what is wrong with them, without a verb that would have to agree
    with the number: "scans with a stamp that jumps back".

    Attributes:
        counts: what -> how often, in all of the log that was read.
        first: what -> where for the first time.
        missed: why -> scans that cannot be used, of those asked for; scans_lost: how many of them
            were lost to damage.
        scans_read: good scans, of those asked for.
    """

    counts: dict[str, int] = field(default_factory=dict)
    first: dict[str, str] = field(default_factory=dict)
    missed: dict[str, int] = field(default_factory=dict)
    scans_lost: int = 0
    scans_read: int = 0

    def add(
        self, what: str, times: int = 1, *, file: str | None = None, where: str | None = None
    ) -> None:
        """Count `what`; `where` in `file` is remembered for the first of a kind."""
        if times:
            self.counts[what] = self.counts.get(what, 0) + times
            if where is not None:
                self.first.setdefault(what, where)

    def miss(self, scans: MissedScans) -> None:
        """Take scans that were asked for and cannot be used into the account."""
        self.missed[scans.what] = self.missed.get(scans.what, 0) + scans.count
        self.scans_lost += scans.count if scans.lost else 0

    def clear(self) -> None:
        self.counts.clear()
        self.first.clear()
        self.missed.clear()
        self.scans_lost = self.scans_read = 0

    @property
    def lost_share(self) -> float:
        """Share of the scans asked for that were lost to damage, as far as is known."""
        return self.scans_lost / max(self.scans_read + sum(self.missed.values()), 1)

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


class StrictDamage(Damage):
    """Refuses the first damage instead of counting it (`--strict`)."""

    def add(
        self, what: str, times: int = 1, *, file: str | None = None, where: str | None = None
    ) -> None:
        if times:
            raise FormatError(
                counted(times, what), file=file, where=where, expected="an undamaged log (--strict)"
            )


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
class SensorCounts:
    """A range sensor with one beam, and what it has read so far (mutable).

    Attributes:
        name: its topic or column.
        kind: `ground` looks at the floor, or up, and is not used; `switch` tells only whether
            something is within its distance.
        mount: where it sits; None where that plays no part.
        range_min, range_max: metres, the same for a switch; field_of_view: radians.
        readings: all; nothing: of these, saw nothing; too_close: something too close to measure;
            invalid: were none.
        least, most: of the distances read, metres; infinite before the first.
    """

    name: str
    kind: SensorKind
    mount: Mount | None
    range_min: float
    range_max: float
    field_of_view: float = 0.0
    readings: int = 0
    nothing: int = 0
    too_close: int = 0
    invalid: int = 0
    least: float = math.inf
    most: float = -math.inf

    def add(self, reading: float) -> None:
        """Count a reading as it was recorded, metres."""
        self.readings += 1
        is_nothing = reading > self.range_max or reading == self.range_max != self.range_min
        self.nothing += is_nothing
        if 0 <= reading < math.inf and not is_nothing:
            self.least, self.most = min(self.least, reading), max(self.most, reading)
        self.invalid += math.isnan(reading) or 0 > reading > -math.inf
        if self.kind == "switch":
            return  # too close to measure is what it tells
        self.too_close += reading == -math.inf or 0 <= reading < self.range_min


@dataclass
class UnitCounts:
    """What the scans read so far say about their units (mutable).

    Attributes:
        scans: all; sampled: of these were looked at.
        too_far: sampled scans with readings that no laser makes, in metres; millimetres: of these,
            those that are rather millimetres than centimetres; middle: the middle reading of the
            last of them.
        turning: sampled scans with angles beyond full turns, in radians; turns: of the last one.
    """

    scans: int = 0
    sampled: int = 0
    too_far: int = 0
    millimetres: int = 0
    middle: float = 0.0
    turning: int = 0
    turns: float = 0.0
