"""Unpacking the chunks of an MCAP file; of a damaged or truncated one, what can be salvaged."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from typing import BinaryIO

import lz4.frame
import zstandard
from mcap.opcode import Opcode

from mapcli.formats.logs.mcap.container_records import (
    MESSAGE,
    RECORD,
    ChunkHead,
    Segment,
    chunk_head,
)

MAX_UNPACKED_BYTES = 1 << 30
"""No recorder writes larger chunks; a broken size must not exhaust the memory."""

_STEP_BYTES = 4096


class ChunkError(Exception):
    """A chunk cannot be used; the text completes "chunks ..."."""


def unpacked(file: BinaryIO, segment: Segment) -> bytes:
    """The records of a segment, one after another.

    Of an incomplete chunk, what can be unpacked of its part.

    Raises:
        ChunkError: wrong checksum, unknown compression, broken data.
    """
    if not segment.chunk:
        file.seek(segment.offset)
        return file.read(segment.end - segment.offset)
    head = chunk_head(file, segment.offset)
    if head is None:
        raise ChunkError("with a broken head")
    if head.compression not in ("", "zstd", "lz4"):
        raise ChunkError(f"with unknown compression {head.compression[:20]!r}")
    file.seek(head.data)
    packed = file.read(min(head.size, segment.end - head.data))
    if not segment.complete:
        return _begun(packed, head)
    data = _whole(packed, head)
    if head.checksum and zlib.crc32(data) != head.checksum:
        raise ChunkError("with a wrong checksum")
    return data


def _whole(packed: bytes, head: ChunkHead) -> bytes:
    try:
        if head.compression == "zstd":
            _refuse_giants(zstandard.frame_content_size(packed))
            size = max(min(head.unpacked_size, MAX_UNPACKED_BYTES), 1)
            return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        if head.compression == "lz4":
            _refuse_giants(lz4.frame.get_frame_info(packed)["content_size"])
            return bytes(lz4.frame.decompress(packed))
    except (zstandard.ZstdError, RuntimeError, ValueError, MemoryError, EOFError) as error:
        raise ChunkError("with broken data") from error
    return packed


def _refuse_giants(size: int) -> None:
    if size > MAX_UNPACKED_BYTES:
        raise ChunkError("with broken data")


def _begun(packed: bytes, head: ChunkHead) -> bytes:
    """The part of a chunk's content that its first bytes hold."""
    if not head.compression:
        return packed
    step: Callable[[bytes], bytes]
    if head.compression == "zstd":
        step = zstandard.ZstdDecompressor().decompressobj().decompress
    else:
        step = lz4.frame.LZ4FrameDecompressor().decompress
    parts: list[bytes] = []
    try:
        for at in range(0, len(packed), _STEP_BYTES):
            parts.append(step(packed[at : at + _STEP_BYTES]))
            if sum(map(len, parts)) > MAX_UNPACKED_BYTES:
                break
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
        pass  # what was unpacked before the damage is all there is
    return b"".join(parts)


def records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """(opcode, start, end) of the contents of the records in unpacked data.

    Raises:
        ChunkError: a record leads beyond the end.
    """
    at, end = 0, len(data)
    while at < end:
        try:
            opcode, length = RECORD.unpack_from(data, at)
        except struct.error:
            raise ChunkError("that end within a record") from None
        at += RECORD.size
        if length > end - at or (opcode == Opcode.MESSAGE and length < MESSAGE.size):
            raise ChunkError("that end within a record")
        yield opcode, at, at + length
        at += length
