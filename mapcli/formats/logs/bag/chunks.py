"""The chunks of a ROS 1 bag: what they hold, and unpacking; of a broken one, its start."""

from __future__ import annotations

import bz2
from dataclasses import dataclass, field
from typing import BinaryIO, NamedTuple

import lz4.frame

from mapcli import memory
from mapcli.formats.logs.bag.records import MESSAGE, Record, records_in
from mapcli.formats.logs.mcap.chunks import LEAST_LIMIT_BYTES, MAX_RATIO, MAX_UNPACKED_BYTES
from mapcli.formats.logs.mcap.frames import lz4_start
from mapcli.formats.logs.message_file import most_of

STEP_BYTES = 4096
"""Packed bytes at a time, of a broken bz2 stream."""


@dataclass(slots=True)
class Chunk:
    """Messages that are unpacked at once: a chunk, or records that stand outside of chunks.

    Attributes:
        data, size: bytes of its content in the file.
        compression: `none`, `bz2` or `lz4`.
        start_ns, end_ns: times of its messages, as far as told.
        told: connection -> messages, as the indexes behind it tell, or the overview of the bag.
        counts: the same as found when it was unpacked.
        complete: False for the one in which a file ends.
    """

    data: int
    size: int
    compression: str = "none"
    start_ns: int = 0
    end_ns: int = 0
    told: dict[int, int] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    complete: bool = True

    def held(self) -> dict[int, int]:
        """Connection -> messages that were in it, those included that are lost."""
        return most_of(self.told, self.counts)


class Content(NamedTuple):
    """The records of a chunk, and what is wrong with them or None; completes "chunks ..."."""

    data: bytes
    records: list[Record]
    trouble: str | None


def content_of(file: BinaryIO, chunk: Chunk) -> Content:
    """What a chunk holds; of a broken one, as much as can be unpacked from its start."""
    file.seek(chunk.data)
    packed = file.read(chunk.size)
    data, whole = unpack(packed, chunk.compression)
    found = [record for record in records_in(data) if record.complete]
    end = found[-1].end if found else 0
    trouble = None
    if not whole and chunk.compression not in UNPACKERS:
        trouble = f"with unknown compression {chunk.compression[:20]!r}"
    elif not whole:
        trouble = "with broken data"
    elif end < len(data):
        trouble = "with broken records"
    return Content(data, found, trouble)


def unpack(packed: bytes, compression: str) -> tuple[bytes, bool]:
    """The content, and whether it is all of it."""
    limit = min(MAX_UNPACKED_BYTES, memory.limit(), max(LEAST_LIMIT_BYTES, MAX_RATIO * len(packed)))
    unpacker = UNPACKERS.get(compression)
    return unpacker(packed, limit) if unpacker else (b"", False)


def _none(packed: bytes, limit: int) -> tuple[bytes, bool]:
    return packed, True


def _bz2(packed: bytes, limit: int) -> tuple[bytes, bool]:
    unpacker, content = bz2.BZ2Decompressor(), bytearray()
    for at in range(0, len(packed), STEP_BYTES):
        try:
            content += unpacker.decompress(packed[at : at + STEP_BYTES])
        except (OSError, EOFError):
            break
        if unpacker.eof or len(content) > limit:
            break
    return bytes(content), unpacker.eof


def _lz4(packed: bytes, limit: int) -> tuple[bytes, bool]:
    try:
        unpacker = lz4.frame.LZ4FrameDecompressor()
        content = bytes(unpacker.decompress(packed, max_length=limit))
        if unpacker.eof:
            return content, True
    except (RuntimeError, ValueError, MemoryError, EOFError):
        pass
    return lz4_start(packed, limit), False


UNPACKERS = {"none": _none, "bz2": _bz2, "lz4": _lz4}


def messages_in(content: Content) -> list[tuple[int, int, Record]]:
    """(time, connection, record) of the messages of a chunk."""
    return [
        (record.time_ns(), record.number(b"conn"), record)
        for record in content.records
        if record.op == MESSAGE and record.time_ns() >= 0
    ]
