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
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import FormatError
from mapcli.formats.maps.map_image import NOTE_TITLE, GreyImage, MapImage, refuse_size
from mapcli.model.counting import counted
from mapcli.model.grid import bands

_FIELD = re.compile(rb"(?:[ \t\r\n\v\f]|#[^\r\n]*[\r\n])*(\d+)")
_COMMENT = re.compile(rb"#([^\r\n]*)")
_PIECE = 1 << 24
"""Bytes of numbers (P2) that are read at a time."""


def read_pgm(data: bytes, file: str) -> MapImage:
    """Read a PGM file's bytes.

    Raises:
        FormatError: not a PGM, a broken header, or fewer pixels than the header says.
    """
    if data[:2] not in (b"P2", b"P5"):
        raise FormatError(f"starts with {data[:8]!r}", file=file, expected="PGM, P2 or P5")
    columns, rows, maxval, start = _header(data, file)
    warnings: list[str] = []
    read = _plain_pixels if data[:2] == b"P2" else _binary_pixels
    pixels = read(data, start, (rows, columns), maxval, file, warnings)

    def part(top: int, bottom: int) -> GreyImage:
        grey = pixels[top:bottom]
        if maxval != 255:
            grey = (grey.astype(np.uint32) * 510 + maxval) // (2 * maxval)
        return GreyImage(grey.astype(np.uint8, copy=False)[:, :, None])

    kind = f"PGM {data[:2].decode()}, {16 if maxval > 255 else 8} bit"
    return MapImage(rows, columns, part, _note(data[:start]), kind, tuple(warnings))


def _refuse_beyond(pixels: NDArray[Any], before: int, columns: int, maxval: int, file: str) -> None:
    """Refuse pixels beyond the maxval of the header; `before` is how many came before these."""
    if pixels.size and pixels.max() > maxval:
        at = int(np.argmax(pixels > maxval))
        row, column = divmod(before + at, columns)
        raise FormatError(
            f"holds {pixels[at]}",
            file=file,
            where=f"pixel row {row}, column {column}",
            expected=f"at most the maxval of its header, {maxval}",
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
    refuse_size(rows, columns, file, pixel=1 if data[:2] == b"P5" else 3)
    if not (0 < maxval < 65536 and columns and rows):
        raise FormatError(
            f"{columns} columns, {rows} rows, maxval {maxval}",
            file=file,
            where="header",
            expected="pixels, and a maxval from 1 to 65535",
        )
    return columns, rows, maxval, end + 1


def _binary_pixels(
    data: bytes, start: int, shape: tuple[int, int], maxval: int, file: str, warnings: list[str]
) -> NDArray[Any]:
    kind = np.dtype(np.uint8 if maxval < 256 else ">u2")
    count = shape[0] * shape[1]
    found = max(len(data) - start, 0)
    if found < count * kind.itemsize:
        raise _too_short(file, found // kind.itemsize, count)
    if found > count * kind.itemsize:
        extra = found - count * kind.itemsize
        warnings.append(counted(extra, "bytes after the last pixel, not used"))
    pixels = np.frombuffer(data, dtype=kind, count=count, offset=start).reshape(shape)
    for band in bands(*shape) if maxval not in (255, 65535) else ():
        _refuse_beyond(pixels[band].ravel(), band.start * shape[1], shape[1], maxval, file)
    return pixels


def _plain_pixels(
    data: bytes, start: int, shape: tuple[int, int], maxval: int, file: str, warnings: list[str]
) -> NDArray[Any]:
    count = shape[0] * shape[1]
    if count > (len(data) - start + 1) // 2:  # a digit and a blank each
        raise _too_short(file, len(data[start : start + 2 * count].split()), count)
    pixels = np.empty(count, dtype=np.uint8 if maxval < 256 else np.uint16)
    found = 0
    for first, piece in _pieces(data, start):
        numbers = _numbers(piece, data, first, file)
        used = numbers[: max(count - found, 0)]
        _refuse_beyond(used, found, shape[1], maxval, file)
        pixels[found : found + len(used)] = used
        found += len(numbers)
    if found < count:
        raise _too_short(file, found, count)
    if found > count:
        warnings.append(counted(found - count, "numbers after the last pixel, not used"))
    return pixels.reshape(shape)


def _pieces(data: bytes, start: int) -> Iterator[tuple[int, bytes]]:
    """The body in pieces that end with a line, or at least with a number."""
    while start < len(data):
        end = start + _PIECE
        if end < len(data):
            cuts = (data.rfind(blank, start + 1, end) for blank in (b"\n", b" "))
            end = next((cut for cut in cuts if cut > 0), end)
        yield start, data[start:end]
        start = end


def _numbers(piece: bytes, data: bytes, first: int, file: str) -> NDArray[np.int64]:
    body = _COMMENT.sub(b" ", piece) if b"#" in piece else piece
    odd = body.translate(None, b"0123456789 \t\r\n\v\f")
    if odd:
        line = data.count(b"\n", 0, data.index(odd[:1], first)) + 1
        raise FormatError(
            f"{odd[:1]!r} among the pixels", file=file, where=f"line {line}", expected="numbers"
        )
    if not body.strip():
        return np.empty(0, dtype=np.int64)
    return np.fromstring(body.decode("ascii"), dtype=np.int64, sep=" ")


def _too_short(file: str, found: int, count: int) -> FormatError:
    return FormatError(
        f"holds {found:,} pixels", file=file, expected=f"{count:,} as its header says"
    )


def _note(header: bytes) -> str:
    comments = [c.decode("utf-8", "replace").strip() for c in _COMMENT.findall(header)]
    if NOTE_TITLE not in comments:
        return ""
    return "\n".join(comments[comments.index(NOTE_TITLE) + 1 :])


def write_pgm(
    rows: int, columns: int, greys: Iterable[NDArray[np.uint8]], note: str = "", *,
    plain: bool = False, bits: int = 8,
) -> Iterator[bytes]:  # fmt: skip
    """The bytes of a PGM file, in pieces: P5, or P2 when `plain`; 16 bit spreads 0..255 to
    0..65535.

    Args:
        greys: the pixels in bands, each of shape (some rows, columns).
        note: map metadata to keep inside, lines.
    """
    notes = [NOTE_TITLE, *note.splitlines()] if note else []
    comments = "".join(f"# {line}\n" for line in notes)
    top = 255 if bits == 8 else 65535
    yield f"P{2 if plain else 5}\n{comments}{columns} {rows}\n{top}\n".encode()
    for grey in greys:
        if plain:
            yield _plain_body(grey, top // 255)
        else:
            yield (grey if bits == 8 else (grey.astype(np.uint16) * 257).astype(">u2")).tobytes()


def _plain_body(grey: NDArray[np.uint8], factor: int) -> bytes:
    width = len(str(255 * factor))
    table = np.array([f"{level * factor:>{width}} ".encode() for level in range(256)])
    body = table[grey].view(np.uint8).reshape(len(grey), -1)
    body[:, -1] = ord("\n")
    return body.tobytes()
