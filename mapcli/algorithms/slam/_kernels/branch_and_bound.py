"""Finding the pose at which a scan fits the map, by branch and bound.

Poses are (u, v, theta) in cells and radians; points are in the robot's frame, in cells. Callers
see to it that every point of every pose in the window, and the width of the coarsest level beyond
it, lie inside the arrays.
"""

from __future__ import annotations

from math import cos, floor, sin

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel

Prior = tuple[float, float, float, float]


def thin(points: NDArray[np.float64], cell: float) -> NDArray[np.int64]:
    """Indices, ascending, of the first point in each square of side `cell`."""
    kept = np.empty(len(points), np.int64)
    # A hash table that stays at least three quarters empty.
    firsts = np.full(4 << len(points).bit_length(), -1, np.int64)
    return kept[: keep_firsts(points, cell, firsts, kept)]


@kernel
def keep_firsts(
    points: NDArray[np.float64], cell: float, firsts: NDArray[np.int64], kept: NDArray[np.int64]
) -> int:
    """Fill `kept` with what `thin` returns, and return how many they are.

    `firsts` is a hash table of so far -1: the first point in each square.
    """
    mask, count = len(firsts) - 1, 0
    for i in range(len(points)):
        u, v = floor(points[i, 0] / cell), floor(points[i, 1] / cell)
        at = ((u * 4000037 + v) * 40503) & mask
        while firsts[at] >= 0:
            first = firsts[at]
            if floor(points[first, 0] / cell) == u and floor(points[first, 1] / cell) == v:
                break
            at = (at + 1) & mask
        if firsts[at] < 0:
            firsts[at] = i
            kept[count] = i
            count += 1
    return count


@kernel
def penalty(shift: float, turn: float, prior: Prior) -> float:
    """What a pose loses by leaving the odometry's: rising at first, level far away.

    Args:
        shift: squared distance in cells; turn: squared angle in steps.
        prior: (most, knee, per squared cell, per squared step); the last two turn the distances
            into squared standard deviations, `knee` of them cost half of `most`.
    """
    most, knee, per_cell, per_step = prior
    a, b = shift * per_cell, turn * per_step
    return most * (a / (knee + a) + b / (knee + b))


@kernel
def nearest_in(low: int, width: int) -> int:
    """The smallest distance from 0 in low, low + 1, ..., low + width - 1."""
    if low > 0:
        return low
    return max(0, -(low + width - 1))


@kernel
def total(field: NDArray[np.uint8], places: NDArray[np.int64], offset: int) -> int:
    """Sum of the field at the points. (A loop so plain that it compiles to four loads at a time;
    looking now and then whether the rest can still win made it three times slower.)"""
    score = 0
    for p in range(len(places)):
        score += field[places[p] + offset]
    return score


def top_level(reach: int) -> int:
    """The level of the largest nodes that is worth it in a window of so many cells either way."""
    return 2 if reach < 8 else 3


