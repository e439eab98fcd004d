"""Unpacking the chunks of an MCAP file; of a damaged or truncated one, what can be salvaged."""

from __future__ import annotations

import zlib
from collections.abc import Container
from io import BytesIO
from typing import BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap.opcode import Opcode

from mapcli import memory
from mapcli.formats.logs.mcap.container_records import (
    RECORD,
    ChunkHead,
    Segment,
    add_description,
    chunk_head,
    reads_like_message,
)
from mapcli.formats.logs.mcap.frames import lz4_start, zstd_start
from mapcli.formats.logs.mcap.places import LEAST_LENGTHS, places

DESCRIPTIONS = frozenset(map(int, (Opcode.SCHEMA, Opcode.CHANNEL)))
"""Records that tell what messages are."""

MAX_UNPACKED_BYTES = 1 << 30
"""No recorder writes larger chunks; a broken size must not exhaust the memory."""
USED = frozenset(
    map(int, (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.STATISTICS, Opcode.CHUNK_INDEX))
)
"""Records in chunks and in the summary that are of use."""
MAX_RATIO, LEAST_LIMIT_BYTES = 500, 1 << 24
"""Nor does a chunk of more than 16 MB hold 500 times its size."""


class ChunkError(Exception):
    """A chunk is damaged; the text completes "chunks ..."."""


class Content(NamedTuple):
    """The records of a segment, one after another.

    Attributes:
        trouble: why they may be wrong or not all; completes "chunks ...".
        proven: a checksum says that they are as written.
    """

    data: bytes
    trouble: str | None = None
    proven: bool = False


def unpacked(file: BinaryIO, segment: Segment) -> Content:
    """What a segment contains; of a damaged or incomplete chunk, as much as can be unpacked."""
    if not segment.chunk:
        file.seek(segment.offset)
        return Content(file.read(segment.end - segment.offset))
    head = chunk_head(file, segment.offset)
    if head is None:
        return Content(b"", "with a broken head")
    file.seek(head.data)
    room = max(segment.end - head.data, 0)
    packed = file.read(min(head.size, room) if head.consistent else room)
    if not segment.complete:
        return Content(_begun(packed, head))
    if not segment.whole and head.compression == "":
        return _grown(file, packed, head, room)
    try:
        data = _whole(packed, head)
    except ChunkError as error:
        return Content(_begun(packed, head), str(error))
    if head.checksum and zlib.crc32(data) != head.checksum:
        if len(data) != head.unpacked_size and head.compression == "lz4":
            # Bytes are in wrong places from the fault on, though the frame looks sound.
            return Content(_begun(packed, head), "with broken data")
        return Content(data, "with a wrong checksum")
    return Content(data, proven=head.checksum != 0)


def _grown(file: BinaryIO, packed: bytes, head: ChunkHead, room: int) -> Content:
    """An uncompressed chunk that may end later than it says, if its checksum does not agree."""
    if head.checksum and zlib.crc32(packed) == head.checksum:
        return Content(packed)
    file.seek(head.data)
    return Content(file.read(room), "with broken data")


def _whole(packed: bytes, head: ChunkHead) -> bytes:
    limit = _limit(packed)
    try:
        if head.compression == "zstd":
            _refuse_giants(zstandard.frame_content_size(packed), limit)
            size = max(min(head.unpacked_size, limit), 1)
            return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        if head.compression == "lz4":
            _refuse_giants(lz4.frame.get_frame_info(packed)["content_size"], limit)
            return _whole_lz4(packed, limit)
    except (zstandard.ZstdError, RuntimeError, ValueError, MemoryError, EOFError) as error:
        raise ChunkError("with broken data") from error
    if head.compression:
        raise ChunkError(f"with unknown compression {head.compression[:20]!r}")
    if len(packed) < head.size or not head.consistent:
        raise ChunkError("with broken data")
    return packed


def _whole_lz4(packed: bytes, limit: int) -> bytes:
    unpacker = lz4.frame.LZ4FrameDecompressor()
    data = bytes(unpacker.decompress(packed, max_length=limit))
    if not unpacker.eof:
        raise ChunkError("with broken data")
    return data


def _limit(packed: bytes) -> int:
    """Bytes that a chunk's content has at most."""
    return min(MAX_UNPACKED_BYTES, memory.limit(), max(LEAST_LIMIT_BYTES, MAX_RATIO * len(packed)))


def _refuse_giants(size: int, limit: int) -> None:
    if size > limit:
        raise ChunkError("with broken data")


def _begun(packed: bytes, head: ChunkHead) -> bytes:
    """The part of a chunk's content that is readable, from its start."""
    compression = head.compression if head.compression in ("", "zstd", "lz4") else head.packed_as
    if compression == "zstd":
        return zstd_start(packed, _limit(packed))
    if compression == "lz4":
        return lz4_start(packed, _limit(packed))
    return b"" if compression else packed


def records(
    data: bytes, channels: Container[int] = (), near_ns: int | None = None
) -> tuple[list[tuple[int, int, int]], bool]:
    """(opcode, start, end) of the contents of records in unpacked data, and whether it is sound.

    Where a record leads nowhere, reading goes on at the next one that makes sense.

    Args:
        channels: by which a message is known whose opcode was hit; near_ns: a log time beside.
    """
    found = _sound_records(data, channels, near_ns)
    if found is not None:
        return found, True
    walked = places(BytesIO(data), 0, len(data), channels, finished=True, near_ns=near_ns)
    return [
        (place.opcode, place.offset + RECORD.size, place.end)
        for place in walked
        if place.opcode in USED and place.complete
    ], False


def _sound_records(
    data: bytes, channels: Container[int], near_ns: int | None
) -> list[tuple[int, int, int]] | None:
    """The same if each record leads to the next and the last one to the end."""
    found = []
    unpack, head, least = RECORD.unpack_from, RECORD.size, LEAST_LENGTHS
    at, end, message = 0, len(data), int(Opcode.MESSAGE)
    last = end - head
    while at <= last:
        opcode, length = unpack(data, at)
        start = at + head
        at = start + length
        if not opcode or at > end or length < least.get(opcode, 0):
            return None
        if opcode in USED:
            found.append((opcode, start, at))
        if opcode != message and channels:
            content = data[start:at]
            hit = reads_like_message(opcode, length, content, channels, near_ns)
            if hit and not _describes(opcode, content):
                return None
    return found if at == end else None


def _describes(opcode: int, content: bytes) -> bool:
    """Whether a record is a schema or a channel, and sound."""
    return opcode in DESCRIPTIONS and add_description({}, {}, opcode, content)
