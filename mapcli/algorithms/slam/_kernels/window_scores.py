"""Scores of points at every position of a window: how ambiguous a match is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.branch_and_bound import sum_of_field


@kernel
def score_shifts(
    field: NDArray[np.uint8],
    scan: NDArray[np.int64],
    columns: int,
    low: tuple[int, int],
    stride: int,
    scores: NDArray[np.int64],
) -> None:
    """Sums of a likelihood field at points that are shifted to every `stride`-th cell of a square.

    Args:
        field: the flattened array; scan: indices of the points in it, before the shift.
        columns: of the array.
        low: the lowest shift, (columns, rows).
        scores: filled, by rows from the lowest shift to the highest.
    """
    for row in range(scores.shape[0]):
        for column in range(scores.shape[1]):
            shift = (low[1] + row * stride) * columns + low[0] + column * stride
            scores[row, column] = sum_of_field(field, scan, shift)
