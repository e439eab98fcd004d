"""Peak, second peak and covariance of the scores of a window of poses.

The scores are an array [turn, dv, du]. The peak's *hill* is every pose that is connected with it
(over the up to 26 neighbours) through scores above the middle between the window's median and the
peak. The second peak is the highest local maximum outside the hill and above the median; in a
corridor the hill is long, in an ambiguous place the second peak is nearly as high as the first.
The covariance is that of the hill's poses, each weighted by its height above the hill's foot.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.measures import Similarity, higher_is_better
from mapcli.errors import DataError
from mapcli.model.local_maxima import LocalMaxima
from mapcli.model.similarity import SimilarityTable

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


def find_local_maxima(table: SimilarityTable, similarity: Similarity, window: tuple[Floats, Floats],
               cell: float) -> LocalMaxima:  # fmt: skip
    """The peaks of a table of all poses of a window.

    Args:
        window: offsets along one axis in cells and turns in degrees, as of `CandidateWindow.axes`.
        cell: the size of a cell.

    Raises:
        DataError: no pose overlaps the map, or all score the same.
    """
    along, turns = window
    side = len(along)
    values = np.where(table.comparable(), table.values, np.nan)
    scores = higher_is_better(similarity, values).T.reshape(len(turns), side, side)
    able = np.isfinite(scores)
    if not able.any():
        raise DataError("no pose of the window overlaps the map; nothing can be concluded")
    top, middle = float(scores.max()), float(np.median(scores[able]))
    if top - float(scores[able].min()) < 1e-9:
        raise DataError("all poses of the window score the same; nothing can be concluded")
    best = np.argwhere(scores >= top - 1e-9)
    peak = tuple(
        int(k) for k in best[np.argmin(((best - np.array(scores.shape) // 2) ** 2).sum(1))]
    )
    foot = (top + middle) / 2 if top > middle else middle - 1e-9
    hill = _connected(scores > foot, peak)
    second = _second(scores, hill, middle)
    share = None
    if second is not None and top > middle:
        share = float(max(scores[second] - middle, 0.0) / (top - middle))
    border = any(
        size > 1 and k in (0, size - 1) for k, size in zip(peak, scores.shape, strict=True)
    )
    covariance = _covariance(np.where(hill, scores - foot, 0.0), along * cell, turns)
    return LocalMaxima(
        table[_place(peak, side)], None if second is None else table[_place(second, side)],
        share, covariance, len(best), border,
    )  # fmt: skip


def _place(index: tuple[int, ...], side: int) -> tuple[int, int]:
    """Row and column of the table."""
    turn, dv, du = index
    return dv * side + du, turn


def _grown(mask: Mask) -> Mask:
    """The mask and all neighbours of it, diagonal ones too."""
    for axis in range(3):
        wider = mask.copy()
        low, high = [slice(None)] * 3, [slice(None)] * 3
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        wider[tuple(low)] |= mask[tuple(high)]
        wider[tuple(high)] |= mask[tuple(low)]
        mask = wider
    return mask


def _connected(mask: Mask, start: tuple[int, ...]) -> Mask:
    """What is connected with `start` in a mask."""
    found = np.zeros_like(mask)
    found[start] = True
    while True:
        more = _grown(found) & mask
        more[start] = True
        if (more == found).all():
            return found
        found = more


def _second(scores: Floats, hill: Mask, middle: float) -> tuple[int, ...] | None:
    """The highest local maximum outside the hill and above the middle; the hill's rim is a slope,
    not a peak."""
    highest = scores.copy()
    for axis in range(3):
        wider = highest.copy()
        low, high = [slice(None)] * 3, [slice(None)] * 3
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        np.maximum(wider[tuple(low)], highest[tuple(high)], out=wider[tuple(low)])
        np.maximum(wider[tuple(high)], highest[tuple(low)], out=wider[tuple(high)])
        highest = wider
    summits = (scores >= highest) & (scores > middle) & ~_grown(hill)
    if not summits.any():
        return None
    flat = np.where(summits, scores, -np.inf)
    return tuple(int(k) for k in np.unravel_index(int(np.argmax(flat)), scores.shape))


def _covariance(weight: Floats, along: Floats, turns_deg: Floats) -> Floats:
    """Of x, y in the map's axes, and theta; shape (3, 3)."""
    theta, y, x = np.meshgrid(np.radians(turns_deg), along, along, indexing="ij")
    poses = np.stack([x.ravel(), y.ravel(), theta.ravel()])
    share = weight.ravel() / weight.sum()
    centred = poses - (poses * share).sum(axis=1, keepdims=True)
    # Sums of products, written out: a matrix product's rounding varies by machine.
    return np.array([[(a * b * share).sum() for b in centred] for a in centred])
