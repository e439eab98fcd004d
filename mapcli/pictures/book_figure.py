"""A small map as the book draws it (Figs. 9.4 to 9.10).

Cells with their probabilities and `?`, obstacles grey, the robot's cell blue, its path with blue
arrows, its start in a ring, and small red squares along the boundary between the frontier and the
unknown cells; rows and columns numbered as in Fig. 9.10.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap
from mapcli.pictures.drawing import (
    BLUE,
    FAINT_INK,
    INK,
    RED,
    UNKNOWN,
    WHITE,
    arrow_head,
    draw_line,
    draw_polygon,
    draw_text,
    font,
)

OBSTACLE = (190, 193, 197)
LINE = (150, 154, 160)
ROBOT = (120, 172, 236)

USUAL_SIDE = 1200
"""Pixels of the picture's longer side, where the size of a cell allows it."""

SMALLEST_CELL, LARGEST_CELL = 12, 72
SMALLEST_LABELLED_CELL = 26
"""Pixels of a cell."""

BESIDE_LABELS = 0.34
"""By how much of a cell a path runs below and to the right of the middles, where numbers are."""

_EDGES = {(-1, 0): (0, 0, 1, 0), (1, 0): (0, 1, 1, 1), (0, -1): (0, 0, 0, 1), (0, 1): (1, 0, 1, 1)}
"""Neighbour (row, column) -> the edge shared with it: x0, y0, x1, y1 in cells."""


