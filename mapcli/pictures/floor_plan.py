"""A map as a floor plan for a report: white rooms, dark walls, the robot's path over it.

The plan shows what is known (and where the path went) in the map's own axes, x to the right and
y up when the origin has no yaw. Everything that explains it (scale bar, metres along the edges,
colours of the time) stands outside the plan, so that nothing covers the map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mapcli.model.grid import GridMap
from mapcli.pictures.drawing import (
    FAINT_INK,
    INK,
    RED,
    WHITE,
    draw_disc,
    draw_text,
    font,
    round_length,
    time_colours,
)
from mapcli.pictures.map_window import MapWindow, PlanLayout, map_pixels, mark_cells, window_of
from mapcli.pictures.robot_path import RobotPath, draw_path


class Marker(NamedTuple):
    """A point of the world, metres, with a label."""

    x: float
    y: float
    text: str


def plan_image(
    grid: GridMap,
    *,
    path: RobotPath | Sequence[RobotPath] | None = None,
    markers: Sequence[Marker] = (),
    frontier: NDArray[np.bool_] | None = None,
    title: str = "",
    caption: str = "",
    scale: int | None = None,
) -> Image.Image:
    """Draw a floor plan.

    Args:
        grid: the map.
        path: of the robot, coloured by time; or of several, each in its colour.
        markers: points with labels.
        frontier: cells to mark in red, shape (rows, columns).
        title, caption: one line above, one line below.
        scale: pixels per cell; by default the longer side is about 1600 pixels.
    """
    paths = [path] if isinstance(path, RobotPath) else path or ()
    driven = [one.points for one in paths]
    window = window_of(grid, np.concatenate(driven) if driven else None, scale=scale)
    layout = PlanLayout.of(window)
    marks = metre_marks(window)
    is_doubtful = any(one.doubtful is not None and one.doubtful.any() for one in paths)
    lines = 4 + LEGEND_LINES * is_doubtful + 2 * bool(caption)
    image, window = sheet(window, layout, marks, title=bool(title), lines=lines)
    pixels = map_pixels(window)
    metre_lines(pixels, marks)
    if frontier is not None:
        mark_cells(pixels, window, np.argwhere(frontier), RED)
    image.paste(Image.fromarray(pixels), (window.x, window.y))
    frame(image, window, layout, marks)
    for one in paths:
        if len(one.points):
            image = draw_path(image, window, layout, one)
    if isinstance(path, RobotPath) and len(path.points):
        _time_bar(image, window, layout, path.duration)
        if is_doubtful:
            _doubtful_line(image, window, layout)
    for marker in markers:
        _pin(image, window, layout, marker)
    scale_bar(image, window, layout)
    _write_around(image, window, layout, title, caption)
    return image


LEGEND_LINES = 1.6
"""Lines of letters that a line of the legend takes."""

Marks = list[tuple[str, float]]
"""Metres as text, and their pixel along an edge of the plan."""


def sheet(
    window: MapWindow, layout: PlanLayout, marks: tuple[Marks, Marks], *, title: bool, lines: float
) -> tuple[Image.Image, MapWindow]:
    """White paper with room for the plan, and so many lines under it; the window placed on it."""
    metres = [font(layout.small).getlength(text) for text, _ in marks[1]]
    left = round(max(metres, default=0)) + layout.margin
    top = layout.margin + (round(layout.letters * 1.2) if title else 0)
    width = max(left + window.width + layout.margin, round(700 * layout.unit))
    height = top + window.height + round(layout.letters * lines)
    x = (width + left - layout.margin - window.width) // 2
    return Image.new("RGB", (width, height), WHITE), replace(window, x=x, y=top)


def _write_around(
    image: Image.Image, window: MapWindow, layout: PlanLayout, title: str, caption: str
) -> None:
    large, below = round(layout.letters * 1.3), image.height - layout.margin * 0.6
    draw_text(image, (window.x, layout.margin), title, large, anchor="ls")
    draw_text(image, (window.x, below), caption, layout.letters, anchor="ls", fill=FAINT_INK)


def metre_marks(window: MapWindow) -> tuple[Marks, Marks]:
    """Round metres along the lower edge, and along the left one.

    They are world coordinates when the map is not turned, else counted from its corner.
    """
    grid, origin = window.grid, window.grid.origin
    step = round_length(max(window.columns, window.rows) * grid.resolution / 5)
    digits = max(-math.floor(math.log10(step)), 0)
    x0, y0 = (0.0, 0.0) if abs(origin.theta) > 1e-9 else (origin.x, origin.y)
    left = x0 + window.left * grid.resolution
    bottom = y0 + (grid.rows - window.top - window.rows) * grid.resolution

    def marks(start: float, cells: int) -> Marks:
        if abs(start) > 1e9 * step:
            return []  # so far from the origin that round metres would all look the same
        first, last = math.ceil(start / step), math.floor((start + cells * grid.resolution) / step)
        per_metre = window.zoom / grid.resolution
        return [
            (f"{k * step:.{digits}f}", (k * step - start) * per_metre)
            for k in range(first, last + 1)
        ]

    along = [(text, window.height - pixel) for text, pixel in marks(bottom, window.rows)]
    return marks(left, window.columns), along


def metre_lines(pixels: NDArray[np.uint8], marks: tuple[Marks, Marks]) -> None:
    """Faint lines at round metres, a tenth darker than what they cross."""
    for axis, edge in enumerate(marks):
        lines = pixels.swapaxes(0, 1) if axis == 0 else pixels
        for _, pixel in edge:
            if 0 <= round(pixel) < len(lines):
                lines[round(pixel)] = lines[round(pixel)] // 20 * 18 + 6


def frame(
    image: Image.Image, window: MapWindow, layout: PlanLayout, marks: tuple[Marks, Marks]
) -> None:
    """A thin frame with metres along the left and the lower edge."""
    right, bottom = window.x + window.width, window.y + window.height
    ImageDraw.Draw(image).rectangle((window.x - 1, window.y - 1, right, bottom), outline=FAINT_INK)
    left, below = float(window.x - layout.gap), float(bottom + layout.gap)
    places = [(text, window.x + pixel, below, "mt") for text, pixel in marks[0]]
    places += [(text, left, window.y + pixel, "rm") for text, pixel in marks[1]]
    for text, x, y, anchor in places:
        draw_text(image, (x, y), text, layout.small, anchor=anchor, fill=FAINT_INK, halo=None)


def _pin(image: Image.Image, window: MapWindow, layout: PlanLayout, marker: Marker) -> None:
    x, y, text = marker
    px, py = (float(v) for v in window.pixels_of_world(np.array([[x, y]]))[0])
    draw_disc(image, px, py, 6 * layout.unit, RED, WHITE, 1.5 * layout.unit)
    draw_text(image, (px + 10 * layout.unit, py), text, layout.letters, anchor="lm")


def scale_bar(image: Image.Image, window: MapWindow, layout: PlanLayout) -> None:
    """A bar of round metres under the plan's left corner."""
    per_metre = window.zoom / window.grid.resolution
    metres = round_length(0.3 * (image.width - window.x) / per_metre)
    y = window.y + window.height + round(layout.letters * 2.6)
    right = window.x + metres * per_metre
    thick = max(round(3 * layout.unit), 2)
    draw = ImageDraw.Draw(image)
    draw.rectangle((window.x, y, right, y + thick), fill=INK)
    for x in (window.x, right - thick + 1):
        draw.rectangle((x, y - thick * 2, x + thick - 1, y + thick), fill=INK)
    text = f"{metres:g} m"
    draw_text(
        image, (right + layout.letters * 0.6, y), text, layout.letters, anchor="lm", halo=None
    )


