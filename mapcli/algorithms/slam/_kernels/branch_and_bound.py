"""Correlative scan matching: the pose in a window at which a scan fits the map best, by branch and
bound on max-pooled likelihood fields (Olson 2009; Hess et al. 2016, Sect. V-B).

A pose of the window is (du, dv, turn): cells and whole steps of the heading away from the pose at
its middle, which is (u, v, theta) in cells and radians. Points are in the robot's frame, in cells.
Callers see to it that every point of every pose in the window, and the width of the coarsest level
beyond it, lie inside the arrays.
"""

from __future__ import annotations

from math import cos, floor, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel


class FieldLevels(NamedTuple):
    """The likelihood field and its upper bounds (max-pooled, see `likelihood_field`).

    Attributes:
        values: shape (levels, rows * columns), uint8: in level k, at cell (v, u), the highest value
            of the field in the `widths[k]` x `widths[k]` cells from there up and right.
        widths: shape (levels,), int64; the first is 1, so level 0 is the field itself.
        columns: of the field, to get from (u, v) to an index of `values`: v * columns + u.
        top: the level of the largest nodes.
    """

    values: NDArray[np.uint8]
    widths: NDArray[np.int64]
    columns: int
    top: int


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


class BestPose(NamedTuple):
    """The best pose of a window so far.

    Attributes:
        du, dv, turn: cells and steps away from the middle of the poses.
        score: the sum of the field at the points, less the prior.
        fit: that sum.
    """

    du: int
    dv: int
    turn: int
    score: float
    fit: int

    def cells(self, middle: NDArray[np.float64], turn_step: float) -> NDArray[np.float64]:
        """(u, v, theta) of the pose, in a window around `middle`."""
        away = np.array([self.du, self.dv, self.turn * turn_step], dtype=np.float64)
        pose: NDArray[np.float64] = middle + away
        return pose


NOTHING_YET = BestPose(0, 0, 0, -np.inf, 0)


class Node(NamedTuple):
    """Poses of one heading whose positions are a square of `widths[level]` cells from (du, dv) up
    and right."""

    du: int
    dv: int
    turn: int
    level: int


class Queue(NamedTuple):
    """The largest nodes in the order in which they are opened.

    Attributes:
        bounds: shape (nodes,), upper bounds of the scores in each, by the nodes' numbers.
        order: the numbers of those that may win, by falling bound.
    """

    bounds: NDArray[np.float64]
    order: NDArray[np.int64]


Plain = tuple[Any, ...]
"""The fields of a record."""

DU, DV, LEVEL = range(3)
"""Columns of the stack of waiting nodes, which all have the same turn."""


