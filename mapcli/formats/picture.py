"""Pictures of maps as PNG bytes: a floor plan for a report, or the book's look for small maps.

`plan_image` and `book_image` give the same as Pillow images, for frames of an animation.
"""

from __future__ import annotations

from typing import Any

from mapcli.formats.book_picture import book_image, cells_passed
from mapcli.formats.drawing import png_bytes
from mapcli.formats.floor_plan import plan_image
from mapcli.formats.plan_view import PlanView, plan_pixels, view_of
from mapcli.model.grid import GridMap

__all__ = [
    "PlanView",
    "book_image",
    "book_picture",
    "cells_passed",
    "floor_plan",
    "plan_image",
    "plan_pixels",
    "png_bytes",
    "view_of",
]


def floor_plan(grid: GridMap, **options: Any) -> bytes:
    """A PNG of the floor plan; options as of `plan_image`."""
    return png_bytes(plan_image(grid, **options))


def book_picture(grid: GridMap, **options: Any) -> bytes:
    """A PNG in the book's look; options as of `book_image`."""
    return png_bytes(book_image(grid, **options))
