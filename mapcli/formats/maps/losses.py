"""What a map loses when it is written: cells that read back otherwise, by the dialect's rules."""

from __future__ import annotations

import math
from enum import Enum
from pathlib import PurePath
from typing import NamedTuple

import numpy as np

from mapcli.formats.maps.save import SaveOptions, as_written, format_of
from mapcli.model.counting import counted
from mapcli.model.grid import GridMap

ROUNDING = 1e-6
"""Of probabilities in single precision."""


class LossKind(Enum):
    """In which way a written map differs from the map in memory."""

    PROBABILITY = "known cells read back with another probability"
    KNOWN_TO_UNKNOWN = "known cells read back as unknown"
    UNKNOWN_TO_KNOWN = "unknown cells read back with a probability"
    UNREADABLE = "the dialect's own reader refuses the file"


class MapLoss(NamedTuple):
    """One kind of loss, and the sentence about it for a person."""

    kind: LossKind
    text: str


def losses(
    grid: GridMap, path: str | PurePath, options: SaveOptions | None = None
) -> list[MapLoss]:
    """What the files that `map_files` makes of `grid` do not hold, read back by the rules of
    `options.dialect`; at most one loss of each kind.

    Raises:
        DataError: a suffix that says no format.
    """
    options = options or SaveOptions()
    written = as_written(grid, path, options)
    half = math.inf if options.digits is None else 0.5 * 10.0**-options.digits
    changed = beyond = to_unknown = to_known = 0
    largest, value = 0.0, 0.0
    for before, counts in grid.tally():
        after = written(before)
        known, stays = ~np.isnan(before), ~np.isnan(after)
        used = counts > 0
        changes = np.where(known & stays & used, np.abs(after - before), 0)
        changed += int(counts[changes > 0].sum())
        beyond += int(counts[changes > half + ROUNDING].sum())
        largest = max(largest, float(changes.max(initial=0)))
        to_unknown += int(counts[known & ~stays].sum())
        invented = ~known & stays & used
        to_known += int(counts[invented].sum())
        value = float(after[invented][0]) if invented.any() else value
    found = []
    if changed:
        cells = counted(changed, "cells whose probability changes")
        text = f"{cells}, by up to {largest:.2g}"
        if options.digits is not None:
            text += f"; {beyond:,} by more than half a digit ({half:g})"
        found.append(MapLoss(LossKind.PROBABILITY, text))
    if to_unknown:
        text = counted(to_unknown, "cells known before and unknown now")
        found.append(MapLoss(LossKind.KNOWN_TO_UNKNOWN, text))
    if to_known:
        text = counted(to_known, f"cells unknown before and {value:.2g} now")
        found.append(MapLoss(LossKind.UNKNOWN_TO_KNOWN, text))
    return found + _unreadable(path, options)


def _unreadable(path: str | PurePath, options: SaveOptions) -> list[MapLoss]:
    """What the dialect's own reader would refuse."""
    kind = format_of(path, options)
    image = kind in ("yaml", "pgm", "png") and not options.inline
    if image and options.image_kind(kind) == "pgm" and options.bits == 16 and (
        options.dialect == "ros1"
    ):  # fmt: skip
        text = "ROS 1's map_server cannot read a PGM of 16 bits"
        return [MapLoss(LossKind.UNREADABLE, text)]
    return []
