"""The records of an MCAP file that mapcli reads by hand, and where they are.

file    magic, records..., DataEnd, summary records..., Footer, magic
record  opcode (1 byte), length (8 bytes), content
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

MAX_DESCRIPTION_BYTES = 1 << 24
"""A schema or channel longer than this is not one."""

RECORD = struct.Struct("<BQ")
CHUNK = struct.Struct("<QQQII")
"""Start and end time, unpacked size, checksum, length of the compression's name."""
MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time."""
INDEX = struct.Struct("<HI")
"""Channel, bytes of entries (16 each: log time, offset)."""


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
        counts: messages by channel, as indexed behind a chunk; empty when not told.
    """

    offset: int
    end: int
    start_ns: int
    end_ns: int
    chunk: bool
    complete: bool = True
    counts: dict[int, int] = field(default_factory=dict)


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


def chunk_head(file: BinaryIO, offset: int) -> ChunkHead | None:
    """The head of the chunk at an offset; None if its two lengths contradict each other."""
    file.seek(offset)
    head = file.read(RECORD.size + CHUNK.size)
    if len(head) < RECORD.size + CHUNK.size:
        return None
    _, length = RECORD.unpack_from(head)
    start, end, unpacked_size, checksum, letters = CHUNK.unpack_from(head, RECORD.size)
    tail = file.read(letters + 8) if letters <= 64 else b""
    if len(tail) < letters + 8:
        return None
    size = int.from_bytes(tail[letters:], "little")
    if CHUNK.size + letters + 8 + size != length:
        return None
    data = offset + RECORD.size + CHUNK.size + letters + 8
    compression = tail[:letters].decode("utf-8", "replace")
    return ChunkHead(start, end, unpacked_size, checksum, compression, data, size)


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
