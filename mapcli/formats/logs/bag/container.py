"""The container of a ROS 1 bag: its connections, and its messages in the order of their times.

The index at the end is missing from interrupted recordings (`.bag.active`), which rosbag therefore
refuses; here it is not needed: a walk along the lengths of the records finds the same chunks. What
an index tells of their content is used where it is there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterator
from operator import itemgetter
from typing import BinaryIO

import numpy as np

from mapcli.errors import FormatError
from mapcli.formats.logs.bag.chunks import Chunk, Content, content_of, messages_in
from mapcli.formats.logs.bag.records import (
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    INDEXED,
    LENGTH,
    MAGIC,
    MESSAGE,
    Record,
    fields_of,
    walk,
)
from mapcli.formats.logs.log import Source
from mapcli.formats.logs.losses import LossLedger
from mapcli.formats.logs.message_file import NOTHING, Message, Stream
from mapcli.model.log import Damage
from mapcli.model.scan import NANOSECONDS

ENCODING = "ros1"


class BagFile:
    """One ROS 1 bag, open for reading; keeps the places of its chunks, never their contents.

    Attributes:
        streams: the connections, by their numbers.
        counts, spans, complete: as of `MessageFile`.

    Raises:
        FormatError: another version of the format.
    """

    def __init__(self, source: Source, damage: Damage) -> None:
        self.source = source
        self.streams: dict[int, Stream] = {}
        self.spans: dict[int, tuple[int, int]] = {}
        self._chunks: list[Chunk] = []
        self._overview: dict[int, Chunk] = {}  # by the offsets of chunks, as the index tells
        with source.path.open("rb") as file:
            version = file.readline(len(MAGIC)).rstrip().decode(errors="replace")
            if version.encode() != MAGIC.rstrip():
                raise FormatError(
                    f"is {version[1:]!r}", file=source.name,
                    expected="a bag of version 2.0, as `rosbag migrate` makes it",
                )  # fmt: skip
            size = file.seek(0, 2)
            self.complete = self._walk(file, size, damage)
            self._survey(file, damage)
        held: Counter[int] = Counter()
        for chunk in [*self._chunks, *self._overview.values()]:
            held.update(chunk.held())
        self.counts = {number: count for number, count in held.items() if number in self.streams}

    def _walk(self, file: BinaryIO, size: int, damage: Damage) -> bool:
        """Find the chunks and what is told of them; whether an overview tells of all."""
        name, offsets = self.source.name, dict[int, Chunk]()
        for record in walk(file, size):
            if record.op == 0:
                place = f"byte {record.offset}"
                damage.add("gaps of unreadable bytes, skipped", file=name, where=place)
                self._forget_index()
            elif record.op == CHUNK:
                offsets[record.offset] = self._add_chunk(record)
            elif record.complete:
                self._add(file, record)
        is_ended = bool(self._overview) or not self._chunks
        if not is_ended:
            damage.add("files cut short", file=name, where=f"byte {size}")
            self._forget_index()
        for offset in self._overview.keys() & offsets.keys():
            found, told = offsets[offset], self._overview.pop(offset)
            found.told = told.told or found.told
            found.start_ns, found.end_ns = told.start_ns, told.end_ns
        return is_ended

    def _forget_index(self) -> None:
        """What is told of the last chunk may be of a part of its connections only."""
        if self._chunks:
            self._chunks[-1].told.clear()

    def _add(self, file: BinaryIO, record: Record) -> None:
        if record.op == MESSAGE:
            self._add_bare(record)
        elif record.op == CONNECTION:
            self._add_connection(record, _data(file, record))
        elif record.op == INDEX and self._chunks:
            self._add_index(record, _data(file, record))
        elif record.op == CHUNK_INFO:
            self._add_overview(record, _data(file, record))

    def _add_chunk(self, record: Record) -> Chunk:
        compression = record.fields.get(b"compression", b"none").decode("ascii", "replace")
        chunk = Chunk(record.data, record.size, compression, complete=record.complete)
        self._chunks.append(chunk)
        return chunk

    def _add_bare(self, record: Record) -> None:
        """A message outside of chunks: the last chunk of a recorder that was killed has no length,
        and what it holds is found one by one."""
        time = record.time_ns()
        chunk = Chunk(record.offset, record.end - record.offset, "none", time, time)
        last = self._chunks[-1] if self._chunks else None
        if last is not None and last.counts and last.data + last.size == record.offset:
            last.size, chunk = record.end - last.data, last
        else:
            self._chunks.append(chunk)
        self._count(chunk, record.number(b"conn"), 1, time, time)

    def _add_connection(self, record: Record, data: bytes) -> None:
        """A connection: the topic stands in the header, the type in the data."""
        described = fields_of(data + _OP)
        topic = record.fields.get(b"topic", b"").decode(errors="replace")
        number = record.number(b"conn")
        if described is not None and topic and number not in self.streams:
            type_name = described.get(b"type", b"").decode(errors="replace")
            self.streams[number] = Stream(topic, type_name, ENCODING)

    def _add_index(self, record: Record, data: bytes) -> None:
        if record.number(b"ver") != 1 or len(data) % INDEXED.size or not data:
            return
        seconds, rest, _ = np.frombuffer(data, "<u4").reshape(-1, 3).T.astype(np.int64)
        times = NANOSECONDS * seconds + rest
        chunk, number = self._chunks[-1], record.number(b"conn")
        chunk.told[number] = len(times)
        self._span(chunk, number, int(times.min()), int(times.max()))

    def _add_overview(self, record: Record, data: bytes) -> None:
        place = record.fields.get(b"chunk_pos", b"")
        if record.number(b"ver") != 1 or len(place) != 8 or len(data) % 8:
            return
        told = dict(np.frombuffer(data, "<u4").reshape(-1, 2).tolist())
        first, last = record.time_ns(b"start_time"), record.time_ns(b"end_time")
        self._overview[int.from_bytes(place, "little")] = Chunk(
            0, 0, "none", first, last, told, complete=False
        )

    def _survey(self, file: BinaryIO, damage: Damage) -> None:
        """Unpack, once, the chunks of which it is not told what they hold."""
        known = all(chunk.held().keys() <= self.streams.keys() for chunk in self._chunks)
        for chunk in self._chunks:
            if known and (chunk.told or chunk.counts):
                continue
            content = content_of(file, chunk)
            for record in content.records:
                if record.op == CONNECTION:
                    data = content.data[record.data : record.end]
                    self._add_connection(record, data)
            if chunk.told or chunk.counts:
                continue
            if content.trouble and chunk.complete:
                damage.add(f"chunks {content.trouble}", file=self.source.name,
                           where=f"byte {chunk.data}")  # fmt: skip
            for time, number, _ in messages_in(content):
                self._count(chunk, number, 1, time, time)

    def _count(self, chunk: Chunk, number: int, count: int, first: int, last: int) -> None:
        chunk.counts[number] = chunk.counts.get(number, 0) + count
        self._span(chunk, number, first, last)

    def _span(self, chunk: Chunk, number: int, first: int, last: int) -> None:
        chunk.start_ns = min(chunk.start_ns or first, first)
        chunk.end_ns = max(chunk.end_ns, last)
        before = self.spans.get(number, (first, last))
        self.spans[number] = min(before[0], first), max(before[1], last)

    def messages(
        self, wanted: set[int], damage: Damage, scans: Container[int] = ()
    ) -> Iterator[Message]:
        """The messages of these connections, chunk by chunk, in a chunk by their times."""
        ledger = LossLedger(self.source.name, damage, scans)
        chunks = [c for c in (*self._chunks, *self._overview.values()) if wanted & c.held().keys()]
        with self.source.path.open("rb") as file:
            for chunk in sorted(chunks, key=lambda chunk: chunk.start_ns):
                yield from self._load(file, chunk, wanted, ledger)

    def _load(
        self, file: BinaryIO, chunk: Chunk, wanted: set[int], ledger: LossLedger
    ) -> list[Message]:
        content = content_of(file, chunk) if chunk.size else Content(b"", [], None)
        if content.trouble and chunk.complete and chunk.told:
            ledger.damage.add(f"chunks {content.trouble}", file=self.source.name,
                              where=f"byte {chunk.data}")  # fmt: skip
        view = memoryview(content.data)
        doubtful = content.trouble is not None
        messages = [
            Message(time, number, view[record.data : record.end], doubtful=doubtful)
            for time, number, record in messages_in(content)
            if number in wanted
        ]
        found = Counter(message.channel for message in messages)
        time = max((message.log_time_ns for message in messages), default=chunk.start_ns)
        lost = (
            Message(time, number, NOTHING, count - found[number])
            for number, count in sorted(chunk.told.items())
            if number in wanted and count > found[number]
        )
        messages += ledger.told(lost)
        messages.sort(key=itemgetter(0))
        return messages


_OP = LENGTH.pack(4) + b"op=" + bytes([CONNECTION])
"""What makes the description of a connection, which is fields without an `op`, a header."""


def _data(file: BinaryIO, record: Record) -> bytes:
    file.seek(record.data)
    return file.read(record.size)
