"""What the grey of a map image means: the trinary, scale and raw modes of map_server.

A pixel's darkness `occ` is `1 - grey / 255`, or `grey / 255` with `negate`. By mode it becomes

    trinary   occ >= occupied_thresh: obstacle; occ <= free_thresh: open; in between: unknown
    scale     the same two, and in between the percent (occ - free) / (occupied - free), rounded
    raw       the grey itself is the percent, 0 to 100; anything else is unknown

Dialect `nav2` is Nav2's map_io as of August 2026: float32 arithmetic, thresholds inclusive, free
wins a tie, transparent pixels unknown except in raw mode, negate ignored in raw mode. Dialect
`ros1` is map_server of ROS 1: thresholds exclusive, scale from 1 to 99, alpha averaged in as one
more colour in trinary mode and heeded only in between and only when it is 0 in scale mode.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import DataError

Mode = Literal["trinary", "scale", "raw"]
Dialect = Literal["nav2", "ros1"]
MODES: tuple[Mode, ...] = get_args(Mode)
DIALECTS: tuple[Dialect, ...] = get_args(Dialect)

OCCUPIED_GREY, UNKNOWN_GREY, FREE_GREY = 0, 205, 254
"""The customary pixels of a trinary map."""

_NO_PERCENT = 255  # stands for unknown where percents are kept as bytes; raw mode's own choice


@dataclass(frozen=True, eq=False)
class GreyImage:
    """A map image as read from or written to a PGM or PNG file.

    Attributes:
        channels: shape (rows, columns, n), uint8; n is 1 for grey, 3 for colour.
        alpha: shape (rows, columns), uint8, 255 is opaque; None when the image has none.
        note: map metadata that mapcli stored inside the image (YAML lines), or "".
        kind: what the file is, for people: "PGM P5, 8 bit".
        warnings: what was odd about the file.
    """

    channels: NDArray[np.uint8]
    alpha: NDArray[np.uint8] | None = None
    note: str = ""
    kind: str = ""
    warnings: tuple[str, ...] = ()

    def luma(self) -> NDArray[np.uint8]:
        """8-bit grey as GraphicsMagick makes it for Nav2: Rec. 601 weights in 1/1024."""
        if self.channels.shape[2] == 1:
            return self.channels[:, :, 0]
        red, green, blue = (self.channels[:, :, k].astype(np.uint32) for k in range(3))
        return ((306 * red + 601 * green + 117 * blue + 512) >> 10).astype(np.uint8)

    def mean(self, *, with_alpha: bool) -> NDArray[Any]:
        """Mean of the channels, as ROS 1 takes it; bytes when there is only one channel."""
        parts = [self.channels[:, :, k] for k in range(self.channels.shape[2])]
        parts += [self.alpha] if with_alpha and self.alpha is not None else []
        return parts[0] if len(parts) == 1 else np.asarray(np.mean(parts, axis=0))


@dataclass(frozen=True)
class GreyRule:
    """How grey becomes probability; what a map's YAML says about its image.

    Raises:
        DataError: thresholds that are not numbers, or free above occupied.
    """

    mode: Mode = "trinary"
    free_thresh: float = 0.196
    occupied_thresh: float = 0.65
    negate: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.free_thresh) and np.isfinite(self.occupied_thresh)):
            raise DataError("free_thresh or occupied_thresh is not finite", expected="numbers")
        if self.free_thresh > self.occupied_thresh:
            raise DataError(
                f"free_thresh {self.free_thresh:g} is above occupied_thresh "
                f"{self.occupied_thresh:g}",
                expected="free_thresh below occupied_thresh",
            )

    def cells(self, image: GreyImage, dialect: Dialect = "nav2") -> NDArray[np.float32]:
        """Obstacle probabilities of an image's pixels, NaN unknown, shape (rows, columns)."""
        return self._nav2(image) if dialect == "nav2" else self._ros1(image)

    def _nav2(self, image: GreyImage) -> NDArray[np.float32]:
        table = _probabilities(self.percents_nav2(np.arange(256)))
        cells = table[image.luma()]
        if image.alpha is not None and self.mode != "raw":
            cells[image.alpha < 255] = np.nan
        return cells

    def percents_nav2(self, grey: NDArray[Any]) -> NDArray[np.float32]:
        """Nav2's percent of grey values 0..255, NaN where unknown."""
        if self.mode == "raw":
            return np.where(grey <= 100, grey, np.nan).astype(np.float32)
        light = grey.astype(np.float32) / np.float32(255)
        occ = light if self.negate else np.float32(1) - light
        free, occupied = np.float32(self.free_thresh), np.float32(self.occupied_thresh)
        percents = np.full(occ.shape, np.nan, dtype=np.float32)
        between = (occ > free) & (occ < occupied)
        if self.mode == "scale":
            span = np.float32(self.occupied_thresh - self.free_thresh)
            percents[between] = _round_half_up((occ[between] - free) / span * np.float32(100))
        percents[occ >= occupied] = 100
        percents[occ <= free] = 0
        return percents

    def _ros1(self, image: GreyImage) -> NDArray[np.float32]:
        grey = image.mean(with_alpha=self.mode == "trinary")
        whole = grey.dtype == np.uint8
        percents = self.percents_ros1(np.arange(256))[grey] if whole else self.percents_ros1(grey)
        cells = _probabilities(percents)
        if image.alpha is not None and self.mode == "scale":
            cells[(image.alpha == 0) & (cells > 0) & (cells < 1)] = np.nan
        return cells

    def percents_ros1(self, grey: NDArray[Any]) -> NDArray[np.float32]:
        """ROS 1's percent of mean grey values 0..255, NaN where unknown."""
        level = grey.astype(np.float64)
        level = 255.0 - level if self.negate else level
        if self.mode == "raw":
            return np.where(level < 101, np.floor(level), np.nan).astype(np.float32)
        occ = (255.0 - level) / 255.0
        percents = np.full(occ.shape, np.nan)
        between = (occ >= self.free_thresh) & (occ <= self.occupied_thresh)
        span = self.occupied_thresh - self.free_thresh
        if self.mode == "scale" and span > 0:
            percents[between] = np.floor(1 + 98 * ((occ[between] - self.free_thresh) / span))
        percents[occ < self.free_thresh] = 0
        percents[occ > self.occupied_thresh] = 100
        return percents.astype(np.float32)

    def greys_of_percents(self) -> NDArray[np.uint8]:
        """For each percent 0..100 the grey that Nav2 reads back as it, or as the nearest percent.

        The table is the reader's own, inverted, so writing and reading cannot disagree.
        """
        percents = np.arange(101, dtype=np.float64)[:, None]
        if self.mode == "raw":
            return np.arange(101, dtype=np.uint8)
        occ = self.free_thresh + percents / 100 * (self.occupied_thresh - self.free_thresh)
        occ[0], occ[100] = 0, 1
        greys = np.arange(256)
        drift = np.abs(greys - 255 * (occ if self.negate else 1 - occ))
        error = np.abs(self.percents_nav2(greys).astype(np.float64) - percents)
        cost = np.where(np.isnan(error), np.inf, error) * 1000 + drift
        best: NDArray[np.intp] = np.argmin(cost, axis=1)
        return best.astype(np.uint8)


