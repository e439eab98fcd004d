"""An evaluation as a picture: the paths on top of each other, and the errors over time below."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mapcli.model.evaluation import Errors, Evaluation, statistics
from mapcli.model.trajectory import Poses, interpolated
from mapcli.pictures.drawing import (
    FAINT_INK,
    FAINT_LINE,
    INK,
    WHITE,
    draw_disc,
    draw_line,
    draw_text,
    draw_x_scale,
    png_bytes,
    round_length,
    time_colours,
)

WIDTH, LEFT, RIGHT, MARGIN = 1200, 110, 1160, 40
HIGHEST_PATH, LOWEST_PATH = 900, 240
"""Pixels that the paths may take from top to bottom."""

STRIP, GAP, FOOT = 190, 84, 80
"""Heights of a strip of errors, of what is between two, and of the axis below the last, pixels."""

REFERENCE = (176, 186, 199)
HUES = (0.15, 0.95)
"""Least to most error on the scale of `time_colours`: dark blue to orange."""


def evaluation_picture(evaluation: Evaluation) -> bytes:
    """A PNG: the trace coloured by its error, over the reference where there is one.

    Against relations, each is a dot where it ends. Below are translation and rotation over time.
    """
    measure = next(iter(evaluation.errors))
    errors = evaluation.errors[measure]
    paths = filter(None, (evaluation.trace, evaluation.reference))
    frame = Frame.around([path.poses for path in paths])
    height = frame.bottom + 2 * (GAP + STRIP) + FOOT
    image = Image.new("RGB", (WIDTH, height), WHITE)
    image = _draw_paths(image, frame, evaluation, errors)
    draw_scale(image, frame)
    _draw_key(image, evaluation, errors)
    top = frame.bottom + GAP
    along = "s since the first pose" if evaluation.trace.stamps_ns is not None else "pose"
    is_line, last = evaluation.reference is not None, float(evaluation.trace.seconds()[-1]) or 1.0
    image = _draw_strip(image, top, "translation, m", errors.seconds, last, errors.metres, is_line)
    top += STRIP + GAP
    image = _draw_strip(image, top, "rotation, deg", errors.seconds, last, errors.degrees, is_line)
    middle, foot = (LEFT + RIGHT) / 2, top + STRIP + 44
    draw_text(image, (middle, foot), along, 20, anchor="mt", halo=None)
    return png_bytes(image)


@dataclass(frozen=True)
class Frame:
    """Where metres fall on the picture.

    Attributes:
        low, high: the corners of what is shown, metres; scale: pixels per metre; bottom: pixels.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    scale: float
    bottom: int

    @classmethod
    def around(cls, paths: Sequence[Poses]) -> Frame:
        """Around all paths, as large as fits."""
        points = np.concatenate(paths)[:, :2]
        low, high = points.min(axis=0), points.max(axis=0)
        size = np.maximum(high - low, 1e-3 * max(*(high - low), 1.0))
        width = RIGHT - LEFT
        scale = float(min(width / size[0], (HIGHEST_PATH - 2 * MARGIN) / size[1]))
        height = int(max(size[1] * scale, LOWEST_PATH))
        return cls(low, high, scale, height + 3 * MARGIN)

    def pixels(self, poses: Poses) -> NDArray[np.float64]:
        """Pixel points (x, y), shape (n, 2); the paths are in the middle of their space."""
        middle = np.array([(LEFT + RIGHT) / 2, (self.bottom + MARGIN) / 2])
        offset = (poses[:, :2] - (self.low + self.high) / 2) * self.scale
        return np.asarray(middle + offset * np.array([1.0, -1.0]), dtype=np.float64)


def _draw_paths(
    image: Image.Image, frame: Frame, evaluation: Evaluation, errors: Errors
) -> Image.Image:
    pixels = np.array(image)
    trace = frame.pixels(evaluation.trace.poses)
    colours = _error_colours(errors.metres)
    if evaluation.reference is not None:
        reference = frame.pixels(evaluation.reference.poses)
        draw_line(pixels, reference, np.tile(np.array(REFERENCE, float), (len(reference), 1)), 5.0)
        steps = np.arange(len(trace), dtype=np.float64)
        matched = np.interp(errors.seconds, evaluation.trace.seconds(), steps)
        shown = np.column_stack([np.interp(steps, matched, channel) for channel in colours.T])
        draw_line(pixels, trace, shown, 1.8)
        return Image.fromarray(pixels)
    draw_line(pixels, trace, np.tile(np.array(REFERENCE, float), (len(trace), 1)), 1.6)
    image = Image.fromarray(pixels)
    relations = evaluation.relations
    assert relations is not None
    ends = frame.pixels(interpolated(relations.to_ns, evaluation.trace))
    for k in np.argsort(errors.metres):  # the worst on top
        red, green, blue = (int(part) for part in colours[k])
        x, y = ends[k].tolist()
        draw_disc(image, x, y, 6.0, (red, green, blue), WHITE, 0.8)
    return image


