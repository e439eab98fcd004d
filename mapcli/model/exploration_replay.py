"""Replaying the trace of an exploration: what was known, and where everybody was, at any step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.model.exploration import Cell, Exploration, between
from mapcli.model.grid import GridMap


class ExplorationReplay:
    """An exploration at one of its moments; `advance` moves on (changes this object).

    Attributes:
        exploration: what is replayed.
        done: steps done.
        robots: where the robots are after them.
        moved: the moves made since the moment before, as a part of `exploration.steps.path`.
    """

    def __init__(self, exploration: Exploration) -> None:
        self.exploration = exploration
        self.done = 0
        self.robots: list[Cell] = list(exploration.robots)
        self.moved = slice(0, 0)
        self._cells = exploration.before.cells.copy()
        self._of_interest = ~exploration.before.known
        robot = exploration.steps.robot
        self._steps_of = [np.flatnonzero(robot == k) for k in range(len(self.robots))]

    @property
    def grid(self) -> GridMap:
        """What is known now (a copy)."""
        return self.exploration.before.replaced(self._cells.copy())

    def advance(self, steps: int) -> None:
        """Go on until so many steps are done."""
        columns, first = self.exploration.steps, self.done
        sensed = between(first, steps, columns.sensed_end)
        rows, cells = columns.cells[sensed].T
        self._cells[rows, cells] = columns.probabilities[sensed]
        self._of_interest[rows, cells] = False
        stayed = columns.unknowable[between(first, steps, columns.unknowable_end)]
        self._of_interest[stayed[:, 0], stayed[:, 1]] = False
        for robot, own in enumerate(self._steps_of):
            count = int(np.searchsorted(own, steps))
            if count:
                row, column = columns.goal[own[count - 1]].tolist()
                self.robots[robot] = (row, column)
        self.moved = between(first, steps, columns.path_end)
        self.done = steps

    def frontier(self, low: float) -> NDArray[np.bool_]:
        """Where the frontier is now, shape (rows, columns): open cells that have a neighbour
        (left, right, up, down) which is unknown and has not been sensed."""
        beside = np.pad(self._of_interest, 1)
        touches = beside[:-2, 1:-1] | beside[2:, 1:-1] | beside[1:-1, :-2] | beside[1:-1, 2:]
        frontier: NDArray[np.bool_] = (self._cells < np.float32(low)) & touches
        return frontier
