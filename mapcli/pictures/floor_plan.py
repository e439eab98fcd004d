"""A map as a floor plan for a report: white rooms, dark walls, the robot's path over it.

The plan shows what is known (and where the path went) in the map's own axes, x to the right and
y up when the origin has no yaw. Everything that explains it (scale bar, metres along the edges,
colours of the time) stands outside the plan, so that nothing covers the map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mapcli.model.grid import GridMap
from mapcli.pictures.drawing import (
    FAINT_INK,
    INK,
    RED,
    WHITE,
    Colour,
    arrow_head,
    draw_disc,
    draw_line,
    draw_polygon,
    font,
    label,
    round_length,
    time_colour,
    time_colours,
)
from mapcli.pictures.map_window import USUAL_SIDE, MapWindow, map_pixels, window_of

Marker = tuple[float, float, str]
"""A world point with a label."""


@dataclass(frozen=True)
class _Layout:
    """Sizes that grow with the picture, pixels."""

    unit: float

    @classmethod
    def of(cls, view: MapWindow) -> _Layout:
        return cls(min(max(max(view.width, view.height) / USUAL_SIDE, 0.7), 2.5))

    @property
    def letters(self) -> int:
        return round(24 * self.unit)

    @property
    def small(self) -> int:
        return round(18 * self.unit)

    @property
    def gap(self) -> int:
        return round(10 * self.unit)

    @property
    def margin(self) -> int:
        return round(40 * self.unit)


def plan_image(
    grid: GridMap,
    *,
    path: NDArray[np.float64] | None = None,
    stamps: NDArray[np.float64] | None = None,
    headings: NDArray[np.float64] | None = None,
    markers: Sequence[Marker] = (),
    frontier: NDArray[np.bool_] | None = None,
    title: str = "",
    caption: str = "",
    scale: int | None = None,
) -> Image.Image:
    """Draw a floor plan.

    Args:
        grid: the map.
        path: world points, shape (n, 2), in time order.
        stamps: seconds of the path's points, shape (n,); they colour the path.
        headings: of the path's points, radians, shape (n,); else arrows follow the path.
        markers: world points with labels.
        frontier: cells to mark in red, shape (rows, columns).
        title, caption: one line above, one line below.
        scale: pixels per cell; by default the longer side is about 1600 pixels.
    """
    view = window_of(grid, path, scale=scale)
    layout = _Layout.of(view)
    marks = _metre_marks(view)
    image, view = _sheet(view, layout, marks, title=bool(title), caption=bool(caption))
    pixels = map_pixels(view)
    _metre_lines(pixels, marks)
    if frontier is not None:
        _mark_cells(pixels, view, frontier, RED)
    image.paste(Image.fromarray(pixels), (view.x, view.y))
    _frame(image, view, layout, marks)
    if path is not None and len(path):
        image = _draw_path(image, view, layout, path, _fractions(path, stamps), headings)
        _time_bar(image, view, layout, stamps)
    for marker in markers:
        _pin(image, view, layout, marker)
    _scale_bar(image, view, layout)
    _write_around(image, view, layout, title, caption)
    return image


Marks = list[tuple[str, float]]
"""Metres as text, and their pixel along an edge of the plan."""


def _sheet(
    view: MapWindow, layout: _Layout, marks: tuple[Marks, Marks], *, title: bool, caption: bool
) -> tuple[Image.Image, MapWindow]:
    """White paper with room for the plan, and the view placed on it."""
    metres = [font(layout.small).getlength(text) for text, _ in marks[1]]
    left = round(max(metres, default=0)) + layout.margin
    top = layout.margin + (round(layout.letters * 1.2) if title else 0)
    width = max(left + view.width + layout.margin, round(700 * layout.unit))
    height = top + view.height + round(layout.letters * (6 if caption else 4))
    x = (width + left - layout.margin - view.width) // 2
    return Image.new("RGB", (width, height), WHITE), replace(view, x=x, y=top)


def _write_around(
    image: Image.Image, view: MapWindow, layout: _Layout, title: str, caption: str
) -> None:
    large, below = round(layout.letters * 1.3), image.height - layout.margin * 0.6
    label(image, view.x, layout.margin, title, large, anchor="ls")
    label(image, view.x, below, caption, layout.letters, anchor="ls", fill=FAINT_INK)


def _mark_cells(
    pixels: NDArray[np.uint8], view: MapWindow, cells: NDArray[np.bool_], colour: Colour
) -> None:
    corners = view.pixels_of_cells(np.argwhere(cells) - 0.5) - (view.x, view.y)
    size = max(int(view.zoom), 1)
    x, y = np.floor(corners + 1e-9).astype(int).T
    for dy in range(size):
        for dx in range(size):
            inside = (x + dx >= 0) & (y + dy >= 0) & (x + dx < view.width) & (y + dy < view.height)
            pixels[(y + dy)[inside], (x + dx)[inside]] = colour


def _metre_marks(view: MapWindow) -> tuple[Marks, Marks]:
    """Round metres along the lower edge, and along the left one.

    They are world coordinates when the map is not turned, else counted from its corner.
    """
    grid, origin = view.grid, view.grid.origin
    step = round_length(max(view.columns, view.rows) * grid.resolution / 5)
    digits = max(-math.floor(math.log10(step)), 0)
    x0, y0 = (0.0, 0.0) if abs(origin.theta) > 1e-9 else (origin.x, origin.y)
    left = x0 + view.left * grid.resolution
    bottom = y0 + (grid.rows - view.top - view.rows) * grid.resolution

    def marks(start: float, cells: int) -> Marks:
        if abs(start) > 1e9 * step:
            return []  # so far from the origin that round metres would all look the same
        first, last = math.ceil(start / step), math.floor((start + cells * grid.resolution) / step)
        per_metre = view.zoom / grid.resolution
        return [
            (f"{k * step:.{digits}f}", (k * step - start) * per_metre)
            for k in range(first, last + 1)
        ]

    along = [(text, view.height - pixel) for text, pixel in marks(bottom, view.rows)]
    return marks(left, view.columns), along


def _metre_lines(pixels: NDArray[np.uint8], marks: tuple[Marks, Marks]) -> None:
    """Faint lines at round metres, a tenth darker than what they cross."""
    for axis, edge in enumerate(marks):
        lines = pixels.swapaxes(0, 1) if axis == 0 else pixels
        for _, pixel in edge:
            if 0 <= round(pixel) < len(lines):
                lines[round(pixel)] = lines[round(pixel)] // 20 * 18 + 6


def _frame(
    image: Image.Image, view: MapWindow, layout: _Layout, marks: tuple[Marks, Marks]
) -> None:
    """A thin frame with metres along the left and the lower edge."""
    right, bottom = view.x + view.width, view.y + view.height
    ImageDraw.Draw(image).rectangle((view.x - 1, view.y - 1, right, bottom), outline=FAINT_INK)
    left, below = float(view.x - layout.gap), float(bottom + layout.gap)
    places = [(text, view.x + pixel, below, "mt") for text, pixel in marks[0]]
    places += [(text, left, view.y + pixel, "rm") for text, pixel in marks[1]]
    for text, x, y, anchor in places:
        label(image, x, y, text, layout.small, anchor=anchor, fill=FAINT_INK, halo=None)


def _fractions(
    path: NDArray[np.float64], stamps: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """How far through its time each point of the path is, 0 to 1; by count without stamps."""
    if stamps is None or stamps[-1] <= stamps[0]:
        return np.linspace(0, 1, len(path))
    fractions: NDArray[np.float64] = (stamps - stamps[0]) / (stamps[-1] - stamps[0])
    return fractions.clip(0, 1)


def _draw_path(
    image: Image.Image, view: MapWindow, layout: _Layout, path: NDArray[np.float64],
    fractions: NDArray[np.float64], headings: NDArray[np.float64] | None,
) -> Image.Image:  # fmt: skip
    points = view.pixels_of_world(path)
    pixels = np.array(image)
    radius = 1.9 * layout.unit
    draw_line(pixels, points, np.full((len(points), 3), 255.0), radius + 1.4 * layout.unit)
    draw_line(pixels, points, time_colours(fractions), radius)
    image = Image.fromarray(pixels)
    _arrows(image, view, layout, points, fractions, headings)
    # The start is the larger disc, so that it shows under an end in the same place.
    for k, text, side, size in ((0, "start", -1, 10.5), (-1, "end", 1, 7.0)):
        x, y = (float(v) for v in points[k])
        draw_disc(
            image, x, y, size * layout.unit, time_colour(fractions[k]), WHITE, 2 * layout.unit
        )
        room = 15 * layout.unit + font(layout.letters).getlength(text)
        side = 1 if x - room < view.x else -1 if x + room > view.x + view.width else side
        anchor = "lm" if side > 0 else "rm"
        label(image, x + side * 15 * layout.unit, y, text, layout.letters, anchor=anchor)
    return image


def _arrows(
    image: Image.Image, view: MapWindow, layout: _Layout, points: NDArray[np.float64],
    fractions: NDArray[np.float64], headings: NDArray[np.float64] | None,
) -> None:  # fmt: skip
    """Arrow heads along the path, at most forty and far enough apart not to crowd it."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    spacing = max(0.09 * max(view.width, view.height), along[-1] / 40)
    for distance in np.arange(spacing, along[-1] - spacing / 3, spacing):
        k = int(np.searchsorted(along, distance))
        if headings is not None:
            direction = -(float(headings[k]) - view.grid.origin.theta)
        else:
            dx, dy = points[k] - points[k - 1]
            direction = math.atan2(dy, dx)
        x, y = (float(v) for v in points[k])
        corners = arrow_head(x, y, direction, 11 * layout.unit)
        draw_polygon(image, corners, time_colour(fractions[k]), WHITE, 1.2 * layout.unit)


