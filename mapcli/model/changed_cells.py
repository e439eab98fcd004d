"""Where something has changed between two maps of the same place: the one rule of that."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.bool_]


class ChangedCells(NamedTuple):
    """Shape (rows, columns) each.

    Attributes:
        vanished: occupied in the older map, and open in the newer one; appeared: the other way.
    """

    vanished: Cells
    appeared: Cells


class States(NamedTuple):
    """What a map knows: where it is occupied, and where it is open; shape (rows, columns) each."""

    occupied: Cells
    open: Cells


def changed_cells(older: States, newer: States) -> ChangedCells:
    """Obstacles of one map where the other is open, and has none in the next cell either: a wall is
    a cell off from one map to the next, by what poses err and by where cells begin."""
    return ChangedCells(
        older.occupied & newer.open & ~with_neighbours(newer.occupied),
        newer.occupied & older.open & ~with_neighbours(older.occupied),
    )


def with_neighbours(cells: Cells) -> Cells:
    """The cells and those next to them, diagonally too."""
    near = cells.copy()
    near[1:] |= cells[:-1]
    near[:-1] |= cells[1:]
    across = near.copy()
    near[:, 1:] |= across[:, :-1]
    near[:, :-1] |= across[:, 1:]
    return near
