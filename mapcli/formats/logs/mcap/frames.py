"""Damaged zstd and lz4 frames: what they give before the fault."""

from __future__ import annotations

import struct
from collections.abc import Callable

import lz4.block
import zstandard

_STEP_BYTES = 512
"""Packed bytes at a time, which give up to 16 MB."""
_LZ4_HEAD_BYTES = 7
_LZ4_HISTORY_BYTES = 1 << 16


def zstd_start(packed: bytes, limit: int) -> bytes:
    """What the first bytes of a zstd frame give before the fault; little more than `limit` bytes.

    A frame gives its content in blocks of up to 128 kB of content.
    """
    magic = struct.pack("<I", zstandard.MAGIC_NUMBER)  # a flipped bit in it need not cost a chunk
    packed = magic + packed[len(magic) :]
    content, fed = _fed(packed, _STEP_BYTES, limit)
    if fed == len(packed) or len(content) > limit:
        return bytes(content)
    # An error loses what its step had given: up to there again, and on byte by byte.
    content, _ = _fed(packed[: fed + _STEP_BYTES], 1, limit, since=fed)
    return bytes(content)


def _fed(packed: bytes, step: int, limit: int, since: int = 0) -> tuple[bytearray, int]:
    """(content, bytes that were fed before a fault): all until `since` at once, then by steps."""
    give: Callable[[bytes], bytes] = zstandard.ZstdDecompressor().decompressobj().decompress
    content, at = bytearray(), 0
    while at < len(packed) and len(content) <= limit:
        stop = min(at + _STEP_BYTES, since) if at < since else at + step
        try:
            content += give(packed[at:stop])
        except (zstandard.ZstdError, MemoryError):
            break
        at = min(stop, len(packed))
    return content, at


def lz4_start(packed: bytes, limit: int) -> bytes:
    """The same of an lz4 frame. Its checksums are not looked at: the chunk has its own.

    <https://github.com/lz4/lz4/blob/dev/doc/lz4_Frame_format.md>
    """
    if len(packed) <= _LZ4_HEAD_BYTES:
        return b""
    flags, sizes = packed[4], packed[5]
    largest = 1 << (8 + 2 * (sizes >> 4 & 7))
    checksum = 4 * (flags >> 4 & 1)
    at = _LZ4_HEAD_BYTES + 8 * (flags >> 3 & 1) + 4 * (flags & 1)
    content = bytearray()
    while at + 4 <= len(packed) and len(content) <= limit:
        (size,) = struct.unpack_from("<I", packed, at)
        stored, size = size >> 31, size & 0x7FFFFFFF
        block = packed[at + 4 : at + 4 + size]
        if size == 0 or size > largest or not (stored or len(block) == size):
            break
        last = packed[at + 4 + size + checksum :][:4] == bytes(4)
        history = b"" if flags & 0x20 else bytes(content[-_LZ4_HISTORY_BYTES:])
        try:
            given = block if stored else _lz4_block(block, largest, history)
        except (lz4.block.LZ4BlockError, MemoryError, ValueError):
            break
        if len(given) < largest and not (stored or last):
            break  # it is not what was packed: all blocks but the last one are full
        content += given
        at += 4 + size + checksum
    return bytes(content)


def _lz4_block(block: bytes, largest: int, history: bytes) -> bytes:
    if history:
        return bytes(lz4.block.decompress(block, uncompressed_size=largest, dict=history))
    return bytes(lz4.block.decompress(block, uncompressed_size=largest))
