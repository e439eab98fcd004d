"""Evaluations of several traces as one picture: all paths, and their errors over time below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mapcli.model.evaluation import Errors, Evaluation, statistics
from mapcli.pictures.drawing import (
    WHITE,
    Colour,
    draw_disc,
    draw_line,
    draw_text,
    png_bytes,
    time_colour,
)
from mapcli.pictures.drives import with_names
from mapcli.pictures.evaluation import (
    FOOT,
    GAP,
    LEFT,
    REFERENCE,
    RIGHT,
    STRIP,
    WIDTH,
    Frame,
    draw_axes,
    draw_scale,
)

Coloured = Sequence[tuple[Evaluation, Colour]]


def several_evaluations_picture(evaluations: Sequence[tuple[str, Evaluation]]) -> bytes:
    """A PNG: each trace in its own colour, over the reference where there is one, and the names.

    Against relations, each is a dot where it ends. Below are translation and rotation over time.

    Args:
        evaluations: by the traces' names, at least one, all of one kind.
    """
    hues = [time_colour(share) for share in np.linspace(0, 1, max(len(evaluations), 2)).tolist()]
    shown = [(one, hue) for (_, one), hue in zip(evaluations, hues, strict=False)]
    paths = [path.poses for one, _ in shown for path in (one.reference, one.trace) if path]
    frame = Frame.around(paths)
    image = Image.new("RGB", (WIDTH, frame.bottom + 2 * (GAP + STRIP) + FOOT), WHITE)
    image = _draw_paths(image, frame, shown)
    draw_scale(image, frame)
    top = frame.bottom + GAP
    image = _draw_strip(image, top, "translation, m", [(_first(e).metres, e, c) for e, c in shown])
    top += STRIP + GAP
    image = _draw_strip(image, top, "rotation, deg", [(_first(e).degrees, e, c) for e, c in shown])
    timed = all(one.trace.stamps_ns is not None for one, _ in shown)
    along = "s since the first pose of each" if timed else "pose"
    draw_text(image, ((LEFT + RIGHT) / 2, top + STRIP + 44), along, 20, anchor="mt", halo=None)
    names = [(name, hue) for (name, _), hue in zip(evaluations, hues, strict=False)]
    if shown[0][0].reference is not None:
        names.insert(0, ("reference", REFERENCE))
    return png_bytes(with_names(image, names))


def _first(evaluation: Evaluation) -> Errors:
    return next(iter(evaluation.errors.values()))


def _draw_paths(image: Image.Image, frame: Frame, shown: Coloured) -> Image.Image:
    """The references below all traces; dots above them."""
    pixels = np.array(image)
    for one, _ in shown:
        if one.reference is not None:
            _draw(pixels, frame.pixels(one.reference.poses), REFERENCE, 5.0)
    for one, colour in shown:
        _draw(pixels, frame.pixels(one.trace.poses), colour, 1.8)
    image = Image.fromarray(pixels)
    for one, colour in shown:
        if one.relations is None:
            continue
        path, seconds = frame.pixels(one.trace.poses), one.trace.seconds()
        places = np.column_stack([np.interp(_first(one).seconds, seconds, v) for v in path.T])
        for x, y in places.tolist():
            draw_disc(image, x, y, 5.0, colour, WHITE, 0.8)
    return image


def _draw_strip(
    image: Image.Image, top: int, title: str,
    shown: Sequence[tuple[NDArray[np.float64], Evaluation, Colour]],
) -> Image.Image:  # fmt: skip
    """One kind of error over time: a line for each trace; of relations, dots."""
    last = max(float(one.trace.seconds()[-1]) for _, one, _ in shown) or 1.0
    worst = max(float(values.max()) for values, _, _ in shown)
    most = 1.05 * worst or 1.0
    draw_axes(image, top, last, most)
    pixels = np.array(image)
    for values, one, colour in shown:
        x = LEFT + _first(one).seconds / last * (RIGHT - LEFT)
        points = np.column_stack([x, top + STRIP - values / most * STRIP])
        if one.reference is not None:
            _draw(pixels, points, colour, 1.6)
        else:
            for point in points:
                _draw(pixels, point[None, :], colour, 3.0)
    image = Image.fromarray(pixels)
    rmse = [statistics(values)["rmse"] for values, _, _ in shown]
    text = f"{title}: rmse {min(rmse):.3g} to {max(rmse):.3g}, most {worst:.3g}"
    draw_text(image, (LEFT, top - 10), text, 20, anchor="lb", halo=None)
    return image


def _draw(
    pixels: NDArray[np.uint8], points: NDArray[np.float64], colour: Colour, radius: float
) -> None:
    """A line of one colour."""
    draw_line(pixels, points, np.tile(np.array(colour, float), (len(points), 1)), radius)
