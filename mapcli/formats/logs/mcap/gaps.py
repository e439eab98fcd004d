"""When the messages were recorded that damage has taken out of an MCAP file."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from operator import attrgetter
from statistics import median_low
from typing import NamedTuple

from mapcli.formats.logs.mcap.container_records import Segment
from mapcli.formats.logs.message_file import NOTHING, Message

LEAST_HOLE = 1.5
"""Periods without a message from which on one may be missing."""


class Gap(NamedTuple):
    """A time of which messages may be lost: log times of what is there before and after it."""

    start_ns: int
    end_ns: int

    @property
    def duration_ns(self) -> int:
        return max(self.end_ns - self.start_ns, 0)


def gaps_between(segments: Sequence[Segment], offsets: Sequence[int]) -> list[Gap]:
    """Unreadable bytes at these offsets, by the segments before and after them."""
    gaps = []
    for offset in offsets:
        at = bisect_left(segments, offset, key=attrgetter("offset"))
        before, after = segments[max(at - 1, 0) : at], segments[at : at + 1]
        if before or after:
            start_ns = before[0].end_ns if before else after[0].start_ns
            gaps.append(Gap(start_ns, after[0].start_ns if after else start_ns))
    return gaps


def hole(segment: Segment, times: Sequence[int]) -> Gap:
    """The longest time without a message in a damaged segment.

    Args:
        times: log times of the messages that were found in it, nanoseconds.
    """
    every = sorted((*times, segment.start_ns, segment.end_ns))
    return max((Gap(*pair) for pair in pairwise(every)), key=attrgetter("duration_ns"))


def holes(times: Sequence[int]) -> list[Gap]:
    """Where messages are missing that come at a steady rate; if nowhere, then at the end.

    Args:
        times: log times of those that are there, sorted, nanoseconds.
    """
    steps = [Gap(*pair) for pair in pairwise(times)]
    period = median_low(step.duration_ns for step in steps) if steps else 0
    longer = [step for step in steps if step.duration_ns > LEAST_HOLE * period]
    # Of n + 1 periods in a hole, n ended with a message.
    found = [Gap(step.start_ns, step.end_ns - period) for step in longer]
    return found or [Gap(time, time) for time in times[-1:] or (0,)]


def shared_out(count: int, gaps: Sequence[Gap]) -> Iterator[tuple[int, int]]:
    """So many messages laid into gaps, in proportion to their durations.

    Yields:
        Log times of what is before them, nanoseconds, and how many.
    """
    total, passed, laid = sum(gap.duration_ns for gap in gaps), 0, 0
    for number, gap in enumerate(gaps, start=1):
        passed += gap.duration_ns
        # In whole numbers: a file may claim more messages than a float can count.
        upto = count * passed // total if total else count * number // len(gaps)
        if upto > laid:
            yield gap.start_ns, upto - laid
            laid = upto


def lost_in(segment: Segment, messages: list[Message], wanted: set[int]) -> list[Message]:
    """What a segment should hold besides the messages found in it."""
    found = Counter(message.channel for message in messages)
    if all(found[channel] >= segment.told.get(channel, 0) for channel in wanted):
        return []
    start_ns = hole(segment, [message.log_time_ns for message in messages]).start_ns
    counts = {channel: segment.told.get(channel, 0) - found[channel] for channel in sorted(wanted)}
    return [Message(start_ns, channel, NOTHING, n) for channel, n in counts.items() if n > 0]
