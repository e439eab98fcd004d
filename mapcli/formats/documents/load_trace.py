"""Whole traces from any format, as the document `mapcli.pose-trace`, and back into any format.

`load_trajectory` reads the poses alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePath
from typing import Any

from mapcli.errors import FormatError
from mapcli.formats.documents.json_document import read_document
from mapcli.formats.documents.load_trajectory import (
    LoadedTrajectory,
    logged_trajectory,
)
from mapcli.formats.documents.pose_trace import (
    POSE_TRACE,
    poses_of,
    rewritten,
    trace_bytes,
    trace_document,
    trace_of,
)
from mapcli.formats.documents.trajectory_text import (
    EXPECTED,
    WRITERS,
    dump_trajectory,
    read_text_trace,
)
from mapcli.formats.file_kind import Role, expecting
from mapcli.formats.file_role import log_format_of
from mapcli.formats.input import read_file, sha256_of, unpacked
from mapcli.model.isometry import Isometry
from mapcli.model.pose import Pose2D
from mapcli.model.trace import PoseTrace, TracedPose
from mapcli.model.trajectory import Trajectory

TRACE_SUFFIXES = (".json", *WRITERS)

LOGGED = "a log"
"""The form of poses that are messages of a log."""


def trace_suffix(file: str) -> str:
    """By which the format of an output goes: JSON, unless its name says another one."""
    suffix = PurePath(file).suffix.lower()
    return suffix if suffix in WRITERS else ".json"


HELD = {
    ".json": ("times", "odometry", "scores", "statuses", "loops", "summary"),
    ".csv": ("times", "odometry", "scores", "statuses"),
    ".tum": ("times",),
    ".kitti": (),
    ".g2o": ("loops",),
}
"""Suffix -> what its format has beside the poses."""


@dataclass(frozen=True, eq=False)
class LoadedTrace:
    """A trace of any format.

    Attributes:
        file: its name.
        content: it as a document `mapcli.pose-trace`.
        form: the name of its format, for people.
        has_times: whether the stamps are its own; without, pose k has the stamp of k seconds.
        sha256: of its file.
        warnings: what was wrong with it, a sentence per kind.
        read: its poses and loops, where they were read before the document was made.
    """

    file: str
    content: dict[str, Any]
    form: str
    has_times: bool
    sha256: str
    warnings: tuple[str, ...] = ()
    read: PoseTrace | None = None

    @cached_property
    def trace(self) -> PoseTrace:
        """Its poses and loops. Raises as `trace_of`."""
        return self.read or trace_of(self.content, self.file)

    def trajectory(self) -> Trajectory:
        """The poses as arrays."""
        trajectory = self.trace.trajectory()
        return trajectory if self.has_times else Trajectory(trajectory.poses)

    def has(self) -> set[str]:
        """What it has beside the poses, in the words of `HELD`."""
        poses = self.trace.poses
        found = {
            "times": self.has_times,
            "odometry": any(pose.odom for pose in poses),
            "scores": any(pose.score is not None for pose in poses),
            "statuses": any(pose.status for pose in poses),
            "loops": bool(self.trace.loops),
            "summary": self.has_summary(),
        }
        return {name for name, is_there in found.items() if is_there}

    def has_summary(self) -> bool:
        """Whether the command that made it says how that went."""
        summary = self.content.get("summary")
        return isinstance(summary, dict) and "converted_from" not in summary

    def lost_in(self, suffix: str) -> list[str]:
        """What of it the format of a suffix cannot hold."""
        return [name for name in HELD[".json"] if name in self.has() and name not in HELD[suffix]]


def load_trace(path: str | Path, topic: str | None = None) -> LoadedTrace:
    """Load a trace from trace.json, TUM, KITTI, g2o, CSV, or the poses in a log.

    `-` is standard input; `topic` as of `load_trajectory`.

    Raises:
        FormatError, DataError: as of `load_trajectory`; a loop or odometry that is none.
    """
    file = str(path)
    if Path(file).is_dir():
        return _of_log(logged_trajectory(file, topic), file)
    with expecting(file, "a trace", Role.TRACE):
        packed = read_file(Path(file), EXPECTED)
        data, digest = unpacked(packed, file), sha256_of(packed)
        is_log = log_format_of(data) is not None
        if topic is not None and not is_log:
            raise FormatError(f"has no topic {topic}", file=file, expected="a log of messages")
        if data.lstrip()[:1] == b"{":
            content = read_document(data, file, POSE_TRACE)
            poses_of(content, file)
            return LoadedTrace(file, content, POSE_TRACE, True, digest)
        if not is_log:
            text = read_text_trace(data, file)
            content = _content(text.trace, text.form, file, digest)
            return LoadedTrace(file, content, text.form, text.has_times, digest, (), text.trace)
    return _of_log(logged_trajectory(file, topic, data, digest), file)


def _of_log(loaded: LoadedTrajectory, file: str) -> LoadedTrace:
    trajectory = loaded.trajectory
    stamps = trajectory.stamps_ns
    assert stamps is not None, "messages have stamps"
    rows = zip(stamps.tolist(), trajectory.poses.tolist(), strict=True)
    trace = PoseTrace(tuple(TracedPose(t, Pose2D(*pose), None, None, None) for t, pose in rows))
    content = _content(trace, LOGGED, file, loaded.sha256)
    return LoadedTrace(file, content, LOGGED, True, loaded.sha256, loaded.warnings, trace)


def _content(trace: PoseTrace, form: str, file: str, digest: str) -> dict[str, Any]:
    """A document of a trace of another format."""
    poses = trace.poses
    duration_s = (poses[-1].stamp_ns - poses[0].stamp_ns) * 1e-9
    summary = {
        "converted_from": form,
        "distance_m": round(trace.distance(), 6),
        "duration_s": round(duration_s, 6),
    }
    content = trace_document(trace, {PurePath(file).name: digest}, {}, summary)
    return {**content, "poses": list(content["poses"])}


def dump_trace(loaded: LoadedTrace, suffix: str) -> bytes:
    """The bytes of a trace in the format of a suffix."""
    if suffix != ".json":
        return dump_trajectory(loaded.trace, f"trace{suffix}")
    content = rewritten(loaded.content, loaded.file, loaded.sha256)
    return trace_bytes(content, loaded.file)


def move_trace(path: str | Path, motion: Isometry, suffix: str = ".json") -> bytes:
    """The bytes of a trace of any format after a rigid motion of its map, maybe with a mirror
    image, in the format of a suffix; see `rewritten`.

    Raises:
        FormatError: as of `load_trace`; odometry, loops or parameters that are none; a number
            anywhere that JSON does not have.
    """
    loaded = load_trace(path)
    content = rewritten(loaded.content, loaded.file, loaded.sha256, motion)
    if suffix == ".json":
        return trace_bytes(content, loaded.file)
    return dump_trajectory(trace_of(content, loaded.file), f"trace{suffix}")
