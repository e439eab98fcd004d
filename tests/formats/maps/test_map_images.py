"""PGM and PNG files: pixels as other programs mean them, and what can be wrong with them."""

from __future__ import annotations

import io
import struct
import zlib
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mapcli.errors import FormatError
from mapcli.formats.maps.map_image import GreyImage
from mapcli.formats.maps.pgm import read_pgm, write_pgm
from mapcli.formats.maps.png import read_png, write_png

RAMP = np.arange(256, dtype=np.uint8).reshape(16, 16)


def pgm(data: bytes) -> list[list[int]]:
    pixels: list[list[int]] = read_pgm(data, "m.pgm").whole().channels[:, :, 0].tolist()
    return pixels


def png(picture: Image.Image, **options: object) -> GreyImage:
    out = io.BytesIO()
    picture.save(out, "PNG", **options)
    return read_png(out.getvalue(), "m.png").whole()


@pytest.mark.parametrize(
    ("data", "pixels"),
    [
        (b"P5\n# CREATOR: map_saver.cpp 0.050 m/pix\n3 2\n255\n\x00\x7f\xcd\xfe\x01\xff",
         [[0, 127, 205], [254, 1, 255]]),
        (b"P5 2 1 255 \n#", [[10, 35]]),  # pixels that look like a line end and a comment
        (b"P5\n2#two columns\n1 # one row\n255\n\x01\x02", [[1, 2]]),
        (b"P2\n# plain\n3 2\n255\n0 127 205\n254 # not 9\n1 255\n", [[0, 127, 205], [254, 1, 255]]),
        (b"P2 2 2 15 15 12 0 1", [[255, 204], [0, 17]]),
        (b"P2 2 1 1 1 0", [[255, 0]]),
        # big-endian; 65535 -> 255, 52685 = 205 * 257, 128 rounds down, 129 up
        (b"P5 4 1 65535\n\xff\xff\xcd\xcd\x00\x80\x00\x81", [[255, 205, 0, 1]]),
        (b"P2 2 1 65535 65535 0", [[255, 0]]),
        (b"P5 2 1 1023\n\x03\xff\x02\x00", [[255, 128]]),
    ],
)  # fmt: skip
def test_pgm_pixel_by_pixel(data: bytes, pixels: list[list[int]]) -> None:
    assert pgm(data) == pixels


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"P6 1 1 255\nabc", "m.pgm: starts with b'P6 1 1 2'; expected PGM, P2 or P5"),
        (b"P5", "m.pgm: header: b'' in the place of the number of columns"),
        (b"P5 2 x", "m.pgm: header: b' x' in the place of the number of rows"),
        (b"P5 2 2\n", "m.pgm: header: b'\\n' in the place of maxval"),
        (b"P5 0 2 255\n", "m.pgm: header: 0 columns, 2 rows, maxval 255"),
        (b"P5 2 2 0\n", "m.pgm: header: 2 columns, 2 rows, maxval 0"),
        (b"P5 2 2 65536\n", "m.pgm: header: 2 columns, 2 rows, maxval 65536"),
        (b"P5 99999 99999 255\n", "m.pgm: claims 99999 columns and 99999 rows; expected at most"),
        (b"P2 30000 30000 255\n1 2", "m.pgm: holds 2 pixels; expected 900,000,000"),
        (b"P5 9999999999 1 255\n", "m.pgm: header: b' 9999999999 ' in the place"),
        (b"P5 2 2 255\nabc", "m.pgm: holds 3 pixels; expected 4 as its header says"),
        (b"P5 2 2 65535\nabcdefg", "m.pgm: holds 3 pixels; expected 4 as its header says"),
        (b"P5 2 2 255", "m.pgm: holds 0 pixels; expected 4 as its header says"),
        (b"P2 2 2 255\n1 2 3", "m.pgm: holds 3 pixels; expected 4 as its header says"),
        (b"P2 2 2 255\n", "m.pgm: holds 0 pixels; expected 4 as its header says"),
        (b"P2 2 2 255\n1 2\n3 -4", "m.pgm: line 3: b'-' among the pixels; expected numbers"),
        (b"P2 2 1 15\n3 16", "m.pgm: pixel row 0, column 1: holds 16; expected at most"),
        (b"P2 1 1 15\n" + b"9" * 30, "m.pgm: pixel row 0, column 0: holds"),
        (b"P5 2 1 15\n\x0f\x10", "m.pgm: pixel row 0, column 1: holds 16; expected at most"),
    ],
)
def test_malformed_pgm(data: bytes, message: str) -> None:
    with pytest.raises(FormatError) as raised:
        pgm(data)
    assert str(raised.value).startswith(message)


@pytest.mark.parametrize("data", [b"P5 2 1 255\nabxyz", b"P2 2 1 255\n1 2 3 4 5"])
def test_more_pixels_than_the_header_says_are_counted(data: bytes) -> None:
    (warning,) = read_pgm(data, "m.pgm").warnings
    assert warning.startswith("3 ")


def test_written_pgm_byte_by_byte() -> None:
    grey = np.array([[0, 205], [254, 7]], dtype=np.uint8)
    assert pgm_of(grey) == b"P5\n2 2\n255\n\x00\xcd\xfe\x07"
    assert pgm_of(grey, plain=True) == b"P2\n2 2\n255\n  0 205\n254   7\n"
    assert pgm_of(grey, bits=16) == b"P5\n2 2\n65535\n\x00\x00\xcd\xcd\xfe\xfe\x07\x07"
    assert pgm_of(grey, plain=True, bits=16).endswith(b"\n    0 52685\n65278  1799\n")


