"""`mapcli transform`: parts of maps, turned, mirrored, moved, resampled, merged."""

from __future__ import annotations

from typing import Any

import click

from mapcli.commands._map_operation_types import MERGE, SET, Crop
from mapcli.commands._map_operations import (
    OPERATIONS,
    Result,
    apply,
    hashing,
    parameters,
)
from mapcli.commands._map_output import digits_option, loss_notes, save_options, write_map
from mapcli.commands._options import (
    FILE,
    POINT,
    POSE,
    POSITIVE,
    Number,
    common_options,
    no_clobber_option,
)
from mapcli.commands._output import check_inputs, check_outputs
from mapcli.commands._say import say
from mapcli.formats.maps.dialects import DIALECTS
from mapcli.formats.maps.map_image import MODES
from mapcli.formats.maps.save import FORMATS
from mapcli.formats.output import output_set


class InOrder(click.Command):
    """A command that remembers in which order its options were given, repetitions included."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        _, _, order = self.make_parser(ctx).parse_args(args=list(args))
        rest = super().parse_args(ctx, args)
        given = {
            name: iter(value) for name, value in ctx.params.items() if isinstance(value, tuple)
        }
        ctx.obj = [
            (str(option.name), next(given[option.name]) if option.name in given else True)
            for option in order
            if option.name in OPERATIONS
        ]
        return rest


@click.command(cls=InOrder, short_help="Crop, turn, mirror, move, resample, align, merge maps.")
@click.argument("source", metavar="IN", type=FILE)
@click.argument("target", metavar="OUT", type=FILE)
@click.option(
    "--crop", type=Crop(), multiple=True, help="Keep what a box in metres touches, or is known."
)
@click.option(
    "--bake-yaw", is_flag=True, help="Turn the cells so that the origin has no yaw any more."
)
@click.option("--resample", type=POSITIVE, metavar="M", multiple=True, help="Cells of M metres.")
@click.option(
    "--rotate",
    type=Number(-360, 360),
    metavar="DEG",
    multiple=True,
    help="Turn the world, about 0, 0.",
)
@click.option(
    "--flip",
    type=click.Choice(("left-right", "up-down")),
    multiple=True,
    help="Mirror the world: x, or y, changes its sign.",
)
@click.option("--shift", type=POINT, multiple=True, help="Move the world by X, Y metres.")
@click.option(
    "--origin", type=POSE, multiple=True, help="Move the world so that this is the map's origin."
)
@click.option("--align", is_flag=True, help="Turn the world so that most walls follow its axes.")
@click.option("--set", type=SET, multiple=True, help="Make a cell, or all from one corner to the "
              "other, an obstacle (1), open (0), or any other probability.")  # fmt: skip
@click.option("--merge", type=MERGE, multiple=True, help="Add another map, see above.")
@click.option(
    "--trace",
    metavar="F F",
    type=FILE,
    nargs=2,
    help="Move a pose trace along (.json, .tum, .kitti, .g2o, .csv), into another file.",
)
@click.option(
    "--mode", type=click.Choice(MODES), help="What grey means in OUT's image.  [default: as in IN]"
)
@click.option(
    "--dialect",
    type=click.Choice(DIALECTS),
    default=DIALECTS[0],
    show_default=True,
    help="Whose rules say what the grey of an image means.",
)
@click.option("--to", "form", type=click.Choice(FORMATS), help="OUT's format if not its suffix's.")
@digits_option
@click.option("--json", "json_file", metavar="F", type=FILE, help="Write what was done as JSON.")
@no_clobber_option
@common_options
def command(
    source: str, target: str, trace: tuple[str, str] | None, mode: Any,
    dialect: Any, form: Any, digits: int | None, json_file: str | None, no_clobber: bool,
    quiet: bool, verbose: bool,
    **_operations: Any,
) -> None:  # fmt: skip
    """Crop, turn, mirror, move, resample, align, merge maps.

    Operations are carried out in the order in which they are given, and can be repeated.

    \b
    The world stays; a wall has the same coordinates before and after:
      --crop LEFT,BOTTOM,RIGHT,TOP   --crop known   --bake-yaw   --resample   --merge   --set
    The world moves, and a trace moves with it (--trace OLD NEW):
      --rotate   --flip   --shift   --origin   --align

    \b
    --merge other.yaml          as both maps' origins say
    --merge other.yaml@X,Y,DEG  after moving the other map's world by this motion
    --merge other.yaml@search   after finding the motion; reports it with a score
    Where both maps know a cell, the higher probability counts.

    Turns by other than quarter turns, and new cell sizes, take for a cell what the old map holds
    at its centre; larger cells take the highest probability in them, so that walls stay.

    \b
    Examples:
      mapcli transform map.yaml small.yaml --crop known
      mapcli transform map.yaml straight.yaml --align --crop known --trace trace.json straight.json
      mapcli transform floor1.yaml all.yaml --merge floor2.yaml@search --merge floor3.yaml@search
      mapcli transform map.yaml - --bake-yaw | mapcli info -
      mapcli transform room.txt changed.txt --set 3,4=1 --set 6,1:7,3=0 --set 0,0=?
    """
    from mapcli import load_map
    from mapcli.formats.documents.load_trace import move_trace, trace_suffix

    operations = click.get_current_context().obj
    if not operations:
        raise click.UsageError("No operation given.")
    merged = [value[0] for name, value in operations if name == "merge"]
    _check(source, target, trace, json_file, merged, no_clobber)
    digests: dict[str, str] = {}
    loaded = load_map(source, dialect=dialect, read=hashing(digests))
    mode = mode or ("trinary" if loaded.rule is None else loaded.rule.mode)
    options = save_options(
        target, {"mode": mode, "dialect": dialect, "form": form, "digits": digits}
    )
    result = apply(loaded, digests, operations, dialect)
    moved = move_trace(trace[0], result.motion, trace_suffix(trace[1])) if trace else None
    with output_set(no_clobber=no_clobber) as outputs:
        names = write_map(result.grid, target, options, result.files, outputs)
        if trace and moved:
            outputs.write(trace[1], moved)
            names.append(trace[1])
        if json_file:
            outputs.write(json_file, _json(result, parameters(operations, dialect)))
    if not quiet:
        for warning in result.warnings:
            say(f"Warning: {warning}")
        for note in loss_notes(result.grid, target, options):
            say(f"Note: {target}: {note}")
        for label, text in [*result.lines(), ("written", ", ".join(names))]:
            say(f"{label:>10}  {text}", err="-" in (target, json_file, *(trace or ())[1:]))


def _json(result: Result, parameters: dict[str, Any]) -> bytes:
    from mapcli.formats.documents.json_document import document, json_bytes

    content = document("mapcli.map-transform", result.digests, parameters, result.content())
    return json_bytes(content)


def _check(
    source: str, target: str, trace: tuple[str, str] | None, json_file: str | None,
    merged: list[str], no_clobber: bool,
) -> None:  # fmt: skip
    """Say early what cannot be written, or read.

    Raises:
        click.UsageError, OutputError: as of `check_output`.
    """
    results = [target, *(trace or ())[1:], *([json_file] if json_file else [])]
    if len(set(results)) < len(results):
        raise click.UsageError("Two results cannot both be written to one file.")
    # IN may be OUT; its image is looked after when the map is written.
    inputs = [*merged, *(trace or ())[:1]]
    check_inputs([source, *inputs])
    check_outputs(results, inputs, "inputs", no_clobber=no_clobber)
    check_outputs(results[1:], [source], "inputs", no_clobber=no_clobber)
