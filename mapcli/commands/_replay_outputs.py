"""What `mapcli slam-replay` writes: the files asked for, and the end report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from types import MappingProxyType
from typing import Any

import click
import numpy as np

from mapcli.algorithms.slam.replay import Replayed
from mapcli.commands._map_output import usual_options
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say
from mapcli.formats.documents.trajectory_text import WRITERS, dump_trajectory
from mapcli.formats.maps.save import SUFFIXES, Pieces, map_files
from mapcli.formats.output import output_set
from mapcli.model.counting import counted
from mapcli.model.grid import GridMap
from mapcli.model.reason import DESCRIPTIONS, WRONG_THROUGHOUT, Reason
from mapcli.model.summary import ReplaySummary
from mapcli.model.trace import PoseTrace

LOG_SUFFIXES = (".gz", ".mcap", ".log", ".clf", ".bag")


@dataclass(frozen=True)
class ReplayOutputs:
    """The files to write; None is not asked for.

    Attributes:
        png: the picture; map: the map, in the format of its suffix; json: the trace as JSON;
        trace: the trace in the format of its suffix; mcap: map and poses as ROS 2 messages.
    """

    png: str | None
    map: str | None
    json: str | None
    trace: str | None
    mcap: str | None

    @classmethod
    def in_folder(cls, folder: str | Path) -> ReplayOutputs:
        """The usual ones: picture, map and trace."""
        png, map_, json = (
            str(Path(folder) / name) for name in ("map.png", "map.yaml", "trace.json")
        )
        return cls(png, map_, json, None, None)

    def names(self) -> list[str]:
        """All files, the companions of a YAML map included."""
        image = None
        if _suffix(self.map) in (".yaml", ".yml"):
            image = str(PurePath(str(self.map)).with_suffix(".pgm"))
        named = self.png, self.map, image, self.json, self.trace, self.mcap
        return [name for name in named if name]


MOST_SPANS = 3
"""Time spans that the report tells of each kind of reason; the trace tells all."""

HALF_MS = 0.0005
"""Seconds by which times may be rounded."""


def default_folder(log: str) -> str:
    """`robot.log.gz` -> `robot-slam`."""
    name = "stdin" if log == "-" else Path(log).name or Path(log).resolve().name
    while PurePath(name).suffix.lower() in LOG_SUFFIXES:
        name = PurePath(name).stem
    return f"{name}-slam"


def check_replay_outputs(
    outputs: ReplayOutputs, logs: Sequence[str], others: Sequence[str] = (), *, no_clobber: bool
) -> None:
    """Say early, before minutes of work, what is wrong with the files asked for.

    `others` are files that are not of the outputs.

    Raises:
        click.UsageError: a suffix of no known format, or two results in one file.
        OutputError: a file that cannot or must not be written, or is one of the logs.
    """
    if outputs.map not in (None, "-") and _suffix(outputs.map) not in SUFFIXES:
        raise click.UsageError(f"--map {outputs.map}: does not end in {', '.join(SUFFIXES)}.")
    if outputs.trace not in (None, "-") and _suffix(outputs.trace) not in WRITERS:
        raise click.UsageError(f"--trace {outputs.trace}: does not end in {', '.join(WRITERS)}.")
    check_outputs([*outputs.names(), *others], logs, "files", no_clobber=no_clobber)


def _suffix(name: str | None) -> str:
    return PurePath(name or "").suffix.lower()


def write_outputs(
    outputs: ReplayOutputs,
    replayed: Replayed,
    head: Mapping[str, Any],
    others: Mapping[str, bytes] = MappingProxyType({}),
    *,
    no_clobber: bool,
) -> None:
    """Write every file that was asked for: all of them, or none. The trace comes last and holds
    the digests of the others, so that a set of files that was torn is found out.

    Args:
        head: `inputs` and `parameters`, for the head of the JSON document.
        others: more files of the set, name -> content.

    Raises:
        OutputError: a file cannot be written.
    """
    contents = {**_contents(outputs, replayed), **others}
    with output_set(no_clobber=no_clobber) as files:
        digests = {name: files.write(name, content) for name, content in contents.items()}
        if outputs.json:
            files.write(
                outputs.json,
                trace_json(outputs.json, replayed.trace, head, replayed.summary, digests),
            )


def _contents(outputs: ReplayOutputs, replayed: Replayed) -> dict[str, bytes | Pieces]:
    """File -> content, of all but the trace as JSON."""
    contents: dict[str, bytes | Pieces] = {}
    if outputs.map:
        files = map_files(replayed.map, outputs.map, usual_options(outputs.map))
        contents |= {beside(outputs.map, name): pieces for name, pieces in files.items()}
    if outputs.trace:
        contents[outputs.trace] = dump_trajectory(replayed.trace, outputs.trace)
    if outputs.mcap:
        contents[outputs.mcap] = _mcap(replayed.map, replayed.trace)
    if outputs.png:
        contents[outputs.png] = _picture(replayed.map, replayed.trace, replayed.summary.reasons)
    return contents


def beside(target: str, name: str) -> str:
    return name if name == "-" else str(Path(target).with_name(name))


def trace_json(
    file: str,
    trace: PoseTrace,
    head: Mapping[str, Any],
    summary: ReplaySummary,
    digests: Mapping[str, str],
) -> Pieces:
    """The trace as JSON, with the digests of the files in its folder.

    Args:
        head: `inputs` and `parameters`.
    """
    from mapcli.formats.documents.json_document import json_pieces
    from mapcli.formats.documents.pose_trace import trace_document

    folder = Path(file).absolute().parent
    siblings = {
        Path(name).name: digest
        for name, digest in digests.items()
        if name != "-" and Path(name).absolute().parent == folder
    }
    document = summary.document()
    return json_pieces(
        trace_document(trace, head["inputs"], head["parameters"], document, siblings)
    )


def _mcap(grid: GridMap, trace: PoseTrace) -> bytes:
    from io import BytesIO

    from mapcli.formats.logs.mcap.replay_writer import write_result

    stream = BytesIO()
    write_result(stream, grid, trace)
    return stream.getvalue()


def _picture(grid: GridMap, trace: PoseTrace, reasons: Sequence[Reason]) -> bytes:
    from mapcli.pictures.map_picture import RobotPath, floor_plan

    driven = trace.trajectory()
    seconds = driven.seconds()
    since, doubtful = seconds - seconds[0], np.zeros(len(seconds), np.bool_)
    for one in (reason for reason in reasons if reason.verdict != "good"):
        doubtful |= (since >= one.from_s - HALF_MS) & (since <= one.to_s + HALF_MS)
    path = RobotPath(driven.poses[:, :2], seconds, driven.poses[:, 2], doubtful)
    return floor_plan(grid, path=path)


def report(summary: ReplaySummary, grid: GridMap, outputs: ReplayOutputs) -> None:
    """The end report, on stderr."""
    skipped = ", ".join(counted(times, reason) for reason, times in summary.skipped.items())
    score = "none" if summary.mean_score is None else f"{summary.mean_score:.2f}"
    failed = summary.odometry_faults
    if any(reason.kind in WRONG_THROUGHOUT for reason in summary.reasons):
        failed = 0  # not the wheels did, but the laser looks the other way
    faults = f"; wheels that failed, at {counted(failed, 'scans')}" if failed else ""
    if summary.odometry_catch_ups:
        faults += f"; stood still and caught up, {summary.odometry_catch_ups:,} times"
    worth = f"; {summary.loop_check.text()}" if summary.loop_check else ""
    width, height = grid.columns * grid.resolution, grid.rows * grid.resolution
    rows = (
        ("scans", f"{summary.used:,} of {summary.scans:,} used ({100 * summary.used_share:.1f} %)"),
        ("skipped", skipped or "none"),
        *(
            [("lost", f"{100 * summary.lost_share:.1f} % of the log's scans, to damage")]
            if summary.lost_share
            else []
        ),
        ("matched", f"{summary.matched:,}; by odometry alone {summary.odometry:,}"),
        ("mean score", f"{score} (1 is perfect agreement with the map)"),
        *([("laser", summary.sweep.text())] if summary.sweep else []),
        ("odometry", f"{summary.odometry_jumps:,} jumps not believed{faults}"),
        ("driven", f"{summary.distance_m:,.1f} m in {summary.duration_s:,.1f} s"),
        ("loops closed", f"{summary.loops:,}{worth}"),
        ("map", f"{width:.1f} m x {height:.1f} m at {grid.resolution:g} m a cell"),
        ("took", f"{summary.seconds:.2f} s, {_times(summary.times_real_time)} times real time"),
        ("written", _listed(outputs.names())),
    )
    for label, text in (*rows, *_verdict_rows(summary)):
        say(f"{label:>13}  {text}")


def _verdict_rows(summary: ReplaySummary) -> Iterator[tuple[str, str]]:
    """The verdict, last of the report, after its reasons: one line of each kind, and of each way
    in which wheels fail."""
    kinds: dict[str, list[Reason]] = {}
    for reason in summary.reasons:
        if reason.kind not in DESCRIPTIONS:  # these were said already
            kind = reason.text if reason.kind == "wheels_failed" else reason.kind
            kinds.setdefault(kind, []).append(reason)
    for reasons in kinds.values():
        spans = [f"{one.from_s:,.0f} to {one.to_s:,.0f} s" for one in reasons]
        more = f" and {len(spans) - MOST_SPANS} more" if len(spans) > MOST_SPANS else ""
        yield "reason", f"{reasons[0].line()} ({', '.join(spans[:MOST_SPANS])}{more})"
    yield "verdict", summary.verdict


def _times(number: float) -> str:
    return f"{number:,.0f}" if number >= 10 else f"{number:.1f}"


def _listed(names: Sequence[str]) -> str:
    """The files, their folder said once when they share it."""
    folders = {str(PurePath(name).parent) for name in names}
    if len(folders) > 1 or folders == {"."}:
        return ", ".join("standard output" if name == "-" else name for name in names)
    return f"{folders.pop()}: {', '.join(PurePath(name).name for name in names)}"
