"""`mapcli slam-replay --sessions`: several drives, one map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import PurePath
from typing import Any

import click

from mapcli.algorithms.sessions.drive import Drive, by_age, do_overlap, without_repeats
from mapcli.algorithms.sessions.join_drives import JointMap, join_drives
from mapcli.algorithms.sessions.saving import restored, saved
from mapcli.algorithms.slam.replay import ReplayRun
from mapcli.algorithms.slam.slam import Slam, SlamParameters
from mapcli.algorithms.slam.submaps import SUBMAP_M
from mapcli.commands._log_options import LogInput, say_notes
from mapcli.commands._output import progress_of_steps
from mapcli.commands._replay import effective_parameters, replay_log
from mapcli.commands._replay_outputs import default_folder
from mapcli.commands._say import say
from mapcli.commands._session_outputs import (
    SessionOutputs,
    check_session_outputs,
    report_sessions,
    session_summary,
    write_sessions,
)
from mapcli.errors import DataError, MapcliError
from mapcli.formats.documents.drive_state import read_state, write_state
from mapcli.formats.logs.open_log import Log
from mapcli.model.knowledge import Knowledge
from mapcli.model.limit import Limit
from mapcli.model.summary import ReplaySummary


@dataclass(frozen=True)
class SessionOptions:
    """What was asked for.

    Attributes:
        newest_last: age is the order of the logs; static: keep what all drives agree on.
        continued: the state to go on from; knowledge: what a person knows of the drives.
    """

    newest_last: bool
    static: bool
    continued: str | None
    knowledge: Knowledge


@dataclass(frozen=True)
class DriveInput:
    """How every drive is read and mapped, and what is said of it."""

    log_input: LogInput
    parameters: SlamParameters
    limits: tuple[Limit, ...]
    no_clobber: bool
    quiet: bool
    verbose: bool


def replay_sessions(
    recordings: Sequence[Sequence[str]],
    options: SessionOptions,
    outputs: SessionOutputs,
    how: DriveInput,
) -> None:
    """Map every drive by itself, join them, and write what comes of it.

    Args:
        recordings: the logs of each drive.

    Raises:
        DataError: a state whose map has other cells; a drive that could not be read, once the
            others are written; KeyboardInterrupt: likewise.
        FormatError: no state.
    """
    before = [restored(one) for one in read_state(options.continued)] if options.continued else []
    _check_resolution(before, how.parameters)
    logs = [log for parts in recordings for log in parts]
    names = names_of([parts[0] for parts in recordings], [drive.name for drive in before])
    check_session_outputs(
        outputs, [*names, *(drive.name for drive in before)],
        how.log_input.inputs(logs), options.continued, no_clobber=how.no_clobber,
    )  # fmt: skip
    mapped = _Mapped(before)
    mapped.map_all(recordings, names, how)
    drives = _in_order(mapped.drives, newest_last=options.newest_last, quiet=how.quiet)
    static = options.static or (not options.newest_last and _have_no_newest(drives, how.quiet))
    maps = _join(drives, how, options.knowledge, static=static)
    write_sessions(maps, drives, outputs, no_clobber=how.no_clobber)
    summary = session_summary(maps)
    if not how.quiet:
        report_sessions(maps, summary, outputs)
    if mapped.error is not None:
        raise mapped.error
    for limit in how.limits:
        limit.check(summary.values(), PurePath(outputs.json).name)


def _check_resolution(drives: Sequence[Drive], parameters: SlamParameters) -> None:
    for drive in drives:
        resolution = drive.parameters["map"]["resolution"]
        if resolution != parameters.map.resolution:
            raise DataError(
                f"cells of {parameters.map.resolution:g} m, where {drive.name} has "
                f"{resolution:g} m", expected=f"--resolution {resolution:g}",
            )  # fmt: skip


def drive_name(log: str) -> str:
    """`data/monday.log.gz` -> `monday`; what names of files should not have becomes `_`."""
    name = default_folder(log).removesuffix("-slam")
    return "".join(sign if sign.isprintable() else "_" for sign in name)


def names_of(logs: Sequence[str], taken: Sequence[str]) -> list[str]:
    """Short names of drives: of their files, without folders and suffixes; a number is added
    where two are alike."""
    names = list(taken)
    for log in logs:
        name = drive_name(log)
        number, free = 1, name
        while free in names:
            number += 1
            free = f"{name}-{number}"
        names.append(free)
    return names[len(taken) :]


class _Mapped:
    """Drives that have been mapped by themselves (stateful).

    Attributes:
        drives: those of the state first.
        error: why a drive is not among them, or that the run was stopped.
    """

    def __init__(self, before: Sequence[Drive]) -> None:
        self.drives, self._before = list(before), len(before)
        self.error: BaseException | None = None

    def map_all(
        self, recordings: Sequence[Sequence[str]], names: Sequence[str], how: DriveInput
    ) -> None:
        """Map every recording. One that cannot be read is told and left out; a signal ends it.

        Raises:
            MapcliError: the same, when not one of them could be mapped; a file that is no log.
        """
        opened = [how.log_input.open(logs) for logs in recordings]  # fails before any work is done
        for log, name in zip(opened, names, strict=True):
            try:
                self.drives.append(self._map(log, name, how))
            except MapcliError as error:
                self.error = self._failed(error)
            except KeyboardInterrupt as stopped:
                self.error = stopped
            if isinstance(self.error, KeyboardInterrupt):
                break
        if self.error is not None and len(self.drives) == self._before:
            raise self.error

    def _failed(self, error: MapcliError) -> BaseException:
        """The first error is raised at the end; those before it are told when they come."""
        if self.error is None:
            return error
        say(f"Error: {error}")
        return self.error

    def _map(self, log: Log, name: str, how: DriveInput) -> Drive:
        slam = Slam(how.parameters)
        replayed, run = replay_log(log, how.log_input, slam, quiet=how.quiet)
        self.error = run.stopped_by or self.error
        say_notes(log, verbose=how.verbose, quiet=how.quiet)
        told = effective_parameters(how.log_input, slam, None, {})
        return drive_of(run, name, log.digests(), told, replayed.summary)


def drive_of(
    run: ReplayRun,
    name: str,
    inputs: Mapping[str, str],
    parameters: Mapping[str, Any],
    summary: ReplaySummary,
) -> Drive:
    """The drive of a replay that has ended.

    Raises:
        DataError: of one that is not matched closely, so that it cannot be found in others.
    """
    if not run.slam.trajectory.keyframes:
        raise DataError("no scan to be found in other drives", file=name, expected="a laser's log")
    whole = replace(summary, seconds=0.0)
    return Drive(name, inputs, parameters, run.slam.trajectory, tuple(run.poses), whole)


def state_of(run: ReplayRun, name: str, head: Mapping[str, Any], summary: ReplaySummary) -> bytes:
    """The state of a map of one drive."""
    drive = drive_of(run, name, head["inputs"], head["parameters"], summary)
    stream = BytesIO()
    write_state([saved(drive)], stream)
    return stream.getvalue()


def refuse_with_drives(options: Mapping[str, Any]) -> None:
    """Refuse options that are for one recording only.

    Args:
        options: name -> whether it was given.

    Raises:
        click.UsageError: names the first of them.
    """
    for name, is_given in options.items():
        if is_given:
            raise click.UsageError(f"{name} is for one recording, not for drives to be joined.")


def _in_order(drives: Sequence[Drive], *, newest_last: bool, quiet: bool) -> list[Drive]:
    """The oldest first, each drive once."""
    ordered = list(drives) if newest_last else by_age(drives)
    kept, repeats = without_repeats(ordered)
    for drive, first in repeats if not quiet else ():
        say(f"Note: {drive.name} is the same drive as {first.name}, and is used once.")
    return kept


def _have_no_newest(drives: Sequence[Drive], quiet: bool) -> bool:
    """Whether drives overlap in time, which is said."""
    if not do_overlap(drives):
        return False
    if not quiet:
        say(
            "Note: drives overlap in time, so that none is the newest: the map is what all of them "
            "agree on, as with --static; --newest-last takes the order of the logs."
        )
    return True


def _join(
    drives: Sequence[Drive], how: DriveInput, knowledge: Knowledge, *, static: bool
) -> list[JointMap]:
    submaps = round(sum(one.trajectory.keyframes[-1].metres for one in drives) / SUBMAP_M)
    with progress_of_steps("joining drives", submaps, quiet=how.quiet) as report:
        return join_drives(drives, how.parameters, knowledge, static=static, progress=report)
