"""Pictures of mowers' paths: a few runs in full, and where all of them ended."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mapcli.model.mowing import Floats, Mowing, MowingPlan
from mapcli.pictures.drawing import (
    FAINT_INK,
    INK,
    RED,
    WHITE,
    Colour,
    draw_disc,
    draw_line,
    draw_text,
    png_bytes,
    round_length,
)

PANEL = 760
"""Pixels of a panel's longer side."""

MARGIN, HEAD, FOOT = 50, 90, 90

SHOWN = 3
"""Runs drawn in full."""

LAWN: Colour = (222, 238, 214)
PATHS: tuple[Colour, ...] = ((38, 90, 196), (214, 137, 16), (122, 60, 160))


def mowing_picture(plan: MowingPlan, mowings: Sequence[Mowing]) -> bytes:
    """A PNG with one panel for each of the mowings, all at the same scale.

    Each shows the lawn, the tape marks, the paths of the first runs, the ends of all runs in red,
    and the station as a ring.
    """
    low, high = _extent(plan, mowings)
    zoom = PANEL / float((high - low).max())
    width, height = (int(side) for side in np.ceil((high - low) * zoom))
    panels = [_panel(plan, mowing, low, zoom, (width, height)) for mowing in mowings]
    sheet = Image.new("RGB", (MARGIN + len(panels) * (width + MARGIN), HEAD + height + FOOT), WHITE)
    for k, (panel, mowing) in enumerate(zip(panels, mowings, strict=True)):
        x = MARGIN + k * (width + MARGIN)
        sheet.paste(panel, (x, HEAD))
        draw_text(sheet, (x, HEAD - 44), _title(plan, mowing), 26, anchor="ls", halo=None)
        draw_text(
            sheet, (x, HEAD - 14), _caption(mowing), 20, anchor="ls", fill=FAINT_INK, halo=None
        )
    _scale_bar(sheet, zoom, HEAD + height + 36)
    return png_bytes(sheet)


def _extent(plan: MowingPlan, mowings: Sequence[Mowing]) -> tuple[Floats, Floats]:
    """The corners of everything shown, and a margin."""
    paths = [run.path for mowing in mowings for run in mowing.runs[:SHOWN]]
    ends = [mowing.end_errors + plan.station for mowing in mowings]
    everything = np.concatenate([plan.outline, *paths, *ends])
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = 0.03 * float((high - low).max())
    return low - margin, high + margin


def _panel(
    plan: MowingPlan, mowing: Mowing, low: Floats, zoom: float, size: tuple[int, int]
) -> Image.Image:
    def place(points: Floats) -> Floats:
        x, y = ((points - low) * zoom).T
        return np.column_stack([x, size[1] - y])

    image = Image.new("RGB", size, WHITE)
    draw = ImageDraw.Draw(image)
    outline = [(float(x), float(y)) for x, y in place(plan.outline)]
    draw.polygon(outline, fill=LAWN)
    for x, y in place(plan.marks) if mowing.landmark_size is not None else ():
        half = max((mowing.landmark_size or 0) * zoom / 2, 2)
        draw.rectangle((x - half, y - half, x + half, y + half), fill=INK)
    pixels = np.array(image)
    for run, colour in zip(mowing.runs[:SHOWN], PATHS, strict=False):
        _draw(pixels, place(run.path), colour)
    image = Image.fromarray(pixels)
    for x, y in place(mowing.end_errors + plan.station):
        draw_disc(image, float(x), float(y), 4, RED, WHITE, 1)
    x, y = (float(value) for value in place(plan.station[None])[0])
    for radius, colour in ((11, INK), (8, WHITE), (5, INK)):
        draw_disc(image, x, y, radius, colour, colour, 0)
    return image


def _draw(pixels: NDArray[np.uint8], points: Floats, colour: Colour) -> None:
    colours = np.tile(np.array(colour, dtype=np.float64), (len(points), 1))
    draw_line(pixels, points, colours, 1.2)


def _title(plan: MowingPlan, mowing: Mowing) -> str:
    if mowing.landmark_size is None:
        return "by odometry alone"
    return f"with {len(plan.marks)} landmarks of {mowing.landmark_size:g} m"


def _caption(mowing: Mowing) -> str:
    shown, runs = min(SHOWN, len(mowing.runs)), len(mowing.runs)
    mean = float(mowing.distances.mean())
    return f"paths of {shown} runs, ends of {runs} (red): {mean:.2f} m from the station on average"


def _scale_bar(sheet: Image.Image, zoom: float, y: int) -> None:
    metres = round_length(PANEL / zoom / 4)
    right = MARGIN + metres * zoom
    ImageDraw.Draw(sheet).rectangle((MARGIN, y, right, y + 3), fill=INK)
    draw_text(sheet, (right + 14, y), f"{metres:g} m", 22, anchor="lm", halo=None)
