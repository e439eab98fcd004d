"""The options of the commands that read a map."""

from __future__ import annotations

import click

from mapcli.formats.maps.dialects import DIALECTS

dialect_option = click.option(
    "--dialect",
    type=click.Choice(DIALECTS),
    default=DIALECTS[0],
    show_default=True,
    help="Whose rules say what the grey of a map's image means.",
)
