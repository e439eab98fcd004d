"""A picture of where two maps agree and where they do not."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mapcli.model.comparison import FREE, OCCUPIED
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

PALE_RED: Colour = (250, 214, 210)
PALE_BLUE: Colour = (210, 224, 250)
DULL_RED: Colour = (226, 130, 122)
DULL_BLUE: Colour = (128, 160, 226)

_MEANINGS: tuple[tuple[int, int, Colour, str], ...] = (
    (NOT_KNOWN, NOT_KNOWN, UNKNOWN, "unknown in both"),
    (FREE, FREE, WHITE, "free in both"),
    (FREE, NOT_KNOWN, PALE_RED, "free in A, unknown in B"),
    (NOT_KNOWN, FREE, PALE_BLUE, "free in B, unknown in A"),
    (OCCUPIED, OCCUPIED, INK, "occupied in both"),
    (OCCUPIED, NOT_KNOWN, DULL_RED, "occupied in A, unknown in B"),
    (NOT_KNOWN, OCCUPIED, DULL_BLUE, "occupied in B, unknown in A"),
    (OCCUPIED, FREE, RED, "occupied in A, free in B"),
    (FREE, OCCUPIED, BLUE, "occupied in B, free in A"),
)
"""State in A, state in B, colour, words. Where cells are drawn as one pixel the last one shows."""

_RANKS = np.zeros(9, dtype=np.uint8)
for _rank, _meaning in enumerate(_MEANINGS):
    _RANKS[3 * _meaning[0] + _meaning[1]] = _rank

_USUAL_SIDE, _LARGEST_SIDE, _LARGEST_CELL = 1200, 4000, 32
_MARGIN, _LETTERS = 24, 20


def difference_picture(pairs: NDArray[np.uint8], names: tuple[str, str]) -> bytes:
    """A PNG of the comparison of two maps.

    Args:
        pairs: as of `Comparison.pairs`.
        names: of the maps, for the legend.
    """
    plan = _plan(_cropped(pairs))
    shown = np.bincount(np.concatenate([np.unique(pairs[rows]) for rows in bands(*pairs.shape)]))
    used = [m for m in _MEANINGS if 3 * m[0] + m[1] < len(shown) and shown[3 * m[0] + m[1]]]
    line = round(_LETTERS * 1.6)
    height = plan.shape[0] + 3 * _MARGIN + line * (len(used) + 1)
    sheet = Image.new("RGB", (max(plan.shape[1] + 2 * _MARGIN, 640), height), WHITE)
    sheet.paste(Image.fromarray(plan), (_MARGIN, _MARGIN))
    pencil = ImageDraw.Draw(sheet)
    right, bottom = _MARGIN + plan.shape[1], _MARGIN + plan.shape[0]
    pencil.rectangle((_MARGIN - 1, _MARGIN - 1, right, bottom), outline=FAINT_INK)
    y = bottom + _MARGIN + line // 2
    draw_text(
        sheet, (_MARGIN, y), f"A: {names[0]}   B: {names[1]}", _LETTERS, anchor="lm", halo=None
    )
    for k, (_, _, colour, words) in enumerate(used, start=1):
        top = y + k * line - _LETTERS // 2
        box = (_MARGIN, top, _MARGIN + 2 * _LETTERS, top + _LETTERS)
        pencil.rectangle(box, fill=colour, outline=FAINT_INK)
        x = _MARGIN + 3 * _LETTERS
        draw_text(sheet, (x, y + k * line), words, _LETTERS, anchor="lm", halo=None)
    return png_bytes(sheet)


def _cropped(pairs: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The part in which either map knows something, with a margin of two cells."""
    known = pairs != 3 * NOT_KNOWN + NOT_KNOWN
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not rows.size:
        return pairs
    top, left = max(rows[0] - 2, 0), max(columns[0] - 2, 0)
    return pairs[top : rows[-1] + 3, left : columns[-1] + 3]


def _plan(pairs: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Cells as colours, shape (height, width, 3), enlarged or reduced."""
    colours = np.array([colour for _, _, colour, _ in _MEANINGS], dtype=np.uint8)
    longer = max(pairs.shape)
    if longer > _LARGEST_SIDE:
        factor = math.ceil(longer / _LARGEST_SIDE)
        return colours[_reduced(pairs, factor)]
    zoom = min(max(round(_USUAL_SIDE / longer), 1), _LARGEST_CELL)
    return colours[_RANKS[pairs]].repeat(zoom, axis=0).repeat(zoom, axis=1)


def _reduced(pairs: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """The highest rank of each block."""
    down, across = (np.arange(0, side, factor) for side in pairs.shape)
    ranks = np.empty((len(down), len(across)), dtype=np.uint8)
    for lines in bands(len(down), pairs.shape[1] * factor):
        part = _RANKS[pairs[lines.start * factor : lines.stop * factor]]
        part = np.maximum.reduceat(part, np.arange(0, len(part), factor), axis=0)
        ranks[lines] = np.maximum.reduceat(part, across, axis=1)
    return ranks
