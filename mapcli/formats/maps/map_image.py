"""Map images: their pixels, and the trinary, scale and raw modes in which grey means probability.

A pixel's darkness `occ` is `1 - grey / 255`, or `grey / 255` with `negate`. By mode it becomes

    trinary   dark enough: obstacle; light enough: open; in between: unknown
    scale     the same two, and in between the percent (occ - free) / (occupied - free)
    raw       the grey itself is the percent, 0 to 100; anything else is unknown

Map servers differ in the details, see `dialects`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import DataError, FormatError
from mapcli.memory import limit_of_file, require
from mapcli.model.grid import bands

Mode = Literal["trinary", "scale", "raw"]
MODES: tuple[Mode, ...] = get_args(Mode)

OCCUPIED_GREY, UNKNOWN_GREY, FREE_GREY = 0, 205, 254
"""The customary pixels of a trinary map."""

MAX_CELLS = 1_000_000_000
"""Larger maps are refused instead of filling the memory of the machine."""

NOTE_TITLE = "mapcli map"
"""Marks the map metadata that mapcli keeps inside an image."""


@dataclass(frozen=True, eq=False)
class GreyImage:
    """Pixels of an image, or of some of its rows.

    Attributes:
        channels: shape (rows, columns, n), uint8; n is 1 for grey, 3 for colour.
        alpha: shape (rows, columns), uint8, 255 is opaque; None when the image has none.
    """

    channels: NDArray[np.uint8]
    alpha: NDArray[np.uint8] | None = None

    @cached_property
    def coloured(self) -> int:
        """Pixels that are not grey."""
        if self.channels.shape[2] == 1:
            return 0
        red, green, blue = (self.channels[:, :, k] for k in range(3))
        return int(np.count_nonzero((red != green) | (green != blue)))

    @cached_property
    def luma(self) -> NDArray[np.uint8]:
        """8-bit grey as GraphicsMagick makes it for Nav2: Rec. 601 weights in 1/1024."""
        if not self.coloured:
            return np.ascontiguousarray(self.channels[:, :, 0])
        red, green, blue = (self.channels[:, :, k].astype(np.uint32) for k in range(3))
        return ((306 * red + 601 * green + 117 * blue + 512) >> 10).astype(np.uint8)

    def sums(self, *, with_alpha: bool) -> tuple[NDArray[Any], int]:
        """Sum of the channels, and how many they are: the mean, before it is rounded.

        Args:
            with_alpha: count alpha, where there is one, as one more channel.
        """
        parts = [self.channels[:, :, k] for k in range(self.channels.shape[2])]
        parts += [self.alpha] if with_alpha and self.alpha is not None else []
        total: NDArray[Any] = parts[0]
        if len(parts) > 1:
            total = np.asarray(np.sum(parts, axis=0, dtype=np.uint16))
        return total, len(parts)


@dataclass(frozen=True, eq=False)
class MapImage:
    """A map image; its pixels are decoded some rows at a time, because it may be large.

    Attributes:
        rows, columns: its size.
        pixels: the rows from the first number to before the second.
        note: map metadata that mapcli stored inside the image (YAML lines), or "".
        kind: what the file is, for people: "PGM P5, 8 bit".
        warnings: what was odd about the file.
    """

    rows: int
    columns: int
    pixels: Callable[[int, int], GreyImage]
    note: str = ""
    kind: str = ""
    warnings: tuple[str, ...] = ()

    def whole(self) -> GreyImage:
        return self.pixels(0, self.rows)

    def bands(self) -> Iterator[tuple[slice, GreyImage]]:
        """The image in bands of some rows, and which rows they are."""
        for band in bands(self.rows, self.columns):
            yield band, self.pixels(band.start, band.stop)


@dataclass(frozen=True)
class GreyRule:
    """How grey becomes probability; what a map's YAML says about its image.

    Raises:
        DataError: thresholds that are not numbers.
    """

    mode: Mode = "trinary"
    free_thresh: float = 0.196
    occupied_thresh: float = 0.65
    negate: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.free_thresh) and np.isfinite(self.occupied_thresh)):
            raise DataError("free_thresh or occupied_thresh is not finite", expected="numbers")


def refuse_size(
    rows: int,
    columns: int,
    file: str,
    *,
    pixel: int,
    limit: int = MAX_CELLS,
    held: int | None = None,
    packed: int | None = None,
) -> None:
    """Refuse an image before memory is taken for it.

    Args:
        pixel: bytes that each takes while it is read, the map's cell among them.
        limit: of pixels.
        packed: bytes of the file, where pixels are packed.
        held: pixels that the file can hold at most, by its length.

    Raises:
        FormatError: more pixels than either.
        MemoryLimitError: more than a run may hold.
    """
    size = f"{columns} columns and {rows} rows"
    if rows * columns > limit:
        raise FormatError(f"claims {size}", file=file, expected=f"at most {limit:,} pixels")
    if held is not None and rows * columns > held:
        expected = f"at most {held:,} pixels in a file of this length; it is cut short or damaged"
        raise FormatError(f"claims {size}", file=file, expected=expected)
    most = None if packed is None else limit_of_file(packed)
    what = f"an image of {columns:,} x {rows:,} pixels"
    require(pixel * rows * columns, what, file=file, most=most)


def trinary_greys(
    cells: NDArray[np.float32], free_thresh: float, occupied_thresh: float, *, negate: bool
) -> NDArray[np.uint8]:
    """Pixels of a trinary map: cells up to `free_thresh` open, from `occupied_thresh` obstacle."""
    greys = np.full(cells.shape, UNKNOWN_GREY, dtype=np.uint8)
    greys[cells <= free_thresh] = FREE_GREY
    greys[cells >= occupied_thresh] = OCCUPIED_GREY
    return np.bitwise_not(greys) if negate else greys
