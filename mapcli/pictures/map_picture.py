"""Pictures of maps as PNG bytes: a floor plan for a report, or the book's look for small maps.

`plan_image` and `book_image` give the same as Pillow images, for frames of an animation.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec

from PIL import Image

from mapcli.pictures.book_figure import book_image, cells_passed
from mapcli.pictures.drawing import png_bytes
from mapcli.pictures.floor_plan import plan_image
from mapcli.pictures.map_window import MapWindow, map_pixels, window_of

__all__ = [
    "MapWindow",
    "book_image",
    "book_picture",
    "cells_passed",
    "floor_plan",
    "map_pixels",
    "plan_image",
    "png_bytes",
    "window_of",
]


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
