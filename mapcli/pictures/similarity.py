"""Pictures of a similarity table: map, perception and product side by side (Fig. 9.21); the scores
of a window as a heat map; landmarks as they are and as they were measured."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mapcli.formats.documents.similarity_table import number_text, position_name, turn_name
from mapcli.model.local_maxima import WindowScores
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
    round_length,
    time_colours,
)

Floats = NDArray[np.float64]
Signs = NDArray[np.int8]

OBSTACLE: Colour = (150, 154, 160)
AGREES: Colour = (178, 223, 166)
DIFFERS: Colour = (244, 150, 140)
LINE: Colour = (150, 154, 160)

SIDE = 560
"""Pixels of a panel's longer side."""

LARGEST_CELL, SMALLEST_LABELLED = 48, 18
MARGIN, TITLE, LETTERS = 24, 40, 20


def panels(map_: Signs, perceived: Signs, robot: tuple[float, float, float] | None,
           best: ScoredCandidate, similarity: str) -> bytes:  # fmt: skip
    """A PNG of m, p and m p.

    Args:
        map_, perceived: the same cells, shape (rows, columns), top row first: -1, 0, +1.
        robot: row, column (fractions, whole numbers are centres) and heading in the map's axes.
        best: the candidate whose perception this is.
    """
    product = map_ * perceived
    signs = {-1: WHITE, 0: UNKNOWN, 1: OBSTACLE}
    scores = {-1: DIFFERS, 0: WHITE, 1: AGREES}
    unit = "cell"
    name = f"{position_name(best.position, unit)}, {turn_name(best.turn_deg)}"
    agree, differ = int((product > 0).sum()), int((product < 0).sum())
    told = "" if similarity == "product" else f", {similarity} {number_text(best.score)}"
    images = [
        _panel(map_, signs, "map m", "-1 empty, 1 obstacle, ? unknown", robot),
        _panel(perceived, signs, "perception p", name, robot),
        _panel(product, scores, f"m p: S = {agree} - {differ} = {agree - differ}{told}",
               "green: agrees, red: differs", robot),
    ]  # fmt: skip
    width = sum(image.width for image in images)
    sheet = Image.new("RGB", (width, max(image.height for image in images)), WHITE)
    x = 0
    for image in images:
        sheet.paste(image, (x, 0))
        x += image.width
    return png_bytes(sheet)


def _panel(
    values: Signs, colours: Mapping[int, Colour], title: str, caption: str,
    robot: tuple[float, float, float] | None,
) -> Image.Image:  # fmt: skip
    rows, columns = values.shape
    scale = min(SIDE / max(rows, columns), LARGEST_CELL)
    size = float(int(scale)) if scale >= 1 else scale
    pixels = np.array([colours[k] for k in (-1, 0, 1)], np.uint8)[values.astype(int) + 1]
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
        text, fill = (str(value), INK) if value else (unknown, FAINT_INK)
        x, y = MARGIN + (column + 0.5) * size, TITLE + (row + 0.5) * size
        draw_text(image, (x, y), text, max(round(size * 0.4), 8), fill=fill, halo=None)


def _robot(image: Image.Image, robot: tuple[float, float, float], size: float) -> None:
    """A blue dot with an arrow along the heading, beside the number of its cell."""
    row, column, heading = robot
    x, y = MARGIN + (column + 0.5) * size, TITLE + (row + 0.5) * size
    reach = max(size, 14.0)
    tip = x + 0.9 * reach * math.cos(heading), y - 0.9 * reach * math.sin(heading)
    ImageDraw.Draw(image).line((x, y, *tip), fill=BLUE, width=3)
    draw_polygon(image, arrow_head(*tip, -heading, max(reach / 5, 6)), BLUE, WHITE, 0)
    draw_disc(image, x, y, max(size / 5, 5), BLUE, WHITE, 1)


