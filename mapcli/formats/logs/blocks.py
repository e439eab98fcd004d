"""The bytes of a log, plain or gzip, in blocks and in lines.

Of a damaged gzip stream, what comes before the damage is used.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import BinaryIO

from mapcli.formats.input import GZIP_MAGIC
from mapcli.formats.logs.log import Source
from mapcli.model.log import Damage

BLOCK_BYTES = 1 << 16
MAX_LINE_BYTES = 1 << 20
"""A longer line (20,000 beams have 200 kB) is no message; it is skipped and not held in memory."""

_GZIP_FORMAT = 31
"""zlib's `wbits` for a gzip header."""

_STEP_BYTES = 512
"""Packed bytes per step. An error loses the output of its whole step, so steps are small."""


def read_blocks(source: Source, damage: Damage) -> Iterator[bytes]:
    """The (unpacked) content in blocks of a bounded size. Damage of the packing is counted."""
    with source.path.open("rb") as file:
        packed = file.read(len(GZIP_MAGIC)) == GZIP_MAGIC
        file.seek(0)
        if packed:
            yield from _unpacked(file, source.name, damage)
            return
        while block := file.read(BLOCK_BYTES):
            yield block


def _unpacked(file: BinaryIO, name: str, damage: Damage) -> Iterator[bytes]:
    unpacker = zlib.decompressobj(_GZIP_FORMAT)
    for packed in iter(lambda: file.read(_STEP_BYTES), b""):
        before, step = unpacker.copy(), packed
        try:
            while packed:
                if unpacker.eof:  # gzip files may be chained (`cat a.gz b.gz`) and padded
                    if not (packed := packed.lstrip(b"\0")):
                        break
                    unpacker = zlib.decompressobj(_GZIP_FORMAT)
                    before, step = unpacker.copy(), packed
                yield unpacker.decompress(packed)
                packed = unpacker.unused_data
        except zlib.error:
            yield _up_to_fault(before, step)
            damage.add(
                "gzip streams broken off, the rest is lost",
                file=name,
                where=f"about byte {file.tell()}",
            )
            return
    if not unpacker.eof:
        damage.add("gzip streams without an end", file=name, where=f"byte {file.tell()}")


def _up_to_fault(unpacker: zlib._Decompress, packed: bytes) -> bytes:
    """What a step gives byte by byte before its fault; all of it if only the checksum is wrong."""
    given = bytearray()
    try:
        for at in range(len(packed)):
            given += unpacker.decompress(packed[at : at + 1])
    except zlib.error:
        pass
    return bytes(given)


def read_lines(source: Source, damage: Damage) -> Iterator[tuple[int, bytes]]:
    """(number from 1, line without its end) of a text file, plain or gzip."""
    number, tail = 1, b""
    for block in read_blocks(source, damage):
        *lines, tail = (tail + block).split(b"\n")
        yield from enumerate(lines, number)
        number += len(lines)
        if len(tail) > MAX_LINE_BYTES:
            damage.add("lines of more than 1 MB", file=source.name, where=f"line {number}")
            tail = b""
    if tail:
        yield number, tail