def search(
    fields: NDArray[np.uint8],
    widths: NDArray[np.int64],
    points: NDArray[np.float64],
    start: NDArray[np.float64],
    half: tuple[int, int],
    steps: tuple[int, float],
    prior: Prior,
    top: int,
    known: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """The best pose of a window around `start`, the same that trying all of them would find.

    The score of a pose is the sum of `fields[0]` at its points less `penalty`. A node is a turn
    and a square of `widths[level]` cells; the coarser field there bounds the score of all poses
    in it, so nodes that cannot beat the best pose so far are never opened.

    Args:
        fields, widths: see `likelihood.update_field`.
        points: shape (n, 2).
        start: (u, v, theta), the pose from odometry.
        half: (cells, turns): the window's half-widths in cells and in turns.
        steps: (cells between poses, a whole number; radians between turns).
        prior: see `penalty`.
        top: the level of the largest nodes.
        known: what this returned for a smaller window within this one, which saves time.

    Returns:
        (du, dv, turns, score, sum of the field): du, dv in cells, turns in steps, from `start`.
    """
    stride, turn_step = steps
    columns = fields.shape[2]
    layers = fields.reshape(fields.shape[0], -1)
    size = (*half, int(widths[top]))
    places = turned(points, start, half[1], turn_step, columns)
    bounds = np.empty(len(places) * side_of(size) ** 2)
    bound_nodes(layers, top, places, columns, size, prior, bounds)
    best = np.array([0.0, 0.0, 0.0, -np.inf, 0.0]) if known is None else known.copy()
    # Sorted outside the compiled loops, where a sort alone would take two seconds to compile.
    order = np.flatnonzero(bounds > best[3])
    order = order[np.argsort(-bounds[order], kind="stable")]
    stack = np.empty((len(widths) * int(widths[top]) ** 2, 3), np.int64)
    open_nodes(
        layers, widths, places, columns, (*size, top, stride), prior, bounds, order, stack, best
    )
    return best


def turned(
    points: NDArray[np.float64],
    start: NDArray[np.float64],
    turns: int,
    turn_step: float,
    columns: int,
) -> NDArray[np.int64]:
    """Where the points fall at `start` after each turn, as flat indices: (2 turns + 1, n)."""
    places = np.empty((2 * turns + 1, len(points)), np.int64)
    turn(points, start, turn_step, columns, places)
    return places


@kernel
def turn(
    points: NDArray[np.float64],
    start: NDArray[np.float64],
    turn_step: float,
    columns: int,
    places: NDArray[np.int64],
) -> None:
    """Fill `places` with what `turned` returns."""
    turns = len(places) // 2
    for k in range(len(places)):
        theta = start[2] + (k - turns) * turn_step
        c, s = cos(theta), sin(theta)
        for p in range(len(points)):
            u = start[0] + c * points[p, 0] - s * points[p, 1]
            v = start[1] + s * points[p, 0] + c * points[p, 1]
            places[k, p] = floor(v) * columns + floor(u)


@kernel
def side_of(size: tuple[int, int, int]) -> int:
    """How many of the largest nodes lie side by side; size is (reach, turns, width)."""
    return (2 * size[0] + size[2]) // size[2]


@kernel
def node_at(node: int, size: tuple[int, int, int]) -> tuple[int, int, int]:
    """(du, dv, turn index) of the lowest corner of a largest node; size is (reach, turns, width).

    Nodes are numbered by turn, then dv, then du.
    """
    reach, _, width = size
    side = side_of(size)
    square = node % (side * side)
    return square % side * width - reach, square // side * width - reach, node // (side * side)


@kernel
def bound_nodes(
    layers: NDArray[np.uint8],
    top: int,
    places: NDArray[np.int64],
    columns: int,
    size: tuple[int, int, int],
    prior: Prior,
    bounds: NDArray[np.float64],
) -> None:
    """Fill `bounds` with bounds on the scores in each of the largest nodes; see `search`."""
    _, turns, width = size
    for node in range(len(bounds)):
        du, dv, k = node_at(node, size)
        shift = nearest_in(du, width) ** 2 + nearest_in(dv, width) ** 2
        fit = total(layers[top], places[k], dv * columns + du)
        bounds[node] = fit - penalty(shift, (k - turns) ** 2, prior)


@kernel
def open_nodes(
    layers: NDArray[np.uint8],
    widths: NDArray[np.int64],
    places: NDArray[np.int64],
    columns: int,
    size: tuple[int, int, int, int, int],
    prior: Prior,
    bounds: NDArray[np.float64],
    order: NDArray[np.int64],
    stack: NDArray[np.int64],
    best: NDArray[np.float64],
) -> None:
    """Open the largest nodes, best bound first, until none left can win; see `search`.

    `size` is (reach, turns, width of the largest nodes, their level, cells between poses);
    `stack` is room for the nodes that wait; `best` is changed in place.
    """
    reach, turns, width, top, stride = size
    for node in order:
        if bounds[node] <= best[3]:
            break
        du, dv, k = node_at(node, (reach, turns, width))
        open_node(
            layers, widths, places[k], columns, (du, dv, k - turns, top), reach, stride, prior,
            stack, best,
        )  # fmt: skip


@kernel
def open_node(
    layers: NDArray[np.uint8],
    widths: NDArray[np.int64],
    places: NDArray[np.int64],
    columns: int,
    node: tuple[int, int, int, int],
    reach: int,
    stride: int,
    prior: Prior,
    stack: NDArray[np.int64],
    best: NDArray[np.float64],
) -> None:
    """Look into one node (du, dv, turn, level), level by level; `best` is changed in place."""
    stack[0, 0], stack[0, 1], stack[0, 2] = node[0], node[1], node[3]
    depth, turn = 1, node[2]
    while depth:
        depth -= 1
        low_u, low_v, level = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        width, child = widths[level], widths[level - 1]
        for dv in range(low_v, min(low_v + width, reach + 1), child):
            for du in range(low_u, min(low_u + width, reach + 1), child):
                if child == 1 and (du % stride or dv % stride):
                    continue
                shift = nearest_in(du, child) ** 2 + nearest_in(dv, child) ** 2
                fit = total(layers[level - 1], places, dv * columns + du)
                score = fit - penalty(shift, turn * turn, prior)
                if score <= best[3]:
                    continue
                if child == 1:
                    best[0], best[1], best[2], best[3], best[4] = du, dv, turn, score, fit
                else:
                    stack[depth, 0], stack[depth, 1], stack[depth, 2] = du, dv, level - 1
                    depth += 1
