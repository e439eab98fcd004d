"""From record to record through an MCAP file, over damage, without unpacking anything.

    file    magic, records..., DataEnd, summary records..., Footer, magic
    record  opcode (1 byte), length (8 bytes), content

The index at the end of a file is missing from interrupted recordings and wrong in some others,
so it is not used: a walk along the records' lengths finds the same chunks, at the cost of a read
per chunk. Where a length leads nowhere, the next record is searched for by its shape.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from mapcli.model.log import Damage

RECORD = struct.Struct("<BQ")
CHUNK = struct.Struct("<QQQII")
"""Start and end time, unpacked size, checksum, length of the compression's name."""
MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time."""
INDEX = struct.Struct("<HI")
"""Channel, bytes of entries (16 each: log time, offset)."""

DATA_OPCODES = frozenset(
    (
        Opcode.HEADER,
        Opcode.SCHEMA,
        Opcode.CHANNEL,
        Opcode.MESSAGE,
        Opcode.CHUNK,
        Opcode.MESSAGE_INDEX,
        Opcode.ATTACHMENT,
        Opcode.METADATA,
        Opcode.DATA_END,
    )
)
PRIVATE_OPCODES = 0x80

BARE_SEGMENT_BYTES = 1 << 20
"""Messages outside chunks are read in stretches of about this."""

MAX_DESCRIPTION_BYTES = 1 << 24
"""A schema or channel longer than this is not one."""

_SEARCH_BYTES = 1 << 20
_SHAPE = re.compile(rb"(?=[\x05\x06][\x00-\xff]{4}\x00{4})")
"""A message or chunk of less than 4 GB, maybe."""


@dataclass(frozen=True, slots=True)
class Place:
    """A record in the file, or (opcode 0) bytes that are none.

    Attributes:
        offset: of its opcode.
        end: of the byte after it; the file's end when it is cut short.
    """

    opcode: int
    offset: int
    end: int
    complete: bool = True


@dataclass(slots=True)
class Segment:
    """Messages that are read at once: a chunk, or some messages outside chunks.

    Attributes:
        offset, end: bytes of its records in the file.
        start_ns, end_ns: log times, as far as told.
        chunk: whether it is one; otherwise message records stand there as they are.
        complete: False for the chunk at which a truncated file ends.
        counts: messages by channel as indexed behind a chunk; empty when not told.
    """

    offset: int
    end: int
    start_ns: int
    end_ns: int
    chunk: bool
    complete: bool = True
    counts: dict[int, int] = field(default_factory=dict)


class Layout:
    """What a walk has found (stateful: `walk` fills it).

    Attributes:
        segments: in file order.
        schemas, channels: by id, those outside chunks.
        spans: channel -> first and last log time, as indexed.
    """

    def __init__(self) -> None:
        self.segments: list[Segment] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.spans: dict[int, tuple[int, int]] = {}


def walk(file: BinaryIO, end: int, finished: bool, name: str, damage: Damage) -> Layout:
    """Find all chunks and loose records between the magic and `end`. Damage is counted.

    Args:
        end: byte after the last record: of the data section if the file was finished.
        finished: otherwise it is no surprise that the last record leads beyond the end.
    """
    layout = Layout()
    for place in places(file, end, finished):
        if place.opcode == 0 or (finished and not place.complete):
            damage.add("gaps of unreadable bytes, skipped", file=name, where=_byte(place))
        if not place.complete:
            if place.opcode == Opcode.CHUNK:
                _add_chunk(layout, file, place)
        elif place.opcode and not _add(layout, file, place):
            damage.add("records of nonsense, skipped", file=name, where=_byte(place))
    return layout


def _byte(place: Place) -> str:
    return f"byte {place.offset}"


def places(file: BinaryIO, end: int, finished: bool) -> Iterator[Place]:
    """The records of the data section in file order, and the gaps between them."""
    at = 8
    while at < end:
        place = _place(file, at, end)
        if place is not None and place.opcode == Opcode.DATA_END:
            if not finished:
                return
            place = None  # the real one is at `end`
        if place is not None and place.complete:
            yield place
            at = place.end
            continue
        resumed = _search(file, at + 1, end)
        if resumed is None:
            yield place or Place(0, at, end)
            return
        yield Place(0, at, resumed)
        at = resumed


def _place(file: BinaryIO, at: int, end: int) -> Place | None:
    """The record at `at`; incomplete if it leads beyond `end`; None if it cannot be one."""
    file.seek(at)
    head = file.read(min(RECORD.size, end - at))
    if len(head) < RECORD.size:
        return Place(head[0], at, end, complete=False) if head[0] in DATA_OPCODES else None
    opcode, length = RECORD.unpack(head)
    if not _possible(opcode, length):
        return None
    stop = at + RECORD.size + length
    return Place(opcode, at, min(stop, end), complete=stop <= end)


def _possible(opcode: int, length: int) -> bool:
    if opcode == Opcode.MESSAGE:
        return length >= MESSAGE.size
    if opcode == Opcode.CHUNK:
        return length >= CHUNK.size + 8
    if opcode == Opcode.MESSAGE_INDEX:
        return length % 16 == INDEX.size
    if opcode == Opcode.DATA_END:
        return length == 4
    return opcode in DATA_OPCODES or opcode >= PRIVATE_OPCODES


def _search(file: BinaryIO, start: int, end: int) -> int | None:
    """Where the next chunk starts, or three records in a row of which the first is a message."""
    for window in range(start, end, _SEARCH_BYTES):
        file.seek(window)
        for match in _SHAPE.finditer(file.read(min(_SEARCH_BYTES + RECORD.size, end - window))):
            at = window + match.start()
            place = _place(file, at, end)
            if place is None or not place.complete:
                continue
            if place.opcode == Opcode.CHUNK:
                if chunk_head(file, place) is not None:
                    return at
            elif _leads_on(file, place.end, end, records=2):
                return at
    return None


def _leads_on(file: BinaryIO, at: int, end: int, records: int) -> bool:
    for _ in range(records):
        if at == end:
            return True
        place = _place(file, at, end)
        if place is None or not place.complete:
            return False
        at = place.end
    return True


@dataclass(frozen=True, slots=True)
class ChunkHead:
    """What a chunk says of itself; `data` is the offset of its content, of `size` bytes."""

    start_ns: int
    end_ns: int
    unpacked_size: int
    checksum: int
    compression: str
    data: int
    size: int


def chunk_head(file: BinaryIO, place: Place | Segment) -> ChunkHead | None:
    """The head of the chunk; None if it contradicts its length."""
    file.seek(place.offset + RECORD.size)
    head = file.read(CHUNK.size)
    if len(head) < CHUNK.size:
        return None
    start, end, unpacked_size, checksum, letters = CHUNK.unpack(head)
    tail = file.read(letters + 8) if letters <= 64 else b""
    if len(tail) < letters + 8:
        return None
    data = place.offset + RECORD.size + CHUNK.size + letters + 8
    size = int.from_bytes(tail[letters:], "little")
    if start > end or (data + size != place.end if place.complete else data + size < place.end):
        return None
    compression = tail[:letters].decode("utf-8", "replace")
    return ChunkHead(start, end, unpacked_size, checksum, compression, data, size)


def _add(layout: Layout, file: BinaryIO, place: Place) -> bool:
    """Take a record into the layout; False if its content is not what its opcode says."""
    if place.opcode == Opcode.CHUNK:
        return _add_chunk(layout, file, place)
    if place.opcode == Opcode.MESSAGE_INDEX:
        return _add_index(layout, file, place)
    if place.opcode == Opcode.MESSAGE:
        _add_message(layout, file, place)
    elif place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
        if place.end - place.offset > MAX_DESCRIPTION_BYTES:
            return False
        file.seek(place.offset + RECORD.size)
        content = file.read(place.end - place.offset - RECORD.size)
        return add_description(layout.schemas, layout.channels, place.opcode, content)
    return True


def add_description(
    schemas: dict[int, Schema], channels: dict[int, Channel], opcode: int, content: bytes
) -> bool:
    """Take a schema or channel record; False if it is malformed."""
    stream = ReadDataStream(BytesIO(content))
    try:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            schemas[schema.id] = schema
        else:
            channel = Channel.read(stream)
            channels[channel.id] = channel
    except (McapError, struct.error, UnicodeDecodeError, OverflowError, MemoryError):
        return False
    return True


def _add_chunk(layout: Layout, file: BinaryIO, place: Place) -> bool:
    head = chunk_head(file, place)
    if head is not None:
        layout.segments.append(
            Segment(place.offset, place.end, head.start_ns, head.end_ns, True, place.complete)
        )
    return head is not None


def _add_index(layout: Layout, file: BinaryIO, place: Place) -> bool:
    file.seek(place.offset + RECORD.size)
    content = file.read(place.end - place.offset - RECORD.size)
    channel, size = INDEX.unpack_from(content)
    if size != len(content) - INDEX.size:
        return False
    times = np.frombuffer(content, dtype="<u8", offset=INDEX.size)[::2]
    if layout.segments and layout.segments[-1].chunk and len(times):
        first, last = int(times.min()), int(times.max())
        segment = layout.segments[-1]
        segment.counts[channel] = segment.counts.get(channel, 0) + len(times)
        known_first, known_last = layout.spans.get(channel, (first, last))
        layout.spans[channel] = min(first, known_first), max(last, known_last)
    return True


def _add_message(layout: Layout, file: BinaryIO, place: Place) -> None:
    file.seek(place.offset + RECORD.size)
    log_time = MESSAGE.unpack(file.read(MESSAGE.size))[2]
    last = layout.segments[-1] if layout.segments else None
    if (
        last is not None
        and not last.chunk
        and last.end == place.offset
        and last.end - last.offset < BARE_SEGMENT_BYTES
    ):
        last.end = place.end
        last.start_ns, last.end_ns = min(last.start_ns, log_time), max(last.end_ns, log_time)
    else:
        layout.segments.append(Segment(place.offset, place.end, log_time, log_time, False))
