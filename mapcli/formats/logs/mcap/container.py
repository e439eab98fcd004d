"""The container of an MCAP log: its channels, and its messages in the order of their log times."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterator, Mapping
from heapq import heappop, heappush, heapreplace
from operator import itemgetter
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from mapcli.formats.logs.log import Source
from mapcli.formats.logs.mcap.chunks import records, unpacked
from mapcli.formats.logs.mcap.container_records import MESSAGE, Segment, add_description
from mapcli.formats.logs.mcap.recovery import Layout, walk
from mapcli.formats.logs.mcap.summary_section import Summary, read_summary
from mapcli.model.log import Damage, Loss
from mapcli.model.scan import NANOSECONDS

NEAR_NS = 3600 * NANOSECONDS
"""What is left of the next chunk may follow in a damaged one; it is not as far off as nonsense."""

LOST_SCANS = "scans lost in damaged parts of the file"
LOST_MESSAGES = "messages lost that the file should hold"

MAX_OPEN_SEGMENTS, MAX_OPEN_BYTES = 64, 1 << 28
"""Overlapping chunks that are held unpacked at most; beyond, `Log` restores the order of stamps."""


class Message(NamedTuple):
    """A message as stored; `data` is a view into its chunk."""

    log_time_ns: int
    channel: int
    data: memoryview


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
            if summary.statistics is not None and self._all_described() and not summary.doubtful:
                self._trust(summary.statistics, layout)
            else:
                self._survey(file, summary, layout)
        told = summary.statistics is not None
        self.complete = told or (summary.finished and not layout.gaps)

    def _all_described(self) -> bool:
        """Whether all channels are known, with their schemas."""
        needed = {channel.schema_id for channel in self.channels.values()} - {0}
        return bool(self.channels) and needed <= self.schemas.keys()

    def _trust(self, statistics: dict[int, int], layout: Layout) -> None:
        """Take the counts from the statistics, and the chunks' own counts if they agree."""
        self.counts = dict(statistics)
        self.spans = layout.spans
        told: Counter[int] = Counter()
        for segment in self._segments:
            told.update(segment.told)
        if told == self.counts:
            for segment in self._segments:
                segment.counts = segment.told or None
        elif any(times > self.counts.get(channel, 0) for channel, times in told.items()):
            for segment in self._segments:
                segment.told = {}

    def _survey(self, file: BinaryIO, summary: Summary, layout: Layout) -> None:
        """Find channels and counts by unpacking every chunk once (there is no usable summary)."""
        lost: Counter[int] = Counter()
        for segment in self._segments:
            segment.counts, segment.surveyed = {}, True
            data, found, trouble = _content(file, segment, self.channels)
            for opcode, start, end in found:
                if opcode == Opcode.MESSAGE:
                    channel, _, log_time, _ = MESSAGE.unpack_from(data, start)
                    if trouble is None or _is_sensible(segment, log_time):
                        self._count(segment, channel, log_time)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    certain = trouble is None and segment.chunk and summary.doubtful
                    self._describe(opcode, data[start:end], certain=certain)
            if trouble is not None:
                layout.gaps = layout.gaps or not segment.told
                lost.update(Counter(segment.told) - Counter(segment.counts))
                _tell(self.damage, trouble, segment, self.source.name)
        found_and_lost = Counter(self.counts) + lost
        told = summary.statistics or summary.indexed
        for channel in self.channels:
            times = max(found_and_lost[channel], told.get(channel, 0))
            if times:
                self.counts[channel] = times

    def _describe(self, opcode: int, content: bytes, *, certain: bool) -> None:
        """Take a schema or channel: one that is not certain only if it is not known yet."""
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        add_description(schemas, channels, opcode, content)
        self.schemas = self.schemas | schemas if certain else schemas | self.schemas
        self.channels = self.channels | channels if certain else channels | self.channels

    def _count(self, segment: Segment, channel: int, log_time: int) -> None:
        assert segment.counts is not None
        segment.counts[channel] = segment.counts.get(channel, 0) + 1
        self.counts[channel] = self.counts.get(channel, 0) + 1
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
        waiting = sorted(
            (s for s in self._segments if s.counts is None or wanted & s.counts.keys()),
            key=lambda segment: (segment.start_ns, segment.offset),
        )
        ledger = _Ledger(self.source.name, damage, scans)
        found: Counter[int] = Counter()
        with self.source.path.open("rb") as file:
            for message in self._merged(file, waiting, wanted, ledger):
                found[message.channel] += 1
                yield message
        for channel in sorted(wanted):
            accounted = found[channel] + ledger.lost[channel]
            ledger.lose(channel, self.counts.get(channel, 0) - accounted)

    def _merged(
        self, file: BinaryIO, waiting: list[Segment], wanted: set[int], ledger: _Ledger
    ) -> Iterator[Message]:
        open_: list[tuple[int, int, Message, Iterator[Message]]] = []
        for segment in waiting:
            while open_ and (open_[0][0] < segment.start_ns or _too_many(open_)):
                yield _advance(open_)
            messages = iter(self._load(file, segment, wanted, ledger))
            if (first := next(messages, None)) is not None:
                heappush(open_, (first.log_time_ns, segment.offset, first, messages))
        while open_:
            yield _advance(open_)

    def _load(
        self, file: BinaryIO, segment: Segment, wanted: set[int], ledger: _Ledger
    ) -> list[Message]:
        data, found, trouble = _content(file, segment, self.channels)
        view = memoryview(data)
        messages: list[Message] = []
        for opcode, start, end in found:
            if opcode == Opcode.MESSAGE:
                channel, _, log_time, _ = MESSAGE.unpack_from(data, start)
                if channel in wanted and (trouble is None or _is_sensible(segment, log_time)):
                    messages.append(Message(log_time, channel, view[start + MESSAGE.size : end]))
        if trouble is not None:
            ledger.chunk(trouble, segment, wanted, Counter(m.channel for m in messages))
        messages.sort(key=itemgetter(0))
        return messages


class _Ledger:
    """Counts what was lost while the messages of a file are read (stateful).

    Attributes:
        lost: channel -> messages that are accounted for as lost.
    """

    def __init__(self, name: str, damage: Damage, scans: Container[int]) -> None:
        self.lost: Counter[int] = Counter()
        self._name, self._damage, self._scans = name, damage, scans

    def chunk(self, trouble: str, segment: Segment, wanted: set[int], found: Counter[int]) -> None:
        """A chunk with damage, and what of it was found."""
        if not segment.surveyed:
            _tell(self._damage, trouble, segment, self._name)
        for channel in sorted(wanted):
            self.lose(channel, segment.told.get(channel, 0) - found[channel])

    def lose(self, channel: int, times: int) -> None:
        """Messages of a channel that are lost; none if `times` is negative."""
        if times <= 0:
            return
        self.lost[channel] += times
        if channel in self._scans:
            self._damage.add(LOST_SCANS, times, loss=Loss.LOST_SCAN, file=self._name)
        else:
            self._damage.add(LOST_MESSAGES, times, file=self._name)


def _content(
    file: BinaryIO, segment: Segment, channels: Mapping[int, Channel]
) -> tuple[bytes, list[tuple[int, int, int]], str | None]:
    """What a segment holds, its records, and what is wrong with it or None."""
    data, trouble = unpacked(file, segment)
    found, sound = records(data, channels)
    return data, found, trouble if sound or trouble else "with broken records"


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
