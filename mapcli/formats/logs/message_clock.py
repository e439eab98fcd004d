"""When messages are from: by their stamps, as long as the times of their recording do not show that
these are wrong.

Stamps are set where something is measured, times of recording come with the delays of a network. So
stamps are taken, but

- none at all, where the first messages show that they do not tell the time: one stamp for messages
  that differ, clocks of scans and odometry that are apart or go at another rate;
- shifted, after they leap to where the times of recording do not go: somebody set the clock. All
  topics are shifted alike, and those that were set by as much stay together to the nanosecond.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice, pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

from mapcli.formats.logs.clock_faults import APART_S, FEWEST, REPEATED_SHARE
from mapcli.formats.logs.decoded_messages import Decoded
from mapcli.formats.logs.odometry_track import SET_BACK_S
from mapcli.formats.logs.recording_break import duration
from mapcli.model.clock import Clock, Delay
from mapcli.model.log import MissedScans, Topic
from mapcli.model.scan import LATEST_STAMP_S, NANOSECONDS

FIRST_MESSAGES = 500
"""Are looked at before the log is read: some ten seconds."""

SET_NS = round(SET_BACK_S * NANOSECONDS)
"""A clock that goes by so much more or less than that of the recording, from one message to the
next, was set; or the message came late."""

OTHER_RATE = 1.05
"""Clocks of topics of which one goes so much faster than the other are not the same. No quartz is
off by a thousandth, but times of recording are off by tenths of a second."""

IMPOSSIBLE = -1
"""A time that there is not."""

NO_RATE = 30.0
"""Logs are played, and recorded again, faster or slower than they were; not so much."""


class _Row(NamedTuple):
    """A message: nanoseconds, and what it tells (`_content`)."""

    stamp: int
    log_time: int
    content: Any


class _TopicClock:
    """The stamps of a topic against the times of their recording, nanoseconds (mutable).

    Attributes:
        delay: how much later than at its time a message is recorded as a rule; it drifts.
        shift: is added to stamps; time: of the last message.
    """

    def __init__(self, delay: int, shift: int) -> None:
        self.delay, self.shift = delay, shift
        self.time: int | None = None


class MessageClocks:
    """The times of the messages of a log, in the order of recording (stateful).

    Attributes:
        clock: which is taken, and why; is kept up to date.
        delays: topic -> how much later than stamped its messages were recorded.
    """

    def __init__(self, clock: Clock, is_free: bool, topics: Iterable[Topic]) -> None:
        """Args:
        is_free: the other clock may be taken, or stamps be shifted, where it is better. Whether
            they may be shifted is decided again by the first messages: a log that was played, and
            recorded again, faster than it was has gaps of another length.
        """
        self.clock = clock
        self.delays = {topic.name: Delay() for topic in topics}
        self._is_free = is_free
        self._topics: dict[str, _TopicClock] = {}
        self._shifts = [0]

    def look_at(self, messages: Iterable[Decoded]) -> None:
        """Find out what the stamps are worth by the first of the messages, none of which is kept:
        clouds are large."""
        if not self._is_free:
            return
        kinds = _by_topic(islice(messages, FIRST_MESSAGES))
        if why := _what_is_wrong(kinds):
            self.clock.source, self.clock.why = "log", why
        self._is_free = bool(kinds) and all(map(_keeps_pace, kinds.values()))
        for name, rows in kinds.items():
            usual = [row.log_time - row.stamp for row in rows[:FEWEST]]
            self._topics[name] = _TopicClock(round(float(np.median(usual))), 0)

    def timed(self, messages: Iterable[Decoded]) -> Iterator[Decoded]:
        """The messages, each with its time in the place of its log time, nanoseconds; it may be
        none that there is."""
        for log_time, topic, message, part, doubtful in messages:
            time = log_time
            if not isinstance(message, MissedScans):
                known = self._time_beside_damage if doubtful else self._time
                time = known(message.stamp_ns, log_time, topic.name)
            yield time, topic, message, part, doubtful

    def _time(self, stamp: int, log_time: int, topic: str) -> int:
        """When a message is from, nanoseconds; also counts its delay."""
        is_possible = _is_possible(stamp)
        if is_possible and stamp:
            self.delays[topic].add(log_time - stamp)
        if self.clock.source == "log":
            return log_time
        if not stamp and log_time:
            self.clock.why = (
                self.clock.why or f"{topic}: stamps of 0, the time of recording is used"
            )
        if not (is_possible and stamp and self._is_free):
            return stamp or log_time
        return self._on_one_clock(stamp, log_time, topic)

    def _time_beside_damage(self, stamp: int, log_time: int, topic: str) -> int:
        """When a doubtful message is from: never, where its stamp is off from when it was recorded
        by more than those of others. It tells nothing about the clocks."""
        if self.clock.source == "log" or not stamp:
            return log_time
        own = self._topics.get(topic)
        is_usual = self.delays[topic].is_usual(log_time - stamp)
        return stamp + (own.shift if own else 0) if is_usual else IMPOSSIBLE

    def _on_one_clock(self, stamp: int, log_time: int, topic: str) -> int:
        """The time of a message, on the clock that the log began with."""
        late = log_time - stamp
        own = self._topics.get(topic)
        if own is None:
            own = self._topics[topic] = _TopicClock(late - self._shifts[-1], self._shifts[-1])
        if abs(late - own.shift - own.delay) <= SET_NS:
            own.delay = late - own.shift
        elif late - own.shift < own.delay or stamp + own.shift < (own.time or 0) - SET_NS:
            # Set ahead, or set back; else the recording was late.
            own.shift = self._known_shift(late - own.delay)
        own.time = stamp + own.shift
        return own.time

    def _known_shift(self, shift: int) -> int:
        """A shift, or one that is known already and about as large."""
        known = min(self._shifts, key=lambda one: abs(one - shift))
        if abs(known - shift) <= SET_NS:
            return known
        way, seconds = "back" if shift > self._shifts[-1] else "ahead", abs(shift) / NANOSECONDS
        self.clock.why = f"a clock was set {way} by {duration(seconds)}, which is taken out"
        self.clock.steps += 1
        self._shifts.append(shift)
        return shift


def _by_topic(messages: Iterable[Decoded]) -> dict[str, list[_Row]]:
    """Those with a possible stamp."""
    kinds: dict[str, list[_Row]] = {}
    for log_time, topic, message, _, doubtful in messages:
        is_sound = not doubtful and not isinstance(message, MissedScans)
        if is_sound and _is_possible(message.stamp_ns):
            row = _Row(message.stamp_ns, log_time, _content(message))
            kinds.setdefault(topic.name, []).append(row)
    return kinds


def _what_is_wrong(kinds: Mapping[str, Sequence[_Row]]) -> str:
    """Why the stamps of a log are not to be used, by its first messages; empty if they may be."""
    kinds = {name: rows for name, rows in kinds.items() if len(rows) >= FEWEST}
    if any(_repeats(rows, "log_time") for rows in kinds.values()):
        return ""  # the times of recording are no better
    for name, rows in kinds.items():
        if _repeats(rows, "stamp"):
            return f"one stamp on many messages of {name}"
    return _rates(kinds) or _offsets(kinds)


def _repeats(rows: Sequence[_Row], clock: Literal["stamp", "log_time"]) -> bool:
    """Whether a clock, that of the stamps or of recording, stays while messages change."""
    changes = [(a, b) for a, b in pairwise(rows) if not _tell_the_same(a.content, b.content)]
    same = sum(getattr(a, clock) == getattr(b, clock) for a, b in changes)
    return len(changes) >= FEWEST - 1 and same > REPEATED_SHARE * len(changes)


def _keeps_pace(rows: Sequence[_Row]) -> bool:
    """Whether a second of recording is a second of the stamps, as long as neither clock is set."""
    steps = [(b.stamp - a.stamp, b.log_time - a.log_time) for a, b in pairwise(rows)]
    usual = [step for step in steps if abs(step[0] - step[1]) <= SET_NS]
    stamped, recorded = (sum(step[k] for step in usual) for k in (0, 1))
    return stamped < OTHER_RATE * recorded + SET_NS and recorded < OTHER_RATE * stamped + SET_NS


def _rates(kinds: Mapping[str, Sequence[_Row]]) -> str:
    """Stamps go faster or slower than those of another topic, or than anything is recorded."""
    rates: dict[str, float] = {}
    for name, rows in kinds.items():
        third = len(rows) // 3
        before, after = (np.median([row[:2] for row in part], axis=0)
                         for part in (rows[:third], rows[-third:]))  # fmt: skip
        stamped, recorded = (float(step) for step in after - before)
        if stamped > 0 and recorded >= NANOSECONDS:
            rates[name] = stamped / recorded
    if not rates:
        return ""
    slow, fast = min(rates, key=rates.__getitem__), max(rates, key=rates.__getitem__)
    for name in (slow, fast):
        if abs(math.log(rates[name])) > math.log(NO_RATE):
            return f"a second of recording is {rates[name]:.3g} s in the stamps of {name}"
    ratio = rates[fast] / rates[slow]
    if ratio <= OTHER_RATE:
        return ""
    return f"stamps of {fast} go {ratio:.3g} times as fast as those of {slow}"


def _offsets(kinds: Mapping[str, Sequence[_Row]]) -> str:
    """Messages of one topic are recorded much longer after their stamps than those of another."""
    delays = {
        name: float(np.median([row.log_time - row.stamp for row in rows])) / NANOSECONDS
        for name, rows in kinds.items()
    }
    if not delays:
        return ""
    low, high = min(delays, key=delays.__getitem__), max(delays, key=delays.__getitem__)
    apart = delays[high] - delays[low]
    return f"stamps of {high} and {low} are {duration(apart)} apart" if apart > APART_S else ""


def _content(message: Any) -> Any:
    """What a message tells, to compare it with the one before; None where it surely changes."""
    pose = getattr(message, "pose", None)
    return (pose.x, pose.y, pose.theta) if pose is not None else getattr(message, "ranges", None)


def _tell_the_same(one: Any, other: Any) -> bool:
    return one is not None and np.array_equal(one, other, equal_nan=True)


def _is_possible(stamp_ns: int) -> bool:
    return 0 <= stamp_ns < LATEST_STAMP_S * NANOSECONDS
