"""`mapcli schema`: what is in the files of mapcli, for programs."""

from __future__ import annotations

from typing import Any

import click

from mapcli.commands._options import common_options
from mapcli.formats.documents.json_schema import NAMES, json_schema


@click.command(short_help="Print the JSON Schema of a format.")
@click.argument("name", metavar="NAME", type=click.Choice(NAMES))
@common_options
def command(name: str, **common: Any) -> None:
    """Print the JSON Schema of a format.

    NAME is what a document calls its format, without `mapcli.`: pose-trace, exploration-trace,
    similarity-table, evaluation, log-info, map-info, trace-info, file-info, sessions,
    map-comparison, map-transform, rasterize, mowing; or a file that people write: perception,
    world. `unit` and `since` tell the unit of a number and the version of mapcli that first wrote
    a field.

    \b
    Examples:
      mapcli schema pose-trace
      mapcli schema perception | jq .title
    """
    from mapcli.formats.documents.json_document import json_bytes
    from mapcli.formats.output import write_bytes

    write_bytes("-", json_bytes(json_schema(name)))
