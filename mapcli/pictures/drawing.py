"""What every picture shares: colours, letters, anti-aliased lines and shapes, PNG bytes.

Pillow draws without anti-aliasing, so lines are stamped as overlapping soft discs and small
shapes are drawn four times too large and shrunk. Pixel coordinates are (x, y), x to the right,
y down; the centre of the upper left pixel is (0.5, 0.5).
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont, PngImagePlugin

from mapcli.formats.file_kind import PICTURE_MARK

Colour = tuple[int, int, int]

WHITE: Colour = (255, 255, 255)
INK: Colour = (38, 42, 48)
FAINT_INK: Colour = (112, 118, 126)
FAINT_LINE: Colour = (224, 226, 229)
UNKNOWN: Colour = (226, 228, 231)
RED: Colour = (214, 39, 40)
BLUE: Colour = (38, 90, 196)

_EARLY_TO_LATE = ((24, 15, 136), (98, 0, 168), (166, 33, 152), (216, 87, 107), (246, 140, 60))
"""Dark blue to orange: brightness grows with time, and every step shows on white and on grey."""

_OVERSIZE = 4
"""Small shapes are drawn so many times too large, then shrunk."""

_BATCH = 50_000
"""Discs of a line that are stamped at once, for the memory that they take."""

_MOST_SAMPLES = 300_000
"""Discs of a line at most; a longer one gets them farther apart."""


@lru_cache(maxsize=32)
def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own typeface, so that pictures do not depend on the machine's fonts."""
    return ImageFont.load_default(size=size)


