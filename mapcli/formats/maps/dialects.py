"""Grey of a map image <-> occupancy percent, as Nav2 since 2026, Nav2 before and ROS 1 do it.

    dialect     grey           thresholds   transparency                        scale, in between
    nav2        luma           inclusive    unknown (not in raw mode)           0..100, half up
    nav2-2024   mean           exclusive    trinary: one more channel of the    0..100, half to even
                                            mean; scale: unknown
    ros1        mean           exclusive    trinary: one more channel of the    1..99, cut off
                                            mean; scale: unknown when fully
                                            transparent and in between

In raw mode both Nav2 ignore `negate`, ROS 1 applies it. A cell that meets both thresholds is free
under `nav2` and occupied under the others. Nav2 of 2026 computes in float32, the others in double.
Sources: nav2_map_server/map_io.cpp of August 2026 and of July 2024, map_server/image_loader.cpp
of 2023. The result is a byte per cell, 0 to 100 percent as in their OccupancyGrid; 255 is unknown.
"""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.maps.map_image import GreyImage, GreyRule
from mapcli.model.grid import UNKNOWN_PERCENT

Dialect = Literal["nav2", "nav2-2024", "ros1"]
DIALECTS: tuple[Dialect, ...] = get_args(Dialect)

_QUANTUM = 257
"""GraphicsMagick keeps a byte b as b * 257 of 65535."""


def read_percents(image: GreyImage, rule: GreyRule, dialect: Dialect = "nav2") -> NDArray[np.uint8]:
    """The percents of an image's pixels, UNKNOWN_PERCENT where unknown, shape (rows, columns)."""
    if dialect == "nav2":
        return _read_nav2(image, rule)
    sums, channels = image.sums(with_alpha=rule.mode == "trinary")
    by_sum = _percents_nav2_2024 if dialect == "nav2-2024" else _percents_ros1
    percents: NDArray[np.uint8] = by_sum(np.arange(255 * channels + 1), channels, rule)[sums]
    if rule.mode == "scale":
        _hide(percents, image, dialect)
    return percents


def _hide(percents: NDArray[np.uint8], image: GreyImage, dialect: Dialect) -> None:
    """Scale mode before 2026: transparent cells become unknown, in place."""
    if dialect == "nav2-2024" and image.alpha is not None:
        percents[image.alpha < 255] = UNKNOWN_PERCENT
    if dialect == "ros1" and (image.alpha is not None or image.channels.shape[2] > 1):
        # ROS 1 takes the last byte of a pixel for its alpha, be it blue.
        last = image.channels[:, :, -1] if image.alpha is None else image.alpha
        percents[(last == 0) & (percents > 0) & (percents < 100)] = UNKNOWN_PERCENT


def percents_of_greys(rule: GreyRule, dialect: Dialect = "nav2") -> NDArray[np.uint8]:
    """The percent that each grey 0..255 without alpha is read as, shape (256,)."""
    ramp = np.arange(256, dtype=np.uint8).reshape(1, 256, 1)
    percents: NDArray[np.uint8] = read_percents(GreyImage(ramp), rule, dialect)[0]
    return percents


def greys_of_percents(rule: GreyRule, dialect: Dialect = "nav2") -> NDArray[np.uint8]:
    """For each percent 0..100 the grey that is read back as it, or as the nearest percent.

    The table is the reader's own, inverted, so writing and reading cannot disagree.
    """
    wanted = np.arange(101, dtype=np.float64)[:, None]
    if rule.mode == "raw":
        return np.arange(101, dtype=np.uint8)
    occ = rule.free_thresh + wanted / 100 * (rule.occupied_thresh - rule.free_thresh)
    occ[0], occ[100] = 0, 1
    drift = np.abs(np.arange(256) - 255 * (occ if rule.negate else 1 - occ))
    read = percents_of_greys(rule, dialect).astype(np.float64)
    error = np.where(read == UNKNOWN_PERCENT, np.inf, np.abs(read - wanted))
    best: NDArray[np.intp] = np.argmin(error * 1000 + drift, axis=1)
    return best.astype(np.uint8)


def _read_nav2(image: GreyImage, rule: GreyRule) -> NDArray[np.uint8]:
    percents: NDArray[np.uint8] = _percents_nav2(rule)[image.luma]
    if image.alpha is not None and rule.mode != "raw":
        percents[image.alpha < 255] = UNKNOWN_PERCENT
    return percents


@np.errstate(over="ignore", invalid="ignore")  # a threshold beyond float32 becomes infinite
def _percents_nav2(rule: GreyRule) -> NDArray[np.uint8]:
    """By grey, shape (256,)."""
    grey = np.arange(256)
    if rule.mode == "raw":
        return _bytes(np.where(grey <= 100, grey, np.nan))
    light = grey.astype(np.float32) / np.float32(255)
    occ = light if rule.negate else np.float32(1) - light
    free, occupied = np.float32(rule.free_thresh), np.float32(rule.occupied_thresh)
    percents = np.full(256, np.nan, dtype=np.float32)
    between = (occ > free) & (occ < occupied)
    if rule.mode == "scale":
        span = np.float32(rule.occupied_thresh - rule.free_thresh)
        percents[between] = _half_up((occ[between] - free) / span * np.float32(100))
    percents[occ >= occupied] = 100
    percents[occ <= free] = 0
    return _bytes(percents)


def _percents_nav2_2024(
    sums: NDArray[np.int64], channels: int, rule: GreyRule
) -> NDArray[np.uint8]:
    """By the sum of the channels, 0 to 255 each."""
    shade = sums * _QUANTUM / channels / (255 * _QUANTUM)
    if rule.mode == "raw":
        percents = _half_up(shade * 255)
        return _bytes(np.where(percents <= 100, percents, np.nan))
    return _exclusive(shade if rule.negate else 1.0 - shade, rule, lambda s: np.rint(s * 100.0))


def _percents_ros1(sums: NDArray[np.int64], channels: int, rule: GreyRule) -> NDArray[np.uint8]:
    """By the sum of the channels, 0 to 255 each."""
    mean = sums / channels
    level = 255.0 - mean if rule.negate else mean
    if rule.mode == "raw":
        return _bytes(np.where(level < 101, np.floor(level), np.nan))
    return _exclusive((255.0 - level) / 255.0, rule, lambda s: np.floor(1 + 98 * s))


def _exclusive(occ: NDArray[np.float64], rule: GreyRule, scale: Any) -> NDArray[np.uint8]:
    """Percents under thresholds that a cell must exceed; at a threshold it is in between.

    Args:
        occ: darkness, 0 to 1.
        scale: makes percents of shares 0 to 1 of the way between the thresholds.
    """
    percents = np.full(occ.shape, np.nan)
    between = (occ >= rule.free_thresh) & (occ <= rule.occupied_thresh)
    span = rule.occupied_thresh - rule.free_thresh
    if rule.mode == "scale" and span > 0:
        percents[between] = scale((occ[between] - rule.free_thresh) / span)
    percents[occ < rule.free_thresh] = 0
    percents[occ > rule.occupied_thresh] = 100
    return _bytes(percents)


def _bytes(percents: NDArray[Any]) -> NDArray[np.uint8]:
    return np.where(np.isnan(percents), UNKNOWN_PERCENT, percents).astype(np.uint8)


def _half_up(values: NDArray[Any]) -> NDArray[Any]:
    """As C's round for numbers that are not negative; numpy's own rounds halves to even."""
    whole = np.floor(values)
    up: NDArray[Any] = np.where(values - whole >= 0.5, whole + values.dtype.type(1), whole)
    return up
