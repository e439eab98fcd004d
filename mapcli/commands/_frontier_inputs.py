"""What `mapcli frontier` reads: the world, what is known of it, and where the robots stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from mapcli import load_map
from mapcli.algorithms.exploration.explore import contradictions
from mapcli.commands._say import say, warn
from mapcli.errors import DataError
from mapcli.formats.input import read_file, sha256_of
from mapcli.formats.maps.dialects import Dialect
from mapcli.model.counting import counted
from mapcli.model.exploration import Cell
from mapcli.model.grid import GridMap


@dataclass(frozen=True)
class Mission:
    """Where to explore, and from where.

    Attributes:
        source, known_source: the maps' files as the user named them.
        world, known: the maps.
        robots: their cells.
        inputs: file name -> SHA-256, for the trace.
    """

    source: str
    known_source: str | None
    world: GridMap
    known: GridMap | None
    robots: tuple[Cell, ...]
    inputs: dict[str, str]


def load_mission(
    world: str,
    known: str | None,
    cells: Sequence[Cell],
    points: Sequence[tuple[float, float]],
    dialect: Dialect,
    *,
    quiet: bool,
) -> Mission:
    """Read the maps, and warn on stderr about what is odd in them.

    Raises:
        FormatError: a file that holds no map.
        click.UsageError: no robot.
    """
    if not cells and not points:
        raise click.UsageError("Where does the robot stand? Add --robot ROW,COL or --robot-xy X,Y.")
    digests: dict[str, str] = {}
    grid = _load(world, dialect, digests, quiet=quiet)
    told = _load(known, dialect, digests, quiet=quiet) if known is not None else None
    robots = (*cells, *(cell_at(grid, point, world) for point in points))
    return Mission(world, known, grid, told, robots, digests)


def cell_at(grid: GridMap, point: tuple[float, float], file: str) -> Cell:
    """The cell in which a place in metres lies.

    Raises:
        DataError: it is outside the map.
    """
    ((row, column),) = grid.cells_of_world([point]).tolist()
    if not grid.contains(row, column):
        width, height = grid.columns * grid.resolution, grid.rows * grid.resolution
        origin = grid.origin
        raise DataError(
            f"--robot-xy {point[0]:g},{point[1]:g} is outside the world",
            file=file,
            expected=f"a place on its {width:g} x {height:g} m, whose bottom left corner is at "
            f"{origin.x:g},{origin.y:g}",
        )
    return row, column


def _load(file: str, dialect: Dialect, digests: dict[str, str], *, quiet: bool) -> GridMap:
    def reading(path: Path) -> bytes:
        data = read_file(path)
        digest = sha256_of(data)
        is_other = digests.get(path.name, digest) != digest
        digests[f"{path.parent.name}/{path.name}" if is_other else path.name] = digest
        return data

    loaded = load_map(file, dialect=dialect, read=reading)
    warn(file, loaded.warnings, quiet=quiet)
    return loaded.grid


def warn_about_known(mission: Mission, low: float) -> None:
    """Say on stderr where what is known does not fit the world."""
    if mission.known is None or mission.known.stored.shape != mission.world.stored.shape:
        return
    known = mission.known_source
    wrong = contradictions(mission.world, mission.known, low)
    if wrong:
        say(
            f"Warning: {known}: {counted(wrong, 'cells')} at odds with {mission.source} (open "
            "against obstacle); where they are sensed, the latter wins",
        )
    place, told = (mission.world.resolution, mission.world.origin), mission.known
    if (told.resolution, told.origin) != place:
        say(
            f"Warning: {known}: has another resolution or origin than {mission.source}, whose "
            "cells it is taken to be",
        )
