"""Pictures of a similarity table: map, perception and product side by side (Fig. 9.21), all
candidates (Figs. 9.19 and 9.20), the map before and after (Fig. 9.22); landmarks as they are and as
they were measured."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageOps

from mapcli.formats.documents.similarity_table import number_text, position_name, turn_name
from mapcli.model.pose import Pose2D
from mapcli.model.similarity import ScoredCandidate
from mapcli.pictures.drawing import (
    BLUE,
    FAINT_INK,
    INK,
    RED,
    UNKNOWN,
    WHITE,
    Colour,
    arrow_head,
    draw_disc,
    draw_polygon,
    draw_text,
    font,
    png_bytes,
)

Floats = NDArray[np.float64]
Signs = NDArray[np.int8]
Robot = tuple[float, float, float]
"""Row, column (fractions, whole numbers are centres) and heading in the map's axes."""

OBSTACLE: Colour = (150, 154, 160)
AGREES: Colour = (178, 223, 166)
DIFFERS: Colour = (244, 150, 140)
LINE: Colour = (150, 154, 160)

NEW = 4
"""Added to -1 and +1 of cells that are new in a map."""

CELLS: Mapping[int, Colour] = {
    -1: WHITE, 0: UNKNOWN, 1: OBSTACLE, NEW - 1: (255, 238, 234), NEW + 1: (255, 178, 170),
}  # fmt: skip

SIDE = 560
"""Pixels of a panel's longer side."""

SMALL_SIDE = 280
"""The same where there are many."""

LARGEST_CELL, SMALLEST_LABELLED = 48, 18
MARGIN, TITLE, LETTERS = 24, 40, 20


def panels(map_: Signs, perceived: Signs, robot: Robot | None,
           best: ScoredCandidate, similarity: str) -> bytes:  # fmt: skip
    """A PNG of m, p and m p.

    Args:
        map_, perceived: the same cells, shape (rows, columns), top row first: -1, 0, +1.
        robot: row, column (fractions, whole numbers are centres) and heading in the map's axes.
        best: the candidate whose perception this is.
    """
    product = map_ * perceived
    scores = {-1: DIFFERS, 0: WHITE, 1: AGREES}
    unit = "cell"
    name = f"{position_name(best.position, unit)}, {turn_name(best.turn_deg)}"
    agree, differ = int((product > 0).sum()), int((product < 0).sum())
    told = "" if similarity == "product" else f", {similarity} {number_text(best.score)}"
    images = [
        _panel(map_, CELLS, "map m", "-1 empty, 1 obstacle, ? unknown", robot),
        _panel(perceived, CELLS, "perception p", name, robot),
        _panel(product, scores, f"m p: S = {agree} - {differ} = {agree - differ}{told}",
               "green: agrees, red: differs", robot),
    ]  # fmt: skip
    return png_bytes(_row(images))


def before_after(before: Signs, after: Signs, robot: Robot) -> bytes:
    """A PNG like Fig. 9.22: the map before and after an update, what is new in it in light red."""
    new = (before == 0) & (after != 0)
    shown = np.where(new, after + np.int8(NEW), after).astype(np.int8)
    changed = int(((before != 0) & (before != after)).sum())
    caption = f"light red: {int((new & (after > 0)).sum())} new obstacles, pale: "
    caption += f"{int((new & (after < 0)).sum())} new empty; {changed} others changed"
    images = [
        _panel(before, CELLS, "map before", "? unknown", robot),
        _panel(shown, CELLS, "map after", caption, robot),
    ]
    return png_bytes(_row(images))


def candidates(
    perceived: Sequence[tuple[Signs, Robot | None, ScoredCandidate]],
    columns: int,
    place: tuple[int, int],
) -> bytes:
    """A PNG like Figs. 9.19 and 9.20: the perception map of every candidate, row by row.

    Args:
        perceived: the same cells of each, top row first, and the robot; columns: candidates side
            by side.
        place: the best one's row and column of the table.
    """
    images = []
    for cells, robot, one in perceived:
        name = f"{position_name(one.position, 'cell')}, {turn_name(one.turn_deg)}"
        best = "   best" if one.place == place else ""
        images.append(_panel(cells, CELLS, name, f"score {number_text(one.score)}{best}", robot,
                             SMALL_SIDE))  # fmt: skip
    width = max(image.width for image in images)
    images = [ImageOps.pad(image, (width, image.height), color=WHITE, centering=(0, 0))
              for image in images]  # fmt: skip
    rows = [_row(images[k : k + columns]) for k in range(0, len(images), columns)]
    sheet = Image.new(
        "RGB", (max(row.width for row in rows), sum(row.height for row in rows)), WHITE
    )
    y = 0
    for row in rows:
        sheet.paste(row, (0, y))
        y += row.height
    return png_bytes(sheet)


def _row(images: Sequence[Image.Image]) -> Image.Image:
    """Images side by side."""
    size = sum(image.width for image in images), max(image.height for image in images)
    sheet, x = Image.new("RGB", size, WHITE), 0
    for image in images:
        sheet.paste(image, (x, 0))
        x += image.width
    return sheet


