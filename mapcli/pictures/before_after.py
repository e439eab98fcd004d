"""Two pictures side by side: a trace or a map before and after its walls were made square."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from mapcli.model.grid import GridMap
from mapcli.model.rectified import Floats, RectifiedTrace
from mapcli.pictures.drawing import (
    BLUE,
    FAINT_INK,
    INK,
    RED,
    WHITE,
    draw_disc,
    draw_line,
    draw_text,
    png_bytes,
    round_length,
)
from mapcli.pictures.floor_plan import plan_image

PANEL = 760
"""Pixels of a panel's longer side."""

MARGIN, HEAD, FOOT = 50, 90, 80


def rectified_trace_picture(before: Floats, result: RectifiedTrace) -> bytes:
    """A PNG like Fig. 9.11: the trace as it came, and along straight walls, at the same scale.

    Args:
        before: positions, shape (n, 2).
    """
    everything = np.concatenate([before, result.corners])
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = 0.04 * float((high - low).max())
    low, size = low - margin, high - low + 2 * margin
    zoom = PANEL / float(size.max())
    width, height = (int(side) for side in np.ceil(size * zoom))
    panels = []
    for line, gap in ((before, result.gap_before), (result.corners, result.gap_after)):
        x, y = ((line - low) * zoom).T
        panels.append(_path_panel(np.column_stack([x, height - y]), (width, height), gap * zoom))
    sheet = _sheet(panels, [
        ("before", f"{result.gap_before:.2f} m from the end to the start"),
        ("straight walls, right angles", f"{result.gap_square:.2f} m before the lengths were "
         f"adjusted, then {result.gap_after:.2f} m" if result.is_loop else
         f"{result.gap_after:.2f} m from the end to the start"),
    ])  # fmt: skip
    metres = round_length(PANEL / zoom / 4)
    bar = (MARGIN, HEAD + height + 30, MARGIN + metres * zoom, HEAD + height + 33)
    ImageDraw.Draw(sheet).rectangle(bar, fill=INK)
    draw_text(sheet, (bar[2] + 14, bar[1]), f"{metres:g} m", 22, anchor="lm", halo=None)
    return png_bytes(sheet)


def rectified_map_picture(before: GridMap, after: GridMap) -> bytes:
    """A PNG of two floor plans."""
    return png_bytes(
        _sheet([plan_image(before), plan_image(after)], [("before", ""), ("after", "")])
    )


def _path_panel(points: Floats, size: tuple[int, int], gap: float) -> Image.Image:
    """A path with its start and end, and a red line over the gap between them, pixels."""
    pixels = np.array(Image.new("RGB", size, WHITE))
    ends = points[[-1, 0]]
    if gap > 1:
        draw_line(pixels, ends, np.tile(np.array(RED, np.float64), (2, 1)), 1.2)
    draw_line(pixels, points, np.tile(np.array(BLUE, np.float64), (len(points), 1)), 2.4)
    image = Image.fromarray(pixels)
    for (x, y), radius, colour in ((points[0], 9, INK), (points[-1], 5, RED)):
        draw_disc(image, float(x), float(y), radius, colour, WHITE, 2)
    return image


def _sheet(panels: Sequence[Image.Image], titles: Sequence[tuple[str, str]]) -> Image.Image:
    width = MARGIN + sum(panel.width + MARGIN for panel in panels)
    height = HEAD + max(panel.height for panel in panels) + FOOT
    sheet = Image.new("RGB", (width, height), WHITE)
    x = MARGIN
    for panel, (title, caption) in zip(panels, titles, strict=True):
        sheet.paste(panel, (x, HEAD))
        draw_text(sheet, (x, HEAD - 44), title, 26, anchor="ls", halo=None)
        draw_text(sheet, (x, HEAD - 14), caption, 20, anchor="ls", fill=FAINT_INK, halo=None)
        x += panel.width + MARGIN
    return sheet
