"""What has changed from one map to another: places where something appeared or vanished."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label

from mapcli.algorithms.maps.transform import CellFrame
from mapcli.model.changed_cells import ChangedCells, States, changed_cells, with_neighbours
from mapcli.model.comparison import FREE, OCCUPIED, Change, ChangeKind
from mapcli.model.grid import UNKNOWN_PERCENT, GridMap, bands

FEWEST_CELLS = 3
"""Of a place: fewer are a leg that one drive saw by chance."""

MOST_BLOCKS = 25_000_000
"""In which cells of larger maps are put together to find what belongs together."""


def cells_changed(pairs: NDArray[np.uint8]) -> ChangedCells:
    """Where two maps differ.

    Args:
        pairs: `3 * state in A + state in B`, shape (rows, columns); A counts as the older one.
    """
    found = ChangedCells(*(np.zeros(pairs.shape, np.bool_) for _ in range(2)))
    for rows in bands(*pairs.shape):
        above, below = max(rows.start - 1, 0), min(rows.stop + 1, len(pairs))
        states = divmod(pairs[above:below], np.uint8(3))
        older, newer = (States(one == OCCUPIED, one == FREE) for one in states)
        inner = slice(rows.start - above, rows.stop - above)
        for all_, some in zip(found, changed_cells(older, newer), strict=True):
            all_[rows] = some[inner]
    return found


def changes(changed: ChangedCells, frame: CellFrame) -> tuple[Change, ...]:
    """The places where something has changed, the largest first.

    Args:
        frame: of the cells.
    """
    grid = place_of(frame)
    found = [
        *_places(changed.vanished, "vanished", grid),
        *_places(changed.appeared, "appeared", grid),
    ]
    return tuple(sorted(found, key=lambda one: (-one.area_m2, one.kind, one.x, one.y)))


def place_of(frame: CellFrame) -> GridMap:
    """A map of these cells of which nothing is known; it takes no memory."""
    nothing = np.broadcast_to(np.uint8(UNKNOWN_PERCENT), (frame.rows, frame.columns))
    return GridMap(nothing, frame.resolution, frame.origin)


def _places(cells: NDArray[np.bool_], kind: ChangeKind, grid: GridMap) -> Iterator[Change]:
    """Cells that touch, or nearly, are of one place."""
    size = max(1, math.ceil(math.sqrt(cells.size / MOST_BLOCKS)))
    blocks = _blocks(cells, size)
    labels, count = label(with_neighbours(blocks), np.ones((3, 3)))
    for number, box in enumerate(find_objects(labels, count), 1):
        rows, columns = (slice(one.start * size, one.stop * size) for one in box)
        own = (labels[box] == number).repeat(size, axis=0).repeat(size, axis=1)
        part = cells[rows, columns]
        v, u = np.nonzero(part & own[: part.shape[0], : part.shape[1]])
        if len(v) < FEWEST_CELLS:
            continue
        v, u = v + rows.start, u + columns.start
        middle = grid.world_of_cells([(v.min() + v.max()) / 2], [(u.min() + u.max()) / 2])[0]
        side = grid.resolution
        yield Change(
            kind,
            float(middle[0]),
            float(middle[1]),
            (int(np.ptp(u)) + 1) * side,
            (int(np.ptp(v)) + 1) * side,
            len(v) * side**2,
        )


def _blocks(cells: NDArray[np.bool_], size: int) -> NDArray[np.bool_]:
    """Whether any cell of each square of so many cells a side is set."""
    if size == 1:
        return cells
    down, across = (np.arange(0, side, size) for side in cells.shape)
    return np.logical_or.reduceat(np.logical_or.reduceat(cells, down, axis=0), across, axis=1)
