"""What a map loses on its way into a file, by what its readers will find there."""

from __future__ import annotations

from pathlib import PurePath

import numpy as np

from mapcli.formats.maps.save import SaveOptions, as_written, format_of
from mapcli.model.counting import counted
from mapcli.model.grid import GridMap


def losses(grid: GridMap, path: str | PurePath, options: SaveOptions | None = None) -> list[str]:
    """Sentences about what the outcome of `map_files` does not hold of `grid`, read back by the
    rules of `options.dialect`."""
    options = options or SaveOptions()
    written = as_written(grid, path, options)
    changed = forgotten = invented = 0
    largest, value = 0.0, 0.0
    for before, counts in grid.tally():
        after = written(before)
        known, stays = ~np.isnan(before), ~np.isnan(after)
        used = counts > 0
        changes = np.where(known & stays & used, np.abs(after - before), 0)
        changed += int(counts[changes > 0].sum())
        largest = max(largest, float(changes.max(initial=0)))
        forgotten += int(counts[known & ~stays].sum())
        news = ~known & stays & used
        invented += int(counts[news].sum())
        value = float(after[news][0]) if news.any() else value
    found = []
    if changed:
        cells = counted(changed, "cells whose probability changes")
        found.append(f"{cells}, by up to {largest:.2g}")
    if forgotten:
        found.append(counted(forgotten, "cells known before and unknown now"))
    if invented:
        found.append(counted(invented, f"cells unknown before and {value:.2g} now"))
    return found + _unreadable(path, options)


def _unreadable(path: str | PurePath, options: SaveOptions) -> list[str]:
    """What the dialect's own reader would refuse."""
    kind = format_of(path, options)
    image = kind in ("yaml", "pgm", "png") and not options.inline
    if image and options.image_kind(kind) == "pgm" and options.bits == 16 and (
        options.dialect == "ros1"
    ):  # fmt: skip
        return ["ROS 1's map_server cannot read a PGM of 16 bits"]
    return []