def _error_colours(metres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours from the least to the most, shape (n, 3)."""
    low, high = HUES
    most = float(metres.max(initial=0.0)) or 1.0
    return time_colours(low + (high - low) * metres / most)


def draw_scale(image: Image.Image, frame: Frame) -> None:
    """How long a round number of metres is, below the paths."""
    metres = round_length(0.2 * (RIGHT - LEFT) / frame.scale)
    y, x = frame.bottom - 4, RIGHT - metres * frame.scale
    ImageDraw.Draw(image).line((x, y, RIGHT, y), fill=INK, width=3)
    draw_text(image, ((x + RIGHT) / 2, y - 8), f"{metres:,.10g} m", 20, anchor="mb", halo=None)


def _draw_key(image: Image.Image, evaluation: Evaluation, errors: Errors) -> None:
    """What the colours mean."""
    y, x, length = MARGIN / 2 + 4, float(LEFT), 160
    if evaluation.reference is not None:
        ImageDraw.Draw(image).line((x, y, x + 50, y), fill=REFERENCE, width=10)
        draw_text(image, (x + 62, y), "reference", 20, anchor="lm", halo=None)
        x += 190
    colours = _error_colours(np.linspace(0, 1, length))
    canvas = ImageDraw.Draw(image)
    for k, colour in enumerate(colours):
        red, green, blue = (int(part) for part in colour)
        canvas.line((x + k, y - 5, x + k, y + 5), fill=(red, green, blue))
    what = "trace" if evaluation.reference is not None else "relation, where it ends"
    text = f"{what}, off by 0 to {errors.metres.max():.3g} m"
    draw_text(image, (x + length + 12, y), text, 20, anchor="lm", halo=None)


def _draw_strip(
    image: Image.Image, top: int, title: str, seconds: NDArray[np.float64], last: float,
    values: NDArray[np.float64], is_line: bool,
) -> Image.Image:  # fmt: skip
    """One kind of error over time up to `last`, with its root mean square as a line across."""
    most = 1.05 * float(values.max()) or 1.0
    found = statistics(values)
    points = np.column_stack(
        [LEFT + seconds / last * (RIGHT - LEFT), top + STRIP - values / most * STRIP]
    )
    draw_axes(image, top, last, most)
    level = top + STRIP - found["rmse"] / most * STRIP
    canvas = ImageDraw.Draw(image)
    for x in range(LEFT, RIGHT, 14):
        canvas.line((x, level, x + 7, level), fill=FAINT_INK, width=2)
    colours = _error_colours(values)
    pixels = np.array(image)
    if is_line:
        draw_line(pixels, points, colours, 1.6)
    else:
        for point, colour in zip(points, colours, strict=True):
            draw_line(pixels, point[None, :], colour[None, :], 3.0)
    image = Image.fromarray(pixels)
    text = f"{title}: rmse {found['rmse']:.3g}, mean {found['mean']:.3g}, most {found['max']:.3g}"
    draw_text(image, (LEFT, top - 10), text, 20, anchor="lb", halo=None)
    return image


def draw_axes(image: Image.Image, top: int, last: float, most: float) -> None:
    """The axes of a strip: over time up to `last`, up to `most` of an error."""
    canvas, bottom = ImageDraw.Draw(image), top + STRIP
    step = round_length(most / 2)
    for k in range(int(most / step + 1e-9) + 1):
        y = bottom - k * step / most * STRIP
        canvas.line((LEFT, y, RIGHT, y), fill=FAINT_LINE)
        draw_text(
            image, (LEFT - 12, y), f"{k * step:.6g}", 20, anchor="rm", fill=FAINT_INK, halo=None
        )
    draw_x_scale(image, (LEFT, top, RIGHT, bottom), last, 10)
