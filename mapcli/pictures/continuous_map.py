"""A continuous map as the book draws it (Fig. 9.1b): outlines over a grid of coordinates."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from PIL import Image, ImageDraw

from mapcli.model.world import World
from mapcli.pictures.book_figure import OBSTACLE
from mapcli.pictures.drawing import (
    BLUE,
    FAINT_INK,
    INK,
    WHITE,
    draw_disc,
    draw_polygon,
    draw_text,
    png_bytes,
    round_length,
)

SIDE, MARGIN = 640, 48
"""Pixels: the longer side of the map, and around it."""

GRID = (226, 228, 231)

MOST_NAMED = 26
"""Vertices and points that are named by a letter each, with their coordinates."""

Box = tuple[float, float, float, float]
"""Left, bottom, right, top."""


def continuous_picture(world: World, *, box: Box | None = None, y_down: bool = False) -> bytes:
    """A PNG of polygons and points, with the numbers of both axes.

    Args:
        box: the part to draw; None for everything with a margin.
        y_down: the file counts y downwards (in `world` it is upwards); so do the numbers.
    """
    left, bottom, right, top = box or _around(world)
    zoom = SIDE / max(right - left, top - bottom)
    width, height = (max(math.ceil(s * zoom), 1) for s in (right - left, top - bottom))
    image = Image.new("RGB", (width + 2 * MARGIN, height + 2 * MARGIN), WHITE)

    def pixel(x: float, y: float) -> tuple[float, float]:
        return MARGIN + (x - left) * zoom, MARGIN + (top - y) * zoom

    _draw_axes(image, (left, bottom, right, top), zoom, y_down=y_down)
    for polygon in world.polygons:
        draw_polygon(image, [pixel(x, y) for x, y in polygon.tolist()], OBSTACLE, INK, 2)
    for x, y in world.points.tolist():
        draw_disc(image, *pixel(x, y), 7, BLUE, WHITE, 1)
    named = [*_vertices(world)]
    for letter, (x, y, away_x, away_y) in enumerate(named if len(named) <= MOST_NAMED else ()):
        down = -y + 0.0 if y_down else y
        px, py = pixel(x, y)
        text = f"{chr(ord('A') + letter)} ({x:g}, {down:g})"
        draw_text(image, (px + 40 * away_x, py - 22 * away_y), text, 17)
    return png_bytes(image)


def _around(world: World) -> Box:
    """Everything, and a tenth of its extent around it, so that whole steps of the axes fit."""
    left, bottom, right, top = world.bounds()
    step = round_length(max(right - left, top - bottom, 1e-9) / 8)
    return (
        math.floor(left / step - 0.5) * step, math.floor(bottom / step - 0.5) * step,
        math.ceil(right / step + 0.5) * step, math.ceil(top / step + 0.5) * step,
    )  # fmt: skip


def _draw_axes(image: Image.Image, box: Box, zoom: float, *, y_down: bool) -> None:
    """Grid lines at round coordinates, with the numbers of x below and of y at the left."""
    left, bottom, right, top = box
    draw, step = ImageDraw.Draw(image), round_length(max(right - left, top - bottom) / 8)
    foot, side = image.height - MARGIN, image.width - MARGIN
    for x in _ticks(left, right, step):
        across = MARGIN + (x - left) * zoom
        draw.line((across, MARGIN, across, foot), fill=GRID)
        draw_text(image, (across, foot + 16), f"{x:g}", 16, fill=FAINT_INK, halo=None)
    for y in _ticks(bottom, top, step):
        down = MARGIN + (top - y) * zoom
        draw.line((MARGIN, down, side, down), fill=GRID)
        text = f"{-y + 0.0 if y_down else y:g}"
        draw_text(image, (MARGIN - 10, down), text, 16, anchor="rm", fill=FAINT_INK, halo=None)
    draw.rectangle((MARGIN, MARGIN, side, foot), outline=FAINT_INK)


def _ticks(low: float, high: float, step: float) -> Iterator[float]:
    for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1):
        yield round(k * step, 9) + 0.0


def _vertices(world: World) -> Iterator[tuple[float, float, float, float]]:
    """x and y of each vertex and point, and the direction away from the middle of its polygon."""
    for polygon in world.polygons:
        away = polygon - polygon.mean(axis=0)
        unit = away / np.maximum(np.hypot(*away.T), 1e-12)[:, None]
        yield from ((*xy, *out) for xy, out in zip(polygon.tolist(), unit.tolist(), strict=True))
    yield from ((x, y, 0.0, 1.0) for x, y in world.points.tolist())
