"""Writing a map: the options for it, what it loses, and the files of the input that must stay."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from mapcli.errors import DataError, OutputError
from mapcli.formats.maps.save import SUFFIXES, Pieces, SaveOptions, map_files
from mapcli.formats.output import OutputSet
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

DEFAULTS = SaveOptions()


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
    for flag, only in (("characters", "txt"), ("inline", "yaml")):
        if given.get(flag) and form != only:
            raise click.UsageError(f"--{flag} is for {only}, and OUT is {form}.")
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
