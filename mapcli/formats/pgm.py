"""PGM images (Netpbm): P2 as numbers, P5 as bytes; maxval up to 65535, two bytes big-endian.

    P5                      magic
    # any comment           from `#` to the end of the line, anywhere before maxval
    604 307                 columns, rows
    255                     maxval, then one white space and the pixels, top row first

The rasters of other maxvals than 255 are scaled to it. mapcli keeps a map's metadata in comments
behind the line `# mapcli map`; other readers skip them.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import FormatError
from mapcli.formats.grey import GreyImage
from mapcli.model.counting import counted

MAX_CELLS = 1_000_000_000
"""Larger images are refused instead of filling the memory of the machine."""

NOTE_TITLE = "mapcli map"

_FIELD = re.compile(rb"(?:[ \t\r\n\v\f]|#[^\r\n]*[\r\n])*(\d+)")
_COMMENT = re.compile(rb"#([^\r\n]*)")


def read_pgm(data: bytes, file: str) -> GreyImage:
    """Read a PGM file's bytes.

    Raises:
        FormatError: not a PGM, a broken header, or fewer pixels than the header says.
    """
    if data[:2] not in (b"P2", b"P5"):
        raise FormatError(f"starts with {data[:8]!r}", file=file, expected="PGM, P2 or P5")
    columns, rows, maxval, start = _header(data, file)
    warnings: list[str] = []
    read = _plain_pixels if data[:2] == b"P2" else _binary_pixels
    pixels = read(data, start, rows * columns, maxval, file, warnings)
    if pixels.max() > maxval:
        at = divmod(int(np.argmax(pixels > maxval)), columns)
        raise FormatError(
            f"holds {pixels[at[0] * columns + at[1]]}",
            file=file,
            where=f"pixel row {at[0]}, column {at[1]}",
            expected=f"at most the maxval of its header, {maxval}",
        )
    if maxval != 255:
        pixels = (pixels.astype(np.uint32) * 510 + maxval) // (2 * maxval)
    return GreyImage(
        pixels.astype(np.uint8).reshape(rows, columns, 1),
        note=_note(data[:start]),
        kind=f"PGM {data[:2].decode()}, {16 if maxval > 255 else 8} bit",
        warnings=tuple(warnings),
    )


def _header(data: bytes, file: str) -> tuple[int, int, int, int]:
    values, end = [], 2
    for name in ("columns", "rows", "maxval"):
        match = _FIELD.match(data, end)
        if match is None or len(match[1]) > 9:
            found = data[end : end + 12]
            raise FormatError(
                f"{found!r} in the place of the number of {name}"
                if name != "maxval"
                else f"{found!r} in the place of maxval",
                file=file,
                where="header",
                expected="columns, rows and maxval",
            )
        values.append(int(match[1]))
        end = match.end()
    columns, rows, maxval = values
    if not (0 < maxval < 65536 and columns and rows and columns * rows <= MAX_CELLS):
        raise FormatError(
            f"{columns} columns, {rows} rows, maxval {maxval}",
            file=file,
            where="header",
            expected=f"1 to {MAX_CELLS:,} pixels and a maxval from 1 to 65535",
        )
    return columns, rows, maxval, end + 1


def _binary_pixels(
    data: bytes, start: int, count: int, maxval: int, file: str, warnings: list[str]
) -> NDArray[Any]:
    kind = np.dtype(np.uint8 if maxval < 256 else ">u2")
    found = max(len(data) - start, 0)
    if found < count * kind.itemsize:
        raise _too_short(file, found // kind.itemsize, count)
    if found > count * kind.itemsize:
        extra = found - count * kind.itemsize
        warnings.append(counted(extra, "bytes after the last pixel, not used"))
    return np.frombuffer(data, dtype=kind, count=count, offset=start)


def _plain_pixels(
    data: bytes, start: int, count: int, maxval: int, file: str, warnings: list[str]
) -> NDArray[Any]:
    body = _COMMENT.sub(b" ", data[start:]) if b"#" in data[start:] else data[start:]
    odd = body.translate(None, b"0123456789 \t\r\n\v\f")
    if odd:
        line = data.count(b"\n", 0, data.index(odd[:1], start)) + 1
        raise FormatError(
            f"{odd[:1]!r} among the pixels", file=file, where=f"line {line}", expected="numbers"
        )
    pixels = (
        np.fromstring(body.decode("ascii"), dtype=np.int64, sep=" ")
        if body.strip()
        else (np.empty(0, dtype=np.int64))
    )
    if len(pixels) < count:
        raise _too_short(file, len(pixels), count)
    if len(pixels) > count:
        warnings.append(counted(len(pixels) - count, "numbers after the last pixel, not used"))
    return pixels[:count]


def _too_short(file: str, found: int, count: int) -> FormatError:
    return FormatError(
        f"holds {found:,} pixels", file=file, expected=f"{count:,} as its header says"
    )


def _note(header: bytes) -> str:
    comments = [c.decode("utf-8", "replace").strip() for c in _COMMENT.findall(header)]
    if NOTE_TITLE not in comments:
        return ""
    return "\n".join(comments[comments.index(NOTE_TITLE) + 1 :])


def write_pgm(image: GreyImage, *, plain: bool = False, bits: int = 8) -> bytes:
    """The bytes of a PGM file: P5, or P2 when `plain`; 16 bit spreads 0..255 to 0..65535."""
    grey = image.channels[:, :, 0]
    rows, columns = grey.shape
    notes = [NOTE_TITLE, *image.note.splitlines()] if image.note else []
    comments = "".join(f"# {line}\n" for line in notes)
    header = f"P{2 if plain else 5}\n{comments}{columns} {rows}\n{255 if bits == 8 else 65535}\n"
    if plain:
        return header.encode() + _plain_body(grey, 1 if bits == 8 else 257)
    body = grey if bits == 8 else (grey.astype(np.uint16) * 257).astype(">u2")
    return header.encode() + body.tobytes()


def _plain_body(grey: NDArray[np.uint8], factor: int) -> bytes:
    width = len(str(255 * factor))
    table = np.array([f"{level * factor:>{width}} ".encode() for level in range(256)])
    body = table[grey].view(np.uint8).reshape(len(grey), -1)
    body[:, -1] = ord("\n")
    return body.tobytes()