def time_colours(fractions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours of fractions 0 (early) to 1 (late), shape (n, 3), 0..255."""
    stops = np.linspace(0, 1, len(_EARLY_TO_LATE))
    channels = np.array(_EARLY_TO_LATE, dtype=np.float64).T
    return np.column_stack([np.interp(fractions, stops, channel) for channel in channels])


def time_colour(fraction: float) -> Colour:
    """The colour of one moment."""
    red, green, blue = time_colours(np.array([fraction]))[0]
    return int(red), int(green), int(blue)


def png_bytes(image: Image.Image) -> bytes:
    """A PNG file of a picture, with a mark by which it is not taken for a map."""
    out, mark = io.BytesIO(), PngImagePlugin.PngInfo()
    mark.add_text("Software", PICTURE_MARK)
    image.save(out, format="PNG", compress_level=6, pnginfo=mark)
    return out.getvalue()


def round_length(metres: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `metres`."""
    power = 10.0 ** math.floor(math.log10(metres))
    return max(step * power for step in (1, 2, 5) if step * power <= metres * (1 + 1e-9))


def draw_line(
    pixels: NDArray[np.uint8],
    points: NDArray[np.float64],
    colours: NDArray[np.float64],
    radius: float,
) -> None:
    """Draw an anti-aliased line with a round pen into `pixels`, in place.

    Args:
        pixels: shape (height, width, 3).
        points: the line's corners, shape (n, 2); what lies outside is not drawn.
        colours: at the corners, shape (n, 3); where the line crosses itself the later one wins.
        radius: of the pen, pixels.
    """
    height, width = pixels.shape[:2]
    points, colours = _dense(points, colours, (width, height), max(0.7, radius / 2))
    reach = math.ceil(radius + 1)
    limit = np.array([width + reach, height + reach])
    inside = np.all((points > -reach) & (points < limit), axis=1)
    points, colours = points[inside], colours[inside]
    if len(points) == 0:
        return
    # A canvas that no disc leaves, though the picture may end before.
    x0, y0 = np.floor(points.min(axis=0)).astype(int) - reach
    x1, y1 = np.ceil(points.max(axis=0)).astype(int) + reach + 1
    cover = np.zeros((y1 - y0, x1 - x0), dtype=np.float32)
    owner = np.zeros(cover.shape, dtype=np.int32)
    for first in range(0, len(points), _BATCH):
        _stamp_discs(cover, owner, points[first : first + _BATCH] - (x0, y0), radius, first)
    seen = np.s_[max(-y0, 0) : height - y0, max(-x0, 0) : width - x0]
    cover, owner = cover[seen], owner[seen]
    region = pixels[max(y0, 0) : y1, max(x0, 0) : x1]
    drawn = np.nonzero(cover > 0)
    blend = cover[drawn][:, None]
    region[drawn] = np.rint(region[drawn] * (1 - blend) + colours[owner[drawn]] * blend)


def _dense(
    points: NDArray[np.float64],
    colours: NDArray[np.float64],
    size: tuple[int, int],
    step: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The line sampled every `step` pixels, so that discs overlap to a smooth edge.

    Stretches that are wholly outside, however long, take no samples.
    """
    outside = np.any((points < 0) | (points > np.array(size)), axis=1)
    points = np.clip(points, -max(size), 2 * max(size))
    lengths = np.hypot(*np.diff(points, axis=0).T)
    lengths[outside[1:] & outside[:-1]] = 0
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    count = min(int(along[-1] / step), _MOST_SAMPLES)
    samples = np.linspace(0, along[-1], max(count, 1) + 1)
    parts = np.column_stack([points, colours])
    dense = np.column_stack([np.interp(samples, along, part) for part in parts.T])
    return dense[:, :2], dense[:, 2:]


def _stamp_discs(
    cover: NDArray[np.float32], owner: NDArray[np.int32], centres: NDArray[np.float64],
    radius: float, first: int,
) -> None:  # fmt: skip
    """Add discs, all of them inside, to what is covered, and by which sample; samples are
    counted from `first`."""
    corner = np.floor(centres).astype(np.intp)
    right, down = _disc(radius)
    distance = np.hypot(
        corner[:, :1] + (right + 0.5) - centres[:, :1],
        corner[:, 1:] + (down + 0.5) - centres[:, 1:],
    )
    used = distance < radius + 0.5
    amounts = np.minimum(radius + 0.5 - distance[used], 1).astype(np.float32)
    width = cover.shape[1]
    cells = (corner[:, 1:] * width + corner[:, :1] + (down * width + right))[used]
    samples = np.repeat(np.arange(first, first + len(centres)), np.count_nonzero(used, axis=1))
    cover, owner = cover.reshape(-1), owner.reshape(-1)
    # A faint rim must not take over the core of an earlier stretch, only fill what is empty.
    firm = (amounts >= 0.5) | (amounts > cover[cells])
    owner[cells[firm]] = samples[firm]
    np.maximum.at(cover, cells, amounts)
    firm = amounts >= 0.5
    owner[cells[firm]] = samples[firm]


def _disc(radius: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Columns and rows, from that of its centre, of the pixels that a soft disc may touch."""
    reach = math.ceil(radius)
    down, right = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1)
    nearest = np.hypot(*np.maximum(np.abs([right, down]) - 0.5, 0))
    near = nearest < radius + 0.5
    return right[near], down[near]


def draw_antialiased(
    image: Image.Image,
    box: tuple[float, float, float, float],
    draw: Callable[[ImageDraw.ImageDraw, Callable[[float, float], tuple[float, float]]], None],
) -> None:
    """Draw a small shape with soft edges.

    Args:
        image: RGB, changed in place.
        box: left, top, right, bottom of the pixels that the shape may touch.
        draw: called with a canvas and the function that puts a point of the image onto it.
    """
    left, top = max(math.floor(box[0]), 0), max(math.floor(box[1]), 0)
    right, bottom = min(math.ceil(box[2]), image.width), min(math.ceil(box[3]), image.height)
    if right <= left or bottom <= top:
        return
    patch = image.crop((left, top, right, bottom))
    large = patch.resize(
        (patch.width * _OVERSIZE, patch.height * _OVERSIZE), Image.Resampling.NEAREST
    )
    draw(
        ImageDraw.Draw(large),
        lambda x, y: ((x - left) * _OVERSIZE, (y - top) * _OVERSIZE),
    )
    image.paste(large.reduce(_OVERSIZE), (left, top))


def draw_polygon(
    image: Image.Image, corners: Sequence[tuple[float, float]], fill: Colour, edge: Colour,
    width: float,
) -> None:  # fmt: skip
    """A filled polygon with an outline `width` pixels wide."""
    xs, ys = zip(*corners, strict=True)

    def shape(
        canvas: ImageDraw.ImageDraw, place: Callable[[float, float], tuple[float, float]]
    ) -> None:
        placed = [place(x, y) for x, y in corners]
        canvas.polygon(placed, fill=fill)
        if width:
            canvas.line(
                [*placed, *placed[:2]],
                fill=edge,
                width=round(width * _OVERSIZE),
                joint="curve",
            )

    pad = width + 1
    draw_antialiased(image, (min(xs) - pad, min(ys) - pad, max(xs) + pad, max(ys) + pad), shape)


def draw_disc(
    image: Image.Image, x: float, y: float, radius: float, fill: Colour, edge: Colour, width: float
) -> None:
    """A filled circle with an outline inside it."""

    def shape(
        canvas: ImageDraw.ImageDraw, place: Callable[[float, float], tuple[float, float]]
    ) -> None:
        box = (*place(x - radius, y - radius), *place(x + radius, y + radius))
        canvas.ellipse(box, fill=fill, outline=edge, width=round(width * _OVERSIZE))

    pad = radius + 1
    draw_antialiased(image, (x - pad, y - pad, x + pad, y + pad), shape)


def arrow_head(x: float, y: float, direction: float, size: float) -> list[tuple[float, float]]:
    """Corners of an arrow head around (x, y) that points along `direction` (radians, y down)."""
    shape = np.array([(1.0, 0.0), (-0.8, 0.75), (-0.35, 0.0), (-0.8, -0.75)]) * size
    cos, sin = math.cos(direction), math.sin(direction)
    turned = shape @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    return [(float(px), float(py)) for px, py in turned]


def draw_text(
    image: Image.Image, place: tuple[float, float], text: str, size: int, *, anchor: str = "mm",
    fill: Colour = INK, halo: Colour | None = WHITE,
) -> None:  # fmt: skip
    """Letters at a pixel (x, y), with a halo that keeps them legible; `anchor` is Pillow's."""
    stroke = max(round(size / 8), 1) if halo else 0
    ImageDraw.Draw(image).text(
        place, text, font=font(size), fill=fill, anchor=anchor,
        stroke_width=stroke, stroke_fill=halo,
    )  # fmt: skip


def draw_x_scale(
    image: Image.Image, box: tuple[float, float, float, float], longest: float, gap: int
) -> None:
    """Grid lines across a plot's box (left, top, right, bottom), from 0 to `longest`, each with
    its number `gap` pixels below."""
    left, top, right, bottom = box
    draw, step = ImageDraw.Draw(image), round_length(longest / 4)
    for k in range(int(longest / step + 1e-9) + 1):
        x = left + k * step / longest * (right - left)
        draw.line((x, top, x, bottom), fill=FAINT_LINE)
        text = f"{k * step:,.10g}"
        draw_text(image, (x, bottom + gap), text, 20, anchor="mt", fill=FAINT_INK, halo=None)
