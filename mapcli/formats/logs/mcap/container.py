"""The container of an MCAP log: its channels, and its messages in the order of their log times."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from heapq import heappop, heappush, heapreplace
from io import BytesIO
from operator import itemgetter
from typing import BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics

from mapcli.formats.input import MCAP_MAGIC
from mapcli.formats.logs.log import Source
from mapcli.formats.logs.mcap.chunks import ChunkError, records, unpacked
from mapcli.formats.logs.mcap.container_records import (
    MESSAGE,
    RECORD,
    Segment,
    add_description,
)
from mapcli.formats.logs.mcap.recovery import Layout, walk
from mapcli.model.log import Damage

FOOTER = struct.Struct("<BQQQI")
"""Opcode, length, start of the summary, start of the summary's offsets, checksum."""
DATA_END_BYTES = RECORD.size + 4

BAD_SUMMARY = "tables of contents that cannot be read"

MAX_OPEN_SEGMENTS = 64
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
        counts: channel -> messages.
        spans: channel -> first and last log time.
    """

    def __init__(self, source: Source, damage: Damage) -> None:
        self.source = source
        self.damage = damage
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.counts: dict[int, int] = {}
        self.spans: dict[int, tuple[int, int]] = {}
        with source.path.open("rb") as file:
            end, finished, statistics = self._read_summary(file)
            layout = walk(file, end, finished, source.name, damage)
            self._segments = layout.segments
            # Where both describe a channel, the summary wins: it is under a checksum.
            self.schemas = layout.schemas | self.schemas
            self.channels = layout.channels | self.channels
            if statistics is not None and self._all_described():
                self._trust(statistics, layout)
            else:
                self._survey(file)

    def _read_summary(self, file: BinaryIO) -> tuple[int, bool, Statistics | None]:
        """(end of the data section, whether the file was finished, its statistics if any)."""
        size = file.seek(0, 2)
        tail = size - len(MCAP_MAGIC) - FOOTER.size
        file.seek(max(tail, 0))
        ending = file.read()
        if tail < len(MCAP_MAGIC) or not ending.endswith(MCAP_MAGIC):
            return self._unfinished(size)
        opcode, length, start, _, checksum = FOOTER.unpack(ending[: FOOTER.size])
        if opcode != Opcode.FOOTER or length != FOOTER.size - RECORD.size:
            return self._unfinished(size)
        end = (start or tail) - DATA_END_BYTES
        file.seek(max(end, 0))
        content = file.read() if len(MCAP_MAGIC) <= end <= tail else b""
        summary = content[DATA_END_BYTES : tail - end]
        signed = content[DATA_END_BYTES : tail - end + FOOTER.size - 4]
        if not content.startswith(RECORD.pack(Opcode.DATA_END, 4)) or (
            checksum and zlib.crc32(signed) != checksum
        ):
            self._complain(BAD_SUMMARY, f"byte {tail}")
            return size - len(MCAP_MAGIC), False, None
        return end, True, self._take_summary(summary)

    def _unfinished(self, size: int) -> tuple[int, bool, None]:
        self._complain("files cut short", f"byte {size}")
        return size, False, None

    def _complain(self, what: str, where: str) -> None:
        self.damage.add(what, file=self.source.name, where=where)

    def _take_summary(self, summary: bytes) -> Statistics | None:
        statistics = None
        try:
            for opcode, start, end in records(summary):
                if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    add_description(self.schemas, self.channels, opcode, summary[start:end])
                elif opcode == Opcode.STATISTICS:
                    statistics = Statistics.read(ReadDataStream(BytesIO(summary[start:end])))
        except (ChunkError, McapError, struct.error, OverflowError, MemoryError):
            self._complain(BAD_SUMMARY, "at the end")
            return None
        return statistics

    def _all_described(self) -> bool:
        """Whether all channels are known, with their schemas."""
        needed = {channel.schema_id for channel in self.channels.values()} - {0}
        return bool(self.channels) and needed <= self.schemas.keys()

    def _trust(self, statistics: Statistics, layout: Layout) -> None:
        """Take the counts from the statistics, and the chunks' own counts if they agree."""
        self.counts = dict(statistics.channel_message_counts)
        self.spans = layout.spans
        indexed: Counter[int] = Counter()
        for segment in self._segments:
            indexed.update(segment.counts)
        if indexed != self.counts:
            for segment in self._segments:
                segment.counts = {}

    def _survey(self, file: BinaryIO) -> None:
        """Find channels and counts by unpacking every chunk once (there is no usable summary)."""
        for segment in self._segments:
            segment.counts = {}
            try:
                data = unpacked(file, segment)
                for opcode, start, end in records(data):
                    if opcode == Opcode.MESSAGE:
                        channel, _, log_time, _ = MESSAGE.unpack_from(data, start)
                        self._count(segment, channel, log_time)
                    elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                        add_description(self.schemas, self.channels, opcode, data[start:end])
            except ChunkError:
                continue  # counted when the messages are read

    def _count(self, segment: Segment, channel: int, log_time: int) -> None:
        segment.counts[channel] = segment.counts.get(channel, 0) + 1
        self.counts[channel] = self.counts.get(channel, 0) + 1
        first, last = self.spans.get(channel, (log_time, log_time))
        self.spans[channel] = min(first, log_time), max(last, log_time)

    def messages(self, wanted: set[int], damage: Damage) -> Iterator[Message]:
        """The messages of these channels, sorted by log time and by place in the file.

        Chunks whose times overlap are unpacked at the same time, no others.
        """
        waiting = sorted(
            (s for s in self._segments if not s.counts or wanted & s.counts.keys()),
            key=lambda segment: (segment.start_ns, segment.offset),
        )
        missing = sum(self.counts.get(channel, 0) for channel in wanted)
        with self.source.path.open("rb") as file:
            for message in self._merged(file, waiting, wanted, damage):
                missing -= 1
                yield message
        if missing > 0:
            what = "messages lost that the file should hold"
            damage.add(what, missing, file=self.source.name)

    def _merged(
        self, file: BinaryIO, waiting: list[Segment], wanted: set[int], damage: Damage
    ) -> Iterator[Message]:
        open_: list[tuple[int, int, Message, Iterator[Message]]] = []
        for segment in waiting:
            while open_ and (open_[0][0] < segment.start_ns or len(open_) >= MAX_OPEN_SEGMENTS):
                yield _advance(open_)
            messages = iter(self._load(file, segment, wanted, damage))
            if (first := next(messages, None)) is not None:
                heappush(open_, (first.log_time_ns, segment.offset, first, messages))
        while open_:
            yield _advance(open_)

    def _load(
        self, file: BinaryIO, segment: Segment, wanted: set[int], damage: Damage
    ) -> list[Message]:
        messages: list[Message] = []
        try:
            data = unpacked(file, segment)
            view = memoryview(data)
            for opcode, start, end in records(data):
                if opcode == Opcode.MESSAGE:
                    channel, _, log_time, _ = MESSAGE.unpack_from(data, start)
                    if channel in wanted:
                        messages.append(
                            Message(log_time, channel, view[start + MESSAGE.size : end])
                        )
        except ChunkError as error:
            if segment.complete:  # otherwise counted as a file cut short
                where = f"byte {segment.offset}"
                damage.add(f"chunks {error}", file=self.source.name, where=where)
        messages.sort(key=itemgetter(0))
        return messages


def _advance(open_: list[tuple[int, int, Message, Iterator[Message]]]) -> Message:
    """Take the earliest message, and put its segment's next one in its place."""
    _, offset, message, rest = open_[0]
    following = next(rest, None)
    if following is None:
        heappop(open_)
    else:
        heapreplace(open_, (following.log_time_ns, offset, following, rest))
    return message
