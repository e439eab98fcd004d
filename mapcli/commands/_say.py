"""What commands say on stderr about the files that they read."""

from __future__ import annotations

from collections.abc import Iterable

import click


def warn(file: str, warnings: Iterable[str], *, quiet: bool = False) -> None:
    """A line for each warning about a file, unless -q."""
    for warning in () if quiet else warnings:
        click.echo(f"Warning: {file}: {warning}", err=True)