def heat_map(scores: WindowScores, *, lower: bool) -> bytes:
    """A PNG of the best score of all headings at each position of a window."""
    surface, along, maxima = scores.surface, scores.along, scores.maxima
    side = len(along)
    size = max(1, min(SIDE * 1.3 / side, 60))
    values = -surface if lower else surface
    able = ~np.isnan(values)
    low, high = float(np.min(values[able])), float(np.max(values[able]))
    share = np.where(able, (values - low) / max(high - low, 1e-12), 0.0)
    pixels = np.rint(time_colours(share.ravel())).reshape(side, side, 3).astype(np.uint8)
    pixels[~able] = UNKNOWN
    width = max(round(side * size), 1)
    plan = Image.fromarray(pixels).resize((width, width), Image.Resampling.NEAREST)
    left, top = 3 * MARGIN + TITLE, 2 * TITLE
    image = Image.new("RGB", (max(left + width + 160, 760), top + width + 3 * TITLE), WHITE)
    image.paste(plan, (left, top))
    _steps(image, along, (left, top, width))
    score = number_text(maxima.peak.score)
    draw_text(image, (MARGIN, TITLE / 2), f"best score of all headings, peak {score}", LETTERS,
          anchor="lm")  # fmt: skip
    _bar(image, (left + width + 40, top, width), (low, high), lower=lower)
    _peak(image, maxima.peak, along, (left, top, width), RED, "peak")
    if maxima.second is not None:
        _peak(image, maxima.second, along, (left, top, width), WHITE, "2")
    told = "no second peak" if maxima.second is None else (
        f"second peak (2): {number_text(maxima.second.score)}")  # fmt: skip
    draw_text(image, (MARGIN, image.height - TITLE / 2), told, LETTERS, anchor="lm", fill=FAINT_INK)
    return png_bytes(image)


def _place(
    candidate: ScoredCandidate, along: Floats, box: tuple[int, int, int]
) -> tuple[float, float]:
    """The middle of a pose's square; the table's rows run right, then up."""
    side = len(along)
    dv, du = divmod(candidate.place[0], side)
    left, top, width = box
    return left + (du + 0.5) * width / side, top + (side - dv - 0.5) * width / side


def _peak(
    image: Image.Image, candidate: ScoredCandidate, along: Floats, box: tuple[int, int, int],
    colour: Colour, text: str,
) -> None:  # fmt: skip
    x, y = _place(candidate, along, box)
    edge = INK if colour == WHITE else WHITE
    draw_disc(image, x, y, 7, colour, edge, 2)
    said = f"{text} ({candidate.turn_deg:g} deg)"
    room = x + 14 + font(LETTERS).getlength(said) < box[0] + box[2]
    draw_text(image, (x + (14 if room else -14), y), said, LETTERS, anchor="lm" if room else "rm")


def _steps(image: Image.Image, along: Floats, box: tuple[int, int, int]) -> None:
    """Round steps along the left and the lower edge."""
    left, top, width = box
    ImageDraw.Draw(image).rectangle((left - 1, top - 1, left + width, top + width), outline=LINE)
    if len(along) < 2:
        return
    spacing = float(along[1] - along[0])
    tick = round_length(float(along[-1] - along[0]) / 3)
    for k in range(-math.floor(along[-1] / tick + 1e-9), math.floor(along[-1] / tick + 1e-9) + 1):
        at = (k * tick - float(along[0])) / spacing + 0.5
        pixel = at * width / len(along)
        draw_text(image, (left + pixel, top + width + 8), f"{k * tick:g}", 16, anchor="mt",
              fill=FAINT_INK, halo=None)  # fmt: skip
        draw_text(image, (left - 8, top + width - pixel), f"{k * tick:g}", 16, anchor="rm",
              fill=FAINT_INK, halo=None)  # fmt: skip
    below = left + width / 2, top + width + 32
    draw_text(
        image, below, "right of the intended pose", 16, anchor="mt", fill=FAINT_INK, halo=None
    )
    draw_text(image, (left, top - 12), "up", 16, anchor="rb", fill=FAINT_INK, halo=None)


def _bar(
    image: Image.Image, place: tuple[int, int, int], ends: tuple[float, float], *, lower: bool
) -> None:
    """What the colours mean."""
    x, top, height = place
    ramp = np.rint(time_colours(np.linspace(1, 0, height))).astype(np.uint8)
    image.paste(Image.fromarray(np.repeat(ramp[:, None], 16, axis=1)), (x, top))
    worst, best = (-ends[0], -ends[1]) if lower else ends
    for y, value, anchor in ((top, best, "lt"), (top + height, worst, "lb")):
        draw_text(image, (x + 22, y), number_text(value + 0.0), 16, anchor=anchor, halo=None)


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
