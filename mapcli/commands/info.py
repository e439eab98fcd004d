"""`mapcli info`: what is in a map or a log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from mapcli.commands._map_options import dialect_option
from mapcli.commands._options import FILE, POINT, common_options, no_clobber_option
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say_lines
from mapcli.formats.input import reopenable, standard_input
from mapcli.formats.output import write_bytes

LOG_SUFFIXES = (".mcap", ".log", ".clf", ".gz", ".bag", ".db3")
LOG_STARTS = (b"\x89MCAP", b"\x1f\x8b", b"#ROSBAG", b"SQLite format 3")


@click.command(short_help="Say what is in a map or a log.")
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
    """Say what is in a map (size, place, cells, warnings; polygons) or a log (topics, times,
    check-up).

    Of several files, JSON is a list with one document for each.

    \b
    Examples:
      mapcli info map.yaml
      mapcli info robot.mcap
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
    if _is_log(file):
        if at:
            raise click.UsageError(f"--at is for maps, and {file} is a log.")
        from mapcli.commands._log_report import log_report

        return log_report(file, verbose=verbose)
    if _is_continuous(file):
        from mapcli.commands._world_report import world_report

        if report := world_report(file, at):
            return report
    from mapcli.commands._map_report import map_report

    return map_report(file, dialect, at)


def _is_continuous(file: str) -> bool:
    """Whether a map is polygons and points, not cells."""
    if Path(file).suffix.lower() in (".txt", ".pgm", ".png"):
        return False
    from mapcli.commands._world_report import looks_continuous

    return looks_continuous(_first_bytes(file))


def _is_log(file: str) -> bool:
    """By suffix; standard input and other names by their first bytes. A folder is a bag."""
    suffix = Path(file).suffix.lower()
    if suffix in LOG_SUFFIXES or (file != "-" and Path(file).is_dir()):
        return True
    if suffix in (".txt", ".yaml", ".yml", ".pgm", ".png"):
        return False
    start = _first_bytes(file)
    if start.startswith(LOG_STARTS):
        return True
    from mapcli.formats.logs.carmen_lines import looks_like_carmen

    return looks_like_carmen(start)


def _first_bytes(file: str) -> bytes:
    if file == "-":
        # Looked at, not taken: the reader that is chosen reads from the first byte on.
        return standard_input().peek(1)
    try:
        source = reopenable(Path(file))
        with source.path.open("rb") as opened:
            return opened.read(1 << 16)
    except OSError:
        return b""  # the map reader says what is wrong
