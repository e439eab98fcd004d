"""`mapcli convert`: a map, or a pose trace, from any format to any other."""

from __future__ import annotations

from typing import Any

import click

from mapcli.commands._map_output import DEFAULTS, digits_option, loss_notes, save_options, write_map
from mapcli.commands._options import FILE, POSE, POSITIVE, Number, common_options, no_clobber_option
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say, warn
from mapcli.formats.maps.dialects import DIALECTS
from mapcli.formats.maps.map_image import MODES
from mapcli.formats.maps.save import FORMATS, TRINARY_THRESHOLDS, WHOLE_SCALE
from mapcli.formats.output import output_set
from mapcli.model.pose import Pose2D

SHARE = Number(0, 1)


@click.command(short_help="Convert a map or a trace from any format to any other.")
@click.argument("source", metavar="IN", type=FILE)
@click.argument("target", metavar="OUT", type=FILE)
@click.option(
    "--mode",
    type=click.Choice(MODES),
    default=DEFAULTS.mode,
    show_default=True,
    help="What grey means in an image: open, obstacle, unknown; percents; percents as bytes.",
)
@click.option(
    "--free-thresh",
    type=SHARE,
    help="Trinary and `--characters`: cells up to this are open.  "
    f"[default: {TRINARY_THRESHOLDS[0]:g}; {WHOLE_SCALE[0]:g} for scale]",
)
@click.option(
    "--occupied-thresh",
    type=SHARE,
    help="Cells from this on are obstacles.  "
    f"[default: {TRINARY_THRESHOLDS[1]:g}; {WHOLE_SCALE[1]:g} for scale]",
)
@click.option("--negate", is_flag=True, help="Dark is open in OUT's image, light is obstacle.")
@click.option("--resolution", type=POSITIVE, help="Metres per cell, in the place of IN's.")
@click.option("--origin", type=POSE, help="Corner bottom left, in the place of IN's.")
@click.option(
    "--threshold", type=SHARE, metavar="P", help="Make known cells 1 from P on and 0 below."
)
@click.option(
    "--dialect",
    type=click.Choice(DIALECTS),
    default=DEFAULTS.dialect,
    show_default=True,
    help="Whose rules say what the grey of an image means, of OUT and of IN.",
)
@click.option(
    "--from-dialect",
    type=click.Choice(DIALECTS),
    help="Whose rules IN's image was made for, if not OUT's.",
)
@click.option(
    "--to",
    "form",
    type=click.Choice((*FORMATS, "json", "tum", "kitti", "g2o", "csv")),
    help="OUT's format if not its suffix's.",
)
@click.option("--topic", metavar="TOPIC", help="Where the poses of an MCAP IN are, if there are "
              "several.")  # fmt: skip
@click.option("--characters", is_flag=True, help="Text as `#`, `.` and `?`.")
@digits_option
@click.option("--inline", is_flag=True, help="YAML with the cells inside, without an image.")
@click.option("--plain", is_flag=True, help="PGM as numbers (P2).")
@click.option(
    "--bits",
    type=click.Choice(("8", "16")),
    default=str(DEFAULTS.bits),
    show_default=True,
    help="Of a PGM's pixels.",
)
@no_clobber_option
@common_options
@click.pass_context
def command(
    ctx: click.Context, /, source: str, target: str, resolution: float | None,
    origin: Pose2D | None, threshold: float | None, from_dialect: Any, topic: str | None,
    no_clobber: bool, quiet: bool, verbose: bool, **given: Any,
) -> None:  # fmt: skip
    """Convert a map or a pose trace from any format to any other.

    The suffixes say the formats: .txt (numbers and `?`), .yaml (an image beside it, as for
    map_server), .pgm, .png. `-` is standard input, whatever its format, or standard output
    (text unless --to says otherwise). What OUT cannot hold, or its --dialect would read
    otherwise, is told on stderr.

    A trace is .json, .tum, .kitti, .g2o or .csv, told by its content as IN, or the poses in an
    MCAP file; its OUT has one of these suffixes (or --to).

    \b
    The dialects: nav2 is Nav2 since 2026, nav2-2024 Nav2 before, ros1 the map_server of ROS 1.

    \b
    Examples:
      mapcli convert map.yaml map.txt
      mapcli convert map.txt map.yaml --mode scale       # map.png + map.yaml, keeps percents
      mapcli convert old.yaml new.yaml --from-dialect ros1 --mode scale
      mapcli convert map.yaml - --threshold 0.7 | head
      mapcli convert map.yaml map.txt --digits 1         # as the book prints maps
      mapcli convert scan.pgm map.yaml --resolution 0.05 --origin -10,-10,0
      mapcli convert trace.json trace.tum
    """
    from mapcli.commands._convert_trace import (
        convert_trace,
        refuse_map_options,
        suffix_of_trace,
    )

    suffix = suffix_of_trace(source, target, given["form"])
    if suffix is not None:
        refuse_map_options(ctx)
        convert_trace(
            source, target, suffix, topic, no_clobber=no_clobber, quiet=quiet, verbose=verbose
        )
        return
    if topic is not None:
        raise click.UsageError("--topic is for traces, and OUT is a map.")
    from mapcli.algorithms.maps.threshold import binary_map
    from mapcli.formats.maps.load import load_map

    dialect = from_dialect or given["dialect"]
    options = save_options(target, given)
    # IN may be OUT; its image is looked after when the map is written.
    check_outputs([target], (), "maps", no_clobber=no_clobber)
    loaded = load_map(source, dialect=dialect, resolution=resolution, origin=origin)
    grid = loaded.grid if threshold is None else binary_map(loaded.grid, threshold)
    with output_set(no_clobber=no_clobber) as outputs:
        names = write_map(grid, target, options, loaded.files, outputs)
    if not quiet:
        warn(source, loaded.warnings)
        for note in loss_notes(grid, target, options):
            say(f"Note: {target}: {note}")
    if verbose:
        say(f"{', '.join(names)}: {grid.rows} rows, {grid.columns} columns")