def _time_bar(
    image: Image.Image, window: MapWindow, layout: PlanLayout, seconds: float | None
) -> None:
    """What the path's colours mean, under the plan's right corner."""
    last = "end" if seconds is None else duration(seconds)
    first = "start" if seconds is None else "0"
    width, height = round(220 * layout.unit), max(round(8 * layout.unit), 4)
    room = font(layout.letters).getlength(last)
    x = round(
        max(window.x + window.width, image.width - layout.margin)
        - room
        - layout.letters * 0.6
        - width
    )
    y = window.y + window.height + round(layout.letters * 2.6)
    ramp = np.rint(time_colours(np.linspace(0, 1, width))).astype(np.uint8)
    image.paste(Image.fromarray(np.repeat(ramp[None], height, axis=0)), (x, y - height // 2))
    draw_text(image, (x - layout.letters * 0.5, y), first, layout.letters, anchor="rm", halo=None)
    draw_text(
        image, (x + width + layout.letters * 0.5, y), last, layout.letters, anchor="lm", halo=None
    )


def _doubtful_line(image: Image.Image, window: MapWindow, layout: PlanLayout) -> None:
    """What red on the path means, under what its other colours mean."""
    text, half = "not to be trusted", max(round(2 * layout.unit), 2)
    right = max(window.x + window.width, image.width - layout.margin)
    y = window.y + window.height + round(layout.letters * (2.6 + LEGEND_LINES))
    x = right - font(layout.letters).getlength(text) - layout.letters * 0.5
    draw = ImageDraw.Draw(image)
    draw.rectangle((x - 3 * layout.letters, y - half, x, y + half), fill=RED)
    draw_text(image, (right, y), text, layout.letters, anchor="rm", halo=None)


def duration(seconds: float) -> str:
    """A length of time as people write it: 8.2 s, 3 min 20 s, 1 h 05 min."""
    if seconds < 60:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s" if rest else f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60:02d} min"
