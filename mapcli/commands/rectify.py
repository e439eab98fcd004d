"""`mapcli rectify`: walls become straight and perpendicular."""

from __future__ import annotations

import math
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

import click

from mapcli.commands._map_options import dialect_option
from mapcli.commands._map_output import usual_options
from mapcli.commands._options import FILE, POSITIVE, common_options, no_clobber_option
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say, warn
from mapcli.errors import DataError
from mapcli.formats.file_kind import Role, kind_at
from mapcli.formats.maps.save import SUFFIXES, dump_map
from mapcli.formats.output import output_set
from mapcli.model.counting import counted

if TYPE_CHECKING:
    from mapcli.formats.documents.load_trace import LoadedTrace
    from mapcli.model.rectified import RectifiedTrace

TRACES = (".json", ".tum", ".kitti", ".g2o", ".csv")

MOST_LISTED = 16
"""Walls that the report lists without -v."""


@click.command(short_help="Make walls straight and perpendicular (Sect. 9.4).")
@click.argument("source", metavar="TRACE|MAP", type=FILE)
@click.argument("target", metavar="OUT", type=FILE)
@click.option(
    "--tolerance",
    type=POSITIVE,
    help="How far a wall may stray from a straight stretch, metres.  [default: 1 % of a trace's "
    "extent, two cells of a map]",
)
@click.option(
    "--shortest-wall",
    type=POSITIVE,
    help="Metres; what is shorter in a trace belongs to a corner.  [default: 5 % of its extent]",
)
@click.option(
    "--loop/--no-loop",
    default=None,
    help="Whether a trace ends where it began, so that the gap is closed by adjusting lengths.  "
    "[default: when right angles alone bring the ends closer than a tenth of the way]",
)
@click.option("--png", metavar="F", type=FILE, help="A picture, before and after.")
@dialect_option
@no_clobber_option
@common_options
def command(
    source: str, target: str, tolerance: float | None, shortest_wall: float | None,
    loop: bool | None, png: str | None, dialect: Any, no_clobber: bool, quiet: bool, verbose: bool,
) -> None:  # fmt: skip
    """Use what is known about walls: they are straight, and meet at right angles (Sect. 9.4).

    A TRACE of a robot that followed walls: sharp turns become 90 degrees, walls straight, and
    when it came round, the gap at the end is spread over the lengths. TRACE and OUT are .json,
    .tum, .kitti, .g2o or .csv; each pose's `odom` in .json is the pose as it was, and `summary`
    has walls, corners and gaps.

    A MAP: the outlines of its open space become straight and perpendicular, and the walls follow;
    what is round or slants by more than 20 degrees stays. OUT is a map.

    \b
    Examples:
      mapcli rectify trace.json rectified.json --png before-after.png
      mapcli rectify map.yaml rectified.yaml --tolerance 0.15
    """
    is_trace = _is_trace(source, target)
    outputs = [target, *([png] if png else [])]
    check_outputs(outputs, [source], "maps", no_clobber=no_clobber)
    try:
        if is_trace:
            lines = _trace(source, target, png, tolerance, shortest_wall, loop, no_clobber, verbose)
        else:
            lines = _map(source, target, png, tolerance, dialect, no_clobber, quiet)
    except DataError as error:
        error.file = error.file or source
        raise
    if not quiet:
        for label, text in lines:
            say(f"{label:>12}  {text}", err="-" in outputs)


def _is_trace(source: str, target: str) -> bool:
    """Whether the input is a trace and not a map.

    Raises:
        click.UsageError: the output's name is of the other kind.
    """
    suffix = PurePath(target).suffix.lower()
    kind = kind_at(source)
    role = kind.role if kind else None
    is_trace = role is Role.TRACE or (role is not Role.MAP and suffix in TRACES)
    suffixes = TRACES if is_trace else tuple(SUFFIXES)
    if target != "-" and suffix not in suffixes:
        what = "a trace" if is_trace else "a map"
        raise click.UsageError(
            f"IN is {what}, and {target!r} does not end in {', '.join(suffixes)}."
        )
    return is_trace


