"""The summary at the end of an MCAP file: where the data end, and how many messages there are.

A file of which bytes were lost or added has its summary elsewhere than its footer says; then it is
searched for by the record that ends the data.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Schema, Statistics

from mapcli.formats.file_role import MCAP_MAGIC
from mapcli.formats.logs.mcap.chunks import records
from mapcli.formats.logs.mcap.container_records import INDEX, RECORD, add_description

FOOTER = struct.Struct("<BQQQI")
"""Opcode, length, start of the summary, start of the summary's offsets, checksum."""
DATA_END_BYTES = RECORD.size + 4

BAD_SUMMARY = "tables of contents that cannot be read"
MOVED = "tables of contents that are not where the file says"
CUT_SHORT = "files cut short"

MAX_SUMMARY_BYTES = 1 << 24
"""A summary is searched for in so many bytes at the end of the file."""

_DATA_END = RECORD.pack(Opcode.DATA_END, 4)
_SUMMARY_OPCODES = frozenset(
    (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX,
     Opcode.STATISTICS, Opcode.METADATA_INDEX, Opcode.SUMMARY_OFFSET, Opcode.FOOTER)
)  # fmt: skip
_ERRORS = (McapError, struct.error, OverflowError, MemoryError, UnicodeDecodeError, ValueError)


@dataclass
class Summary:
    """What a file says of itself at its end.

    Attributes:
        end: of the data section; of the file where that is not known.
        finished: whether the file's recorder came to its end.
        problem: what is wrong, and at which byte; None for a file that is as it should be.
        statistics: channel -> messages; None where the summary does not tell.
        indexed: the same from the indexes of chunks: messages outside chunks are not in it.
    """

    end: int
    finished: bool
    problem: tuple[str, int] | None = None
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    statistics: dict[int, int] | None = None
    indexed: dict[int, int] = field(default_factory=dict)

    @property
    def doubtful(self) -> bool:
        """Whether it contradicts its checksum."""
        return self.problem is not None and self.problem[0] == BAD_SUMMARY


def read_summary(file: BinaryIO) -> Summary:
    """The summary of a file, wherever it stands, as far as it can be read."""
    size = file.seek(0, 2)
    tail = size - len(MCAP_MAGIC) - FOOTER.size
    file.seek(max(tail, 0))
    ending = file.read()
    if tail < len(MCAP_MAGIC) or not ending.endswith(MCAP_MAGIC):
        return _found(file, size, (CUT_SHORT, size))
    opcode, length, start, _, checksum = FOOTER.unpack(ending[: FOOTER.size])
    if opcode != Opcode.FOOTER or length != FOOTER.size - RECORD.size:
        return _found(file, size, (CUT_SHORT, size))
    end = (start or tail) - DATA_END_BYTES
    possible = len(MCAP_MAGIC) <= end <= tail
    file.seek(end if possible else size)
    content = file.read()
    signed = content[DATA_END_BYTES : tail - end + FOOTER.size - 4]
    agrees = bool(checksum) and zlib.crc32(signed) == checksum
    if not (agrees or (content.startswith(_DATA_END) and not checksum)):
        return _found(file, size, (BAD_SUMMARY, tail), checksum)
    summary = Summary(end, finished=True)
    if not content.startswith(_DATA_END):
        summary.problem = BAD_SUMMARY, end
    _take(summary, content[DATA_END_BYTES : tail - end])
    return summary


def _found(file: BinaryIO, size: int, problem: tuple[str, int], checksum: int = 0) -> Summary:
    """The summary of a file whose footer leads nowhere, if there is one."""
    start = max(size - MAX_SUMMARY_BYTES, len(MCAP_MAGIC))
    file.seek(start)
    content = file.read()
    at = content.rfind(_DATA_END)
    while at >= 0:
        following = content[at + DATA_END_BYTES :]
        if len(following) > RECORD.size and following[0] in _SUMMARY_OPCODES:
            signed = following[: -len(MCAP_MAGIC) - 4]
            summary = Summary(start + at, finished=True, problem=problem)
            if checksum and zlib.crc32(signed) == checksum:
                summary.problem = MOVED, problem[1]
            _take(summary, following)
            if summary.channels:
                return summary
        at = content.rfind(_DATA_END, 0, at)
    cut = problem[0] == CUT_SHORT
    return Summary(size if cut else size - len(MCAP_MAGIC), finished=False, problem=problem)


def _take(summary: Summary, content: bytes) -> None:
    """Read the records of a summary; those that cannot be read are left out."""
    indexes: list[ChunkIndex] = []
    found, whole = records(content)
    for opcode, start, end in found:
        part = content[start:end]
        try:
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                add_description(summary.schemas, summary.channels, opcode, part)
            elif opcode == Opcode.STATISTICS:
                summary.statistics = _statistics(part)
            elif opcode == Opcode.CHUNK_INDEX:
                indexes.append(ChunkIndex.read(ReadDataStream(BytesIO(part))))
        except _ERRORS:
            whole = False
    summary.indexed = {} if summary.doubtful else _indexed(indexes)
    if not whole and summary.problem is None:
        summary.problem = BAD_SUMMARY, summary.end


def _statistics(content: bytes) -> dict[int, int] | None:
    """Messages by channel; None where they contradict their sum."""
    statistics = Statistics.read(ReadDataStream(BytesIO(content)))
    counts = dict(statistics.channel_message_counts)
    return counts if sum(counts.values()) == statistics.message_count else None


def _indexed(indexes: list[ChunkIndex]) -> dict[int, int]:
    """Messages by channel, by the lengths of the indexes behind each chunk."""
    counts: Counter[int] = Counter()
    for index in indexes:
        at = index.chunk_start_offset + index.chunk_length
        end = at + index.message_index_length
        starts = sorted(
            (offset, channel) for channel, offset in index.message_index_offsets.items()
        )
        if not starts or starts[0][0] != at:
            continue
        stops = [offset for offset, _ in starts[1:]] + [end]
        sizes = [stop - offset - RECORD.size - INDEX.size
                 for (offset, _), stop in zip(starts, stops, strict=True)]  # fmt: skip
        if any(size < 0 or size % 16 for size in sizes):
            continue
        counts.update(
            {channel: size // 16 for (_, channel), size in zip(starts, sizes, strict=True)}
        )
    return dict(counts)
