"""How well a scan fits everywhere in a window, for those who must know what else would fit."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mapcli.algorithms._kernels.matching import total


@njit(cache=True)
def fits(
    field: NDArray[np.uint8], places: NDArray[np.int64], columns: int, reach: int, stride: int
) -> NDArray[np.int64]:
    """Sums of a field at points that are shifted by every `stride`-th cell of a window.

    Args:
        field: the flattened array; places: indices of the points in it, before the shift.
        columns: of the array; reach: half-width of the window in cells.

    Returns:
        shape (n, n), by rows from the lowest shift to the highest.
    """
    count = 2 * reach // stride + 1
    sums = np.empty((count, count), np.int64)
    for row in range(count):
        for column in range(count):
            shift = (row * stride - reach) * columns + column * stride - reach
            sums[row, column] = total(field, places, shift)
    return sums
