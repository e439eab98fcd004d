"""What `mapcli slam-replay --sessions` writes: one map, a trace of each drive, and the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import click
import numpy as np

from mapcli.algorithms.sessions.drive import Drive
from mapcli.algorithms.sessions.join_drives import JoinedDrive, JointMap
from mapcli.commands._map_output import usual_options
from mapcli.commands._output import check_outputs, is_same_file
from mapcli.commands._replay_outputs import beside, trace_json
from mapcli.commands._say import say
from mapcli.formats.maps.save import SUFFIXES, Pieces, map_files
from mapcli.formats.output import OutputSet, descriptor_of, output_set
from mapcli.model.counting import counted
from mapcli.model.reason import VERDICTS
from mapcli.model.summary import ReplaySummary


@dataclass(frozen=True)
class SessionOutputs:
    """The files to write.

    Attributes:
        folder: of all that are not named.
        png: the picture; map: the map, in the format of its suffix; json: what became of the
            drives; state: all that is needed to go on, None if it was not asked for.
    """

    folder: str
    png: str
    map: str
    json: str
    state: str | None

    @classmethod
    def of(
        cls,
        folder: str,
        png: str | None,
        map_: str | None,
        json: str | None,
        state: str | None,
    ) -> SessionOutputs:
        """Those that were named, and the usual names in the folder."""
        usual = [str(Path(folder) / name) for name in ("map.png", "map.yaml", "sessions.json")]
        return cls(folder, png or usual[0], map_ or usual[1], json or usual[2], state)

    def trace(self, drive: str) -> str:
        """The trace of a drive."""
        return str(Path(self.folder) / f"trace-{drive}.json")

    def of_others(self, drive: str) -> tuple[str, str]:
        """Map and picture of drives that belong to no older one, the oldest of which is named:
        beside those of the first, or in the folder where these are streams."""
        usual = SessionOutputs.of(self.folder, None, None, None, None)
        named = ((self.map, usual.map), (self.png, usual.png))
        map_, png = (Path(name if descriptor_of(name) is None else other) for name, other in named)
        return str(map_.with_stem(f"{map_.stem}-{drive}")), str(
            png.with_stem(f"{png.stem}-{drive}")
        )


def check_session_outputs(
    outputs: SessionOutputs,
    drives: Sequence[str],
    logs: Sequence[str],
    continued: str | None,
    *,
    no_clobber: bool,
) -> None:
    """Say early what is wrong with the files asked for. A state may be the one that is gone on
    from, which it takes the place of.

    Raises:
        click.UsageError, OutputError: as of `check_outputs`.
    """
    suffix = PurePath(outputs.map).suffix.lower()
    if outputs.map != "-" and suffix not in SUFFIXES:
        raise click.UsageError(f"--map {outputs.map}: does not end in {', '.join(SUFFIXES)}.")
    names = [outputs.png, outputs.map, outputs.json, *map(outputs.trace, drives)]
    if suffix in (".yaml", ".yml"):
        names.append(str(PurePath(outputs.map).with_suffix(".pgm")))
    check_outputs(names, [*logs, *filter(None, [continued])], "logs", no_clobber=no_clobber)
    if outputs.state is not None:
        is_replaced = continued is not None and is_same_file(outputs.state, Path(continued))
        others = [] if is_replaced or continued is None else [continued]
        check_outputs([*names, outputs.state], [*logs, *others], "logs",
                      no_clobber=no_clobber and not is_replaced)  # fmt: skip


def write_sessions(
    maps: Sequence[JointMap], drives: Sequence[Drive], outputs: SessionOutputs, *, no_clobber: bool
) -> None:
    """Write every file, all of them or none; the document last, with the digests of the others.

    Raises:
        OutputError: a file cannot be written.
    """
    from mapcli.algorithms.sessions.saving import saved
    from mapcli.formats.documents.drive_state import write_state
    from mapcli.formats.documents.json_document import json_pieces
    from mapcli.formats.documents.sessions import sessions_document

    with output_set(no_clobber=no_clobber) as files:
        digests, rows = dict[str, str](), list[dict[str, Any]]()
        for k, joint in enumerate(maps):
            names = (outputs.map, outputs.png)
            if k:
                names = outputs.of_others(joint.drives[0].drive.name)
            own = _write_map(files, joint, *names)
            digests |= own
            for one in joint.drives:
                trace = outputs.trace(one.drive.name)
                head = {"inputs": one.drive.inputs, "parameters": one.drive.parameters}
                pieces = trace_json(trace, one.trace, head, one.summary, own)
                digests[trace] = files.write(trace, pieces)
                rows.append(_row(one, k, Path(trace).name))
        if outputs.state is not None:
            with files.opened(outputs.state) as stream:
                write_state([saved(drive) for drive in drives], stream)
        inputs = {name: digest for drive in drives for name, digest in drive.inputs.items()}
        content = sessions_document(rows, inputs, session_summary(maps), digests)
        files.write(outputs.json, json_pieces(content))


def _write_map(files: OutputSet, joint: JointMap, map_: str, png: str) -> dict[str, str]:
    """Write map and picture; their names with the digests."""
    contents: dict[str, bytes | Pieces] = {
        beside(map_, name): pieces
        for name, pieces in map_files(joint.map, map_, usual_options(map_)).items()
    }
    contents[png] = _picture(joint)
    return {name: files.write(name, content) for name, content in contents.items()}


def _picture(joint: JointMap) -> bytes:
    from mapcli.pictures.drives import drives_plan
    from mapcli.pictures.robot_path import RobotPath

    paths = {one.drive.name: RobotPath.of(one.trace.trajectory()) for one in joint.drives}
    return drives_plan(joint.map, paths)


def _row(one: JoinedDrive, map_: int, trace: str) -> dict[str, Any]:
    """A drive in the document."""
    from_ns, to_ns = one.drive.span_ns
    begin = one.trace.poses[0].pose
    return {
        "name": one.drive.name,
        "from_ns": from_ns,
        "to_ns": to_ns,
        "map": map_,
        "trace": trace,
        "begin": {name: round(getattr(begin, name), 6) + 0.0 for name in ("x", "y", "theta")},
        "joined_to": [{"name": name, "loops": loops} for name, loops in one.loops_to.items()],
        "scans": one.summary.scans,
        "used": one.summary.used,
        "distance_m": round(one.summary.distance_m, 3),
        "verdict": one.summary.verdict,
        "reasons": [reason.document() for reason in one.summary.reasons],
    }


def session_summary(maps: Sequence[JointMap]) -> ReplaySummary:
    """All drives together; drives that are not in the first map are unjoined."""
    drives = [one for joint in maps for one in joint.drives]
    each = [one.summary for one in drives]
    scores = [(one.mean_score, one.matched) for one in each if one.mean_score is not None]
    matched = sum(weight for _, weight in scores)
    between = sum(loops for one in drives for loops in one.loops_to.values()) // 2
    return ReplaySummary(
        scans=sum(one.scans for one in each),
        used=sum(one.used for one in each),
        matched=sum(one.matched for one in each),
        odometry=sum(one.odometry for one in each),
        skipped=_added([one.skipped for one in each]),
        distance_m=sum(one.distance_m for one in each),
        duration_s=sum(one.duration_s for one in each),
        loops=sum(one.loops for one in each) + between,
        mean_score=sum(score * weight for score, weight in scores) / matched if matched else None,
        odometry_jumps=sum(one.odometry_jumps for one in each),
        odometry_faults=sum(one.odometry_faults for one in each),
        odometry_catch_ups=sum(one.odometry_catch_ups for one in each),
        damage=_added([one.damage for one in each]),
        interrupted=any(one.interrupted for one in each),
        lost_share=float(np.average([one.lost_share for one in each],
                                    weights=[max(one.scans, 1) for one in each])),
        verdict=max((one.verdict for one in each), key=VERDICTS.index),
        unjoined=len(drives) - len(maps[0].drives),
    )  # fmt: skip


def _added(counts: Sequence[Any]) -> dict[str, int]:
    names = dict.fromkeys(name for one in counts for name in one)
    return {name: sum(one.get(name, 0) for one in counts) for name in names}


def report_sessions(
    maps: Sequence[JointMap], summary: ReplaySummary, outputs: SessionOutputs
) -> None:
    """The end report, on stderr: a line a drive, and what came of all."""
    first = maps[0]
    for joint in maps:
        for one in joint.drives:
            say(f"{'drive':>13}  {_line(one, is_apart=joint is not first)}")
            for reason in one.summary.reasons:
                if reason.verdict != "good":
                    span = f"{reason.from_s:,.0f} to {reason.to_s:,.0f} s"
                    say(f"{'reason':>13}  {reason.line()} ({span})")
    count = sum(len(joint.drives) for joint in maps)
    grid = first.map
    width, height = grid.columns * grid.resolution, grid.rows * grid.resolution
    rows = [
        ("joined", f"{len(first.drives):,} of {counted(count, 'drives')}"),
        ("driven", f"{summary.distance_m:,.1f} m in {summary.duration_s:,.1f} s"),
        ("map", f"{width:.1f} m x {height:.1f} m at {grid.resolution:g} m a cell"),
        ("written", f"{outputs.folder}: {PurePath(outputs.map).name}, "
                    f"{PurePath(outputs.png).name}, {PurePath(outputs.json).name} and a "
                    "trace-NAME.json of each drive"),
        ("verdict", summary.verdict),
    ]  # fmt: skip
    if outputs.state is not None:
        rows.insert(-1, ("state", f"{outputs.state}, for --continue"))
    for label, text in rows:
        say(f"{label:>13}  {text}")


def _line(one: JoinedDrive, *, is_apart: bool) -> str:
    """A drive in the report."""
    text = f"{one.drive.name}: {counted(one.summary.used, 'scans')}, "
    text += f"{one.summary.distance_m:,.1f} m, verdict {one.summary.verdict}"
    if one.loops_to:
        loops = ", ".join(f"{name} ({count:,})" for name, count in one.loops_to.items())
        text += f"; loops to {loops}"
    elif is_apart:
        text += "; could not be joined, and has a map of its own"
    return text