def _trace(
    source: str, target: str, png: str | None, tolerance: float | None, shortest: float | None,
    loop: bool | None, no_clobber: bool, verbose: bool,
) -> list[tuple[str, str]]:  # fmt: skip
    from mapcli import rectify_trace
    from mapcli.algorithms.maps.rectify_trace import RectifyParameters
    from mapcli.formats.documents.load_trace import load_trace

    loaded = load_trace(source)
    before = loaded.trace.trajectory()
    result = rectify_trace(before.poses, RectifyParameters(tolerance, shortest, loop))
    parameters = {"tolerance": tolerance, "shortest_wall": shortest, "loop": loop}
    with output_set(no_clobber=no_clobber) as outputs:
        outputs.write(target, _dump_trace(loaded, target, result, parameters))
        if png:
            from mapcli.pictures.before_after import rectified_trace_picture

            outputs.write(png, rectified_trace_picture(before.poses[:, :2], result))
    return _trace_lines(result, verbose=verbose)


def _dump_trace(
    loaded: LoadedTrace, target: str, result: RectifiedTrace, parameters: dict[str, Any]
) -> bytes:
    from mapcli.algorithms.maps.rectify_trace import rectified_trace
    from mapcli.formats.documents.json_document import json_bytes
    from mapcli.formats.documents.pose_trace import trace_document
    from mapcli.formats.documents.trajectory_text import dump_trajectory

    trace = rectified_trace(loaded.trace.trajectory(), result)
    if PurePath(target).suffix.lower() not in (".json", ""):
        return dump_trajectory(trace, target)
    inputs = {} if loaded.file == "-" else {Path(loaded.file).name: loaded.sha256}
    return json_bytes(trace_document(trace, inputs, parameters, result.document()))


def _trace_lines(result: RectifiedTrace, *, verbose: bool) -> list[tuple[str, str]]:
    walls = result.walls
    off = result.corner_errors
    corners = f", up to {math.degrees(max(off)):.1f} degrees off" if off else ""
    rows = [("walls", f"{len(walls)}, with {counted(len(off), 'corners')}{corners}")]
    for wall in walls if verbose or len(walls) <= MOST_LISTED else ():
        rows.append(("", f"{wall.measured:7.2f} m -> {wall.length:.2f} m, towards "
                         f"{90 * (wall.quarter % 4):3} degrees, bent by "
                         f"{math.degrees(wall.drift):+.1f}"))  # fmt: skip
    rows.append(("gap", f"{result.gap_before:.2f} m from the end to the start before"))
    rows.append(("", f"{result.gap_square:.2f} m with straight walls and right angles"))
    if result.is_loop:
        rows.append(("", f"{result.gap_after:.2f} m with the lengths adjusted"))
    else:
        rows.append(("", "not closed: it is not taken for a loop (--loop closes it)"))
    return rows


def _map(
    source: str, target: str, png: str | None, tolerance: float | None, dialect: Any,
    no_clobber: bool, quiet: bool,
) -> list[tuple[str, str]]:  # fmt: skip
    from mapcli import load_map, rectify_map

    loaded = load_map(source, dialect=dialect)
    warn(source, loaded.warnings, quiet=quiet)
    grid = loaded.grid
    result = rectify_map(grid, tolerance)
    files = dump_map(result.grid, target, usual_options(target))
    with output_set(no_clobber=no_clobber) as outputs:
        outputs.write_beside(target, files)
        if png:
            from mapcli.pictures.before_after import rectified_map_picture

            outputs.write(png, rectified_map_picture(grid, result.grid))
    degrees = math.degrees(result.direction)
    return [
        ("walls", f"{degrees:+.2f} degrees from the map's x axis, and across"),
        ("outlines", f"{result.rectified:,} of {result.outlines:,} of the open space made square"),
        ("changed", f"{counted(result.changed, 'cells')} of {grid.cells.size:,}"),
    ]
