"""`mapcli vectorize`: the obstacles of a grid map become polygons."""

from __future__ import annotations

from typing import Any

import click

from mapcli.commands._map_options import dialect_option
from mapcli.commands._options import FILE, POSITIVE, Number, common_options, no_clobber_option
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say, warn
from mapcli.formats.output import write_bytes
from mapcli.model.grid import OCCUPIED_THRESHOLD


@click.command(short_help="Turn the obstacles of a grid map into polygons (Sect. 9.1).")
@click.argument("source", metavar="MAP", type=FILE)
@click.argument("target", metavar="OUT", type=FILE)
@click.option(
    "--tolerance",
    type=POSITIVE,
    help="How far an outline may move to need fewer corners, metres.  [default: half a cell]",
)
@click.option(
    "--threshold",
    type=Number(0, 1, min_open=True),
    default=OCCUPIED_THRESHOLD,
    show_default=True,
    metavar="P",
    help="Cells from this probability on are obstacles.",
)
@click.option("--y-down", is_flag=True, help="Write y growing downwards, with `y: down`.")
@dialect_option
@no_clobber_option
@common_options
def command(
    source: str, target: str, tolerance: float | None, threshold: float, y_down: bool,
    dialect: Any, no_clobber: bool, quiet: bool, verbose: bool,
) -> None:  # fmt: skip
    """Turn the outlines of a map's obstacles into polygons, and compare what they take to store.

    OUT is YAML with `polygons:`, each solid, its corners as [x, y] in the map's frame, metres; - is
    standard output. An obstacle around an opening, such as the walls of a room, becomes several
    polygons that touch. A larger --tolerance makes slanting walls smooth; more than half a
    cell can also shave off walls that are a cell thick.

    \b
    Examples:
      mapcli vectorize map.yaml walls.yaml --tolerance 0.05
      mapcli vectorize fig9_1.txt - --y-down
    """
    from mapcli import load_map, vectorize
    from mapcli.algorithms.maps.vectorize import default_tolerance
    from mapcli.formats.documents.world import write_world
    from mapcli.model.memory import Memory

    check_outputs([target], [source], "maps", no_clobber=no_clobber)
    loaded = load_map(source, dialect=dialect)
    grid = loaded.grid
    tolerance = default_tolerance(grid) if tolerance is None else tolerance
    world = vectorize(grid, tolerance, threshold)
    write_bytes(target, write_world(world, y_down=y_down), no_clobber=no_clobber)
    if quiet:
        return
    warn(source, loaded.warnings)
    memory = Memory.of(world, grid, threshold)
    if not memory.occupied:
        say(f"Warning: {source}: no cell is an obstacle from {threshold:g} on")
    rows = memory.rows()
    rows.append(("tolerance", f"{tolerance:g} m"))
    for label, text in rows:
        say(f"{label:>12}  {text}", err=target == "-")
