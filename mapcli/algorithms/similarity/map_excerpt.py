"""The same cells of a map and of a perception map, to be shown beside each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.perception_map import PerceptionMap

WHOLE_MAP_SIDE = 64
"""Maps up to this many rows and columns are shown as a whole."""


def crop_to_all(
    cells: NDArray[np.int8], perceived: Sequence[PerceptionMap]
) -> tuple[list[NDArray[np.int8]], tuple[int, int]]:
    """The same cells of all perceptions, as `crop_to_perception` would show them, top row first,
    and their column and row (from below)."""
    left, bottom = (min(getattr(p, name) for p in perceived) for name in ("left", "bottom"))
    right = max(p.left + p.values.shape[1] for p in perceived)
    top = max(p.bottom + p.values.shape[0] for p in perceived)
    any_ = np.zeros((top - bottom, right - left), np.int8)
    for p in perceived:
        rows, columns = np.nonzero(p.values)
        any_[rows + p.bottom - bottom, columns + p.left - left] = 1
    shown, _, corner = crop_to_perception(cells, PerceptionMap(any_, left, bottom))
    low = corner[1], corner[0]
    parts = [_cut_out(p.values, (p.bottom, p.left), low, shown.shape)[::-1] for p in perceived]
    return parts, corner


def crop_to_perception(
    cells: NDArray[np.int8], perceived: PerceptionMap
) -> tuple[NDArray[np.int8], NDArray[np.int8], tuple[int, int]]:
    """The same cells of map and perception, top row first, and their column and row (from below).

    A small map is shown whole, of a large one the part that the perception knows.
    """
    row, column = np.nonzero(perceived.values)
    row, column = row + perceived.bottom, column + perceived.left
    if max(cells.shape) <= WHOLE_MAP_SIDE or not len(row):
        row, column = (
            np.append(row, [0, cells.shape[0] - 1]),
            np.append(column, [0, cells.shape[1] - 1]),
        )
    bottom, left = int(row.min()), int(column.min())
    shape = int(row.max()) + 1 - bottom, int(column.max()) + 1 - left
    parts = (
        _cut_out(cells, (0, 0), (bottom, left), shape),
        _cut_out(perceived.values, (perceived.bottom, perceived.left), (bottom, left), shape),
    )
    return parts[0][::-1], parts[1][::-1], (left, bottom)


def _cut_out(
    values: NDArray[np.int8], at: tuple[int, int], corner: tuple[int, int], shape: tuple[int, int]
) -> NDArray[np.int8]:
    """Cells of a matrix that lies at `at`, from `corner` on; 0 outside."""
    part = np.zeros(shape, np.int8)
    (a, b), (rows, columns) = (at[0] - corner[0], at[1] - corner[1]), values.shape
    v0, v1 = max(a, 0), min(a + rows, shape[0])
    u0, u1 = max(b, 0), min(b + columns, shape[1])
    if v1 > v0 and u1 > u0:
        part[v0:v1, u0:u1] = values[v0 - a : v1 - a, u0 - b : u1 - b]
    return part
