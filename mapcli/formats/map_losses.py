"""What a map loses on its way into a file: the file is read back and compared."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mapcli.formats.maps import Format, load_map
from mapcli.model.counting import counted
from mapcli.model.grid import GridMap


def losses(
    grid: GridMap, files: Mapping[str, bytes], name: str, form: Format | None = None
) -> list[str]:
    """Sentences about what `files`, the outcome of `dump_map`, do not hold of `grid`.

    Args:
        grid: the map that was written.
        files: name -> content.
        name: which of them is the map.
        form: the map's format where its name does not say.
    """
    written = load_map(name, read=lambda path: files[path.name], form=form)
    found = _cell_losses(grid, written.grid)
    if written.grid.resolution != grid.resolution or written.grid.origin != grid.origin:
        found.append("the resolution and the origin are lost")
    return found


def _cell_losses(grid: GridMap, written: GridMap) -> list[str]:
    before, after = grid.cells, written.cells
    if np.array_equal(before, after, equal_nan=True):
        return []
    forgotten = grid.known & ~written.known
    invented = ~grid.known & written.known
    changes = np.abs(after - before)
    changed = int(np.count_nonzero(changes > 0))
    found = []
    if changed:
        largest = float(np.fmax.reduce(changes, axis=None))
        found.append(
            f"{counted(changed, 'cells whose probability changes')}, by up to {largest:.2g}"
        )
    if forgotten.any():
        found.append(counted(int(forgotten.sum()), "cells known before and unknown now"))
    if invented.any():
        value = float(after[invented][0])
        found.append(counted(int(invented.sum()), f"cells unknown before and {value:.2g} now"))
    return found
