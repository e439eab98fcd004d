"""What commands say before and while they work: which files cannot be written, how far it is."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import click

from mapcli.errors import OutputError
from mapcli.formats.output import check_output, descriptor_of

Item = TypeVar("Item")


def check_outputs(
    files: Iterable[str], inputs: Iterable[str], kind: str, *, no_clobber: bool = False
) -> None:
    """Say early what is wrong with all the files of a run.

    Args:
        files: the files to be written; inputs: those to be read, of the kind "logs" or "maps".

    Raises:
        click.UsageError: two results for one file, or as of `check_inputs`.
        OutputError: one of the inputs, or as of `check_output`.
    """
    inputs = list(inputs)
    check_inputs(inputs)
    sources = read_files(inputs)
    taken: set[str | int] = set()
    for name in files:
        stream = descriptor_of(name)
        place = os.path.realpath(name) if stream is None else stream
        if place in taken:
            where = "standard output" if name == "-" else name
            raise click.UsageError(f"Two results cannot both be written to {where}.")
        if any(is_same_file(name, source) for source in sources if name != "-"):
            raise OutputError(f"is one of the {kind} to be read", file=name)
        taken.add(place)
        check_output(name, no_clobber=no_clobber)


def check_inputs(inputs: Iterable[str]) -> None:
    """Say early what is wrong with all the files that a run reads.

    Raises:
        click.UsageError: two of them are standard input.
    """
    if list(inputs).count("-") > 1:
        raise click.UsageError("Two inputs cannot both be standard input.")


def read_files(inputs: Iterable[str]) -> list[Path]:
    """Every file that reading these touches: the files of a folder, and the image of a YAML."""
    files: list[Path] = []
    for path in (Path(name) for name in inputs if name != "-"):
        files.append(path)
        if path.is_dir():
            files += [inner for inner in path.iterdir() if inner.is_file()]
        elif path.suffix.lower() in (".yaml", ".yml") and path.is_file():
            with path.open("rb") as file:
                image = IMAGE.search(file.read(1 << 16))
            if image:
                files.append(path.parent / image[1].decode(errors="surrogateescape").strip())
    return files


IMAGE = re.compile(rb"^[ \t]*image[ \t]*:\s*[\"']?([^\"'#\n\r]+)", re.MULTILINE)
"""The line of a map's YAML that names its image; the reader of maps reads it properly later."""


def is_same_file(name: str, other: Path) -> bool:
    """Whether two names are of one regular file, however they are spelt."""
    path = Path(name)
    try:
        if os.path.realpath(path) == os.path.realpath(other):
            return True
        return path.is_file() and other.is_file() and path.samefile(other)
    except (OSError, ValueError):  # too long for a name, or with a NUL in it: there is no such file
        return False


def progress(
    items: Iterable[Item], label: str, total: int | None, *, quiet: bool
) -> Iterator[Item]:
    """The items, with a bar on stderr when that is a terminal."""
    if quiet or not sys.stderr.isatty():
        yield from items
        return
    with click.progressbar(
        items, label=label, length=total, file=sys.stderr, update_min_steps=16, show_pos=True
    ) as bar:
        yield from bar


@contextmanager
def progress_of_steps(label: str, total: int, *, quiet: bool) -> Iterator[Callable[[int], None]]:
    """Something to call with the number of each step that is done, shown as `progress` does."""
    if quiet or not total or not sys.stderr.isatty():
        yield lambda step: None
        return
    with click.progressbar(length=total, label=label, file=sys.stderr, show_pos=True) as bar:
        yield lambda step: bar.update(step + 1 - bar.pos)
