"""The container of an MCAP log: its channels, and its messages in the order of their log times."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Container, Iterator, Mapping
from heapq import heappop, heappush, heapreplace, merge
from operator import itemgetter
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from mapcli.formats.logs.log import Source
from mapcli.formats.logs.losses import LossLedger
from mapcli.formats.logs.mcap.chunks import records, unpacked
from mapcli.formats.logs.mcap.container_records import (
    MESSAGE,
    NEAR_NS,
    Segment,
    add_description,
)
from mapcli.formats.logs.mcap.gaps import Gap, gaps_between, hole, holes, lost_in, shared_out
from mapcli.formats.logs.mcap.recovery import walk
from mapcli.formats.logs.mcap.summary_section import read_summary
from mapcli.formats.logs.message_file import NOTHING, Message, Stream
from mapcli.model.log import Damage

MAX_OPEN_SEGMENTS, MAX_OPEN_BYTES = 64, 1 << 28
"""Overlapping chunks that are held unpacked at most; beyond, `Log` restores the order of stamps."""


class McapFile:
    """One MCAP file, open for reading; keeps the places of its chunks, never their contents.

    Attributes:
        damage: what was wrong with its structure when it was opened.
        schemas, channels: by id.
        counts: channel -> messages, as the file tells; where it does not, those found.
        complete: whether `counts` are all that were in the file, lost ones included.
        spans: channel -> first and last log time.
    """

    def __init__(self, source: Source, damage: Damage) -> None:
        self.source = source
        self.damage = damage
        self.counts: dict[int, int] = {}
        self.spans: dict[int, tuple[int, int]] = {}
        with source.path.open("rb") as file:
            summary = read_summary(file)
            if summary.problem is not None:
                what, byte = summary.problem
                damage.add(what, file=source.name, where=f"byte {byte}")
            layout = walk(
                file, summary.end, summary.finished, summary.channels, source.name, damage
            )
            self._segments = layout.segments
            # Where both describe a channel, the summary wins if its checksum is right.
            self.schemas = layout.schemas | summary.schemas
            self.channels = layout.channels | summary.channels
            if summary.doubtful:
                self.schemas |= layout.schemas
                self.channels |= layout.channels
            self._gaps = gaps_between(self._segments, layout.gaps)
            agreed = summary.statistics is not None and self._tell_of(summary.statistics)
            if agreed and self._all_described() and not summary.doubtful:
                self.spans = layout.spans
            else:
                self._gaps += self._survey(file, doubtful=summary.doubtful)
            self._count_missing(summary.statistics or summary.indexed)
        self.complete = summary.statistics is not None or (summary.finished and not self._gaps)

    @property
    def streams(self) -> dict[int, Stream]:
        """The channels, with their schemas."""
        streams = {}
        for number, channel in self.channels.items():
            schema = self.schemas.get(channel.schema_id)
            name, text = (schema.name, schema.data) if schema else ("", b"")
            streams[number] = Stream(channel.topic, name, channel.message_encoding, text)
        return streams

    def _all_described(self) -> bool:
        """Whether all channels are known, with their schemas."""
        needed = {channel.schema_id for channel in self.channels.values()} - {0}
        return bool(self.channels) and needed <= self.schemas.keys()

    def _tell_of(self, statistics: dict[int, int]) -> bool:
        """Whether the segments tell of as many messages as the summary does."""
        told: Counter[int] = Counter()
        for segment in self._segments:
            told.update(segment.told)
        return told == Counter(statistics)

    def _survey(self, file: BinaryIO, *, doubtful: bool) -> list[Gap]:
        """Find channels and counts by unpacking every chunk once.

        That is needed where the summary is missing, or what it says is not what is there. Gaps are
        in chunks of which it is not told how much they held.
        """
        gaps: list[Gap] = []
        for segment in self._segments:
            content = _content(file, segment, self.channels)
            if self._describe(content, certain=segment.chunk and doubtful):
                content = _content(file, segment, self.channels)  # more is known to be a message
            data, found, trouble = content
            segment.surveyed, times = True, list[int]()
            for opcode, start, _ in found:
                if opcode == Opcode.MESSAGE:
                    channel, _, log_time, _ = MESSAGE.unpack_from(data, start)
                    if channel not in self.channels:
                        trouble = trouble or "with messages of unknown channels"
                    elif trouble is None or _is_sensible(segment, log_time):
                        self._count(segment, channel, log_time)
                        times.append(log_time)
            if trouble is None:
                segment.told = {}  # what else an index tells is wrong
            else:
                _tell(self.damage, trouble, segment, self.source.name)
                if not segment.told:
                    gaps.append(hole(segment, times))
        return gaps

    def _count_missing(self, told: Mapping[int, int]) -> None:
        """Find out how many messages are in no segment, by what the summary tells."""
        held: Counter[int] = Counter()
        for segment in self._segments:
            held.update(segment.held())
        self._missing = Counter(told) - held
        counts = held + self._missing
        self.counts = {channel: counts[channel] for channel in self.channels if counts[channel]}

    def _describe(self, content: Content, *, certain: bool) -> bool:
        """Take schemas and channels; those that are not certain only if they are not known yet.

        Returns:
            Whether there was a channel that was not known.
        """
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        for opcode, start, end in content.records:
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                add_description(schemas, channels, opcode, content.data[start:end])
        new = not channels.keys() <= self.channels.keys()
        wins = certain and content.trouble is None
        self.schemas = self.schemas | schemas if wins else schemas | self.schemas
        self.channels = self.channels | channels if wins else channels | self.channels
        return new

    def _count(self, segment: Segment, channel: int, log_time: int) -> None:
        segment.counts[channel] = segment.counts.get(channel, 0) + 1
        first, last = self.spans.get(channel, (log_time, log_time))
        self.spans[channel] = min(first, log_time), max(last, log_time)

    def messages(
        self, wanted: set[int], damage: Damage, scans: Container[int] = ()
    ) -> Iterator[Message]:
        """The messages of these channels, sorted by log time and by place in the file.

        Chunks whose times overlap are unpacked at the same time, no others.

        Args:
            scans: channels of which a message that is lost is a lost scan.
        """
        ledger = LossLedger(self.source.name, damage, scans)
        with self.source.path.open("rb") as file:
            messages = self._merged(file, wanted, ledger)
            if wanted & self._missing.keys():
                lost = [m for channel in sorted(wanted) for m in self._lost(file, channel)]
                lost.sort(key=itemgetter(0))
                messages = merge(messages, ledger.told(lost), key=itemgetter(0))
            yield from messages

    def _lost(self, file: BinaryIO, channel: int) -> Iterator[Message]:
        """The messages of a channel that are in no segment, by the times around them."""
        gaps = self._gaps
        if not gaps and self._missing[channel]:
            known = self._merged(file, {channel}, LossLedger(self.source.name, Damage(), ()))
            gaps = holes([message.log_time_ns for message in known])
        for start_ns, count in shared_out(self._missing[channel], gaps):
            yield Message(start_ns, channel, NOTHING, count)

    def _merged(self, file: BinaryIO, wanted: set[int], ledger: LossLedger) -> Iterator[Message]:
        waiting = sorted(
            (segment for segment in self._segments if wanted & segment.held().keys()),
            key=lambda segment: (segment.start_ns, segment.offset),
        )
        open_: list[tuple[int, int, Message, Iterator[Message]]] = []
        starts = [*(segment.start_ns for segment in waiting[1:]), math.inf]
        for segment, next_start in zip(waiting, starts, strict=False):
            while open_ and (open_[0][0] < segment.start_ns or _too_many(open_)):
                yield _advance(open_)
            loaded = self._load(file, segment, wanted, ledger)
            if not open_ and loaded and loaded[-1].log_time_ns < next_start:
                yield from loaded  # as nearly all segments are, it is over before the next begins
                continue
            messages = iter(loaded)
            if (first := next(messages, None)) is not None:
                heappush(open_, (first.log_time_ns, segment.offset, first, messages))
        while open_:
            yield _advance(open_)

    def _load(
        self, file: BinaryIO, segment: Segment, wanted: set[int], ledger: LossLedger
    ) -> list[Message]:
        data, found, trouble = _content(file, segment, self.channels)
        view = memoryview(data)
        messages, doubtful = list[Message](), trouble is not None
        for opcode, start, end in found:
            if opcode == Opcode.MESSAGE:
                channel, _, log_time, _ = MESSAGE.unpack_from(data, start)
                if channel in wanted and (not doubtful or _is_sensible(segment, log_time)):
                    content = view[start + MESSAGE.size : end]
                    messages.append(Message(log_time, channel, content, 0, doubtful))
        if trouble is not None and not segment.surveyed:
            _tell(ledger.damage, trouble, segment, self.source.name)
        messages.extend(ledger.told(lost_in(segment, messages, wanted)))
        messages.sort(key=itemgetter(0))
        return messages


class Content(NamedTuple):
    """What a segment holds: its records (opcode, start, end), and what is wrong or None."""

    data: bytes
    records: list[tuple[int, int, int]]
    trouble: str | None


def _content(file: BinaryIO, segment: Segment, channels: Mapping[int, Channel]) -> Content:
    data, trouble, proven = unpacked(file, segment)
    found, sound = records(data, () if proven else channels, segment.start_ns)
    if not sound and segment.chunk:  # outside chunks, the walk has told
        trouble = trouble or "with broken records"
    return Content(data, found, trouble)


def _tell(damage: Damage, trouble: str, segment: Segment, name: str) -> None:
    if segment.complete:  # otherwise counted as a file cut short
        damage.add(f"chunks {trouble}", file=name, where=f"byte {segment.offset}")


def _is_sensible(segment: Segment, log_time_ns: int) -> bool:
    """Whether a message in damaged content lies in the time of its chunk, or of one beside it."""
    earliest, latest = segment.start_ns - NEAR_NS, segment.end_ns + NEAR_NS
    return not segment.chunk or earliest <= log_time_ns <= latest


def _too_many(open_: list[tuple[int, int, Message, Iterator[Message]]]) -> bool:
    if len(open_) >= MAX_OPEN_SEGMENTS:
        return True
    return sum(memoryview(entry[2].data.obj).nbytes for entry in open_) > MAX_OPEN_BYTES


def _advance(open_: list[tuple[int, int, Message, Iterator[Message]]]) -> Message:
    """Take the earliest message, and put its segment's next one in its place."""
    _, offset, message, rest = open_[0]
    following = next(rest, None)
    if following is None:
        heappop(open_)
    else:
        heapreplace(open_, (following.log_time_ns, offset, following, rest))
    return message
