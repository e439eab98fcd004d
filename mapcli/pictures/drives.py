"""A map with the paths of several drives, from the oldest to the newest in colours of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from PIL import Image

from mapcli.model.grid import GridMap
from mapcli.pictures.drawing import (
    WHITE,
    Colour,
    draw_disc,
    draw_text,
    font,
    png_bytes,
    time_colour,
)
from mapcli.pictures.floor_plan import plan_image
from mapcli.pictures.robot_path import RobotPath

LETTERS = 26
"""Pixels of the names' letters."""


def drives_plan(grid: GridMap, paths: Mapping[str, RobotPath]) -> bytes:
    """A PNG of a floor plan with several paths, and their names below.

    Args:
        paths: of the robot, by the drive's name, the oldest first.
    """
    ages = np.linspace(0, 1, max(len(paths), 2)).tolist()
    colours = {name: time_colour(age) for name, age in zip(paths, ages, strict=False)}
    plan = plan_image(grid, path=[replace(paths[name], colour=colours[name]) for name in paths])
    return png_bytes(with_names(plan, list(colours.items())))


def with_names(plan: Image.Image, colours: Sequence[tuple[str, Colour]]) -> Image.Image:
    """A picture, and under it a disc and a name for each drive, in as many lines as it takes."""
    gap, width = LETTERS, plan.width - 2 * LETTERS
    places, x, y = [], 0.0, 0.0
    for name, _ in colours:
        room = 2.5 * gap + font(LETTERS).getlength(name)
        if x and x + room > width:
            x, y = 0.0, y + 1.6 * gap
        places.append((x, y))
        x += room
    image = Image.new("RGB", (plan.width, plan.height + round(y + 2 * gap)), WHITE)
    image.paste(plan, (0, 0))
    for (name, colour), (x, y) in zip(colours, places, strict=True):
        left, middle = gap + x, plan.height + y + gap / 2
        draw_disc(image, left + gap / 2, middle, gap / 3, colour, WHITE, 0)
        draw_text(image, (left + 1.2 * gap, middle), name, LETTERS, anchor="lm")
    return image
