"""`mapcli render`: a map, of cells or of polygons, as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from mapcli.commands._map_options import dialect_option
from mapcli.commands._options import CELL, FILE, NumberList, common_options, no_clobber_option
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say, warn
from mapcli.errors import DataError
from mapcli.formats.file_kind import Role, kind_at
from mapcli.formats.output import write_bytes
from mapcli.model.world import World

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from mapcli.formats.documents.world import LoadedWorld
    from mapcli.model.grid import GridMap
    from mapcli.model.trajectory import Trajectory


@click.command(short_help="Draw a map as a picture.")
@click.argument("source", metavar="MAP", type=FILE)
@click.option(
    "--png", metavar="F", type=FILE, required=True, help="The picture; - is standard output."
)
@click.option(
    "--trace",
    metavar="F",
    type=FILE,
    help="A pose trace to draw as the path: trace.json, .tum, .kitti, .g2o, .csv.",
)
@click.option("--labels", is_flag=True, help="Print probabilities and `?` into the cells.")
@click.option("--frontier", is_flag=True, help="Mark the frontier in red.")
@click.option("--robot", "robots", type=CELL, multiple=True, help="A robot's cell. Repeatable.")
@click.option("--scale", type=click.IntRange(1), metavar="N", help="Pixels per cell.")
@click.option("--box", type=NumberList("X0,Y0,X1,Y1"), help="Of polygons and points: the part to "
              "draw, two opposite corners.  [default: everything]")  # fmt: skip
@click.option("--title", default="", help="A line above a floor plan.")
@dialect_option
@no_clobber_option
@common_options
def command(
    source: str, png: str, trace: str | None, labels: bool, frontier: bool,
    robots: tuple[tuple[int, int], ...], scale: int | None,
    box: tuple[float, ...] | None, title: str, dialect: Any, no_clobber: bool, quiet: bool,
    verbose: bool,
) -> None:  # fmt: skip
    """Draw a map as a picture.

    Up to 64 rows and columns, and always with --labels, it gets the look of the book; larger maps
    become a floor plan with path, scale bar and metres. The path is coloured by time. Polygons
    and points (a continuous map, Sect. 9.1) are drawn with their coordinates.

    \b
    Examples:
      mapcli render map.yaml --png map.png --trace trace.json
      mapcli render fig9_4.txt --png fig9_4.png --labels --frontier --robot 5,9
      mapcli render fixtures/fig9_1.yaml --png fig9_1b.png --box 0,0,8,8
    """
    from mapcli import load_map, render

    inputs = [source, *filter(None, [trace])]
    check_outputs([png], inputs, "inputs", no_clobber=no_clobber)
    world = _continuous(source)
    if world is not None:
        _refuse_cell_options(trace, robots, scale, title, labels=labels, frontier=frontier)
        _write(png, _polygons(world, box), no_clobber=no_clobber, verbose=verbose)
        return
    if box is not None:
        raise click.UsageError("--box is for polygons; `mapcli transform --crop` cuts grid maps.")
    loaded = load_map(source, dialect=dialect)
    warn(source, loaded.warnings, quiet=quiet)
    trajectory = _trajectory(trace, quiet=quiet) if trace else None
    cells = _frontier(loaded.grid) if frontier else None
    try:
        data = render(
            loaded.grid, trajectory=trajectory, robots=robots, frontier=cells, labels=labels,
            scale=scale, title=title,
        )  # fmt: skip
    except DataError as error:
        error.file = error.file or source
        raise
    _write(png, data, no_clobber=no_clobber, verbose=verbose)


def _write(png: str, data: bytes, *, no_clobber: bool, verbose: bool) -> None:
    write_bytes(png, data, no_clobber=no_clobber)
    if verbose:
        say(f"{png}: {len(data):,} bytes")


def _continuous(source: str) -> LoadedWorld | None:
    """The polygons and points in a file; None when it holds cells, or what is no map."""
    kind = kind_at(source)
    if kind is None or kind.role is not Role.WORLD:
        return None
    from mapcli.formats.documents.world import load_world

    return load_world(source)


def _refuse_cell_options(
    trace: str | None, robots: tuple[tuple[int, int], ...], scale: int | None, title: str,
    *, labels: bool, frontier: bool,
) -> None:  # fmt: skip
    """Say which options have no meaning for polygons.

    Raises:
        click.UsageError: one of them is given.
    """
    given = {
        "--trace": trace, "--robot": robots, "--scale": scale, "--title": title,
        "--labels": labels, "--frontier": frontier,
    }  # fmt: skip
    for option, value in given.items():
        if value:
            raise click.UsageError(f"{option} is for maps of cells, and MAP holds polygons.")


def _polygons(loaded: LoadedWorld, box: tuple[float, ...] | None) -> bytes:
    from mapcli.pictures.continuous_map import continuous_picture

    assert isinstance(loaded.world, World)
    part = None
    if box is not None:
        x0, y0, x1, y1 = box
        y0, y1 = (-y0, -y1) if loaded.y_down else (y0, y1)
        part = min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)
        if part[0] == part[2] or part[1] == part[3]:
            raise click.UsageError("--box has no area.")
    return continuous_picture(loaded.world, box=part, y_down=loaded.y_down)


def _trajectory(file: str, *, quiet: bool) -> Trajectory:
    from mapcli.formats.documents.load_trace import load_trace

    loaded = load_trace(file)
    warn(file, loaded.warnings, quiet=quiet)
    return loaded.trajectory()


def _frontier(grid: GridMap) -> NDArray[np.bool_]:
    from mapcli import frontier_cells

    return frontier_cells(grid)
