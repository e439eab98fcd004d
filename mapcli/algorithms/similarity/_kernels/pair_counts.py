"""The loops of `perception_map` and `similarity`, compiled for large scans and windows.

The numpy versions beside the callers do the same on small maps, where numba is not loaded.
"""

from __future__ import annotations

from math import ceil, floor, inf

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import njit

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@njit(cache=True)
def accumulate(path: Floats, left: int, bottom: int, area: Floats) -> None:
    """Add to `area` what `perception_map.covered` sums up along the rows.

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


@njit(cache=True)
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


@njit(cache=True)
def draw(
    face: Floats, back: Floats, left: int, bottom: int, rows: int, columns: int, exact: float
) -> NDArray[np.int8]:
    """The majority rule (see `perception_map`) for every cell of a box."""
    free = np.zeros((rows, columns + 2))
    all_ = np.zeros((rows, columns + 2))
    accumulate(face, left, bottom, free)
    accumulate(back, left, bottom, all_)
    values = np.zeros((rows, columns), np.int8)
    for row in range(rows):
        before, behind = 0.0, 0.0
        for column in range(columns):
            before += free[row, column]
            behind += all_[row, column]
            wall = behind - before
            if wall >= 0.5 - exact and wall > 1 - behind + exact:
                values[row, column] = 1
            elif before > 0.5 + exact:
                values[row, column] = -1
    return values


@njit(cache=True)
def find_runs(values: NDArray[np.int8]) -> Ints:
    """Row, first and end column, and content of equal known cells side by side, shape (n, 4)."""
    rows, columns = values.shape
    found = np.empty((1024, 4), np.int64)
    n = 0
    for row in range(rows):
        begin = 0
        for column in range(1, columns + 1):
            if column < columns and values[row, column] == values[row, begin]:
                continue
            if values[row, begin] != 0:
                if n == len(found):
                    found = np.concatenate((found, np.empty_like(found)))
                found[n, 0], found[n, 1], found[n, 2] = row, begin, column
                found[n, 3] = values[row, begin]
                n += 1
            begin = column
    return found[:n]


@njit(cache=True)
def count(
    sums: Ints, row: Ints, start: Ints, end: Ints, obstacle: NDArray[np.bool_], offsets: Ints
) -> Ints:
    """How runs of a perception map compare with the map at each offset; see `TernaryMap.counts`.

    Args:
        sums: shape (rows + 1, columns + 1), obstacles * 2^32 + empty cells so far in each row.
    """
    rows, columns = sums.shape[0] - 1, sums.shape[1] - 1
    flat, width = sums.ravel(), columns + 1
    shifts = offsets[:, 1] * width + offsets[:, 0]
    left, right = offsets[:, 0].min(), offsets[:, 0].max()
    down, up = offsets[:, 1].min(), offsets[:, 1].max()
    totals = np.zeros((2, len(offsets)), np.int64)
    # Run by run, because the offsets of one run lie close together in memory.
    for i in range(len(row)):
        total = totals[1 if obstacle[i] else 0]
        first, last = row[i] * width + start[i], row[i] * width + end[i]
        if (
            row[i] + down >= 0
            and row[i] + up < rows
            and start[i] + left >= 0
            and end[i] + right <= columns
        ):
            for k in range(len(shifts)):
                total[k] += flat[last + shifts[k]] - flat[first + shifts[k]]
            continue
        for k in range(len(shifts)):
            v = row[i] + offsets[k, 1]
            if 0 <= v < rows:
                a = min(max(start[i] + offsets[k, 0], 0), columns)
                b = min(max(end[i] + offsets[k, 0], 0), columns)
                total[k] += sums[v, b] - sums[v, a]
    result = np.empty((len(offsets), 2, 2), np.int64)
    for p in range(2):
        result[:, p, 0] = totals[p] & 0xFFFFFFFF
        result[:, p, 1] = totals[p] >> 32
    return result
