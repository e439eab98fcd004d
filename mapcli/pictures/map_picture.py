"""Maps as pictures, PNG bytes: a floor plan for a report, or the book's look for small maps.

`plan_image` and `book_image` give the same as Pillow images, for frames of an animation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import ParamSpec

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.trajectory import Trajectory
from mapcli.pictures.book_figure import book_image, cells_passed
from mapcli.pictures.drawing import png_bytes
from mapcli.pictures.floor_plan import Marker, plan_image
from mapcli.pictures.map_window import MapWindow, map_pixels, mark_cells, window_of
from mapcli.pictures.robot_path import RobotPath

__all__ = [
    "MapWindow",
    "Marker",
    "RobotPath",
    "book_image",
    "book_picture",
    "cells_passed",
    "floor_plan",
    "map_pixels",
    "mark_cells",
    "plan_image",
    "png_bytes",
    "render",
    "window_of",
]

BOOK_SIDE = 64
"""Maps up to this many rows and columns get the book's look."""

LABELLED_SIDE = 250
"""Numbers in the cells of larger maps could not be read."""

LARGEST_PICTURE = 10_000
"""Pixels of a side, when pixels per cell are asked for."""

P = ParamSpec("P")


def _as_png(draw: Callable[P, Image.Image]) -> Callable[P, bytes]:
    @wraps(draw)
    def picture(*args: P.args, **options: P.kwargs) -> bytes:
        return png_bytes(draw(*args, **options))

    return picture


floor_plan = _as_png(plan_image)
"""A PNG of the floor plan of a map; parameters as of `plan_image`."""

book_picture = _as_png(book_image)
"""A PNG of a small map in the book's look; parameters as of `book_image`."""


def render(
    grid: GridMap,
    *,
    trajectory: Trajectory | None = None,
    robots: Sequence[tuple[int, int]] = (),
    frontier: NDArray[np.bool_] | None = None,
    labels: bool = False,
    scale: int | None = None,
    title: str = "",
) -> bytes:
    """A PNG of a map: in the book's look up to 64 rows and columns and always with labels, else as
    a floor plan.

    Args:
        trajectory: of the robot, drawn as its path; a floor plan colours it by time.
        robots: (row, column) of the robots' cells.
        frontier: cells to mark in red, shape (rows, columns).
        labels: print probabilities and `?` into the cells.
        scale: pixels per cell; by default the picture gets a usual size.
        title: a line above a floor plan.

    Raises:
        DataError: a robot outside the map, or a map too large for labels or for this scale.
    """
    _check_drawable(grid, robots, scale, labels=labels)
    if labels or max(grid.rows, grid.columns) <= BOOK_SIDE:
        path = () if trajectory is None else cells_passed(grid, trajectory.poses[:, :2])
        return book_picture(
            grid, labels=labels, frontier=frontier, robots=robots, path=path, scale=scale
        )
    points = [grid.world_of_cells([row], [column])[0] for row, column in robots]
    markers = [Marker(float(x), float(y), "robot") for x, y in points]
    shown = None if trajectory is None else RobotPath.of(trajectory)
    return floor_plan(
        grid, path=shown, markers=markers, frontier=frontier, title=title, scale=scale
    )


def _check_drawable(
    grid: GridMap, robots: Sequence[tuple[int, int]], scale: int | None, *, labels: bool
) -> None:
    longer = max(grid.rows, grid.columns)
    shape = f"{grid.rows} rows, {grid.columns} columns"
    for row, column in robots:
        if not grid.contains(row, column):
            raise DataError(f"robot at {row},{column}", expected=f"a cell of {shape}")
    if labels and longer > LABELLED_SIDE:
        raise DataError(shape, expected=f"at most {LABELLED_SIDE} a side with labels")
    if scale is not None and longer * scale > LARGEST_PICTURE:
        raise DataError(
            f"{shape} at {scale} pixels per cell",
            expected=f"at most {LARGEST_PICTURE:,} pixels a side",
        )
