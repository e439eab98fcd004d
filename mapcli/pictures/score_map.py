"""The scores of a whole window of poses as a heat map."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mapcli.formats.documents.similarity_table import number_text
from mapcli.model.local_maxima import WindowScores
from mapcli.model.similarity import ScoredCandidate
from mapcli.pictures.drawing import (
    FAINT_INK,
    INK,
    RED,
    UNKNOWN,
    WHITE,
    Colour,
    draw_disc,
    draw_text,
    font,
    png_bytes,
    round_length,
    time_colours,
)
from mapcli.pictures.similarity import LETTERS, LINE, MARGIN, SIDE, TITLE

Floats = NDArray[np.float64]


def heat_map(scores: WindowScores, *, lower: bool) -> bytes:
    """A PNG of the best score of all headings at each position of a window."""
    surface, along, maxima = scores.surface, scores.along, scores.maxima
    side = len(along)
    size = max(1, min(SIDE * 1.3 / side, 60))
    values = -surface if lower else surface
    able = ~np.isnan(values)
    low, high = float(np.min(values[able])), float(np.max(values[able]))
    share = np.where(able, (values - low) / max(high - low, 1e-12), 0.0)
    pixels = np.rint(time_colours(share.ravel())).reshape(side, side, 3).astype(np.uint8)
    pixels[~able] = UNKNOWN
    width = max(round(side * size), 1)
    plan = Image.fromarray(pixels).resize((width, width), Image.Resampling.NEAREST)
    left, top = 3 * MARGIN + TITLE, 2 * TITLE
    image = Image.new("RGB", (max(left + width + 160, 760), top + width + 3 * TITLE), WHITE)
    image.paste(plan, (left, top))
    _steps(image, along, (left, top, width))
    score = number_text(maxima.peak.score)
    draw_text(image, (MARGIN, TITLE / 2), f"best score of all headings, peak {score}", LETTERS,
          anchor="lm")  # fmt: skip
    _bar(image, (left + width + 40, top, width), (low, high), lower=lower)
    _peak(image, maxima.peak, along, (left, top, width), RED, "peak")
    if maxima.second is not None:
        _peak(image, maxima.second, along, (left, top, width), WHITE, "2")
    told = "no second peak" if maxima.second is None else (
        f"second peak (2): {number_text(maxima.second.score)}")  # fmt: skip
    draw_text(image, (MARGIN, image.height - TITLE / 2), told, LETTERS, anchor="lm", fill=FAINT_INK)
    return png_bytes(image)


def _place(
    candidate: ScoredCandidate, along: Floats, box: tuple[int, int, int]
) -> tuple[float, float]:
    """The middle of a pose's square; the table's rows run right, then up."""
    side = len(along)
    dv, du = divmod(candidate.place[0], side)
    left, top, width = box
    return left + (du + 0.5) * width / side, top + (side - dv - 0.5) * width / side


def _peak(
    image: Image.Image, candidate: ScoredCandidate, along: Floats, box: tuple[int, int, int],
    colour: Colour, text: str,
) -> None:  # fmt: skip
    x, y = _place(candidate, along, box)
    edge = INK if colour == WHITE else WHITE
    draw_disc(image, x, y, 7, colour, edge, 2)
    said = f"{text} ({candidate.turn_deg:g} deg)"
    room = x + 14 + font(LETTERS).getlength(said) < box[0] + box[2]
    draw_text(image, (x + (14 if room else -14), y), said, LETTERS, anchor="lm" if room else "rm")


def _steps(image: Image.Image, along: Floats, box: tuple[int, int, int]) -> None:
    """Round steps along the left and the lower edge."""
    left, top, width = box
    ImageDraw.Draw(image).rectangle((left - 1, top - 1, left + width, top + width), outline=LINE)
    if len(along) < 2:
        return
    spacing = float(along[1] - along[0])
    tick = round_length(float(along[-1] - along[0]) / 3)
    for k in range(-math.floor(along[-1] / tick + 1e-9), math.floor(along[-1] / tick + 1e-9) + 1):
        at = (k * tick - float(along[0])) / spacing + 0.5
        pixel = at * width / len(along)
        draw_text(image, (left + pixel, top + width + 8), f"{k * tick:g}", 16, anchor="mt",
              fill=FAINT_INK, halo=None)  # fmt: skip
        draw_text(image, (left - 8, top + width - pixel), f"{k * tick:g}", 16, anchor="rm",
              fill=FAINT_INK, halo=None)  # fmt: skip
    below = left + width / 2, top + width + 32
    draw_text(
        image, below, "right of the intended pose", 16, anchor="mt", fill=FAINT_INK, halo=None
    )
    draw_text(image, (left, top - 12), "up", 16, anchor="rb", fill=FAINT_INK, halo=None)


def _bar(
    image: Image.Image, place: tuple[int, int, int], ends: tuple[float, float], *, lower: bool
) -> None:
    """What the colours mean."""
    x, top, height = place
    ramp = np.rint(time_colours(np.linspace(1, 0, height))).astype(np.uint8)
    image.paste(Image.fromarray(np.repeat(ramp[:, None], 16, axis=1)), (x, top))
    worst, best = (-ends[0], -ends[1]) if lower else ends
    for y, value, anchor in ((top, best, "lt"), (top + height, worst, "lb")):
        draw_text(image, (x + 22, y), number_text(value + 0.0), 16, anchor=anchor, halo=None)
