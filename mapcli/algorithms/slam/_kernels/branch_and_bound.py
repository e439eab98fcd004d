"""Correlative scan matching: the pose in a window at which a scan fits the map best, by branch and
bound on max-pooled likelihood fields (Olson 2009; Hess et al. 2016, Sect. V-B).

Poses and points are those of `window_scores`. Callers see to it that every point of every pose in
the window, and the width of the coarsest level beyond it, lie inside the arrays.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.window_scores import (
    PoseGrid,
    Prior,
    penalty,
    rotate_scan,
    sum_of_field,
)


class Pyramid(NamedTuple):
    """The likelihood field and its upper bounds, max-pooled (see `likelihood_field`).

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


class BestPose(NamedTuple):
    """The best pose of a window so far.

    Attributes:
        du, dv, turn: cells and steps of the heading away from the middle of the window.
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
    pyramid: Pyramid,
    points: NDArray[np.float64],
    middle: NDArray[np.float64],
    poses: PoseGrid,
    prior: Prior,
    known: BestPose | None = None,
) -> BestPose:
    """The best pose of a window, the same that trying all of them would find.

    The score of a pose is the sum of the field at its points less the prior. A node is a square of
    poses, and the coarser field there bounds the scores of all of them: the largest nodes are
    bounded first (`bound_nodes`), then opened by falling bound, level by level (`open_node`), and
    nodes that cannot beat the best pose so far are never opened.

    Args:
        points: shape (n, 2).
        middle: (u, v, theta), the window's middle, where the prior costs nothing.
        known: what this returned for a smaller window within this one, which saves time.
    """
    # Plain tuples get into compiled code in a third of the time of records.
    records = tuple(pyramid), tuple(poses), tuple(prior)
    width = int(pyramid.widths[pyramid.top])
    scans = np.empty((2 * poses.turns + 1, len(points)), np.int64)
    bounds = np.empty(len(scans) * ((2 * poses.reach + width) // width) ** 2)
    bound_window(*records, points, middle, scans, bounds)
    best = known or NOTHING_YET
    # Sorted outside the compiled loops, where a sort alone would take two seconds to compile.
    order = np.flatnonzero(bounds > best.score)
    order = order[np.argsort(-bounds[order], kind="stable")]
    stack = np.empty((len(pyramid.widths) * width**2, 3), np.int64)
    return BestPose(*branch(*records, scans, (bounds, order), stack, tuple(best)))


@kernel
def bound_window(
    pyramid: Plain,
    poses: Plain,
    prior: Plain,
    points: NDArray[np.float64],
    middle: NDArray[np.float64],
    scans: NDArray[np.int64],
    bounds: NDArray[np.float64],
) -> None:
    """`rotate_scan` and `bound_nodes` for a call from Python; the first three are fields of a
    `Pyramid`, a `PoseGrid` and a `Prior`."""
    pyramid_, poses_, prior_ = Pyramid(*pyramid), PoseGrid(*poses), Prior(*prior)
    rotate_scan(points, middle, poses_.turn_step, pyramid_.columns, scans)
    bound_nodes(pyramid_, scans, poses_, prior_, bounds)


@kernel
def bound_nodes(
    pyramid: Pyramid,
    scans: NDArray[np.int64],
    poses: PoseGrid,
    prior: Prior,
    bounds: NDArray[np.float64],
) -> None:
    """Fill `bounds` with upper bounds of the scores in each of the largest nodes."""
    width, field = pyramid.widths[pyramid.top], pyramid.values[pyramid.top]
    for number in range(len(bounds)):
        du, dv, turn, _ = node_at(number, pyramid, poses)
        shift = nearest_in(du, width) ** 2 + nearest_in(dv, width) ** 2
        fit = sum_of_field(field, scans[turn + poses.turns], dv * pyramid.columns + du)
        bounds[number] = fit - penalty(shift, turn**2, prior)


@kernel
def branch(
    pyramid: Plain,
    poses: Plain,
    prior: Plain,
    scans: NDArray[np.int64],
    queue: Plain,
    stack: NDArray[np.int64],
    best: Plain,
) -> Plain:
    """`open_nodes` for a call from Python, in and out with fields of the records."""
    pyramid_, poses_, prior_ = Pyramid(*pyramid), PoseGrid(*poses), Prior(*prior)
    return open_nodes(pyramid_, scans, poses_, prior_, Queue(*queue), stack, BestPose(*best))[:5]


@kernel
def open_nodes(
    pyramid: Pyramid,
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
        node = node_at(number, pyramid, poses)
        best = open_node(pyramid, scans[node.turn + poses.turns], poses, prior, node, stack, best)
    return best


@kernel
def open_node(
    pyramid: Pyramid,
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
        width, child = pyramid.widths[level], pyramid.widths[level - 1]
        for dv in range(low_v, min(low_v + width, poses.reach + 1), child):
            for du in range(low_u, min(low_u + width, poses.reach + 1), child):
                if child == 1 and (du % poses.stride or dv % poses.stride):
                    continue
                shift = nearest_in(du, child) ** 2 + nearest_in(dv, child) ** 2
                fit = sum_of_field(pyramid.values[level - 1], scan, dv * pyramid.columns + du)
                score = fit - penalty(shift, turn * turn, prior)
                if score <= best.score:
                    continue
                if child == 1:
                    best = BestPose(du, dv, turn, score, fit)
                else:
                    stack[depth, DU], stack[depth, DV], stack[depth, LEVEL] = du, dv, level - 1
                    depth += 1
    return best


@kernel
def node_at(number: int, pyramid: Pyramid, poses: PoseGrid) -> Node:
    """One of the largest nodes, which are numbered by turn, then dv, then du."""
    width = pyramid.widths[pyramid.top]
    side = nodes_per_side(poses.reach, width)
    square, turn = number % (side * side), number // (side * side) - poses.turns
    du, dv = square % side * width - poses.reach, square // side * width - poses.reach
    return Node(du, dv, turn, pyramid.top)


@kernel
def nodes_per_side(reach: int, width: int) -> int:
    """How many nodes of a width lie side by side in a window."""
    return (2 * reach + width) // width


@kernel
def nearest_in(low: int, width: int) -> int:
    """The smallest distance from 0 in low, low + 1, ..., low + width - 1."""
    if low > 0:
        return low
    return max(0, -(low + width - 1))
