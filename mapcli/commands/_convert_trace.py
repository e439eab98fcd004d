"""`mapcli convert` of pose traces, between every format that tools for trajectories know."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath

import click
from click.core import ParameterSource

from mapcli.commands._output import check_outputs
from mapcli.commands._say import say, warn
from mapcli.formats.documents.load_trace import (
    HELD,
    TRACE_SUFFIXES,
    LoadedTrace,
    dump_trace,
    load_trace,
)
from mapcli.formats.file_kind import Role, kind_at
from mapcli.formats.maps.save import SUFFIXES
from mapcli.formats.output import write_bytes
from mapcli.model.counting import counted

FOR_TRACES = {"source", "target", "form", "topic", "no_clobber", "quiet", "verbose"}
"""Parameters of the command that mean something for a trace."""


def suffix_of_trace(source: str, target: str, form: str | None) -> str | None:
    """The suffix of OUT's format if that is one of traces; None for maps.

    Raises:
        click.UsageError: IN is a trace, and OUT's name says no format.
    """
    suffix = f".{form}" if form else PurePath(target).suffix.lower()
    if suffix in TRACE_SUFFIXES:
        return suffix
    kind = kind_at(source)
    if kind is None or kind.role is not Role.TRACE or form or suffix in SUFFIXES:
        return None
    if target == "-":
        return ".csv"
    known = ", ".join(TRACE_SUFFIXES)
    raise click.UsageError(f"{target!r} says no format; end it in {known} or add --to.")


def convert_trace(
    source: str, target: str, suffix: str, topic: str | None, *,
    no_clobber: bool, quiet: bool, verbose: bool,
) -> None:  # fmt: skip
    """Write a trace in the format of a suffix; what OUT does not hold is told on stderr."""
    check_outputs([target], (), "traces", no_clobber=no_clobber)
    loaded = load_trace(source, topic)
    write_bytes(target, dump_trace(loaded, suffix), no_clobber=no_clobber)
    warn(source, loaded.warnings, quiet=quiet)
    for note in () if quiet else notes(loaded, suffix):
        say(f"Note: {target}: {note}")
    if verbose:
        say(f"{target}: {counted(len(loaded.trace.poses), 'poses')}")


def notes(loaded: LoadedTrace, suffix: str) -> list[str]:
    """What OUT does not hold, and what it holds that IN does not say."""
    lost = loaded.lost_in(suffix)
    said = [f"{listed(lost)} of IN {'is' if lost == ['summary'] else 'are'} lost"] if lost else []
    if not loaded.has_times and "times" in HELD[suffix]:
        said.append("IN has no times, so its poses are taken to be one second apart")
    return said


def listed(words: Sequence[str]) -> str:
    """`times, scores and loops`."""
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def refuse_map_options(ctx: click.Context) -> None:
    """Options that say how maps are read or written do not go with a trace.

    Raises:
        click.UsageError: one was given.
    """
    for parameter in ctx.command.params:
        given = ctx.get_parameter_source(str(parameter.name)) is ParameterSource.COMMANDLINE
        is_map_option = parameter.expose_value and parameter.name not in FOR_TRACES
        if given and is_map_option:
            raise click.UsageError(f"{parameter.opts[0]} is for maps, and OUT is a trace.")
