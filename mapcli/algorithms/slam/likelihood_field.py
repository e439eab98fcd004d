"""The likelihood field of a map (Thrun 2001), and its max-pooled pyramid for branch and bound.

The field says, for every cell, how well the end of a beam fits there: 255 in an occupied cell,
falling off as a Gaussian around it. The pyramid's level k holds, for every cell, the maximum of the
field over the LEVEL_WIDTHS[k] x LEVEL_WIDTHS[k] cells from it up and right: the upper bounds of
`_kernels/branch_and_bound.py`. Level 0 is the field itself.

`build_pyramid` makes both in one go; while a map grows, its pyramid follows the cells that change
(`_kernels/likelihood_field.py`: `update_likelihood_field`).
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels.likelihood_field import (
    MAX_LIKELIHOOD,
    update_likelihood_field,
)

LEVEL_WIDTHS = np.array([1, 2, 4, 16], dtype=np.int64)
"""Cells a side over which one value of each level of the pyramid is the maximum."""


def gaussian_kernel(sigma: float) -> NDArray[np.uint8]:
    """The likelihood field around one occupied cell, out to three standard deviations.

    Args:
        sigma: standard deviation, in cells.

    Returns:
        shape (2 r + 1, 2 r + 1), 255 in the middle and 0 outside a circle of radius r + 0.5.
    """
    radius = math.ceil(3 * sigma)
    steps = np.arange(-radius, radius + 1)
    squares = steps[:, None] ** 2 + steps[None, :] ** 2
    values = np.round(MAX_LIKELIHOOD * np.exp(-squares / (2 * sigma**2)))
    return np.where(squares <= (radius + 0.5) ** 2, values, 0).astype(np.uint8)


def build_pyramid(
    pyramid: NDArray[np.uint8], log_odds: NDArray[np.int16], gaussian: NDArray[np.uint8]
) -> None:
    """Build the likelihood field of a map, and the coarser levels that bound it.

    Args:
        pyramid: shape (levels, rows, columns), zeros; filled.
        log_odds: the map, shape (rows, columns); more than 0 is occupied.
        gaussian: from `gaussian_kernel`.
    """
    occupied = np.flatnonzero(log_odds > 0)
    if not len(occupied):
        return
    update_likelihood_field(pyramid, LEVEL_WIDTHS[:1], log_odds, occupied, gaussian)
    part = pyramid[:, *_support(occupied, log_odds.shape[1], len(gaussian) // 2)]
    for level, (width, wider) in enumerate(pairwise(LEVEL_WIDTHS.tolist()), start=1):
        bound = part[level - 1]
        for axis in (0, 1):
            bound = max_pool_ahead(bound, wider // width, width, axis)
        part[level] = bound


def _support(occupied: NDArray[np.int64], columns: int, reach: int) -> tuple[slice, slice]:
    """The rows and columns outside which the field and its bounds are 0.

    Args:
        occupied: indices of cells, row * columns + column; reach: radius of the Gaussian, cells.
    """
    v, u = np.divmod(occupied, columns)
    before, after = reach + int(LEVEL_WIDTHS[-1]), reach + 1
    return (
        slice(int(v.min()) - before, int(v.max()) + after),
        slice(int(u.min()) - before, int(u.max()) + after),
    )


def max_pool_ahead(
    values: NDArray[np.uint8], count: int, stride: int, axis: int
) -> NDArray[np.uint8]:
    """For every cell the maximum of `count` values along an axis, `stride` apart, from it on.

    (A few maxima of whole arrays of bytes: `scipy.ndimage.maximum_filter1d` gives the same in 18
    times the time, and takes 0.4 s to import.)
    """
    highest = values.copy()
    size = values.shape[axis]
    for k in range(1, count):
        here = [slice(None), slice(None)]
        there = [slice(None), slice(None)]
        here[axis], there[axis] = slice(size - k * stride), slice(k * stride, size)
        target = highest[tuple(here)]
        np.maximum(target, values[tuple(there)], out=target)
    return highest