def _pin(image: Image.Image, view: MapWindow, layout: _Layout, marker: Marker) -> None:
    x, y, text = marker
    px, py = (float(v) for v in view.pixels_of_world(np.array([[x, y]]))[0])
    draw_disc(image, px, py, 6 * layout.unit, RED, WHITE, 1.5 * layout.unit)
    label(image, px + 10 * layout.unit, py, text, layout.letters, anchor="lm")


def _scale_bar(image: Image.Image, view: MapWindow, layout: _Layout) -> None:
    """A bar of round metres under the plan's left corner."""
    per_metre = view.zoom / view.grid.resolution
    metres = round_length(0.3 * (image.width - view.x) / per_metre)
    y = view.y + view.height + round(layout.letters * 2.6)
    right = view.x + metres * per_metre
    thick = max(round(3 * layout.unit), 2)
    draw = ImageDraw.Draw(image)
    draw.rectangle((view.x, y, right, y + thick), fill=INK)
    for x in (view.x, right - thick + 1):
        draw.rectangle((x, y - thick * 2, x + thick - 1, y + thick), fill=INK)
    text = f"{metres:g} m"
    label(image, right + layout.letters * 0.6, y, text, layout.letters, anchor="lm", halo=None)


def _time_bar(
    image: Image.Image, view: MapWindow, layout: _Layout, stamps: NDArray[np.float64] | None
) -> None:
    """What the path's colours mean, under the plan's right corner."""
    seconds = float(stamps[-1] - stamps[0]) if stamps is not None and len(stamps) else None
    last = "end" if seconds is None else duration(seconds)
    first = "start" if seconds is None else "0"
    width, height = round(220 * layout.unit), max(round(8 * layout.unit), 4)
    room = font(layout.letters).getlength(last)
    x = round(
        max(view.x + view.width, image.width - layout.margin) - room - layout.letters * 0.6 - width
    )
    y = view.y + view.height + round(layout.letters * 2.6)
    ramp = np.rint(time_colours(np.linspace(0, 1, width))).astype(np.uint8)
    image.paste(Image.fromarray(np.repeat(ramp[None], height, axis=0)), (x, y - height // 2))
    label(image, x - layout.letters * 0.5, y, first, layout.letters, anchor="rm", halo=None)
    label(image, x + width + layout.letters * 0.5, y, last, layout.letters, anchor="lm", halo=None)


def duration(seconds: float) -> str:
    """A length of time as people write it: 8.2 s, 3 min 20 s, 1 h 05 min."""
    if seconds < 60:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s" if rest else f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60:02d} min"
