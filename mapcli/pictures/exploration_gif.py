"""An exploration as a GIF: one frame a step, or at most MOST_FRAMES of them, evenly spread."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mapcli.model.exploration import Exploration, cells_before
from mapcli.model.exploration_replay import ExplorationReplay
from mapcli.pictures.book_figure import book_image
from mapcli.pictures.drawing import FAINT_INK, WHITE, draw_disc, draw_text
from mapcli.pictures.exploration import (
    FRONTIER,
    ROBOT_COLOURS,
    robot_colour,
)
from mapcli.pictures.map_window import map_pixels, mark_cells, window_of

MOST_FRAMES = 300

LONGER_SIDE = 1000
"""Pixels of a frame's longer side, where cells need not be larger to be read."""

LABELLED_SIDE = 24
"""Cells a side up to which frames show the probabilities."""

SECONDS, LAST_SECONDS = 20.0, 2.5
"""What a long animation lasts, and how long its last frame stays."""

COLOURS = 128


def exploration_gif(exploration: Exploration, *, small: bool, low: float) -> bytes:
    """A GIF from what was known at the start to the end.

    Args:
        small: in the book's look; else a floor plan.
        low: cells from this probability on are obstacles.
    """
    count = len(exploration.steps)
    moments = np.unique(np.rint(np.linspace(0, count, min(count + 1, MOST_FRAMES))).astype(int))
    draw = BookFrames(low) if small else PlanFrames(exploration, low)
    # One palette for all frames, of some of them, so that colours do not flicker.
    some = [*frames(exploration, draw, moments[:: max(len(moments) // 6, 1)])]
    palette = palette_of(some)
    draw = BookFrames(low) if small else PlanFrames(exploration, low)
    drawn = (
        frame.quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames(exploration, draw, moments)
    )
    each = int(min(max(1000 * SECONDS / len(moments), 60), 700))
    durations = [each] * (len(moments) - 1) + [int(1000 * LAST_SECONDS)]
    out = io.BytesIO()
    first = next(drawn)
    first.save(
        out, format="GIF", save_all=True, append_images=drawn, duration=durations, loop=0,
        optimize=False,
    )  # fmt: skip
    return out.getvalue()


def palette_of(some: list[Image.Image]) -> Image.Image:
    """A palette for frames like these."""
    side_by_side = np.concatenate([np.asarray(image) for image in some])
    return Image.fromarray(side_by_side).quantize(COLOURS, dither=Image.Dither.NONE)


def frames(
    exploration: Exploration, draw: BookFrames | PlanFrames, moments: NDArray[np.intp]
) -> Iterator[Image.Image]:
    """A picture after so many steps, for each moment."""
    replay = ExplorationReplay(exploration)
    for moment in moments.tolist():
        replay.advance(moment)
        yield draw.frame(replay)


class BookFrames:
    """Frames in the book's look: the map, the frontier, the robots and their last step."""

    def __init__(self, low: float) -> None:
        self.low = low

    def frame(self, replay: ExplorationReplay) -> Image.Image:
        grid = replay.grid
        longer = max(grid.rows, grid.columns)
        labels = longer <= LABELLED_SIDE
        last = replay.exploration.steps[replay.done - 1] if replay.done else None
        image = book_image(
            grid,
            labels=labels,
            frontier=replay.frontier(self.low),
            robots=replay.robots,
            path=[last.origin, *last.path.tolist()] if last else (),
            low=self.low,
            scale=min(max(LONGER_SIDE // longer, 30 if labels else 8), 48),
        )
        return captioned(image, replay, 16)


class PlanFrames:
    """Frames of a floor plan: what is known, the frontier, and the paths so far."""

    def __init__(self, exploration: Exploration, low: float) -> None:
        self.low = low
        whole = window_of(exploration.after)
        longer = max(whole.rows, whole.columns)
        zoom = round(LONGER_SIDE / longer) or 1 / -(-longer // LONGER_SIDE)
        self.window = replace(whole, zoom=float(zoom))
        steps = exploration.steps
        self.begins, self.ends = cells_before(steps), steps.path
        of_moves = np.repeat(steps.robot, np.diff(steps.path_end, prepend=0))
        palette = np.array(ROBOT_COLOURS, dtype=np.uint8) // 2 + 127
        self.colours = palette[of_moves % len(palette)]
        self.paths = np.zeros((self.window.height, self.window.width, 3), dtype=np.uint8)

    def frame(self, replay: ExplorationReplay) -> Image.Image:
        shown = replace(self.window, grid=replay.grid)
        pixels = map_pixels(shown)
        self.draw_moves(replay.moved)
        walked = self.paths.any(axis=2)
        pixels[walked] = self.paths[walked]
        mark_cells(pixels, shown, np.argwhere(replay.frontier(self.low)), FRONTIER)
        image = Image.fromarray(pixels)
        for robot, cell in enumerate(replay.robots):
            x, y = (float(v) for v in shown.pixels_of_cells([cell])[0])
            draw_disc(image, x, y, 7, robot_colour(robot), WHITE, 1.5)
        return captioned(image, replay, 18)

    def draw_moves(self, moves: slice) -> None:
        """Add moves to the paths: thin lines, over those that were there."""
        begin = self.window.pixels_of_cells(self.begins[moves])
        end = self.window.pixels_of_cells(self.ends[moves])
        for part in np.linspace(0, 1, max(round(self.window.zoom), 1) + 1)[1:]:
            x, y = (begin + (end - begin) * part).astype(int).T
            self.paths[y, x] = self.colours[moves]


def captioned(image: Image.Image, replay: ExplorationReplay, size: int) -> Image.Image:
    """The picture with a line below that says where in the exploration it is."""
    steps = replay.exploration.steps
    time = int(steps.time[replay.done - 1]) if replay.done else 0
    text = f"step {replay.done:,} of {len(steps):,}   time {time:,}"
    sheet = Image.new("RGB", (image.width, image.height + round(size * 1.8)), WHITE)
    sheet.paste(image)
    y = image.height + size * 0.8
    draw_text(sheet, (size * 0.7, y), text, size, anchor="lm", fill=FAINT_INK, halo=None)
    return sheet
