"""`mapcli render`: a map as a picture."""

from __future__ import annotations

from typing import Any

import click

from mapcli.commands._map_options import dialect_option
from mapcli.commands._options import CELL, FILE, common_options, no_clobber_option
from mapcli.commands._output import write_bytes
from mapcli.errors import DataError
from mapcli.model.grid import GridMap

BOOK_SIDE = 64
"""Maps up to this many rows and columns get the book's look."""

LABELLED_SIDE = 250
"""Numbers in the cells of larger maps could not be read."""

LARGEST_PICTURE = 10_000
"""Pixels of a side, with --scale."""


@click.command(short_help="Draw a map as a picture.")
@click.argument("source", metavar="MAP", type=FILE)
@click.option(
    "--png", metavar="F", type=FILE, required=True, help="The picture; - is standard output."
)
@click.option(
    "--trace", metavar="F", type=FILE, help="A pose trace (trace.json) to draw as the path."
)
@click.option("--labels", is_flag=True, help="Print probabilities and `?` into the cells.")
@click.option("--frontier", is_flag=True, help="Mark the frontier in red.")
@click.option("--robot", "robots", type=CELL, multiple=True, help="A robot's cell. Repeatable.")
@click.option("--scale", type=click.IntRange(1), metavar="N", help="Pixels per cell.")
@click.option("--title", default="", help="A line above a floor plan.")
@dialect_option
@no_clobber_option
@common_options
def command(
    source: str, png: str, trace: str | None, labels: bool, frontier: bool,
    robots: tuple[tuple[int, int], ...], scale: int | None, title: str, dialect: Any,
    no_clobber: bool, quiet: bool, verbose: bool,
) -> None:  # fmt: skip
    """Draw a map as a picture.

    Up to 64 rows and columns, and always with --labels, it gets the look of the book; larger maps
    become a floor plan with path, scale bar and metres. The path is coloured by time.

    \b
    Examples:
      mapcli render map.yaml --png map.png --trace trace.json
      mapcli render fig9_4.txt --png fig9_4.png --labels --frontier --robot 5,9
    """
    from mapcli.formats.maps.load import load_map

    if source == trace == "-":
        raise click.UsageError("MAP and --trace cannot both be standard input.")
    loaded = load_map(source, dialect=dialect)
    for warning in () if quiet else loaded.warnings:
        click.echo(f"Warning: {source}: {warning}", err=True)
    grid = loaded.grid
    _check(source, grid, robots, scale, labels=labels)
    overlays = {"frontier": _frontier(grid) if frontier else None, "scale": scale}
    if labels or max(grid.rows, grid.columns) <= BOOK_SIDE:
        data = _book(grid, trace, robots, labels=labels, **overlays)
    else:
        data = _plan(grid, trace, robots, title=title, **overlays)
    write_bytes(png, data, no_clobber=no_clobber)
    if verbose:
        click.echo(f"{png}: {len(data):,} bytes", err=True)


def _check(
    source: str, grid: GridMap, robots: tuple[tuple[int, int], ...], scale: int | None, *,
    labels: bool,
) -> None:  # fmt: skip
    """Refuse what cannot be drawn.

    Raises:
        DataError: naming the map.
    """
    longer = max(grid.rows, grid.columns)
    shape = f"{grid.rows} rows, {grid.columns} columns"
    for row, column in robots:
        if not grid.contains(row, column):
            raise DataError(f"robot at {row},{column}", file=source, expected=f"a cell of {shape}")
    if labels and longer > LABELLED_SIDE:
        expected = f"at most {LABELLED_SIDE} a side with --labels"
        raise DataError(shape, file=source, expected=expected)
    if scale is not None and longer * scale > LARGEST_PICTURE:
        expected = f"at most {LARGEST_PICTURE:,} pixels a side"
        raise DataError(f"{shape} at --scale {scale}", file=source, expected=expected)


def _frontier(grid: GridMap) -> Any:
    from mapcli.algorithms.exploration.frontier_cells import frontier_cells

    return frontier_cells(grid)


def _book(
    grid: GridMap, trace: str | None, robots: tuple[tuple[int, int], ...], **options: Any
) -> bytes:
    from mapcli.formats.documents.trace import load_trace_poses
    from mapcli.pictures.map_picture import book_picture, cells_passed

    path = cells_passed(grid, load_trace_poses(trace).poses[:, :2]) if trace else ()
    return book_picture(grid, robots=robots, path=path, **options)


def _plan(
    grid: GridMap, trace: str | None, robots: tuple[tuple[int, int], ...], **options: Any
) -> bytes:
    from mapcli.formats.documents.trace import load_trace_poses
    from mapcli.pictures.map_picture import floor_plan

    if trace:
        poses = load_trace_poses(trace)
        path, headings = poses.poses[:, :2], poses.poses[:, 2]
        options |= {"path": path, "headings": headings, "stamps": poses.seconds()}
    markers = [(*grid.world_of_cells([row], [column])[0], "robot") for row, column in robots]
    return floor_plan(grid, markers=markers, **options)
