"""The bytes of a log, plain or packed, in blocks and in lines.

Of a damaged stream, what comes before the damage is used.
"""

from __future__ import annotations

import lzma
import zlib
from collections.abc import Iterator
from typing import Any, BinaryIO, Protocol

import zstandard

from mapcli.formats.logs.log import Source
from mapcli.formats.packed import PACKINGS, Packing, packing_of
from mapcli.model.log import Damage

BLOCK_BYTES = 1 << 16
LONGEST_MAGIC = max(len(packing.magic) for packing in PACKINGS)
MAX_LINE_BYTES = 1 << 20
"""A longer line (20,000 beams have 200 kB) is no message; it is skipped and not held in memory."""

MAX_RATIO, LEAST_LIMIT_BYTES = 500, 1 << 30
"""A log is not packed to less than a five-hundredth; what gives more than that and a gigabyte is
made to fill disks."""

_STEP_BYTES = 512
"""Packed bytes per step. An error loses the output of its whole step, so steps are small."""


class Unpacker(Protocol):
    """What Python's and other libraries' decompressors have in common."""

    @property
    def eof(self) -> bool: ...
    @property
    def unused_data(self) -> bytes: ...
    def decompress(self, data: bytes, /) -> bytes: ...


_FAULTS = (zlib.error, OSError, EOFError, lzma.LZMAError, zstandard.ZstdError, RuntimeError,
           ValueError, MemoryError)  # fmt: skip


def read_blocks(source: Source, damage: Damage) -> Iterator[bytes]:
    """The (unpacked) content in blocks of a bounded size. Damage of the packing is counted."""
    with source.path.open("rb") as file:
        packing = packing_of(file.read(LONGEST_MAGIC))
        file.seek(0)
        if packing is not None:
            yield from _unpacked(file, packing, source.name, damage)
            return
        while block := file.read(BLOCK_BYTES):
            yield block


def _unpacked(file: BinaryIO, packing: Packing, name: str, damage: Damage) -> Iterator[bytes]:
    unpacker, given = packing.unpacker(), 0
    for packed in iter(lambda: file.read(_STEP_BYTES), b""):
        before, step = _copied(unpacker), packed
        try:
            while packed:
                if unpacker.eof:  # packed files may be chained (`cat a.gz b.gz`) and padded
                    if not (packed := packed.lstrip(b"\0")):
                        break
                    unpacker = packing.unpacker()
                    before, step = _copied(unpacker), packed
                content = unpacker.decompress(packed)
                given += len(content)
                yield content
                packed = unpacker.unused_data if unpacker.eof else b""
        except _FAULTS:
            if before is not None:
                yield _up_to_fault(before, step)
            damage.add(
                f"{packing.name} streams broken off, the rest is lost",
                file=name,
                where=f"about byte {file.tell()}",
            )
            return
        if given > max(LEAST_LIMIT_BYTES, MAX_RATIO * file.tell()):
            what = f"{packing.name} streams of far more than a log, the rest is not read"
            damage.add(what, file=name, where=f"byte {file.tell()}")
            return
    if not unpacker.eof:
        damage.add(f"{packing.name} streams without an end", file=name, where=f"byte {file.tell()}")


def _copied(unpacker: Any) -> Any:
    """A copy from which to begin anew; None of those that cannot be copied."""
    copy = getattr(unpacker, "copy", None)
    return copy() if copy else None


def _up_to_fault(unpacker: Unpacker, packed: bytes) -> bytes:
    """What a step gives byte by byte before its fault; all of it if only the checksum is wrong."""
    given = bytearray()
    try:
        for at in range(len(packed)):
            given += unpacker.decompress(packed[at : at + 1])
    except _FAULTS:
        pass
    return bytes(given)


def read_lines(source: Source, damage: Damage) -> Iterator[tuple[int, bytes]]:
    """(number from 1, line without its end) of a text file, plain or packed."""
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
