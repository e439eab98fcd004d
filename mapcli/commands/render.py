"""`mapcli render`: a map as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from mapcli.commands._map_options import dialect_option
from mapcli.commands._options import CELL, FILE, common_options, no_clobber_option
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say, warn
from mapcli.errors import DataError
from mapcli.formats.output import write_bytes

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

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
    from mapcli import load_map, render

    inputs = [source, *filter(None, [trace])]
    check_outputs([png], inputs, "inputs", no_clobber=no_clobber)
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
    write_bytes(png, data, no_clobber=no_clobber)
    if verbose:
        say(f"{png}: {len(data):,} bytes")


def _trajectory(file: str, *, quiet: bool) -> Trajectory:
    from mapcli.formats.documents.load_trace import load_trace

    loaded = load_trace(file)
    warn(file, loaded.warnings, quiet=quiet)
    return loaded.trajectory()


def _frontier(grid: GridMap) -> NDArray[np.bool_]:
    from mapcli import frontier_cells

    return frontier_cells(grid)
