"""`mapcli info`: what is in a map, a log, a trace, or another file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from mapcli.commands._map_options import dialect_option
from mapcli.commands._options import FILE, POINT, common_options, no_clobber_option
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say_lines
from mapcli.formats.file_kind import FileKind, Role, kind_at
from mapcli.formats.output import write_bytes

LOG_SUFFIXES = (".mcap", ".log", ".clf", ".gz", ".bag", ".db3")


@click.command(short_help="Say what is in a map, a log, a trace or another file.")
@click.argument("files", metavar="FILE...", type=FILE, nargs=-1, required=True)
@click.option(
    "--json", "json_file", metavar="F", type=FILE, help="Write it as JSON; - is standard output."
)
@click.option("--at", type=POINT, multiple=True, help="What lies at a point of a map? Repeatable.")
@dialect_option
@no_clobber_option
@common_options
def command(
    files: tuple[str, ...], json_file: str | None, at: tuple[tuple[float, float], ...],
    dialect: Any, no_clobber: bool, quiet: bool, verbose: bool,
) -> None:  # fmt: skip
    """Say what is in a map (size, place, cells, warnings; polygons), a log (topics, times,
    check-up), a trace of any format (poses, length, verdict), or another file that mapcli reads
    or writes: a perception, waypoints, relations, a document, a picture.

    The content tells what a file is, not its name. Of several files, JSON is a list with one
    document for each.

    \b
    Examples:
      mapcli info map.yaml
      mapcli info robot.mcap
      mapcli info apartment-slam/trace.json
      mapcli info fixtures/fig9_1.yaml --at 5.5,6
      mapcli info map.yaml --json - | jq .cells
    """
    outputs = [json_file] if json_file else []
    check_outputs(outputs, files, "files", no_clobber=no_clobber)
    reports = [_report(file, dialect, at, verbose=verbose) for file in files]
    if not quiet and json_file != "-":
        for number, (lines, _) in enumerate(reports):
            say_lines(["", *lines] if number else lines, err=False)
    if json_file is not None:
        from mapcli.formats.documents.json_document import json_bytes

        documents = [document for _, document in reports]
        content = json_bytes(documents if len(documents) > 1 else documents[0])
        write_bytes(json_file, content, no_clobber=no_clobber)


def _report(
    file: str, dialect: Any, at: tuple[tuple[float, float], ...], *, verbose: bool
) -> tuple[list[str], dict[str, Any]]:
    """What to print about a file, and the same as a document."""
    kind = _kind(file)
    role = kind.role if kind else Role.MAP
    if at and role not in (Role.MAP, Role.WORLD):
        raise click.UsageError(f"--at is for maps, and {file} is {kind.name if kind else 'none'}.")
    if role is Role.LOG:
        from mapcli.commands._log_report import log_report

        return log_report(file, verbose=verbose)
    if role is Role.TRACE:
        from mapcli.commands._trace_report import trace_report

        return trace_report(file)
    if role is Role.WORLD:
        from mapcli.commands._world_report import world_report

        if report := world_report(file, at):
            return report
    if kind is not None and role not in (Role.MAP, Role.WORLD):
        from mapcli.commands._file_report import file_report

        return file_report(file, kind)
    from mapcli.commands._map_report import map_report

    return map_report(file, dialect, at)


def _kind(file: str) -> FileKind | None:
    """By the content; what has none that is known, by its suffix. A folder is a bag."""
    kind = kind_at(file)
    is_folder = file != "-" and Path(file).is_dir()
    if kind is None and (Path(file).suffix.lower() in LOG_SUFFIXES or is_folder):
        return FileKind("a log", Role.LOG)
    return kind
