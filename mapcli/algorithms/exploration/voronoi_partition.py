"""Whose part of the field a cell is in: that of the robot nearest to it (Sect. 9.3.2: "each robot
will explore that portion of the frontier that is closest to its position").

Nearest over known open cells, as points move; ties go to the first robot. Waves go out from all
robots at once, and no farther than somebody asks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapcli.algorithms.exploration.exploration_state import OPEN, Cells, Field
from mapcli.algorithms.exploration.path_search import NEVER, beside_diagonal, is_diagonal


class Parts(NamedTuple):
    """Scratch memory of the waves (mutable; as in `motion.Search`, it is never cleared).

    Attributes:
        mark: base where the waves have been (int32).
        owner: the robot whose wave was there first (int32).
        queue: the cells in the order in which the waves reached them (int32).
        base: shape (1,) (int64).
    """

    mark: Cells
    owner: Cells
    queue: Cells
    base: Cells


def make_parts(field: Field, robots: int) -> Parts:
    """Memory for the waves; a single robot needs none."""
    size = len(field.known) if robots > 1 else 0
    return Parts(
        np.zeros(size, np.int32),
        np.zeros(size, np.int32),
        np.zeros(size, np.int32),
        np.zeros(1, np.int64),
    )


def start_waves(parts: Parts, cells: Cells) -> int:
    """Waves start at the robots' cells; returns the length of the queue."""
    parts.base[0] += 1
    if parts.base[0] > NEVER - 1:
        for cell in range(len(parts.mark)):
            parts.mark[cell] = 0
        parts.base[0] = 1
    count = 0
    for robot in range(len(cells)):
        count = flood(parts, cells[robot], robot, count)
    return count


def spread_waves(field: Field, parts: Parts, begin: int, end: int) -> int:
    """Each wave goes one move on from queue[begin:end]; returns the new end of the queue."""
    reached = end
    for k in range(begin, end):
        cell = parts.queue[k]
        for m in range(len(field.moves)):
            there = cell + field.moves[m]
            if parts.mark[there] < parts.base[0] and can_pass(field, cell, there):
                reached = flood(parts, there, parts.owner[cell], reached)
    return reached


def flood(parts: Parts, cell: int, robot: int, reached: int) -> int:
    """A wave gets to a cell, unless one has been there."""
    if parts.mark[cell] == parts.base[0]:
        return reached
    parts.mark[cell] = parts.base[0]
    parts.owner[cell] = robot
    parts.queue[reached] = cell
    return reached + 1


def can_pass(field: Field, cell: int, there: int) -> bool:
    """Whether a point may move to a neighbouring cell."""
    if field.known[there] != OPEN:
        return False
    if not is_diagonal(field, cell, there):
        return True
    beside = beside_diagonal(field, cell, there)
    return field.known[beside] == OPEN and field.known[cell + there - beside] == OPEN


def is_in_part(parts: Parts, robot: int, cell: int) -> bool:
    """Whether a robot's wave was the first at a cell."""
    return parts.mark[cell] == parts.base[0] and parts.owner[cell] == robot


def owned(parts: Parts, robot: int, begin: int, end: int) -> int:
    """How many of queue[begin:end] are in a robot's part."""
    count = 0
    for k in range(begin, end):
        count += is_in_part(parts, robot, parts.queue[k])
    return count
