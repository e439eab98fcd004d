"""Coverage over distance as a plot, of one strategy or several (Activity 9.2)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mapcli.model.exploration import CoverageCurve
from mapcli.pictures.drawing import (
    FAINT_INK,
    FAINT_LINE,
    WHITE,
    draw_disc,
    draw_line,
    draw_text,
    draw_x_scale,
    png_bytes,
)
from mapcli.pictures.exploration import colours_of, robot_colour

SIZE = (1200, 720)
LEFT, TOP, RIGHT, BOTTOM = 110, 40, 1160, 620
"""The plot in the picture, pixels."""

MOST_POINTS = 2000


def coverage_plot(curves: Mapping[str, CoverageCurve]) -> bytes:
    """A PNG with a line for each strategy: metres to the right, coverage up."""
    longest = max((float(curve.distance_m[-1]) for curve in curves.values()), default=0.0) or 1.0
    image = Image.new("RGB", SIZE, WHITE)
    _draw_axes(image, longest)
    pixels = np.array(image)
    for k, curve in enumerate(curves.values()):
        points = _points(curve, longest)
        draw_line(pixels, points, colours_of(k, len(points)), 2.2)
    image = Image.fromarray(pixels)
    _draw_legend(image, curves)
    return png_bytes(image)


def _points(curve: CoverageCurve, longest: float) -> NDArray[np.float64]:
    """Pixels of the line, shape (n, 2)."""
    count = len(curve.coverage)
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_POINTS)).round().astype(int))
    x = LEFT + curve.distance_m[chosen] / longest * (RIGHT - LEFT)
    y = BOTTOM - curve.coverage[chosen] * (BOTTOM - TOP)
    return np.column_stack([x, y])


def _draw_axes(image: Image.Image, longest: float) -> None:
    draw = ImageDraw.Draw(image)
    for percent in range(0, 101, 20):
        y = BOTTOM - percent / 100 * (BOTTOM - TOP)
        draw.line((LEFT, y, RIGHT, y), fill=FAINT_LINE)
        draw_text(image, (LEFT - 12, y), f"{percent} %", 20, anchor="rm", fill=FAINT_INK, halo=None)
    draw_x_scale(image, (LEFT, TOP, RIGHT, BOTTOM), longest, 12)
    middle = (LEFT + RIGHT) / 2
    draw_text(image, (middle, BOTTOM + 46), "distance driven, m", 20, anchor="mt", halo=None)
    draw_text(image, (LEFT, TOP - 10), "coverage", 20, anchor="lb", halo=None)


def _draw_legend(image: Image.Image, curves: Mapping[str, CoverageCurve]) -> None:
    for k, (strategy, curve) in enumerate(curves.items()):
        y = BOTTOM - 30 - 34 * (len(curves) - 1 - k)
        text = f"{strategy}: {curve.coverage[-1]:.1%} after {curve.distance_m[-1]:,.6g} m"
        draw_disc(image, RIGHT - 440, y, 8, robot_colour(k), robot_colour(k), 0)
        draw_text(image, (RIGHT - 420, y), text, 22, anchor="lm")
