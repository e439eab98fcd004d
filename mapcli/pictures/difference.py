"""A picture of where two maps agree and where they do not."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mapcli.model.comparison import FREE, OCCUPIED, Change, Comparison
from mapcli.model.comparison import UNKNOWN as NOT_KNOWN
from mapcli.model.grid import bands
from mapcli.pictures.drawing import (
    BLUE,
    FAINT_INK,
    INK,
    RED,
    UNKNOWN,
    WHITE,
    Colour,
    draw_text,
    png_bytes,
)
from mapcli.pictures.floor_plan import frame, metre_marks, scale_bar, sheet
from mapcli.pictures.map_window import MapWindow, PlanLayout

PALE_RED: Colour = (250, 214, 210)
PALE_BLUE: Colour = (210, 224, 250)
GREY: Colour = (96, 100, 108)
DULL_RED: Colour = (226, 130, 122)
DULL_BLUE: Colour = (128, 160, 226)

_USUAL_SIDE, _LARGEST_SIDE, _LARGEST_CELL = 1200, 4000, 32

_MEANINGS: tuple[tuple[int, int, Colour, str], ...] = (
    (NOT_KNOWN, NOT_KNOWN, UNKNOWN, "unknown in both"),
    (FREE, FREE, WHITE, "free in both"),
    (FREE, NOT_KNOWN, PALE_RED, "free in A, unknown in B"),
    (NOT_KNOWN, FREE, PALE_BLUE, "free in B, unknown in A"),
    (OCCUPIED, OCCUPIED, INK, "occupied in both"),
    (OCCUPIED, NOT_KNOWN, DULL_RED, "occupied in A, unknown in B"),
    (NOT_KNOWN, OCCUPIED, DULL_BLUE, "occupied in B, unknown in A"),
    (OCCUPIED, FREE, GREY, "occupied in one, and in a cell next to it in the other"),
    (FREE, OCCUPIED, GREY, ""),
    (NOT_KNOWN, NOT_KNOWN, RED, "vanished: occupied in A, free in B"),
    (NOT_KNOWN, NOT_KNOWN, BLUE, "appeared: occupied in B, free in A"),
)
"""State in A, state in B, colour, words; those without words are like the one before. Where cells
are drawn as one pixel the last one shows. The last two are not told by states alone."""

VANISHED, APPEARED = len(_MEANINGS) - 2, len(_MEANINGS) - 1

_RANKS = np.zeros(9, dtype=np.uint8)
for _rank, _meaning in enumerate(_MEANINGS[:VANISHED]):
    _RANKS[3 * _meaning[0] + _meaning[1]] = _rank

_COLOURS = np.array([colour for _, _, colour, _ in _MEANINGS], dtype=np.uint8)

MOST_NUMBERS = 99
"""Places that are numbered, the largest ones."""

SMALLEST_LETTERS = 16


def difference_picture(comparison: Comparison, names: tuple[str, str]) -> bytes:
    """A PNG of the comparison of two maps, with a number at each place that has changed.

    Args:
        names: of the maps, for the legend.
    """
    window = _window(comparison)
    layout = PlanLayout.of(window)
    marks = metre_marks(window)
    ranks, used = _ranks(comparison, window)
    line = round(max(layout.letters, SMALLEST_LETTERS) * 1.6)
    image, window = sheet(window, layout, marks, title=False,
                          lines=4 + 1.6 * (len(used) + 1))  # fmt: skip
    pixels = _COLOURS[ranks]
    if window.zoom > 1:
        zoom = round(window.zoom)
        pixels = pixels.repeat(zoom, axis=0).repeat(zoom, axis=1)
    image.paste(Image.fromarray(np.ascontiguousarray(pixels)), (window.x, window.y))
    frame(image, window, layout, marks)
    for number, change in enumerate(comparison.changes[:MOST_NUMBERS], 1):
        _numbered(image, window, layout, number, change)
    scale_bar(image, window, layout)
    y = window.y + window.height + round(layout.letters * 4)
    _legend(image, (window.x, y), layout, line, names, used)
    return png_bytes(image)


def _window(comparison: Comparison) -> MapWindow:
    """The part in which either map knows something, with a margin of two cells."""
    pairs, place = comparison.pairs, comparison.place
    assert place is not None
    known = pairs != 3 * NOT_KNOWN + NOT_KNOWN
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    top = left = 0
    bottom, right = pairs.shape
    if rows.size:
        top, left = max(int(rows[0]) - 2, 0), max(int(columns[0]) - 2, 0)
        bottom, right = min(int(rows[-1]) + 3, bottom), min(int(columns[-1]) + 3, right)
    longer = max(bottom - top, right - left)
    zoom = float(min(max(round(_USUAL_SIDE / longer), 1), _LARGEST_CELL))
    if longer > _LARGEST_SIDE:
        zoom = 1.0 / math.ceil(longer / _LARGEST_SIDE)
    return MapWindow(place, top, left, bottom - top, right - left, zoom)


def _ranks(comparison: Comparison, window: MapWindow) -> tuple[NDArray[np.uint8], list[int]]:
    """What each cell, or each square of cells that is one pixel, is drawn as; and all that is
    shown."""
    part = np.s_[window.top : window.top + window.rows, window.left : window.left + window.columns]
    pairs, changed = comparison.pairs[part], comparison.changed
    assert changed is not None
    vanished, appeared = changed.vanished[part], changed.appeared[part]
    factor = max(round(1 / window.zoom), 1)
    down, across = (np.arange(0, side, factor) for side in pairs.shape)
    ranks = np.empty((len(down), len(across)), dtype=np.uint8)
    counts = np.zeros(len(_MEANINGS), np.int64)
    for lines in bands(len(down), pairs.shape[1] * factor):
        rows = slice(lines.start * factor, lines.stop * factor)
        some = _RANKS[pairs[rows]]
        some[vanished[rows]], some[appeared[rows]] = VANISHED, APPEARED
        counts += np.bincount(some.ravel(), minlength=len(_MEANINGS))
        if factor > 1:
            some = np.maximum.reduceat(some, np.arange(0, len(some), factor), axis=0)
            some = np.maximum.reduceat(some, across, axis=1)
        ranks[lines] = some
    counts[_GREY] += counts[_GREY + 1]
    shown = [k for k in np.flatnonzero(counts).tolist() if _MEANINGS[k][3]]
    return ranks, shown


_GREY = next(k for k, meaning in enumerate(_MEANINGS) if meaning[2] == GREY)


def _numbered(
    image: Image.Image, window: MapWindow, layout: PlanLayout, number: int, change: Change
) -> None:
    """The number of a place, beside the upper right corner of its box."""
    place = np.array([[change.x, change.y]])
    x, y = (float(value) for value in window.pixels_of_world(place)[0])
    per_metre = window.zoom / window.grid.resolution
    x = min(x + change.width / 2 * per_metre, window.x + window.width - layout.letters)
    y = max(y - change.height / 2 * per_metre, window.y + layout.letters)
    colour = RED if change.kind == "vanished" else BLUE
    draw_text(image, (x + layout.gap / 2, y), str(number), layout.letters, anchor="ls",
              fill=colour)  # fmt: skip


def _legend(
    image: Image.Image,
    corner: tuple[int, int],
    layout: PlanLayout,
    line: int,
    names: tuple[str, str],
    used: list[int],
) -> None:
    letters = max(layout.letters, SMALLEST_LETTERS)
    pencil, (left, y) = ImageDraw.Draw(image), corner
    text = f"A: {names[0]}   B: {names[1]}"
    draw_text(image, (left, y), text, letters, anchor="lm", halo=None)
    for k, rank in enumerate(used, start=1):
        _, _, colour, words = _MEANINGS[rank]
        top = y + k * line - letters // 2
        box = (left, top, left + 2 * letters, top + letters)
        pencil.rectangle(box, fill=colour, outline=FAINT_INK)
        draw_text(image, (left + 3 * letters, y + k * line), words, letters, anchor="lm", halo=None)
