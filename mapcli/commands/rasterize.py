"""`mapcli rasterize`: a continuous map becomes a grid map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mapcli.commands._map_output import usual_options
from mapcli.commands._options import (
    FILE,
    POSITIVE,
    Number,
    NumberList,
    common_options,
    no_clobber_option,
)
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say
from mapcli.errors import DataError
from mapcli.formats.input import sha256_of
from mapcli.formats.maps.save import SUFFIXES, dump_map
from mapcli.formats.output import output_set
from mapcli.model.grid import GridMap
from mapcli.model.memory import Memory

if TYPE_CHECKING:
    from mapcli.formats.documents.world import LoadedWorld
    from mapcli.model.world import World

MOST_LISTED = 32
"""Covered cells that the report lists."""


@click.command(short_help="Turn polygons into a grid map (Sect. 9.1).")
@click.argument("source", metavar="POLYGONS", type=FILE)
@click.argument("target", metavar="OUT", type=FILE)
@click.option(
    "--min-cover",
    type=Number(0, 1, min_open=True),
    default=0.5,
    show_default=True,
    help="A cell is an obstacle when at least this share of its area is covered.",
)
@click.option("--shares", is_flag=True, help="Write the share covered of each cell instead.")
@click.option(
    "--resolution", type=POSITIVE, default=1.0, show_default=True, help="Metres per cell."
)
@click.option(
    "--box",
    type=NumberList("X0,Y0,X1,Y1"),
    help="The part to be mapped, two opposite corners.  [default: around everything]",
)
@click.option("--y-down", is_flag=True, help="y grows downwards in POLYGONS, as in pictures.")
@click.option("--json", "json_file", metavar="F", type=FILE, help="The report as JSON.")
@no_clobber_option
@common_options
def command(
    source: str, target: str, min_cover: float, shares: bool, resolution: float,
    box: tuple[float, ...] | None, y_down: bool, json_file: str | None, no_clobber: bool,
    quiet: bool, verbose: bool,
) -> None:  # fmt: skip
    """Turn a continuous map into a grid map, and compare what they take to store (Sect. 9.1).

    POLYGONS is YAML with `polygons:`, solid objects as lists of [x, y] in metres; y grows upwards
    unless the file has `y: down` or --y-down is given, and then so do the cells that the report
    lists as (x, y) and the corners of --box: the map's upper left cell is the smallest x and y.
    OUT is a map in any format of `mapcli convert`, or - for text. Points have no area.

    \b
    Examples:
      mapcli rasterize fixtures/fig9_1.yaml fig9_1.txt --box 0,0,8,8 --min-cover 0.3
      mapcli rasterize fixtures/apartment.yaml apartment.yaml --resolution 0.05
    """
    from mapcli.algorithms.maps.rasterize import covered_cells_listed, frame_of

    if target != "-" and Path(target).suffix.lower() not in SUFFIXES:
        raise click.UsageError(f"{target!r} says no format; end it in {', '.join(SUFFIXES)}.")
    outputs = [target, *([json_file] if json_file else [])]
    check_outputs(outputs, [source], "maps", no_clobber=no_clobber)
    loaded, world = _load(source, y_down=y_down)
    try:
        frame = frame_of(world, resolution, box, y_down=loaded.y_down)
        grid, written = _rasterized(world, frame, min_cover, shares=shares)
    except DataError as error:
        error.file = error.file or source
        raise
    files = dump_map(written, target, usual_options(target))
    memory, cells = Memory.of(world, grid), list[tuple[int, int]]()
    # A list of millions takes longer than the map itself.
    if json_file is not None or verbose or memory.occupied <= MOST_LISTED:
        cells = covered_cells_listed(grid, y_down=loaded.y_down)
    with output_set(no_clobber=no_clobber) as results:
        results.write_beside(target, files)
        if json_file is not None:
            parameters = {"min_cover": min_cover, "resolution": resolution,
                          "y_down": loaded.y_down, "box": box}  # fmt: skip
            data = _json(source, loaded.data, parameters, memory, cells)
            results.write(json_file, data)
    if not quiet:
        _report(memory.rows(), cells, world, files, to_stderr="-" in outputs, verbose=verbose)


def _json(
    source: str,
    data: bytes,
    parameters: dict[str, Any],
    memory: Memory,
    cells: list[tuple[int, int]],
) -> bytes:
    from mapcli.formats.documents.json_document import document, json_bytes

    digest = {Path(source).name: sha256_of(data)}
    listed = [{"x": x, "y": y} for x, y in cells]
    content = {"memory": memory.document(), "cells": listed}
    return json_bytes(document("mapcli.rasterize", digest, parameters, content))


def _load(source: str, *, y_down: bool) -> tuple[LoadedWorld, World]:
    from mapcli import load_world

    loaded = load_world(source, y_down=y_down)
    if isinstance(loaded.world, GridMap):
        raise DataError("is a grid map", file=source, expected="`polygons:` in YAML")
    return loaded, loaded.world


def _rasterized(
    world: World, frame: GridMap, min_cover: float, *, shares: bool
) -> tuple[GridMap, GridMap]:
    """The map of covered cells, and the one to be written: that or the shares."""
    import numpy as np

    from mapcli.algorithms.maps.polygons import solid_area
    from mapcli.algorithms.maps.rasterize import covered_map, covered_shares

    covered = covered_shares(solid_area(world), frame)
    grid = covered_map(covered, frame, min_cover)
    return grid, frame.replaced(covered.astype(np.float32)) if shares else grid


def _report(
    comparison: list[tuple[str, str]], cells: list[tuple[int, int]], world: World,
    files: dict[str, bytes], *, to_stderr: bool, verbose: bool,
) -> None:  # fmt: skip
    rows = list(comparison)
    if cells and (verbose or len(cells) <= MOST_LISTED):
        rows.append(("cells x, y", " ".join(f"({x},{y})" for x, y in cells)))
    if len(world.points):
        rows.append(("points", f"{len(world.points):,} left out: they cover no area"))
    if not world.polygons:
        rows.append(("warning", "there are no polygons, so that every cell is open"))
    rows.append(("written", ", ".join("standard output" if f == "-" else f for f in files)))
    for label, text in rows:
        say(f"{label:>12}  {text}", err=to_stderr)