def _probabilities(percents: NDArray[np.float32]) -> NDArray[np.float32]:
    return percents / np.float32(100)


def _round_half_up(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """As C's round for numbers that are not negative; numpy's own rounds halves to even."""
    whole = np.floor(values)
    up: NDArray[np.float32] = np.where(values - whole >= 0.5, whole + np.float32(1), whole)
    return up


def trinary_greys(
    cells: NDArray[np.float32], free_thresh: float, occupied_thresh: float, *, negate: bool
) -> NDArray[np.uint8]:
    """Pixels of a trinary map: cells up to `free_thresh` open, from `occupied_thresh` obstacle."""
    greys = np.full(cells.shape, UNKNOWN_GREY, dtype=np.uint8)
    greys[cells <= free_thresh] = FREE_GREY
    greys[cells >= occupied_thresh] = OCCUPIED_GREY
    return np.bitwise_not(greys) if negate else greys


def percent_greys(cells: NDArray[np.float32], rule: GreyRule, unknown: int) -> NDArray[np.uint8]:
    """Pixels of a scale or raw map; unknown cells get the grey `unknown`."""
    percents = np.rint(cells * np.float32(100))
    index = np.where(np.isnan(percents), _NO_PERCENT, percents).astype(np.uint8)
    table = np.full(256, unknown, dtype=np.uint8)
    table[:101] = rule.greys_of_percents()
    return table[index]