def cell_size(grid: GridMap, *, labels: bool, scale: int | None = None) -> int:
    """Pixels of a cell: `scale`, or what makes the picture about 1200 pixels long."""
    if scale is not None:
        return scale
    smallest = SMALLEST_LABELLED_CELL if labels else SMALLEST_CELL
    return min(max(USUAL_SIDE // max(grid.rows, grid.columns), smallest), LARGEST_CELL)


def book_image(
    grid: GridMap,
    *,
    labels: bool = True,
    frontier: NDArray[np.bool_] | None = None,
    robots: Sequence[tuple[int, int]] = (),
    path: Sequence[tuple[float, float]] = (),
    low: float = OCCUPIED_THRESHOLD,
    scale: int | None = None,
) -> Image.Image:
    """Draw a map as in the book.

    Args:
        grid: the map.
        labels: print probabilities and `?`, and number rows and columns; without them unknown
            cells are light grey.
        frontier: frontier cells, shape (rows, columns); their edges to unknown cells are marked.
        robots: cells of the robots.
        path: (row, column) of the cells passed, in order; fractions are allowed.
        low: cells from this probability on are drawn as obstacles.
        scale: pixels per cell.
    """
    size = cell_size(grid, labels=labels, scale=scale)
    margin = max(size // 3, 8)
    image = _cells_image(grid, robots, size, margin, low, unknown=WHITE if labels else UNKNOWN)
    if frontier is not None:
        _mark_frontier(image, grid, frontier, size, margin)
    if len(path) > 1:
        image = _draw_path(image, path, size, margin, BESIDE_LABELS if labels else 0.0)
    if labels:
        _write_cells(image, grid, size, margin)
        _number_sides(image, grid, size, margin)
    return image


def cells_passed(grid: GridMap, points: NDArray[np.float64]) -> list[tuple[int, int]]:
    """The map's cells that a path through world points, shape (n, 2), visits one after another."""
    cells = grid.cells_of_world(points)
    inside = (cells >= 0).all(axis=1) & (cells < (grid.rows, grid.columns)).all(axis=1)
    cells = cells[inside]
    fresh = np.ones(len(cells), dtype=bool)
    fresh[1:] = (np.diff(cells, axis=0) != 0).any(axis=1)
    return [(int(row), int(column)) for row, column in cells[fresh]]


def _cells_image(
    grid: GridMap, robots: Sequence[tuple[int, int]], size: int, margin: int, low: float,
    unknown: tuple[int, int, int],
) -> Image.Image:  # fmt: skip
    colours = np.empty((grid.rows, grid.columns, 3), dtype=np.uint8)
    colours[:] = WHITE
    colours[~grid.known] = unknown
    colours[grid.cells >= low] = OBSTACLE
    for row, column in robots:
        colours[row, column] = ROBOT
    cells = Image.fromarray(colours.repeat(size, axis=0).repeat(size, axis=1))
    width, height = cells.size
    image = Image.new("RGB", (width + 2 * margin, height + 2 * margin), WHITE)
    image.paste(cells, (margin, margin))
    draw = ImageDraw.Draw(image)
    thick = max(size // 40, 1)
    for column in range(grid.columns + 1):
        x = margin + column * size
        draw.line((x, margin, x, margin + height), fill=LINE, width=thick)
    for row in range(grid.rows + 1):
        y = margin + row * size
        draw.line((margin, y, margin + width, y), fill=LINE, width=thick)
    return image


def _write_cells(image: Image.Image, grid: GridMap, size: int, margin: int) -> None:
    stamps: dict[tuple[str, Any], tuple[Image.Image, Image.Image]] = {}
    for row, column in np.ndindex(grid.rows, grid.columns):
        text = probability_label(float(grid.cells[row, column]))
        left, top = margin + column * size, margin + row * size
        # A halo of the cell's own colour keeps the number legible where the path crosses it.
        halo = image.getpixel((left + size // 8, top + size // 8))
        if (text, halo) not in stamps:
            stamps[text, halo] = _label_stamp(text, size, halo)
        stamp, mask = stamps[text, halo]
        image.paste(stamp, (left, top), mask)


def _number_sides(image: Image.Image, grid: GridMap, size: int, margin: int) -> None:
    """The numbers of the rows at the left, of the columns below."""
    letters, middle = max(round(size * 0.24), 7), margin / 2
    for row in range(grid.rows):
        y = margin + (row + 0.5) * size
        draw_text(image, (middle, y), str(row), letters, fill=FAINT_INK, halo=None)
    for column in range(grid.columns):
        x = margin + (column + 0.5) * size
        below = image.height - middle
        draw_text(image, (x, below), str(column), letters, fill=FAINT_INK, halo=None)


def _label_stamp(text: str, size: int, halo: Any) -> tuple[Image.Image, Image.Image]:
    """Letters in the middle of a cell, and where they and their halo cover it."""
    stamp, mask = Image.new("RGB", (size, size), halo), Image.new("L", (size, size))
    ink = FAINT_INK if text == "?" else INK
    height = 0.34 if len(text) < 4 else 0.26
    options: dict[str, Any] = {"font": font(max(round(size * height), 8)), "anchor": "mm"}
    ImageDraw.Draw(stamp).text((size / 2, size / 2), text, fill=ink, **options)
    halo_width = max(size // 24, 1)
    ImageDraw.Draw(mask).text(
        (size / 2, size / 2), text, fill=255, stroke_width=halo_width, **options
    )
    return stamp, mask


def probability_label(probability: float) -> str:
    """`?`, or the probability with at most two decimals."""
    return "?" if math.isnan(probability) else f"{round(probability, 2):g}"


def _mark_frontier(
    image: Image.Image, grid: GridMap, frontier: NDArray[np.bool_], size: int, margin: int
) -> None:
    """A line of small red squares on every edge between a frontier cell and an unknown one."""
    draw = ImageDraw.Draw(image)
    half = max(size / 18, 1.5)
    count = 5 if size >= 20 else 3
    unknown = ~grid.known
    for row, column in np.argwhere(frontier):
        for (down, right), (x0, y0, x1, y1) in _EDGES.items():
            if (
                not grid.contains(row + down, column + right)
                or not unknown[row + down, column + right]
            ):
                continue
            for k in range(count):
                part = (k + 0.5) / count
                x = margin + (column + x0 + (x1 - x0) * part) * size
                y = margin + (row + y0 + (y1 - y0) * part) * size
                draw.rectangle((x - half, y - half, x + half, y + half), fill=RED)


def _draw_path(
    image: Image.Image, path: Sequence[tuple[float, float]], size: int, margin: int, aside: float
) -> Image.Image:
    """The path, with an arrow head at each turn and at the end, and a ring where it starts.

    Args:
        aside: how far below and to the right of the cells' middles it runs, in cells.
    """
    cells = np.asarray(path, dtype=np.float64)
    points = (cells[:, ::-1] + 0.5 + aside) * size + margin
    pixels = np.array(image)
    draw_line(
        pixels, points, np.tile(np.array(BLUE, dtype=np.float64), (len(points), 1)), size / 30
    )
    image = Image.fromarray(pixels)
    x, y = (cells[0, ::-1] + 0.5) * size + margin
    ring = (x - 0.4 * size, y - 0.4 * size, x + 0.4 * size, y + 0.4 * size)
    ImageDraw.Draw(image).ellipse(ring, outline=BLUE, width=max(round(size / 24), 1))
    steps = np.diff(points, axis=0)
    for k, (dx, dy) in enumerate(steps):
        last = k == len(steps) - 1
        if not last and np.allclose(steps[k + 1] / size, steps[k] / size, atol=0.05):
            continue
        length = math.hypot(dx, dy)
        if length:
            # Between two cells, where no number is.
            x, y = points[k + 1] - steps[k] / length * size * 0.45
            corners = arrow_head(float(x), float(y), math.atan2(dy, dx), size * 0.13)
            draw_polygon(image, corners, BLUE, WHITE, 0)
    return image
