"""What commands say before and while they work: which files cannot be written, how far it is."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import click

from mapcli.errors import OutputError
from mapcli.formats.output import check_output

Item = TypeVar("Item")


def check_outputs(
    files: Iterable[str], inputs: Iterable[str], kind: str, *, no_clobber: bool = False
) -> None:
    """Say early what is wrong with all the files of a run.

    Args:
        files: the files to be written; inputs: those to be read, of the kind "logs" or "maps".

    Raises:
        click.UsageError: two results for one file.
        OutputError: one of the inputs, or as of `check_output`.
    """
    sources = {Path(name).resolve() for name in inputs if name != "-"}
    taken: set[str | Path] = set()
    for name in files:
        place = name if name == "-" else Path(name).resolve()
        if place in taken:
            where = "standard output" if name == "-" else name
            raise click.UsageError(f"Two results cannot both be written to {where}.")
        if place in sources:
            raise OutputError(f"is one of the {kind} to be read", file=name)
        taken.add(place)
        check_output(name, no_clobber=no_clobber)


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
