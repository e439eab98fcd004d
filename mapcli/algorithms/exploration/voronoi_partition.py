"""Voronoi partition of the map among robots, by multi-source breadth-first search: each cell
belongs to the robot nearest to it (Sect. 9.3.2: "each robot will explore that portion of the
frontier that is closest to its position").

Distances are those of a point over known open cells; ties go to the first robot. The searches grow
from all robots at once, and no farther than is asked for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapcli.algorithms.exploration.exploration_state import OPEN, Cells, ExplorationState
from mapcli.algorithms.exploration.path_search import (
    NEVER,
    beside_diagonal,
    is_diagonal,
    next_place,
)


class VoronoiPartition(NamedTuple):
    """Scratch memory of the waves (mutable; as in `PathSearch`, it is never cleared).

    Attributes:
        mark: base + the robot whose wave was there first, where waves have been (int32).
        queue: the cells that the waves reached by their last moves, in order (int32).
        base: shape (1,) (int64).
    """

    mark: Cells
    queue: Cells
    base: Cells


def make_partition(state: ExplorationState, robots: int) -> VoronoiPartition:
    """Memory for the waves; a single robot needs none."""
    size = len(state.known) if robots > 1 else 0
    return VoronoiPartition(
        np.zeros(size, np.int32), np.zeros(size, np.int32), np.zeros(1, np.int64)
    )


def start_partition(partition: VoronoiPartition, cells: Cells) -> int:
    """Waves start at the robots' cells; returns the length of the queue."""
    partition.base[0] += len(cells)
    if partition.base[0] > NEVER - 2 * len(cells):
        for cell in range(len(partition.mark)):
            partition.mark[cell] = 0
        partition.base[0] = 1
    count = 0
    for robot in range(len(cells)):
        count = claim(partition, cells[robot], robot, count)
    return count


def grow_partition(
    state: ExplorationState, partition: VoronoiPartition, begin: int, end: int
) -> tuple[int, int]:
    """Each wave goes one move on from queue[begin:end]; returns where in the queue they are."""
    base = partition.base[0]
    first = reached = next_place(state, begin, end)
    for k in range(begin, end):
        cell = partition.queue[k]
        for m in range(len(state.moves)):
            there = cell + state.moves[m]
            if partition.mark[there] < base and can_pass(state, cell, there):
                reached = claim(partition, there, partition.mark[cell] - base, reached)
    return first, reached


def claim(partition: VoronoiPartition, cell: int, robot: int, reached: int) -> int:
    """A wave gets to a cell, unless one has been there."""
    if partition.mark[cell] >= partition.base[0]:
        return reached
    partition.mark[cell] = partition.base[0] + robot
    partition.queue[reached] = cell
    return reached + 1


def can_pass(state: ExplorationState, cell: int, there: int) -> bool:
    """Whether a point may move to a neighbouring cell."""
    if state.known[there] != OPEN:
        return False
    if not is_diagonal(state, cell, there):
        return True
    beside = beside_diagonal(state, cell, there)
    return state.known[beside] == OPEN and state.known[cell + there - beside] == OPEN


def is_owned(partition: VoronoiPartition, robot: int, cell: int) -> bool:
    """Whether a robot's wave was the first at a cell."""
    return partition.mark[cell] == partition.base[0] + robot


def count_owned(partition: VoronoiPartition, robot: int, begin: int, end: int) -> int:
    """How many of queue[begin:end] are in a robot's part."""
    count = 0
    for k in range(begin, end):
        count += is_owned(partition, robot, partition.queue[k])
    return count