@pytest.mark.parametrize("plain", [False, True])
@pytest.mark.parametrize("bits", [8, 16])
def test_every_grey_survives_every_pgm(plain: bool, bits: int) -> None:
    data = pgm_of(RAMP, "resolution: 0.05\nmode: raw", plain=plain, bits=bits)
    again = read_pgm(data, "m.pgm")
    assert np.array_equal(again.whole().channels[:, :, 0], RAMP)
    assert again.note == "resolution: 0.05\nmode: raw"
    assert again.kind == f"PGM P{2 if plain else 5}, {bits} bit"
    pillow = np.asarray(Image.open(io.BytesIO(data)))
    assert np.array_equal(pillow, RAMP.astype(np.int32) * (1 if bits == 8 else 257))


def pgm_of(grey: np.ndarray, note: str = "", **options: Any) -> bytes:
    """Written in bands of one row."""
    return b"".join(write_pgm(*grey.shape, np.split(grey, len(grey)), note, **options))


def png_of(grey: np.ndarray, alpha: np.ndarray | None = None, note: str = "") -> bytes:
    """Written in bands of three rows."""
    places = [slice(k, k + 3) for k in range(0, len(grey), 3)]
    images = [GreyImage(grey[k][:, :, None], None if alpha is None else alpha[k]) for k in places]
    return b"".join(write_png(*grey.shape, images, note, clear=alpha is not None))


def test_plain_pgm_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapcli.formats.maps.pgm._PIECE", 7)
    assert np.array_equal(pgm(pgm_of(RAMP, plain=True)), RAMP)
    one_line = pgm_of(RAMP, plain=True).replace(b"\n ", b"  ")
    assert np.array_equal(pgm(one_line), RAMP)


def test_png_kinds() -> None:
    grey = Image.fromarray(RAMP)
    assert np.array_equal(png(grey).channels[:, :, 0], RAMP)
    assert png(grey).alpha is None
    assert np.array_equal(png(grey.convert("RGB")).luma, RAMP)
    assert np.array_equal(png(grey.convert("P")).luma, RAMP)
    clear = png(Image.merge("LA", (grey, Image.fromarray(RAMP.T.copy()))))
    assert np.array_equal(clear.channels[:, :, 0], RAMP)
    assert np.array_equal(clear.alpha, RAMP.T)
    assert png(grey.convert("1")).channels[0, 0, 0] == 0


def test_16_bit_png_is_reduced_by_rounding() -> None:
    deep = np.array([[0, 128, 129, 52685, 65535]], dtype=np.uint16)
    assert png(Image.fromarray(deep)).channels[0, :, 0].tolist() == [0, 0, 1, 205, 255]


def test_transparent_colour_and_palette_entry() -> None:
    assert png(Image.fromarray(RAMP), transparency=7).alpha is not None
    assert (png(Image.fromarray(RAMP), transparency=7).alpha == 0).sum() == 1
    palette = Image.fromarray(RAMP).convert("P")
    assert (png(palette, transparency=3).alpha == 0).sum() == 1


def test_transparency_of_colours_that_the_palette_does_not_have() -> None:
    """Pillow notices it only when the pixels are converted."""
    picture = Image.new("P", (2, 1))
    picture.putpalette([0, 0, 0, 255, 255, 255])
    out = io.BytesIO()
    picture.save(out, "PNG", transparency=b"\x00" * 2, bits=8)
    chunk = b"tRNS" + b"\x00" * 300
    longer = struct.pack(">I", 300) + chunk + struct.pack(">I", zlib.crc32(chunk))
    data = out.getvalue()
    start = data.index(b"tRNS") - 4
    with pytest.raises(FormatError, match=r"m\.png: the PNG image is damaged \(palette index"):
        read_png(data[:start] + longer + data[start + 14 :], "m.png").whole()


def test_png_round_trip_with_alpha_and_note() -> None:
    data = png_of(RAMP, RAMP.T.copy(), "resolution: 0.05\nmode: raw")
    again = read_png(data, "m.png")
    assert np.array_equal(again.whole().channels[:, :, 0], RAMP)
    assert np.array_equal(again.whole().alpha, RAMP.T)
    assert again.note == "resolution: 0.05\nmode: raw"
    pillow = np.asarray(Image.open(io.BytesIO(data)))
    assert np.array_equal(pillow, np.dstack([RAMP, RAMP, RAMP, RAMP.T]))
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(png_of(RAMP)))), RAMP)


def test_png_cut_anywhere_is_an_error_unless_all_pixels_are_there() -> None:
    data = png_of(RAMP, note="mode: raw")
    refused = 0
    for length in range(len(data)):
        try:
            image = read_png(data[:length], "m.png")
        except FormatError:
            refused += 1
        else:
            assert np.array_equal(image.whole().channels[:, :, 0], RAMP)
    assert refused >= len(data) - 24  # checksums of the pixels, and the end mark


@pytest.mark.parametrize("side", [30_000, 100_000])
def test_sizes_that_a_png_cannot_hold_are_refused_by_its_header(side: int) -> None:
    """One row of pixels in the name of thousands; Pillow never gets to take the memory."""
    data = bytearray(png_of(RAMP))
    data[16:24] = struct.pack(">II", side, side)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    with pytest.raises(FormatError, match=rf"claims {side} columns and {side} rows; expected at"):
        read_png(bytes(data), "m.png")


def test_not_a_png() -> None:
    with pytest.raises(FormatError, match=r"m\.png: starts with b'GIF8'; expected a PNG image"):
        read_png(b"GIF8", "m.png")
