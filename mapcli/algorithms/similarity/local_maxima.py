"""Local maxima and covariance of the scores of a window of poses.

The scores are an array [turn, dv, du]. The *mode* of the peak is every pose that is connected with
it (over the up to 26 neighbours) through scores above the *basin threshold*, the middle between the
window's median and the peak. The second peak is the highest local maximum outside the mode and
above the median; in a corridor the mode is long, in an ambiguous place the second peak is nearly as
high as the first. The covariance is that of the mode's poses, each weighted by its score above the
basin threshold.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.candidate_poses import CandidateWindow
from mapcli.errors import DataError
from mapcli.model.local_maxima import LocalMaxima, WindowScores
from mapcli.model.similarity import EQUAL, SimilarityTable

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


class WindowAxes(NamedTuple):
    """The poses of a window: steps along one axis in the map's unit, turns in degrees."""

    along: Floats
    turns_deg: Floats


def window_scores(
    table: SimilarityTable, window: CandidateWindow, cell: float | None
) -> WindowScores:
    """What the scores of all poses of a window look like.

    Args:
        cell: the size of a cell; None for maps without cells.

    Raises:
        DataError: no pose overlaps the map, or all score the same.
    """
    along, turns_deg = window.axes(cell)
    side = len(along)
    maxima = find_local_maxima(table, WindowAxes(along * (cell or 1.0), turns_deg))
    highest = table.ascending_scores().max(axis=1).reshape(side, side)[::-1]
    surface = np.where(np.isfinite(highest), -highest if table.lower else highest, np.nan)
    return WindowScores(along * (cell or 1.0), surface + 0.0, maxima)


def find_local_maxima(table: SimilarityTable, axes: WindowAxes) -> LocalMaxima:
    """The peak of a table of all poses of a window, its mode, and the second peak.

    Raises:
        DataError: no pose overlaps the map, or all score the same.
    """
    side = len(axes.along)
    scores = table.ascending_scores().T.reshape(len(axes.turns_deg), side, side)
    able = np.isfinite(scores)
    if not able.any():
        raise DataError("no pose of the window overlaps the map; nothing can be concluded")
    top, median = float(scores.max()), float(np.median(scores[able]))
    if top - float(scores[able].min()) < EQUAL:
        raise DataError("all poses of the window score the same; nothing can be concluded")
    best = np.argwhere(scores >= top - EQUAL)
    peak = _nearest_to_middle(best, scores.shape)
    threshold = (top + median) / 2 if top > median else median - EQUAL
    mode = _connected_region(scores > threshold, peak)
    second = _second_maximum(scores, mode, median)
    share = None
    if second is not None and top > median:
        share = float(max(scores[second] - median, 0.0) / (top - median))
    at_border = any(
        size > 1 and k in (0, size - 1) for k, size in zip(peak, scores.shape, strict=True)
    )
    return LocalMaxima(
        table[_place(peak, side)],
        None if second is None else table[_place(second, side)],
        share,
        _covariance(np.where(mode, scores - threshold, 0.0), axes),
        len(best),
        at_border,
    )


def _nearest_to_middle(poses: NDArray[np.int64], shape: tuple[int, ...]) -> tuple[int, ...]:
    """Of some indices of the window, the one nearest to the intended pose."""
    away = ((poses - np.array(shape) // 2) ** 2).sum(1)
    return tuple(int(k) for k in poses[np.argmin(away)])


def _place(index: tuple[int, ...], side: int) -> tuple[int, int]:
    """Row and column of the table."""
    turn, dv, du = index
    return dv * side + du, turn


def _dilated(mask: Mask) -> Mask:
    """A mask and all neighbours of it, diagonal ones too (26 in all)."""
    for axis in range(3):
        wider = mask.copy()
        low, high = [slice(None)] * 3, [slice(None)] * 3
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        wider[tuple(low)] |= mask[tuple(high)]
        wider[tuple(high)] |= mask[tuple(low)]
        mask = wider
    return mask


def _connected_region(mask: Mask, start: tuple[int, ...]) -> Mask:
    """What is connected with `start` in a mask.

    (`scipy.ndimage.label` finds the same, but its import takes 0.4 s, and this 0.1 s on a window of
    600,000 poses.)
    """
    found = np.zeros_like(mask)
    found[start] = True
    while True:
        more = _dilated(found) & mask
        more[start] = True
        if (more == found).all():
            return found
        found = more


def _second_maximum(scores: Floats, mode: Mask, median: float) -> tuple[int, ...] | None:
    """The highest local maximum outside the mode and its border (a slope, no maximum of its own)
    and above the median."""
    highest = scores.copy()
    for axis in range(3):
        wider = highest.copy()
        low, high = [slice(None)] * 3, [slice(None)] * 3
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        np.maximum(wider[tuple(low)], highest[tuple(high)], out=wider[tuple(low)])
        np.maximum(wider[tuple(high)], highest[tuple(low)], out=wider[tuple(high)])
        highest = wider
    maxima = (scores >= highest) & (scores > median) & ~_dilated(mode)
    if not maxima.any():
        return None
    flat = np.where(maxima, scores, -np.inf)
    return tuple(int(k) for k in np.unravel_index(int(np.argmax(flat)), scores.shape))


def _covariance(weight: Floats, axes: WindowAxes) -> Floats:
    """Of x, y in the map's axes, and theta; shape (3, 3)."""
    theta, y, x = np.meshgrid(np.radians(axes.turns_deg), axes.along, axes.along, indexing="ij")
    poses = np.stack([x.ravel(), y.ravel(), theta.ravel()])
    share = weight.ravel() / weight.sum()
    centred = poses - (poses * share).sum(axis=1, keepdims=True)
    # Sums of products, written out: a matrix product's rounding varies by machine.
    return np.array([[(a * b * share).sum() for b in centred] for a in centred])
