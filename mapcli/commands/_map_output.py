"""Writing a map: the options for it, what it loses, and the files of the input that must stay."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from mapcli.errors import DataError, OutputError
from mapcli.formats.maps.map_image import Mode
from mapcli.formats.maps.save import SUFFIXES, Format, Pieces, SaveOptions, map_files
from mapcli.formats.output import OutputSet
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

DEFAULTS = SaveOptions()

TERMINAL_DIGITS = 1
"""After the point, of a map that is printed on a terminal, as the book prints maps."""

digits_option = click.option("--digits", type=click.IntRange(1, 9), metavar="N", help="Round "
    "text to N digits after the point.  [default: exact; 1 on a terminal]")  # fmt: skip


def terminal_digits(target: str) -> int | None:
    """Digits of a map that goes to a terminal; None, exact, for files and pipes."""
    on_terminal = target == "-" and sys.stdout is not None and sys.stdout.isatty()
    return TERMINAL_DIGITS if on_terminal else None


def usual_options(target: str, mode: Mode = DEFAULTS.mode) -> SaveOptions:
    """How commands without options for it write a map: by its suffix, as text on standard
    output."""
    form: Format | None = "txt" if target == "-" else None
    return SaveOptions(mode, format=form, digits=terminal_digits(target))


def save_options(target: str, given: dict[str, Any]) -> SaveOptions:
    """How OUT is written, from what the user typed.

    Raises:
        click.UsageError: options that do not fit together.
    """
    given["format"] = given.pop("form") or ("txt" if target == "-" else None)
    given["bits"] = int(given.get("bits", DEFAULTS.bits))
    form = given["format"] or SUFFIXES.get(Path(target).suffix.lower())
    if form is None:
        raise click.UsageError(
            f"{target!r} says no format; end it in {', '.join(SUFFIXES)} or add --to."
        )
    for flag, only in (("characters", "txt"), ("digits", "txt"), ("inline", "yaml")):
        if given.get(flag) and form != only:
            raise click.UsageError(f"--{flag} is for {only}, and OUT is {form}.")
    if given.get("digits") is None:
        given["digits"] = terminal_digits(target)
    elif given.get("characters"):
        raise click.UsageError("--digits is for numbers, and --characters writes none.")
    if given.get("negate") and given["mode"] == "raw":
        raise click.UsageError(
            "--negate has no meaning with --mode raw: Nav2 ignores it there and ROS 1 does not."
        )
    try:
        return SaveOptions(**given)
    except DataError as error:
        raise click.UsageError(f"{error}.") from error


def write_map(
    grid: GridMap, target: str, options: SaveOptions, inputs: Sequence[Path], outputs: OutputSet
) -> list[str]:
    """Write a map, and give the names of its files.

    Args:
        inputs: what the map was made of, the file that the user named first.
        outputs: the files of the command.

    Raises:
        OutputError: a file cannot be written, or is part of the input.
    """
    files = map_files(grid, target, options)
    _spare_inputs(inputs, files, Path(target))
    return outputs.write_beside(target, files)


def _spare_inputs(inputs: Sequence[Path], files: dict[str, Pieces], target: Path) -> None:
    """Refuse to change a file of IN that the user did not name as OUT, such as its image."""
    if os.path.realpath(target) == os.path.realpath(inputs[0]):
        return
    known = {os.path.realpath(path): path for path in inputs if str(path) != "-"}
    for name, pieces in files.items():
        mine = known.get(os.path.realpath(target.parent / name))
        if mine is not None and _differs(mine, pieces):
            raise OutputError("is part of IN and would change", file=mine, expected="another OUT")


def _differs(path: Path, pieces: Pieces) -> bool:
    with path.open("rb") as file:
        return any(file.read(len(piece)) != piece for piece in pieces) or bool(file.read(1))


def loss_notes(grid: GridMap, target: str, options: SaveOptions) -> list[str]:
    """What OUT does not hold, how to keep it, and what only mapcli will find."""
    from mapcli.formats.maps.losses import LossKind, losses

    lost = losses(grid, target, options)
    notes = [loss.text for loss in lost]
    form = options.format or SUFFIXES[Path(target).suffix.lower()]
    image = form in ("pgm", "png") or (form == "yaml" and not options.inline and target != "-")
    if image and any(loss.kind is LossKind.PROBABILITY for loss in lost):
        notes.append("--mode scale keeps whole percents, and .txt keeps everything")
    if form in ("pgm", "png") and (grid.resolution != 1 or grid.origin != Pose2D()):
        notes.append(
            "resolution and origin are in a comment inside the image that mapcli reads; "
            "map_server needs a .yaml"
        )
    return notes
