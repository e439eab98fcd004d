"""The path of a robot over a floor plan, coloured by time, with arrows along its headings."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mapcli.model.trajectory import Trajectory
from mapcli.pictures.drawing import (
    RED,
    WHITE,
    Colour,
    arrow_head,
    draw_disc,
    draw_line,
    draw_polygon,
    draw_text,
    font,
    time_colour,
    time_colours,
)
from mapcli.pictures.map_window import MapWindow, PlanLayout


@dataclass(frozen=True, eq=False)
class RobotPath:
    """The path of a robot, drawn over a floor plan.

    Attributes:
        points: positions in the world, shape (n, 2), metres, in time order.
        seconds: when the robot was there, shape (n,); they colour the path. None: by count.
        headings: radians in the world, shape (n,), for the arrows. None: they follow the path.
        doubtful: where the path is not to be trusted, shape (n,), drawn in red. None: nowhere.
        colour: of all of it, as of one path among others, whose ends have no words. None: by time.
    """

    points: NDArray[np.float64]
    seconds: NDArray[np.float64] | None = None
    headings: NDArray[np.float64] | None = None
    doubtful: NDArray[np.bool_] | None = None
    colour: Colour | None = None

    @classmethod
    def of(cls, trajectory: Trajectory) -> RobotPath:
        poses = trajectory.poses
        return cls(poses[:, :2], trajectory.seconds(), poses[:, 2])

    @property
    def fractions(self) -> NDArray[np.float64]:
        """How far through its time each point is, 0 to 1, shape (n,); by count without times."""
        seconds = self.seconds
        if seconds is None or seconds[-1] <= seconds[0]:
            return np.linspace(0, 1, len(self.points))
        fractions: NDArray[np.float64] = (seconds - seconds[0]) / (seconds[-1] - seconds[0])
        return fractions.clip(0, 1)

    def colours(self) -> NDArray[np.float64]:
        """Of each point, shape (n, 3), 0..255."""
        if self.colour is not None:
            return np.tile(np.array(self.colour, np.float64), (len(self.points), 1))
        colours = time_colours(self.fractions)
        if self.doubtful is not None:
            colours[self.doubtful] = RED
        return colours

    def colour_at(self, point: int) -> Colour:
        return self.colour or time_colour(self.fractions[point])

    @property
    def duration(self) -> float | None:
        """Seconds from the first point to the last; None without times."""
        if self.seconds is None or not len(self.seconds):
            return None
        return float(self.seconds[-1] - self.seconds[0])


def draw_path(
    image: Image.Image, window: MapWindow, layout: PlanLayout, path: RobotPath
) -> Image.Image:
    """The path with arrows, and discs at its start and end, over a white rim."""
    points = window.pixels_of_world(path.points)
    pixels = np.array(image)
    radius = 1.9 * layout.unit
    draw_line(pixels, points, np.full((len(points), 3), 255.0), radius + 1.4 * layout.unit)
    draw_line(pixels, points, path.colours(), radius)
    image = Image.fromarray(pixels)
    _arrows(image, window, layout, path)
    # The start is the larger disc, so that it shows under an end in the same place.
    for k, text, side, size in ((0, "start", -1, 10.5), (-1, "end", 1, 7.0)):
        x, y = (float(v) for v in points[k])
        draw_disc(image, x, y, size * layout.unit, path.colour_at(k), WHITE, 2 * layout.unit)
        if path.colour is not None:
            continue
        room = 15 * layout.unit + font(layout.letters).getlength(text)
        side = 1 if x - room < window.x else -1 if x + room > window.x + window.width else side
        anchor = "lm" if side > 0 else "rm"
        draw_text(image, (x + side * 15 * layout.unit, y), text, layout.letters, anchor=anchor)
    return image


def _arrows(image: Image.Image, window: MapWindow, layout: PlanLayout, path: RobotPath) -> None:
    """Arrow heads along the path, at most forty and far enough apart not to crowd it."""
    points = window.pixels_of_world(path.points)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    spacing = max(0.09 * max(window.width, window.height), along[-1] / 40)
    for distance in np.arange(spacing, along[-1] - spacing / 3, spacing):
        k = int(np.searchsorted(along, distance))
        if path.headings is not None:
            direction = -(float(path.headings[k]) - window.grid.origin.theta)
        else:
            dx, dy = points[k] - points[k - 1]
            direction = math.atan2(dy, dx)
        x, y = (float(v) for v in points[k])
        corners = arrow_head(x, y, direction, 11 * layout.unit)
        draw_polygon(image, corners, path.colour_at(k), WHITE, 1.2 * layout.unit)