def search(
    levels: FieldLevels,
    points: NDArray[np.float64],
    middle: NDArray[np.float64],
    poses: PoseGrid,
    prior: Prior,
    known: BestPose | None = None,
) -> BestPose:
    """The best pose of a window, the same that trying all of them would find.

    The score of a pose is the sum of the field at its points less the prior. The coarser field at a
    node bounds the score of all poses in it, so nodes that cannot beat the best pose so far are
    never opened.

    Args:
        points: shape (n, 2).
        middle: (u, v, theta), the window's middle, where the prior costs nothing.
        known: what this returned for a smaller window within this one, which saves time.
    """
    # Plain tuples get into compiled code in a third of the time of records.
    records = tuple(levels), tuple(poses), tuple(prior)
    width = int(levels.widths[levels.top])
    scans = np.empty((2 * poses.turns + 1, len(points)), np.int64)
    bounds = np.empty(len(scans) * ((2 * poses.reach + width) // width) ** 2)
    bound_window(*records, points, middle, scans, bounds)
    best = known or NOTHING_YET
    # Sorted outside the compiled loops, where a sort alone would take two seconds to compile.
    order = np.flatnonzero(bounds > best.score)
    order = order[np.argsort(-bounds[order], kind="stable")]
    stack = np.empty((len(levels.widths) * width**2, 3), np.int64)
    return BestPose(*branch(*records, scans, (bounds, order), stack, tuple(best)))


@kernel
def bound_window(
    levels: Plain,
    poses: Plain,
    prior: Plain,
    points: NDArray[np.float64],
    middle: NDArray[np.float64],
    scans: NDArray[np.int64],
    bounds: NDArray[np.float64],
) -> None:
    """`rotate_scan` and `bound_nodes` for a call from Python; the first three are fields of a
    `FieldLevels`, a `PoseGrid` and a `Prior`."""
    levels_, poses_, prior_ = FieldLevels(*levels), PoseGrid(*poses), Prior(*prior)
    rotate_scan(points, middle, poses_.turn_step, levels_.columns, scans)
    bound_nodes(levels_, scans, poses_, prior_, bounds)


@kernel
def branch(
    levels: Plain,
    poses: Plain,
    prior: Plain,
    scans: NDArray[np.int64],
    queue: Plain,
    stack: NDArray[np.int64],
    best: Plain,
) -> Plain:
    """`open_nodes` for a call from Python, in and out with fields of the records."""
    levels_, poses_, prior_ = FieldLevels(*levels), PoseGrid(*poses), Prior(*prior)
    return open_nodes(levels_, scans, poses_, prior_, Queue(*queue), stack, BestPose(*best))[:5]


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
def penalty(squared_cells: float, squared_turns: float, prior: Prior) -> float:
    """What a pose loses by being so far from the middle of the window; see `Prior`."""
    a, b = squared_cells * prior.per_cell, squared_turns * prior.per_turn
    return prior.most * (a / (prior.half_at + a) + b / (prior.half_at + b))


@kernel
def sum_of_field(field: NDArray[np.uint8], scan: NDArray[np.int64], offset: int) -> int:
    """Sum of the field at the points. (A loop so plain that it compiles to four loads at a time;
    looking now and then whether the rest can still win made it three times slower.)"""
    score = 0
    for p in range(len(scan)):
        score += field[scan[p] + offset]
    return score


@kernel
def nearest_in(low: int, width: int) -> int:
    """The smallest distance from 0 in low, low + 1, ..., low + width - 1."""
    if low > 0:
        return low
    return max(0, -(low + width - 1))


@kernel
def nodes_per_side(reach: int, width: int) -> int:
    """How many nodes of a width lie side by side in a poses."""
    return (2 * reach + width) // width


@kernel
def node_at(number: int, levels: FieldLevels, poses: PoseGrid) -> Node:
    """One of the largest nodes, which are numbered by turn, then dv, then du."""
    width = levels.widths[levels.top]
    side = nodes_per_side(poses.reach, width)
    square, turn = number % (side * side), number // (side * side) - poses.turns
    du, dv = square % side * width - poses.reach, square // side * width - poses.reach
    return Node(du, dv, turn, levels.top)


@kernel
def bound_nodes(
    levels: FieldLevels,
    scans: NDArray[np.int64],
    poses: PoseGrid,
    prior: Prior,
    bounds: NDArray[np.float64],
) -> None:
    """Fill `bounds` with upper bounds of the scores in each of the largest nodes."""
    width, field = levels.widths[levels.top], levels.values[levels.top]
    for number in range(len(bounds)):
        du, dv, turn, _ = node_at(number, levels, poses)
        shift = nearest_in(du, width) ** 2 + nearest_in(dv, width) ** 2
        fit = sum_of_field(field, scans[turn + poses.turns], dv * levels.columns + du)
        bounds[number] = fit - penalty(shift, turn**2, prior)


@kernel
def open_nodes(
    levels: FieldLevels,
    scans: NDArray[np.int64],
    poses: PoseGrid,
    prior: Prior,
    queue: Queue,
    stack: NDArray[np.int64],
    best: BestPose,
) -> BestPose:
    """Open the largest nodes, best bound first, until none left can win; `stack` is room for the
    smaller nodes that wait."""
    for number in queue.order:
        if queue.bounds[number] <= best.score:
            break
        node = node_at(number, levels, poses)
        best = open_node(levels, scans[node.turn + poses.turns], poses, prior, node, stack, best)
    return best


@kernel
def open_node(
    levels: FieldLevels,
    scan: NDArray[np.int64],
    poses: PoseGrid,
    prior: Prior,
    node: Node,
    stack: NDArray[np.int64],
    best: BestPose,
) -> BestPose:
    """Branch into one of the largest nodes, level by level, and bound each of its children."""
    stack[0, DU], stack[0, DV], stack[0, LEVEL] = node.du, node.dv, node.level
    depth, turn = 1, node.turn
    while depth:
        depth -= 1
        low_u, low_v, level = stack[depth, DU], stack[depth, DV], stack[depth, LEVEL]
        width, child = levels.widths[level], levels.widths[level - 1]
        for dv in range(low_v, min(low_v + width, poses.reach + 1), child):
            for du in range(low_u, min(low_u + width, poses.reach + 1), child):
                if child == 1 and (du % poses.stride or dv % poses.stride):
                    continue
                shift = nearest_in(du, child) ** 2 + nearest_in(dv, child) ** 2
                fit = sum_of_field(levels.values[level - 1], scan, dv * levels.columns + du)
                score = fit - penalty(shift, turn * turn, prior)
                if score <= best.score:
                    continue
                if child == 1:
                    best = BestPose(du, dv, turn, score, fit)
                else:
                    stack[depth, DU], stack[depth, DV], stack[depth, LEVEL] = du, dv, level - 1
                    depth += 1
    return best
