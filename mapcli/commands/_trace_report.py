"""What `mapcli info` says about a pose trace."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from mapcli.formats.documents.json_document import document
from mapcli.formats.documents.load_trace import LoadedTrace, load_trace
from mapcli.formats.documents.pose_trace import torn_files
from mapcli.model.counting import counted
from mapcli.model.trace import PoseTrace
from mapcli.model.trajectory import Trajectory, wrap_angles

VERDICTS = "good", "doubtful", "bad"


def trace_report(file: str) -> tuple[list[str], dict[str, Any]]:
    """What to print about a trace of any format, and the same as a document.

    Raises:
        FormatError: as of `load_trace`.
    """
    loaded = load_trace(file)
    content = describe(loaded)
    digest = {Path(file).name: loaded.sha256}
    lines = [f"{file}: trace, {content['kind']}", *_lines(content)]
    return lines, document("mapcli.trace-info", digest, {}, content)


def describe(loaded: LoadedTrace) -> dict[str, Any]:
    """The facts about a trace, ready for JSON."""
    trajectory, trace = loaded.trajectory(), loaded.trace
    summary = loaded.content.get("summary")
    told = summary if isinstance(summary, dict) else {}
    score = trace.mean_score()
    return {
        "kind": loaded.form,
        "poses": len(trajectory),
        **_times(trajectory),
        **_way(trajectory),
        "statuses": dict(Counter(pose.status for pose in trace.poses if pose.status)),
        "with_odometry": sum(pose.odom is not None for pose in trace.poses),
        "mean_score": None if score is None else round(score, 4),
        "loops": len(trace.loops),
        "verdict": told.get("verdict") if told.get("verdict") in VERDICTS else None,
        "reasons": _texts(told.get("reasons"), "text"),
        "made_of": _texts(loaded.content.get("input"), "file") if loaded.has_summary() else [],
        "warnings": [*loaded.warnings, *_warnings(loaded, trace)],
    }


def _texts(items: Any, key: str) -> list[str]:
    """What a list of objects has under a key, where it is one."""
    objects = items if isinstance(items, list) else []
    return [str(one[key]) for one in objects if isinstance(one, dict) and key in one]


def _times(trajectory: Trajectory) -> dict[str, Any]:
    """When it was; null where the format has no times."""
    stamps = trajectory.stamps_ns
    if stamps is None or not len(stamps):
        return dict.fromkeys(("start_ns", "end_ns", "duration_s", "longest_gap_s"))
    gaps = np.diff(stamps)
    return {
        "start_ns": int(stamps[0]),
        "end_ns": int(stamps[-1]),
        "duration_s": round(int(stamps[-1] - stamps[0]) * 1e-9, 6),
        "longest_gap_s": round(int(gaps.max()) * 1e-9, 6) if len(gaps) else None,
    }


def _way(trajectory: Trajectory) -> dict[str, Any]:
    """Where it went."""
    poses = trajectory.poses
    if not len(poses):
        return {"distance_m": 0.0, "turned_deg": 0.0, "longest_step_m": 0.0, "end_to_start_m": 0.0,
                "bounds": None}  # fmt: skip
    steps, turns = np.diff(trajectory.driven()), wrap_angles(np.diff(poses[:, 2]))
    bounds = np.concatenate([poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)])
    return {
        "distance_m": round(float(steps.sum()), 6),
        "turned_deg": round(math.degrees(float(np.abs(turns).sum())), 3),
        "longest_step_m": round(float(steps.max(initial=0.0)), 6),
        "end_to_start_m": round(math.dist(poses[0, :2], poses[-1, :2]), 6),
        "bounds": [round(number, 6) + 0.0 for number in bounds.tolist()],
    }


def _warnings(loaded: LoadedTrace, trace: PoseTrace) -> Iterator[str]:
    for name in torn_files(Path(loaded.file)):
        yield f"{name} beside it is not the one that it was written with"
    if not trace.poses:
        yield "has no poses"
    stamps = [pose.stamp_ns for pose in trace.poses]
    back = sum(b < a for a, b in pairwise(stamps))
    if back:
        yield f"{counted(back, 'stamps')} before the one before"


def _lines(content: dict[str, Any]) -> Iterator[str]:
    """The facts for a person, one a line."""
    times = "without times"
    if content["duration_s"] is not None:
        first, last = content["start_ns"] * 1e-9, content["end_ns"] * 1e-9
        times = f"{content['duration_s']:,.1f} s, from {first:.3f} to {last:.3f} s"
    yield f"  poses       {content['poses']:,}, {times}"
    yield (
        f"  way         {content['distance_m']:,.1f} m and {content['turned_deg']:,.0f} deg of "
        f"turns; ends {content['end_to_start_m']:.2f} m from its start"
    )
    if content["bounds"]:
        x0, y0, x1, y1 = content["bounds"]
        yield f"  extent      x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m"
    yield from _scan_lines(content)
    if content["made_of"]:
        yield f"  made of     {', '.join(content['made_of'])}"
    if content["verdict"] is not None:
        yield f"  verdict     {content['verdict']}"
    yield from (f"  reason      {reason}" for reason in content["reasons"])
    yield from (f"  warning     {warning}" for warning in content["warnings"])


def _scan_lines(content: dict[str, Any]) -> Iterator[str]:
    statuses, score = content["statuses"], content["mean_score"]
    if statuses:
        shown = ", ".join(f"{count:,} {status}" for status, count in statuses.items())
        mean = "" if score is None else f"; mean score {score:.2f}"
        yield f"  scans       {shown}{mean}"
    if content["loops"]:
        yield f"  loops       {content['loops']:,} closed"
