"""How well a scan fits everywhere in a window, for those who must know what else would fit."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mapcli.algorithms._kernels.matching import total


@njit(cache=True)
def fits(
    field: NDArray[np.uint8],
    places: NDArray[np.int64],
    columns: int,
    low: tuple[int, int],
    count: int,
    stride: int,
) -> NDArray[np.int64]:
    """Sums of a field at points that are shifted to every `stride`-th cell of a square.

    Args:
        field: the flattened array; places: indices of the points in it, before the shift.
        columns: of the array.
        low: the lowest shift, (columns, rows); count: shifts along each side.

    Returns:
        shape (count, count), by rows from the lowest shift to the highest.
    """
    sums = np.empty((count, count), np.int64)
    for row in range(count):
        for column in range(count):
            shift = (low[1] + row * stride) * columns + low[0] + column * stride
            sums[row, column] = total(field, places, shift)
    return sums
