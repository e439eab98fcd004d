"""A run of `mapcli slam-replay`, with what a person sees meanwhile."""

from __future__ import annotations

import time
from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import asdict, replace
from typing import Any

from mapcli.algorithms.evaluation.log_reasons import log_reasons
from mapcli.algorithms.slam.replay import Replayed, ReplayRun
from mapcli.algorithms.slam.slam import Slam
from mapcli.algorithms.slam.verdict import verdict_of
from mapcli.commands._clock_report import reasons_of_clocks
from mapcli.commands._log_options import LogInput
from mapcli.commands._output import progress, progress_of_steps
from mapcli.commands._say import say, warn
from mapcli.errors import DataError
from mapcli.formats.logs.open_log import Log
from mapcli.model.counting import counted
from mapcli.model.knowledge import NOTHING_KNOWN, Knowledge
from mapcli.model.pose import Pose2D
from mapcli.model.reason import DESCRIPTIONS, WRONG_THROUGHOUT, Reason, ReasonKind
from mapcli.model.scan import RangeScan, Record

FIRST_SCANS, FIRST_RECORDS = 40, 10_000
"""So much is read before anything is mapped, for its units: a map in wrong ones takes long."""


def replay_log(
    log: Log,
    log_input: LogInput,
    slam: Slam,
    keep: Container[int] = (),
    watch: Callable[[ReplayRun], None] = lambda run: None,
    *,
    knowledge: Knowledge = NOTHING_KNOWN,
    quiet: bool,
) -> tuple[Replayed, ReplayRun]:
    """Replay a log to its end, or to Ctrl-C, with a progress bar; `watch` is called after each
    scan.

    Raises:
        DataError: not one scan in the part asked for; KeyboardInterrupt: none before Ctrl-C.
    """
    started = time.perf_counter()
    run = ReplayRun(slam, keep, lambda: bool(log.unknown_mounts))
    warned: set[ReasonKind] = set()
    try:
        steps = run.track(_with_known_units(log, log_input, warned))
        for _ in progress(steps, log.name, log.scan_count, quiet=quiet):
            watch(run)
        if not run.poses:
            raise DataError("no scan in the part asked for")
        with progress_of_steps("closing loops", slam.submap_count, quiet=quiet) as report:
            run.finalise(report, knowledge)
    except KeyboardInterrupt as stopped:
        if not run.poses:
            raise
        _stop(run, stopped)
    except DataError as error:
        error.file = error.file or log.name
        raise
    replayed = run.result(log.damage)
    summary = replayed.summary
    laser = run.calibration.estimate(run.mount)
    is_unknown = bool(log.unknown_mounts) and log.odom_topic is not None
    duration_s = summary.duration_s
    told = (
        *log_reasons(log.units, run.mount.finding(), duration_s, laser, is_unknown=is_unknown),
        *reasons_of_clocks(log, duration_s),
    )
    reasons = (*told, *summary.reasons)
    if any(reason.kind in WRONG_THROUGHOUT for reason in told):  # not the wheels have failed
        reasons = tuple(reason for reason in reasons if reason.kind != "wheels_failed")
    _warn(log, reasons, warned)
    seconds = time.perf_counter() - started
    summary = replace(
        summary, verdict=verdict_of(reasons), reasons=reasons, clock=log.clock, seconds=seconds
    )
    return replace(replayed, summary=summary), run


def _with_known_units(log: Log, log_input: LogInput, warned: set[ReasonKind]) -> Iterator[Record]:
    """The records of a log, after a warning if the first scans have other units than they should.

    Args:
        warned: of what; is added to.
    """
    records, first, scans = log_input.records(log), list[Record](), 0
    for record in records:
        first.append(record)
        scans += isinstance(record, RangeScan)
        if scans == FIRST_SCANS or len(first) == FIRST_RECORDS:
            break
    _warn(log, log_reasons(log.units, None, 0.0), warned)
    yield from first
    yield from records


def _warn(log: Log, told: tuple[Reason, ...], warned: set[ReasonKind]) -> None:
    """Warn of what a log is described wrongly in, once."""
    new = [one for one in told if one.kind in DESCRIPTIONS - warned]
    warn(log.name, [one.line() for one in new])
    warned.update(one.kind for one in new)


def _stop(run: ReplayRun, stopped: KeyboardInterrupt) -> None:
    """Say what is done after a signal, and take what is known."""
    run.stopped_by = stopped
    count = counted(len(run.poses), "scans")
    say("")  # what was on the line: a bar, or ^C
    say(
        f"Stopped after {count}: their map is written without loop closure and refinement; "
        "once more ends at once."
    )
    run.stop()


def effective_parameters(
    log_input: LogInput,
    slam: Slam,
    start: Pose2D | None,
    known: Mapping[str, str],
    knowledge: Knowledge = NOTHING_KNOWN,
) -> dict[str, Any]:
    """Everything that the result depends on besides the log.

    Args:
        start: where the robot starts, if that was said; known: the files of the known map, name
            -> SHA-256; knowledge: what a person told.
    """
    return {
        **log_input.parameters(),
        "initial_pose": None if start is None else asdict(start),
        "known": [{"file": name, "sha256": digest} for name, digest in known.items()],
        **({"knowledge": asdict(knowledge)} if knowledge else {}),
        **asdict(slam.parameters),
    }
