"""PNG map images, through Pillow: grey, colour or palette, with or without transparency.

16-bit grey is reduced to 8 bits as Nav2's GraphicsMagick does. mapcli keeps a map's metadata in
a text chunk named `mapcli map`; other readers skip it.
"""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
from numpy.typing import NDArray
from PIL import Image, PngImagePlugin

from mapcli.errors import FormatError
from mapcli.formats.grey import GreyImage
from mapcli.formats.pgm import MAX_CELLS, NOTE_TITLE

SIGNATURE = b"\x89PNG\r\n\x1a\n"

_BROKEN = (OSError, SyntaxError, ValueError, EOFError, IndexError, KeyError, TypeError,
           AttributeError, OverflowError, struct.error, zlib.error)  # fmt: skip
"""What Pillow was seen to raise, or may raise, on damaged files."""


def read_png(data: bytes, file: str) -> GreyImage:
    """Read a PNG file's bytes.

    Raises:
        FormatError: not a PNG, cut short, or damaged.
    """
    if not data.startswith(SIGNATURE):
        raise FormatError(f"starts with {data[:8]!r}", file=file, expected="a PNG image")
    try:
        # Not Image.open: its guard against huge images is meant for web servers, and ours is above.
        image = PngImagePlugin.PngImageFile(io.BytesIO(data))
        if image.width * image.height > MAX_CELLS:
            raise FormatError(
                f"{image.width} x {image.height} pixels",
                file=file,
                expected=f"at most {MAX_CELLS:,}",
            )
        image.load()
        note = str(image.text.get(NOTE_TITLE, ""))
        channels, alpha = _channels(image)
    except _BROKEN as error:
        raise FormatError(
            f"the PNG image is damaged ({error})", file=file, expected="a whole PNG file"
        ) from error
    return GreyImage(channels, alpha, note=note, kind=f"PNG {_KINDS.get(image.mode, image.mode)}")


_KINDS = {"1": "1 bit", "L": "grey", "LA": "grey with alpha", "P": "palette", "RGB": "colour",
          "RGBA": "colour with alpha", "I;16": "grey, 16 bit", "I": "grey, 16 bit"}  # fmt: skip


def _channels(
    image: Image.Image,
) -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None]:
    """Colour channels, shape (rows, columns, 1 or 3), and alpha or None."""
    if image.mode.startswith("I"):
        deep = np.asarray(image).astype(np.uint32)
        key = image.info.get("transparency")
        alpha = None if key is None else np.where(deep == key, 0, 255).astype(np.uint8)
        return ((deep + 128) // 257).astype(np.uint8)[:, :, None], alpha
    clear = "transparency" in image.info or image.mode in ("LA", "RGBA")
    grey = image.mode in ("1", "L", "LA")
    if not clear:
        pixels = np.asarray(image.convert("L" if grey else "RGB"))
        return pixels.reshape(image.height, image.width, -1), None
    pixels = np.asarray(image.convert("RGBA"))
    return pixels[:, :, : 1 if grey else 3], pixels[:, :, 3]


def write_png(image: GreyImage) -> bytes:
    """The bytes of a PNG file: 8-bit grey, or RGBA where there is transparency.

    RGBA, not grey with alpha, because GraphicsMagick loses the alpha of the latter.
    """
    grey = image.channels[:, :, 0]
    if image.alpha is not None:
        picture = Image.fromarray(np.dstack([grey, grey, grey, image.alpha]))
    else:
        picture = Image.fromarray(grey)
    info = PngImagePlugin.PngInfo()
    if image.note:
        info.add_text(NOTE_TITLE, image.note)
    out = io.BytesIO()
    picture.save(out, format="PNG", pnginfo=info, compress_level=6)
    return out.getvalue()
