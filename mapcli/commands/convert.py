"""`mapcli convert`: a map from any format to any other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from mapcli.commands._map_options import dialect_option
from mapcli.commands._options import FILE, POSE, Number, common_options, no_clobber_option
from mapcli.commands._output import write_bytes, write_files
from mapcli.errors import DataError, OutputError
from mapcli.formats.grey import MODES
from mapcli.formats.map_output import FORMATS, SUFFIXES, SaveOptions, dump_map
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

SHARE = Number(0, 1)
DEFAULTS = SaveOptions()


@click.command(short_help="Convert a map from any format to any other.")
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
    help="Trinary and `--characters`: cells up to this are open.  [default: 0.25; 0 for scale]",
)
@click.option(
    "--occupied-thresh",
    type=SHARE,
    help="Cells from this on are obstacles.  [default: 0.65; 1 for scale]",
)
@click.option("--negate", is_flag=True, help="Dark is open in OUT's image, light is obstacle.")
@click.option("--resolution", type=float, help="Metres per cell, in the place of IN's.")
@click.option("--origin", type=POSE, help="Corner bottom left, in the place of IN's.")
@click.option(
    "--threshold", type=SHARE, metavar="P", help="Make known cells 1 from P on and 0 below."
)
@dialect_option
@click.option("--to", "form", type=click.Choice(FORMATS), help="OUT's format if not its suffix's.")
@click.option("--characters", is_flag=True, help="Text as `#`, `.` and `?`.")
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
def command(
    source: str, target: str, resolution: float | None, origin: Pose2D | None,
    threshold: float | None, dialect: Any, no_clobber: bool, quiet: bool, verbose: bool,
    **given: Any,
) -> None:  # fmt: skip
    """Convert a map from any format to any other.

    The suffixes say the formats: .txt (numbers and `?`), .yaml (an image beside it, as for
    map_server), .pgm, .png. `-` is standard input, whatever its format, or standard output
    (text unless --to says otherwise). What OUT cannot hold is told on stderr.

    \b
    Examples:
      mapcli convert map.yaml map.txt
      mapcli convert map.txt map.yaml --mode scale       # map.png + map.yaml, keeps percents
      mapcli convert map.yaml - --threshold 0.7 | head
      mapcli convert scan.pgm map.yaml --resolution 0.05 --origin -10,-10,0
    """
    from mapcli.algorithms.threshold import binary_map
    from mapcli.formats.map_losses import losses
    from mapcli.formats.maps import load_map

    options = _save_options(target, given)
    if resolution is not None and not resolution > 0:
        raise click.UsageError("--resolution must be more than 0.")
    loaded = load_map(source, dialect=dialect, resolution=resolution, origin=origin)
    grid = loaded.grid if threshold is None else binary_map(loaded.grid, threshold)
    files = dump_map(grid, target, options)
    _spare_inputs(loaded.files, files, Path(target))
    lost = losses(grid, files, Path(target).name, options.format)
    if target == "-":
        write_bytes("-", files["-"])
    else:
        write_files(Path(target).parent, files, no_clobber=no_clobber)
    if not quiet:
        notes = [f"Note: {target}: {note}" for note in lost + _hints(grid, files, lost)]
        for line in [f"Warning: {source}: {text}" for text in loaded.warnings] + notes:
            click.echo(line, err=True)
    if verbose:
        click.echo(f"{', '.join(files)}: {grid.rows} rows, {grid.columns} columns", err=True)


def _save_options(target: str, given: dict[str, Any]) -> SaveOptions:
    given["format"] = given.pop("form") or ("txt" if target == "-" else None)
    given["bits"] = int(given["bits"])
    form = given["format"] or SUFFIXES.get(Path(target).suffix.lower())
    if form is None:
        raise click.UsageError(
            f"{target!r} says no format; end it in {', '.join(SUFFIXES)} or add --to."
        )
    for flag, only in (("characters", "txt"), ("inline", "yaml")):
        if given[flag] and form != only:
            raise click.UsageError(f"--{flag} is for {only}, and OUT is {form}.")
    if given["negate"] and given["mode"] == "raw":
        raise click.UsageError(
            "--negate has no meaning with --mode raw: Nav2 ignores it there and ROS 1 does not."
        )
    try:
        return SaveOptions(**given)
    except DataError as error:
        raise click.UsageError(f"{error}.") from error


def _spare_inputs(inputs: tuple[Path, ...], files: dict[str, bytes], target: Path) -> None:
    """Refuse to change a file of IN that the user did not name as OUT, such as its image."""
    if target.resolve() == inputs[0].resolve():
        return
    known = {path.resolve(): path for path in inputs if str(path) != "-"}
    for name, data in files.items():
        mine = known.get((target.parent / name).resolve())
        if mine is not None and mine.read_bytes() != data:
            raise OutputError("is part of IN and would change", file=mine, expected="another OUT")


def _hints(grid: GridMap, files: dict[str, bytes], lost: list[str]) -> list[str]:
    """How to keep what is lost, and what only mapcli will find."""
    hints = []
    images = [name for name in files if Path(name).suffix.lower() in (".pgm", ".png")]
    if images and any("probability" in loss for loss in lost):
        hints.append("--mode scale keeps whole percents, and .txt keeps everything")
    if images == list(files) and (grid.resolution != 1 or grid.origin != Pose2D()):
        hints.append(
            "resolution and origin are in a comment inside the image that mapcli reads; "
            "map_server needs a .yaml"
        )
    return hints
