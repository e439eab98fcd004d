"""The window of a map that a picture shows, and the pixels on which its cells fall."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapcli.model.grid import GridMap, bands
from mapcli.model.seen_part import seen_edges
from mapcli.pictures.drawing import INK, UNKNOWN, WHITE, Colour

USUAL_SIDE, LARGEST_SIDE = 1600, 4000
"""Pixels of a plan's longer side: what is aimed at, and where reducing begins."""

LARGEST_CELL = 48
"""Pixels of a cell in the plan of a tiny map."""


@dataclass(frozen=True, eq=False)
class MapWindow:
    """Which cells of a map a plan shows, and where on the picture.

    Attributes:
        grid: the map.
        top, left: first row and column shown; may lie outside the map.
        rows, columns: how many are shown.
        zoom: pixels per cell: whole, or 1/k for maps that are reduced k-fold.
        x, y: the picture's pixel where the plan begins.
    """

    grid: GridMap
    top: int
    left: int
    rows: int
    columns: int
    zoom: float
    x: int = 0
    y: int = 0

    @property
    def width(self) -> int:
        return math.ceil(self.columns * self.zoom)

    @property
    def height(self) -> int:
        return math.ceil(self.rows * self.zoom)

    def pixels_of_cells(self, cells: ArrayLike) -> NDArray[np.float64]:
        """Pixel points (x, y) of fractional (row, column), shape (n, 2)."""
        rows, columns = np.asarray(cells, dtype=np.float64).reshape(-1, 2).T
        x = (columns + 0.5 - self.left) * self.zoom + self.x
        y = (rows + 0.5 - self.top) * self.zoom + self.y
        return np.column_stack([x, y])

    def pixels_of_world(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixel points (x, y) of world points, shape (n, 2)."""
        return self.pixels_of_cells(self.grid.fractional_cells_of_world(points))


@dataclass(frozen=True)
class PlanLayout:
    """Sizes of what stands on and around a plan, which grow with it, pixels."""

    unit: float

    @classmethod
    def of(cls, window: MapWindow) -> PlanLayout:
        return cls(min(max(max(window.width, window.height) / USUAL_SIDE, 0.7), 2.5))

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


def window_of(
    grid: GridMap, path: NDArray[np.float64] | None = None, *, scale: int | None = None,
    crop: bool = True,
) -> MapWindow:  # fmt: skip
    """The window around what is known and the path, with a margin.

    Args:
        path: of the robot that saw the map; glimpses are left out then.
        scale: pixels per cell.
    """
    top, left, bottom, right = _window(grid, path) if crop else (0, 0, grid.rows, grid.columns)
    longer = max(bottom - top, right - left)
    if scale is not None:
        zoom = float(scale)
    elif longer > LARGEST_SIDE:
        zoom = 1.0 / math.ceil(longer / LARGEST_SIDE)
    else:
        zoom = float(min(max(round(USUAL_SIDE / longer), 1), LARGEST_CELL))
    return MapWindow(grid, top, left, bottom - top, right - left, zoom)


def _window(grid: GridMap, path: NDArray[np.float64] | None) -> tuple[int, int, int, int]:
    """Top, left, bottom, right of what is to be seen, the latter two one past the last cell."""
    known = grid.known
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if rows.size == 0:
        rows, columns = np.array([0, grid.rows - 1]), np.array([0, grid.columns - 1])
    elif path is not None:
        rows, columns = seen_edges(known, grid.resolution)
    if path is not None and len(path):
        # A path that leaves the map by more than the map's size would leave nothing of the map.
        reach = max(grid.rows, grid.columns)
        limit = (grid.rows - 1 + reach, grid.columns - 1 + reach)
        cells = np.clip(grid.fractional_cells_of_world(path), -reach, limit).round().astype(int)
        rows, columns = np.append(rows, cells[:, 0]), np.append(columns, cells[:, 1])
    margin = max(2, round(0.02 * max(np.ptp(rows), np.ptp(columns))))
    return (
        int(rows.min()) - margin,
        int(columns.min()) - margin,
        int(rows.max()) + margin + 1,
        int(columns.max()) + margin + 1,
    )


def map_pixels(window: MapWindow) -> NDArray[np.uint8]:
    """The cells of a window as colours, shape (height, width, 3); walls survive reducing."""
    factor = max(round(1 / window.zoom), 1)
    lines = -(-window.rows // factor)
    colours = np.empty((lines, -(-window.columns // factor), 3), dtype=np.uint8)
    for band in bands(lines, window.columns * factor):
        cells = _shown_cells(window, band.start * factor, min(band.stop * factor, window.rows))
        cells = _pool(cells, factor) if factor > 1 else cells
        levels = np.where(np.isnan(cells), _UNKNOWN_LEVEL, np.rint(cells * np.float32(100)))
        colours[band] = _LEVEL_COLOURS[levels.astype(np.uint8)]
    if window.zoom > 1:
        colours = colours.repeat(int(window.zoom), axis=1).repeat(int(window.zoom), axis=0)
    return colours


def mark_cells(
    pixels: NDArray[np.uint8], window: MapWindow, cells: NDArray[np.integer], colour: Colour
) -> None:
    """Colour cells, (row, column) in shape (n, 2), in the window's pixels, in place; at least a
    pixel each."""
    corners = window.pixels_of_cells(cells - 0.5) - (window.x, window.y)
    x, y = np.floor(corners + 1e-9).astype(int).T
    size = max(int(window.zoom), 1)
    for down, right in np.ndindex(size, size):
        inside = (x + right >= 0) & (x + right < pixels.shape[1])
        inside &= (y + down >= 0) & (y + down < pixels.shape[0])
        pixels[(y + down)[inside], (x + right)[inside]] = colour


def _shown_cells(window: MapWindow, first: int, last: int) -> NDArray[np.float32]:
    """The cells of the window's rows from `first` to before `last`, shape (rows, columns);
    outside the map they are unknown."""
    shown = np.full((last - first, window.columns), np.nan, dtype=np.float32)
    start = window.top + first
    top, left = max(start, 0), max(window.left, 0)
    bottom = min(window.top + last, window.grid.rows)
    right = min(window.left + window.columns, window.grid.columns)
    if bottom > top and right > left:
        part = shown[top - start : bottom - start, left - window.left : right - window.left]
        part[:] = window.grid.part(top, left, bottom, right).cells
    return shown


def _pool(cells: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """The highest known probability of each block, so that thin walls stay."""
    rows, columns = (-(-side // factor) for side in cells.shape)
    pooled = np.full((rows, columns), np.nan, dtype=np.float32)
    for row, column in np.ndindex(factor, factor):
        part = cells[row::factor, column::factor]
        place = pooled[: part.shape[0], : part.shape[1]]
        np.fmax(place, part, out=place)
    return pooled


_UNKNOWN_LEVEL = np.float32(101)


def _level_colours() -> NDArray[np.uint8]:
    """Free cells white and obstacles dark, with a short ramp between, shape (102, 3)."""
    darkness = np.clip((np.arange(101) / 100 - 0.3) / 0.4, 0, 1)[:, None]
    ramp = np.array(WHITE) * (1 - darkness) + np.array(INK) * darkness
    return np.vstack([np.rint(ramp), UNKNOWN]).astype(np.uint8)


_LEVEL_COLOURS = _level_colours()
