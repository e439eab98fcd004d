"""Files packed by gzip, bzip2, xz or zstd: which of them, and how the content begins."""

from __future__ import annotations

from contextlib import suppress

from mapcli.formats.input import SNIFFED_BYTES

MAGIC = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ": "xz", b"\x28\xb5\x2f\xfd": "zstd"}
"""First bytes -> what has packed the rest."""


def packing_of(start: bytes) -> str | None:
    """What a file is packed by, by its first bytes."""
    return next((name for magic, name in MAGIC.items() if start.startswith(magic)), None)


def unpacked_start(start: bytes) -> bytes:
    """The first bytes of the content, from those of the file; as many as could be unpacked."""
    with suppress(Exception):  # each library has its own for damage; nothing can be said then
        return _unpack(start)[:SNIFFED_BYTES]
    return b""


def _unpack(start: bytes) -> bytes:
    name = packing_of(start)
    if name == "gzip":
        import zlib

        return zlib.decompressobj(wbits=31).decompress(start, SNIFFED_BYTES)
    if name == "bzip2":
        import bz2

        return bz2.BZ2Decompressor().decompress(start, SNIFFED_BYTES)
    if name == "xz":
        import lzma

        return lzma.LZMADecompressor().decompress(start, SNIFFED_BYTES)
    import zstandard

    return zstandard.ZstdDecompressor().stream_reader(start).read(SNIFFED_BYTES)
