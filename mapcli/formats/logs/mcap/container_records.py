"""The records of an MCAP file that mapcli reads by hand, and where they are.

file    magic, records..., DataEnd, summary records..., Footer, magic
record  opcode (1 byte), length (8 bytes), content
"""

from __future__ import annotations

import struct
from collections.abc import Container
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from mapcli.formats.logs.message_file import most_of
from mapcli.formats.packed import LZ4_MAGIC, ZSTD_MAGIC
from mapcli.model.scan import NANOSECONDS

MAX_DESCRIPTION_BYTES = 1 << 24
"""A schema or channel longer than this is not one."""

RECORD = struct.Struct("<BQ")
CHUNK = struct.Struct("<QQQII")
"""Start and end time, unpacked size, checksum, length of the compression's name."""
MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time."""
MAX_NAME_BYTES = 64
NAME_LENGTHS = len("zstd"), len("lz4"), 0
MAGICS = {ZSTD_MAGIC: "zstd", LZ4_MAGIC: "lz4"}
"""First bytes of a chunk's content -> how it is compressed."""

NEAR_NS = 3600 * NANOSECONDS
"""Messages are not farther from those around them; nonsense is."""

INDEX = struct.Struct("<HI")
"""Channel, bytes of entries (16 each: log time, offset)."""
FARTHEST_OFFSET = 1 << 40
"""Of a message in a chunk; as a time, 18 minutes after 1970."""


@dataclass(frozen=True, slots=True)
class Place:
    """A record in the file, or (opcode 0) bytes that are none.

    Attributes:
        offset: of its opcode.
        end: of the byte after it; the file's end when it is cut short.
        complete: False where it leads beyond the file's end.
        whole: False for a chunk whose head is broken or whose end is elsewhere than it says, and
            for a message known by its content.
    """

    opcode: int
    offset: int
    end: int
    complete: bool = True
    whole: bool = True


@dataclass(slots=True)
class Segment:
    """Messages that are read at once: a chunk, or some messages outside chunks.

    Attributes:
        offset, end: bytes of its records in the file.
        start_ns, end_ns: log times, as far as told.
        chunk: whether it is one; otherwise message records stand there as they are.
        complete: False for the chunk at which a truncated file ends.
        whole: False for a chunk whose head is broken or whose end is elsewhere than it says.
        told: messages by channel, as the index behind a chunk tells.
        counts: messages by channel that were found in a survey.
        surveyed: whether there was one, which told its damage.
    """

    offset: int
    end: int
    start_ns: int
    end_ns: int
    chunk: bool
    complete: bool = True
    whole: bool = True
    told: dict[int, int] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    surveyed: bool = False

    def held(self) -> dict[int, int]:
        """Messages by channel that were in it, those included that are lost."""
        return most_of(self.told, self.counts)


@dataclass(frozen=True, slots=True)
class ChunkHead:
    """What a chunk says of itself; `data` is the offset of its content, of `size` bytes.

    Attributes:
        length: of the record; `consistent` where it agrees with `size`.
        packed_as: what the first bytes of its content say: zstd, lz4 or nothing.
    """

    start_ns: int
    end_ns: int
    unpacked_size: int
    checksum: int
    compression: str
    data: int
    size: int
    consistent: bool
    packed_as: str


def chunk_head(file: BinaryIO, offset: int) -> ChunkHead | None:
    """The head of the chunk at an offset, whatever its opcode; None if there cannot be one."""
    file.seek(offset)
    content = file.read(RECORD.size + CHUNK.size + MAX_NAME_BYTES + 8 + 4)
    if len(content) < RECORD.size + CHUNK.size + 8:
        return None
    _, length = RECORD.unpack_from(content)
    start, end, unpacked_size, checksum, told = CHUNK.unpack_from(content, RECORD.size)
    name = RECORD.size + CHUNK.size
    sizes = {
        letters: int.from_bytes(content[name + letters :][:8], "little")
        for letters in (told, *NAME_LENGTHS)  # the one told may be broken, too
        if letters <= MAX_NAME_BYTES and name + letters + 8 <= len(content)
    }
    agreeing = [n for n, size in sizes.items() if CHUNK.size + n + 8 + size == length]
    letters = agreeing[0] if agreeing else told
    if letters not in sizes:
        return None
    data = name + letters + 8
    return ChunkHead(
        start, end, unpacked_size, checksum,
        content[name : name + letters].decode("utf-8", "replace"), offset + data, sizes[letters],
        consistent=bool(agreeing),
        packed_as=MAGICS.get(content[data : data + 4], ""),
    )  # fmt: skip


def reads_like_message(
    opcode: int, length: int, content: bytes, channels: Container[int], near_ns: int | None
) -> bool:
    """Whether a record is a message though its opcode tells otherwise: that byte was hit.

    Args:
        length: of its content; content: the first `MESSAGE.size` bytes of it, or more.
        channels: that are known.
        near_ns: log time of a message beside it; None where none is known.
    """
    if length < MESSAGE.size or len(content) < MESSAGE.size:
        return False
    channel, number, log_time, publish_time = MESSAGE.unpack_from(content)
    near = abs(log_time - (publish_time if near_ns is None else near_ns)) <= NEAR_NS
    # An index has the time of a message where messages have theirs; an offset in a chunk follows.
    entries = length - INDEX.size
    told = number == entries or (opcode == Opcode.MESSAGE_INDEX and publish_time < FARTHEST_OFFSET)
    is_index = entries % 16 == 0 and told
    return channel in channels and log_time > 0 and near and not is_index


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
