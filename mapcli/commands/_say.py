"""The one place where commands print, on stdout and stderr.

Names come from files, and files from anywhere: what a terminal would obey is shown as an escape.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable

import click

from mapcli.errors import printable


def say(text: str, *, err: bool = True) -> None:
    """A line."""
    click.echo(printable(text), err=err)


def say_lines(lines: Iterable[str], *, err: bool = True) -> None:
    """Lines, in one go."""
    click.echo("\n".join(printable(line) for line in lines), err=err)


def note_meanwhile(text: str) -> None:
    """A note while a bar may be shown, whose line it takes; the bar goes on below."""
    over = "\r\x1b[K" if sys.stderr is not None and sys.stderr.isatty() else ""
    click.echo(f"{over}Note: {printable(text)}", err=True)


def warn(file: str, warnings: Iterable[str], *, quiet: bool = False) -> None:
    """A line for each warning about a file, unless -q."""
    for warning in () if quiet else warnings:
        say(f"Warning: {file}: {warning}")
