"""What `mapcli similarity-table` reads: a perception, and the map or database it is scored on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from mapcli import load_map
from mapcli.algorithms.similarity.comparisons import Comparison, comparison_of
from mapcli.errors import DataError, FormatError
from mapcli.formats.documents.perception_reader import read_perception
from mapcli.formats.file_kind import Role, expecting
from mapcli.formats.input import DigestingReader
from mapcli.formats.maps.load import sniff
from mapcli.formats.maps.save import SUFFIXES
from mapcli.model.grid import GridMap
from mapcli.model.perception import (
    LandmarkPerception,
    MeasuredTrials,
    Perceived,
    PerceptionDatabase,
)
from mapcli.model.world import World

POINTS_MAP = "a points map for landmarks, YAML with points: [[x, y], ...]"


@dataclass(frozen=True, eq=False)
class Loaded:
    """A comparison, and what its reader should know.

    Attributes:
        perception: the file's name, for errors; digests: file name -> SHA-256;
        warnings: sentences about the map, with its name.
        trials: all sets of readings, where there are several; `comparison` has the first.
    """

    comparison: Comparison
    perception: str
    digests: dict[str, str]
    warnings: tuple[str, ...] = ()
    trials: MeasuredTrials | None = None


def load_comparison(
    files: tuple[str, ...], database: str | None, dialect: Any, low: float
) -> Loaded:
    """Read the perception, and the map or the database.

    Raises:
        click.UsageError: not the files that are needed.
        FormatError: a file that does not hold what it should.
    """
    wanted = 1 if database else 2
    if len(files) != wanted:
        expected = "PERCEPTION alone, with --database" if database else "MAP and PERCEPTION"
        raise click.UsageError(f"Expected {expected}; got {len(files)} of them.")
    read = DigestingReader()
    name = files[-1]
    with expecting(name, "a perception", Role.PERCEPTION):
        perception = read_perception(read(Path(name)), name, low, needs_pose=database is None)
    if isinstance(perception, PerceptionDatabase):
        raise FormatError("is a database", file=name, expected="a scan, landmarks or grids; "
                          "databases go to --database")  # fmt: skip
    if database:
        with expecting(database, "a database of perceptions", Role.PERCEPTION):
            found = read_perception(read(Path(database)), database)
        if not isinstance(found, PerceptionDatabase):
            raise FormatError("is one perception", file=database, expected="kind: database")
        if isinstance(perception, MeasuredTrials):
            first = _compare(found, perception.trials[0].measured, name)
            return Loaded(first, name, read.digests, trials=perception)
        return Loaded(_compare(found, perception, name), name, read.digests)
    if isinstance(perception, MeasuredTrials):
        raise FormatError("is a set of trials", file=name, expected="--database to compare with")
    if isinstance(perception, LandmarkPerception):
        with expecting(files[0], POINTS_MAP, Role.WORLD):
            world = _points(read(Path(files[0])), files[0])
        return Loaded(_compare(world, perception, name), name, read.digests)
    loaded = load_map(files[0], dialect=dialect, read=read)
    warnings = tuple(f"{files[0]}: {warning}" for warning in loaded.warnings)
    return Loaded(_compare(loaded.grid, perception, name), name, read.digests, warnings)


def _compare(
    known: GridMap | World | PerceptionDatabase, perception: Perceived, name: str
) -> Comparison:
    """`comparison_of`, with errors that name the perception's file."""
    try:
        return comparison_of(known, perception)
    except DataError as error:
        error.file = name
        raise


def _points(data: bytes, file: str) -> World:
    """The points map that landmarks are compared with.

    Raises:
        FormatError: the file holds something else.
    """
    from mapcli.formats.documents.world import read_world

    if (SUFFIXES.get(Path(file).suffix.lower()) or sniff(data)) != "yaml":
        raise FormatError("is no YAML", file=file, expected=POINTS_MAP)
    if b"points" not in data:
        raise FormatError("holds no points", file=file, expected=POINTS_MAP)
    world = read_world(data, file)
    if not len(world.points):
        raise FormatError("holds no points", file=file, expected=POINTS_MAP)
    return world
