"""Draw a perception map, compiled: for large scans and windows.

The numpy versions in `perception_map` do the same for small ones, for which numba is not loaded.
"""

from __future__ import annotations

from math import ceil, floor, inf

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import allocating_kernel

Floats = NDArray[np.float64]


@allocating_kernel
def accumulate(path: Floats, left: int, bottom: int, area: Floats) -> None:
    """Add to `area` what `perception_map.covered_area` sums up along the rows.

    Args:
        path: shape (n, 2), closed; area: shape (rows, columns + 2), changed in place.
    """
    for i in range(len(path)):
        j = i + 1 if i + 1 < len(path) else 0
        u, v = path[i, 0] - left, path[i, 1] - bottom
        du, dv = path[j, 0] - left - u, path[j, 1] - bottom - v
        if dv == 0.0:
            continue
        # The next whole u and v ahead, and the share of the edge at which it gets there.
        step_u, step_v = (1.0 if du > 0 else -1.0), (1.0 if dv > 0 else -1.0)
        next_u = floor(u) + 1.0 if du > 0 else ceil(u) - 1.0
        next_v = floor(v) + 1.0 if dv > 0 else ceil(v) - 1.0
        t = 0.0
        while t < 1.0:
            at_u = (next_u - u) / du if du != 0.0 else inf
            at_v = (next_v - v) / dv
            end = min(at_u, at_v, 1.0)
            if at_u <= end:
                next_u += step_u
            if at_v <= end:
                next_v += step_v
            add_piece(area, u + du * (t + end) / 2, v + dv * (t + end) / 2, dv * (end - t))
            t = end


@allocating_kernel
def add_piece(area: Floats, u: float, v: float, rise: float) -> None:
    """One piece of an edge within a cell, with its middle at (u, v)."""
    rows, columns = area.shape[0], area.shape[1] - 2
    row = floor(v)
    if row < 0 or row >= rows:
        return
    u = min(max(u, 0.0), float(columns))
    column = floor(u)
    part = rise * (u - column)
    area[row, column] -= rise - part
    area[row, column + 1] -= part


@allocating_kernel
def draw_perception_map(
    face: Floats, back: Floats, left: int, bottom: int, rows: int, columns: int, exact: float
) -> NDArray[np.int8]:
    """The majority rule (see `perception_map`) for every cell of a box."""
    free = np.zeros((rows, columns + 2))
    whole = np.zeros((rows, columns + 2))
    accumulate(face, left, bottom, free)
    accumulate(back, left, bottom, whole)
    values = np.zeros((rows, columns), np.int8)
    for row in range(rows):
        before, behind = 0.0, 0.0
        for column in range(columns):
            before += free[row, column]
            behind += whole[row, column]
            wall = behind - before
            if wall >= 0.5 - exact and wall > 1 - behind + exact:
                values[row, column] = 1
            elif before > 0.5 + exact:
                values[row, column] = -1
    return values
