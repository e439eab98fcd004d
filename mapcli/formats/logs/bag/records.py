"""The records of a ROS 1 bag, and where they are, also behind damage.

file    "#ROSBAG V2.0\\n", records...
record  length of the header (4 bytes), header, length of the data (4 bytes), data
header  fields: length (4 bytes), name=value; the field `op` says what the record is

A chunk holds connections and messages, packed; indexes of its messages follow it. All connections
once more, and an overview of the chunks, end a bag whose recorder came to its end.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import BinaryIO, NamedTuple

from mapcli.model.scan import NANOSECONDS

MAGIC = b"#ROSBAG V2.0\n"

MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)
"""Values of `op`."""

MAX_HEADER_BYTES = 1 << 16
"""Names of topics are shorter; what is longer is no header."""

LEAST_HEADER_BYTES = 8
"""Of a header with a field `op`."""

LENGTH = struct.Struct("<I")
TIME = struct.Struct("<II")
INDEXED = struct.Struct("<III")
"""Of each message in an index: its time, and its place in the chunk."""

OP_FIELD = b"\x04\0\0\0op="
SEARCHED_BYTES = 1 << 20

FARTHEST_OP = 512
"""Bytes after the beginning of a record at which its field `op` is looked for."""

Fields = dict[bytes, bytes]
Read = Callable[[int, int], bytes]


class Record(NamedTuple):
    """A record, or (op 0) bytes that are none.

    Attributes:
        fields: of its header.
        offset: of the record; data: of its data, `size` bytes.
        complete: False where it leads beyond the end of the file.
    """

    op: int
    fields: Fields
    offset: int
    data: int
    size: int
    complete: bool = True

    @property
    def end(self) -> int:
        return self.data + self.size

    def number(self, name: bytes) -> int:
        """A field of four bytes; -1 where there is none."""
        value = self.fields.get(name, b"")
        return LENGTH.unpack(value)[0] if len(value) == LENGTH.size else -1

    def time_ns(self, name: bytes = b"time") -> int:
        """A field with a time; -1 where there is none."""
        value = self.fields.get(name, b"")
        return nanoseconds(*TIME.unpack(value)) if len(value) == TIME.size else -1


def nanoseconds(seconds: int, rest: int) -> int:
    return seconds * NANOSECONDS + rest


def fields_of(header: bytes) -> Fields | None:
    """The fields of a header; None if it is none."""
    fields, at = Fields(), 0
    while at < len(header):
        if at + LENGTH.size > len(header):
            return None
        (length,) = LENGTH.unpack_from(header, at)
        field = header[at + LENGTH.size : at + LENGTH.size + length]
        name, equals, value = field.partition(b"=")
        if len(field) < length or not equals or not name.isascii():
            return None
        fields[name] = value
        at += LENGTH.size + length
    op = fields.get(b"op", b"")
    return fields if len(op) == 1 and MESSAGE <= op[0] <= CONNECTION else None


def records_in(data: bytes | memoryview, offset: int = 0) -> Iterator[Record]:
    """The records of a chunk's content, up to the first bytes that are none."""
    read, size = _slices(memoryview(data)), len(data)
    while (record := _record_at(read, offset, size)) is not None:
        yield record
        if not record.complete:
            return
        offset = record.end


def _record_at(read: Read, offset: int, size: int) -> Record | None:
    """The record there; None if there is none.

    Args:
        read: gives the bytes at an offset, as many as asked for or as there are; size: of all.
    """
    (length,) = LENGTH.unpack(read(offset, LENGTH.size).ljust(LENGTH.size, b"\0"))
    if not LEAST_HEADER_BYTES <= length <= MAX_HEADER_BYTES:
        return None
    start = offset + LENGTH.size
    header = read(start, length + LENGTH.size)
    fields = fields_of(header[:length]) if len(header) >= length else None
    if fields is None:
        return None
    (data_size,) = LENGTH.unpack(header[length:].ljust(LENGTH.size, b"\0"))
    data = start + length + LENGTH.size
    return Record(fields[b"op"][0], fields, offset, data, data_size, data + data_size <= size)


def _slices(data: memoryview) -> Read:
    return lambda offset, count: bytes(data[offset : offset + count])


def _reads(file: BinaryIO) -> Read:
    def read(offset: int, count: int) -> bytes:
        file.seek(offset)
        return file.read(count)

    return read


def walk(file: BinaryIO, size: int) -> Iterator[Record]:
    """The records of a file one after another; over bytes that are none, to the next record.

    Args:
        size: of the file, bytes.
    """
    offset, read = len(MAGIC), _reads(file)
    while offset < size:
        record = _record_at(read, offset, size)
        if record is None:
            found = _next_record(file, offset + 1, size)
            yield Record(0, {}, offset, offset, found - offset, found < size)
            offset = found
            continue
        if not record.complete and (found := _next_record(file, record.data, size)) < size:
            record = record._replace(size=found - record.data, complete=True)  # a broken length
            yield record._replace(op=0) if record.op != CHUNK else record
        else:
            yield record
        offset = record.end


def _next_record(file: BinaryIO, offset: int, size: int) -> int:
    """Where the next record begins; the size of the file if there is none."""
    while offset < size:
        file.seek(offset)
        block = file.read(SEARCHED_BYTES + MAX_HEADER_BYTES)
        read = _slices(memoryview(block))
        for start, op in _possible_starts(block):
            found = _record_at(read, start, len(block))
            if found and found.data > op and _is_followed(file, offset, found, size):
                return offset + start
        offset += SEARCHED_BYTES
    return size


def _possible_starts(block: bytes) -> Iterator[tuple[int, int]]:
    """Where a record may begin, some bytes before each field `op`, the nearest first; and where
    the field is."""
    op = -1
    while 0 <= (op := block.find(OP_FIELD, op + 1)) < SEARCHED_BYTES:
        for start in range(op - LENGTH.size, max(op - FARTHEST_OP, 0) - 1, -1):
            yield start, op


def _is_followed(file: BinaryIO, offset: int, record: Record, size: int) -> bool:
    """Whether another record comes after one, or the end. Packed content has some that are none."""
    end = offset + record.end
    return end == size or (end < size and _record_at(_reads(file), end, size) is not None)