def _panel(
    values: Signs, colours: Mapping[int, Colour], title: str, caption: str,
    robot: Robot | None, side: int = SIDE,
) -> Image.Image:  # fmt: skip
    rows, columns = values.shape
    scale = min(side / max(rows, columns), LARGEST_CELL)
    size = float(int(scale)) if scale >= 1 else scale
    palette = np.array([colours.get(k, WHITE) for k in range(-1, NEW + 2)], np.uint8)
    pixels = palette[values.astype(int) + 1]
    cells = Image.fromarray(pixels).resize(
        (max(round(columns * size), 1), max(round(rows * size), 1)),
        Image.Resampling.NEAREST if size >= 1 else Image.Resampling.BOX,
    )
    letters = [font(LETTERS).getlength(text) for text in (title, caption)]
    width = max(cells.width, *map(math.ceil, letters)) + 2 * MARGIN
    image = Image.new("RGB", (width, cells.height + 2 * TITLE + MARGIN), WHITE)
    image.paste(cells, (MARGIN, TITLE))
    draw_text(image, (MARGIN, TITLE / 2), title, LETTERS, anchor="lm")
    draw_text(image, (MARGIN, TITLE * 1.5 + cells.height), caption, LETTERS, anchor="lm",
          fill=FAINT_INK)  # fmt: skip
    right, bottom = MARGIN + cells.width, TITLE + cells.height
    ImageDraw.Draw(image).rectangle((MARGIN - 1, TITLE - 1, right, bottom), outline=LINE)
    if size >= SMALLEST_LABELLED:
        _grid_and_numbers(image, values, int(size), unknown="?" if colours[0] == UNKNOWN else "0")
    if robot is not None:
        _robot(image, robot, size)
    return image


def _grid_and_numbers(image: Image.Image, values: Signs, size: int, unknown: str) -> None:
    draw = ImageDraw.Draw(image)
    rows, columns = values.shape
    for k in range(columns + 1):
        draw.line((MARGIN + k * size, TITLE, MARGIN + k * size, TITLE + rows * size), fill=LINE)
    for k in range(rows + 1):
        draw.line((MARGIN, TITLE + k * size, MARGIN + columns * size, TITLE + k * size), fill=LINE)
    for (row, column), value in np.ndenumerate(values):
        sign = value - NEW if value > 1 else value
        text, fill = (str(sign), INK) if sign else (unknown, FAINT_INK)
        x, y = MARGIN + (column + 0.5) * size, TITLE + (row + 0.5) * size
        draw_text(image, (x, y), text, max(round(size * 0.4), 8), fill=fill, halo=None)


def _robot(image: Image.Image, robot: Robot, size: float) -> None:
    """A blue dot with an arrow along the heading, beside the number of its cell."""
    row, column, heading = robot
    x, y = MARGIN + (column + 0.5) * size, TITLE + (row + 0.5) * size
    reach = max(size, 14.0)
    tip = x + 0.9 * reach * math.cos(heading), y - 0.9 * reach * math.sin(heading)
    ImageDraw.Draw(image).line((x, y, *tip), fill=BLUE, width=3)
    draw_polygon(image, arrow_head(*tip, -heading, max(reach / 5, 6)), BLUE, WHITE, 0)
    draw_disc(image, x, y, max(size / 5, 5), BLUE, WHITE, 1)


def landmark_plan(
    points: Floats, poses: Mapping[str, Pose2D | None], measured: Floats, best: Pose2D
) -> bytes:
    """A PNG of a points map: the landmarks, and where the measurements put them from the best
    pose.

    Args:
        points: shape (n, 2); measured: shape (n, 2), distances and bearings (radians).
        poses: the robot, by name.
    """
    angle = best.theta + measured[:, 1]
    ends = np.column_stack([np.cos(angle), np.sin(angle)]) * measured[:, :1] + (best.x, best.y)
    robots = {name: pose for name, pose in poses.items() if pose is not None}
    spots = np.array([(pose.x, pose.y) for pose in robots.values()])
    everything = np.concatenate([points, ends[~np.isnan(ends).any(axis=1)], spots])
    low, high = everything.min(axis=0), everything.max(axis=0)
    scale = SIDE / max(float((high - low).max()), 1e-9)
    margin = 3 * MARGIN

    def pixel(x: float, y: float) -> tuple[float, float]:
        return margin + (x - low[0]) * scale, margin + (high[1] - y) * scale

    size = (high - low) * scale + 2 * margin
    image = Image.new("RGB", (max(round(size[0]), 640), round(size[1]) + TITLE), WHITE)
    draw = ImageDraw.Draw(image)
    for point, end in zip(points, ends, strict=True):
        if np.isnan(end).any():
            continue
        draw.line((*pixel(best.x, best.y), *pixel(*end)), fill=LINE, width=2)
        draw.line((*pixel(*end), *pixel(*point)), fill=RED, width=2)
        draw_disc(image, *pixel(*end), 6, WHITE, RED, 2)
    for k, point in enumerate(points):
        draw_disc(image, *pixel(*point), 9, OBSTACLE, INK, 1)
        x, y = pixel(*point)
        draw_text(image, (x + 14, y - 14), str(k), 16, anchor="lm")
    for name, pose in robots.items():
        _posed(image, *pixel(pose.x, pose.y), pose.theta, name)
    legend = "grey: landmarks; red rings: as measured from the best pose"
    below = MARGIN, image.height - TITLE / 2
    draw_text(image, below, legend, LETTERS, anchor="lm", fill=FAINT_INK)
    return png_bytes(image)


def _posed(image: Image.Image, x: float, y: float, heading: float, name: str) -> None:
    """A robot with its heading and name; the best one is blue."""
    colour = BLUE if name == "best" else FAINT_INK
    tip = x + 40 * math.cos(heading), y - 40 * math.sin(heading)
    ImageDraw.Draw(image).line((x, y, *tip), fill=colour, width=3)
    draw_polygon(image, arrow_head(*tip, -heading, 9), colour, WHITE, 0)
    draw_disc(image, x, y, 8, colour, WHITE, 1)
    draw_text(image, (x, y + 22), name, 16)
