"""How a pose of a window scores: the sum of the likelihood field at the points, less the prior; and
the scores of a whole window, which tell how ambiguous a match is.

A pose of the window is (du, dv, turn): cells and whole steps of the heading away from the pose at
its middle, which is (u, v, theta) in cells and radians. Points are in the robot's frame, in cells.
"""

from __future__ import annotations

from math import cos, floor, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel


class PoseGrid(NamedTuple):
    """The poses of a window that are tried.

    Attributes:
        reach: half-width of the window in cells, along both axes.
        turns: half-width in steps of the heading.
        stride: cells between positions.
        turn_step: radians between headings.
    """

    reach: int
    turns: int
    stride: int
    turn_step: float


class Prior(NamedTuple):
    """What a pose loses by being away from the middle of the window: rising at first, level far
    away (Geman and McClure's robust kernel), for shift and turn each.

    Attributes:
        most: the most that either costs.
        half_at: squared standard deviations that cost half of it: the kernel's squared scale.
        per_cell, per_turn: squared standard deviations for a squared cell, and a squared step.
    """

    most: float
    half_at: float
    per_cell: float
    per_turn: float


def rotated_scans(
    points: NDArray[np.float64],
    middle: NDArray[np.float64],
    turns: int,
    turn_step: float,
    columns: int,
) -> NDArray[np.int64]:
    """Where the points fall at `middle` after each turn, as flat indices: (2 turns + 1, n)."""
    scans = np.empty((2 * turns + 1, len(points)), np.int64)
    rotate_scan(points, middle, turn_step, columns, scans)
    return scans


@kernel
def rotate_scan(
    points: NDArray[np.float64],
    middle: NDArray[np.float64],
    turn_step: float,
    columns: int,
    scans: NDArray[np.int64],
) -> None:
    """Fill `scans` with what `rotated_scans` returns."""
    turns = len(scans) // 2
    for k in range(len(scans)):
        theta = middle[2] + (k - turns) * turn_step
        c, s = cos(theta), sin(theta)
        for p in range(len(points)):
            u = middle[0] + c * points[p, 0] - s * points[p, 1]
            v = middle[1] + s * points[p, 0] + c * points[p, 1]
            scans[k, p] = floor(v) * columns + floor(u)


@kernel
def sum_of_field(field: NDArray[np.uint8], scan: NDArray[np.int64], offset: int) -> int:
    """Sum of the field at the points. (A loop so plain that it compiles to four loads at a time;
    looking now and then whether the rest can still win made it three times slower.)"""
    score = 0
    for p in range(len(scan)):
        score += field[scan[p] + offset]
    return score


@kernel
def penalty(squared_cells: float, squared_turns: float, prior: Prior) -> float:
    """What a pose loses by being so far from the middle of the window; see `Prior`."""
    a, b = squared_cells * prior.per_cell, squared_turns * prior.per_turn
    return prior.most * (a / (prior.half_at + a) + b / (prior.half_at + b))


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
