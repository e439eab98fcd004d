"""Files packed by gzip, zstd, bzip2, xz or lz4: which of them, and what unpacks them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

from mapcli.formats.input import GZIP_MAGIC, SNIFFED_BYTES

ZSTD_MAGIC, LZ4_MAGIC = b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18"
"""How frames of these begin, files or parts of files."""


class Packing(NamedTuple):
    """A way to pack a file.

    Attributes:
        name: of what packs; magic: the first bytes of such a file.
        unpacker: makes a decompressor, with `decompress`, `eof` and `unused_data`.
    """

    name: str
    magic: bytes
    unpacker: Callable[[], Any]


def _gzip() -> Any:
    import zlib

    return zlib.decompressobj(wbits=31)  # with a gzip header


def _zstd() -> Any:
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj()


def _bzip2() -> Any:
    import bz2

    return bz2.BZ2Decompressor()


def _xz() -> Any:
    import lzma

    return lzma.LZMADecompressor()


def _lz4() -> Any:
    import lz4.frame

    return lz4.frame.LZ4FrameDecompressor()


PACKINGS = (
    Packing("gzip", GZIP_MAGIC, _gzip),
    Packing("zstd", ZSTD_MAGIC, _zstd),
    Packing("bzip2", b"BZh", _bzip2),
    Packing("xz", b"\xfd7zXZ", _xz),
    Packing("lz4", LZ4_MAGIC, _lz4),
)


def packing_of(start: bytes) -> Packing | None:
    """How a file is packed that begins so; None if it is not."""
    return next((packing for packing in PACKINGS if start.startswith(packing.magic)), None)


def unpacked_start(start: bytes) -> bytes:
    """The first bytes of the content, from those of the file; as many as could be unpacked."""
    packing = packing_of(start)
    with suppress(Exception):  # each library has its own for damage; nothing can be said then
        return bytes(packing.unpacker().decompress(start)[:SNIFFED_BYTES]) if packing else b""
    return b""
