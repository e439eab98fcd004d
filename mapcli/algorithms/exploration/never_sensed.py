"""Cells of the world that an exploration has left unknown, and why."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.model.exploration import Exploration
from mapcli.model.grid import GridMap

Cells = NDArray[np.intp]
"""(row, column) of each, shape (n, 2)."""


class NeverSensed(NamedTuple):
    """Cells that the world knows and the robots do not.

    Attributes:
        left: a robot could stand on them or beside them; the exploration ended before, or the
            robots are too large.
        at_corners: they touch cells where a robot could stand at corners only. No frontier is
            beside them, so they are sensed by a robot that happens to stand there, or not at all.
        out_of_reach: not even that.
    """

    left: Cells
    at_corners: Cells
    out_of_reach: Cells


def never_sensed(world: GridMap, exploration: Exploration, low: float) -> NeverSensed:
    """The cells of each kind, in the order of rows and columns."""
    unseen = world.known & ~exploration.after.known
    explorable = exploration.explorable
    open_cells = world.each(lambda cells: cells < np.float32(low))
    stand = np.pad(explorable & open_cells, 1)
    rows, columns = unseen.shape
    beside = np.zeros_like(unseen)
    for down in (0, 2):
        for right in (0, 2):
            beside |= stand[down : down + rows, right : right + columns]
    return NeverSensed(
        np.argwhere(unseen & explorable),
        np.argwhere(unseen & ~explorable & beside),
        np.argwhere(unseen & ~explorable & ~beside),
    )
