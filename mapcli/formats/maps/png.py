"""PNG map images: grey, colour or palette, with or without transparency.

Pillow reads them. 16-bit grey is reduced to 8 bits as Nav2's GraphicsMagick does. They are written
here, row by row, because Pillow would hold a large map at four bytes a pixel. mapcli keeps a map's
metadata in a text chunk named `mapcli map`; other readers skip it.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np
from PIL import Image, PngImagePlugin

from mapcli.errors import FormatError
from mapcli.formats.maps.map_image import MAX_CELLS, NOTE_TITLE, GreyImage, MapImage, refuse_size

SIGNATURE = b"\x89PNG\r\n\x1a\n"

_BROKEN = (OSError, SyntaxError, ValueError, EOFError, IndexError, KeyError, TypeError,
           AttributeError, OverflowError, struct.error, zlib.error)  # fmt: skip
"""What Pillow was seen to raise, or may raise, on damaged files."""

_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
"""Colour type of the header -> channels."""

_DEFLATE_AT_MOST = 1032
"""Bytes that one byte of a compressed file can unpack to."""

_ROOMY_MODES = ("1", "L", "P")
"""Pillow's modes with a byte a pixel; the others take up to four."""

_COMPRESSION = 4
"""Three times as fast as 6 on large maps, and a tenth larger."""


def read_png(data: bytes, file: str) -> MapImage:
    """Read a PNG file's bytes.

    Raises:
        FormatError: not a PNG, cut short, damaged, or too large.
    """
    if not data.startswith(SIGNATURE):
        raise FormatError(f"starts with {data[:8]!r}", file=file, expected="a PNG image")
    with _damage_told(file):
        _refuse_absurd(data, file)
        # Not Image.open: its guard against huge images is meant for web servers, and ours is above.
        image = PngImagePlugin.PngImageFile(io.BytesIO(data))
        if image.mode not in _ROOMY_MODES:
            size = image.height, image.width
            refuse_size(*size, file, pixel=6, limit=MAX_CELLS // 2, packed=len(data))
        image.load()
        note = str(image.text.get(NOTE_TITLE, ""))
    kind = f"PNG {_KINDS.get(image.mode, image.mode)}"
    clear = "transparency" in image.info or image.mode in ("LA", "RGBA")

    def part(top: int, bottom: int) -> GreyImage:
        with _damage_told(file):  # a wrong palette is noticed only now
            return _pixels(image.crop((0, top, image.width, bottom)), image, clear)

    return MapImage(image.height, image.width, part, note, kind)


_KINDS = {"1": "1 bit", "L": "grey", "LA": "grey with alpha", "P": "palette", "RGB": "colour",
          "RGBA": "colour with alpha", "I;16": "grey, 16 bit", "I": "grey, 16 bit"}  # fmt: skip


@contextmanager
def _damage_told(file: str) -> Iterator[None]:
    """Whatever Pillow finds wrong meanwhile becomes a FormatError."""
    try:
        yield
    except _BROKEN as error:
        raise FormatError(
            f"the PNG image is damaged ({error})", file=file, expected="a whole PNG file"
        ) from error


def _refuse_absurd(data: bytes, file: str) -> None:
    """By the header alone, before Pillow takes memory for the pixels."""
    columns, rows, depth, colour = struct.unpack(">IIBB", data[16:26])
    bits = columns * depth * _CHANNELS.get(colour, 1)
    unpacked = rows * ((bits + 7) // 8 + 1)
    share = min(len(data) * _DEFLATE_AT_MOST / unpacked, 1.0) if unpacked else 1.0
    held = int(rows * columns * share)
    refuse_size(rows, columns, file, pixel=2, held=held, packed=len(data))


def _pixels(part: Image.Image, image: Image.Image, clear: bool) -> GreyImage:
    """Colour channels, shape (rows, columns, 1 or 3), and alpha or None, of a part of an image."""
    key = image.info.get("transparency")
    if image.mode.startswith("I"):
        deep = np.asarray(part).astype(np.uint32)
        alpha = None if key is None else np.where(deep == key, 0, 255).astype(np.uint8)
        return GreyImage(((deep + 128) // 257).astype(np.uint8)[:, :, None], alpha)
    grey = image.mode in ("1", "L", "LA")
    if not clear:
        pixels = np.asarray(part.convert("L" if grey else "RGB"))
        return GreyImage(pixels.reshape(part.height, part.width, -1))
    pixels = np.asarray(part.convert("RGBA"))
    return GreyImage(pixels[:, :, : 1 if grey else 3], pixels[:, :, 3])


def write_png(
    rows: int, columns: int, pixels: Iterable[GreyImage], note: str = "", *, clear: bool = False
) -> Iterator[bytes]:
    """The bytes of a PNG file, in pieces: 8-bit grey, or RGBA where there is transparency.

    RGBA, not grey with alpha, because GraphicsMagick loses the alpha of the latter.

    Args:
        pixels: grey pixels in bands of some rows, all with alpha when `clear`.
        note: map metadata to keep inside.
    """
    yield SIGNATURE
    yield _chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 6 if clear else 0, 0, 0, 0))
    if note:
        yield _chunk(b"tEXt", NOTE_TITLE.encode() + b"\0" + note.encode("latin-1", "replace"))
    packer = zlib.compressobj(_COMPRESSION)
    for band in pixels:
        if packed := packer.compress(_scanlines(band)):
            yield _chunk(b"IDAT", packed)
    yield _chunk(b"IDAT", packer.flush())
    yield _chunk(b"IEND", b"")


def _scanlines(band: GreyImage) -> bytes:
    """Rows as differences to the row above, PNG's filter 2; the first one as it is, filter 0."""
    grey = band.channels
    if band.alpha is not None:
        grey = np.concatenate([grey, grey, grey, band.alpha[:, :, None]], axis=2)
    pixels = grey.reshape(len(grey), -1)
    lines = np.full((len(pixels), pixels.shape[1] + 1), 2, dtype=np.uint8)
    lines[0, 0] = 0
    lines[0, 1:] = pixels[0]
    np.subtract(pixels[1:], pixels[:-1], out=lines[1:, 1:])
    return lines.tobytes()


def _chunk(kind: bytes, content: bytes) -> bytes:
    checksum = zlib.crc32(content, zlib.crc32(kind))
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)
