"""Pose traces (`mapcli.pose-trace`): the pose of the robot in the map at every scan."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from mapcli.errors import FormatError
from mapcli.formats.documents.json_document import document, json_bytes, read_document
from mapcli.formats.input import sha256_of
from mapcli.model.isometry import Isometry
from mapcli.model.pose import FARTHEST_M, Pose2D
from mapcli.model.trace import STATUSES, Loop, PoseTrace, TracedPose
from mapcli.model.trajectory import Trajectory

POSE_TRACE = "mapcli.pose-trace"


def read_trace_poses(data: bytes, file: str) -> Trajectory:
    """The poses of a trace.

    Raises:
        FormatError: not a trace, or a pose without its numbers.
    """
    return poses_of(read_document(data, file, POSE_TRACE), file)


def poses_of(content: Mapping[str, Any], file: str) -> Trajectory:
    """The poses of a trace that is read already; raises as `read_trace_poses`."""
    poses = content.get("poses")
    if not isinstance(poses, list):
        raise FormatError("has no list of poses", file=file, expected=POSE_TRACE)
    rows = []
    for k, pose in enumerate(poses):
        try:
            rows.append((int(pose["stamp_ns"]), *(float(pose[key]) for key in ("x", "y", "theta"))))
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise _bad_pose(file, k, error) from error
    stamps = np.array([row[0] for row in rows], dtype=object)
    numbers = np.array([row[1:] for row in rows], dtype=np.float64).reshape(-1, 3)
    bad = ~(np.abs(numbers) < FARTHEST_M).all(axis=1) | (np.abs(stamps) >= 2**63)
    if bad.any():
        raise _bad_pose(file, int(np.argmax(bad)), None)
    return Trajectory(numbers, stamps.astype(np.int64))


def torn_files(trace: Path) -> list[str]:
    """Files beside a trace that are not those that were written with it, by their digests: the
    run that wrote them was killed, or another one wrote over them. Empty where nothing is known.
    """
    if not trace.is_file():  # nothing lies beside a pipe
        return []
    try:
        content = json.loads(trace.read_bytes())
        files = content["files"] if content["format"] == POSE_TRACE else []
        named = {str(one["file"]): str(one["sha256"]) for one in files}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []
    beside = {name: _digest(trace.parent / Path(name).name) for name in named}
    return [name for name, found in beside.items() if found not in (None, named[name])]


def _digest(path: Path) -> str | None:
    """Of a file that can be read."""
    with suppress(OSError):
        return sha256_of(path.read_bytes()) if path.is_file() else None
    return None


def rewritten(
    content: Mapping[str, Any], file: str, digest: str, motion: Isometry | None = None
) -> dict[str, Any]:
    """A trace as a new document that was made of `file`, after a rigid motion of its map.

    The poses move with the map. Odometry and loops are relative and stay as they are, except that
    a mirror changes the sign of their y and theta.

    Raises:
        FormatError: odometry, loops or parameters that are none.
    """
    poses, loops = content["poses"], content.get("loops") or []
    head = document(POSE_TRACE, {Path(file).name: digest}, {}, {})
    parameters = {} if motion is None else {
        "moved_by": {**_pose(motion.pose), "mirrored": motion.mirrored}
    }  # fmt: skip
    if motion is not None:
        poses = []
        for k, pose in enumerate(content["poses"]):
            with _told(file, f"pose {k}", "odom of x, y and theta, or null"):
                poses.append(_moved(pose, motion))
        with _told(file, "loops", "a list of loops with dy and dtheta"):
            loops = [_moved_loop(loop, motion) for loop in loops]
    with _told(file, "parameters", "names and values"):
        head["parameters"] = {**content.get("parameters", {}), **parameters}
    rest = {key: value for key, value in content.items() if key not in head}
    return {**head, **rest, "files": [], "loops": loops, "poses": poses}


def trace_bytes(content: Mapping[str, Any], file: str) -> bytes:
    """The document as JSON.

    Raises:
        FormatError: a number that JSON does not have.
    """
    with _told(file, None, "finite numbers"):
        written = json_bytes(content)
    return written


def trace_of(content: Mapping[str, Any], file: str) -> PoseTrace:
    """The records of a document whose poses `read_trace_poses` has read.

    Raises:
        FormatError: odometry, a score or a loop that is none.
    """
    poses = []
    for k, pose in enumerate(content["poses"]):
        with _told(file, f"pose {k}", "odom of x, y and theta, or null; a score"):
            odom, score = pose.get("odom"), pose.get("score")
            poses.append(
                TracedPose(
                    int(pose["stamp_ns"]),
                    _pose_of(pose),
                    _pose_of(odom) if odom else None,
                    None if score is None else float(score),
                    STATUSES.get(str(pose.get("status"))),
                )
            )
    with _told(file, "loops", "a list of loops"):
        loops = [_loop_of(loop, len(poses)) for loop in content.get("loops") or []]
    return PoseTrace(tuple(poses), tuple(loops))


def _loop_of(loop: Mapping[str, Any], poses: int) -> Loop:
    start, end, score = int(loop["from"]), int(loop["to"]), loop.get("score")
    if not (0 <= start < poses and 0 <= end < poses):
        raise ValueError(start, end)
    motion = Pose2D(*(float(loop[key]) for key in ("dx", "dy", "dtheta")))
    return Loop(start, end, motion, None if score is None else float(score))


def _pose_of(numbers: Mapping[str, Any]) -> Pose2D:
    return Pose2D(*(float(numbers[key]) for key in ("x", "y", "theta")))


@contextmanager
def _told(file: str, where: str | None, expected: str) -> Iterator[None]:
    """What a value of another type makes Python raise becomes a FormatError."""
    try:
        yield
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        missing = f"no {error}" if isinstance(error, KeyError) else "a value of another kind"
        raise FormatError(f"has {missing}", file=file, where=where, expected=expected) from error


def _moved_loop(loop: dict[str, Any], motion: Isometry) -> dict[str, Any]:
    return loop | ({"dy": -loop["dy"], "dtheta": -loop["dtheta"]} if motion.mirrored else {})


def _moved(pose: dict[str, Any], motion: Isometry) -> dict[str, Any]:
    moved = motion.apply_pose(_pose_of(pose))
    odom = pose.get("odom")
    if odom and motion.mirrored:
        odom = odom | {"y": -odom["y"], "theta": -odom["theta"]}
    return pose | _pose(moved) | ({"odom": odom} if "odom" in pose else {})


def _bad_pose(file: str, index: int, error: Exception | None) -> FormatError:
    missing = f"no {error}" if isinstance(error, KeyError) else "a bad number"
    return FormatError(
        f"has {missing}", file=file, where=f"pose {index}", expected="stamp_ns, x, y and theta"
    )


def trace_document(
    trace: PoseTrace,
    inputs: Mapping[str, str],
    parameters: Mapping[str, Any],
    summary: Mapping[str, Any],
    siblings: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Any]:
    """A pose trace as a document of format `mapcli.pose-trace` (see `json_document`).

    `siblings` are the files that were written with it into its folder, name -> SHA-256.

    Its poses are an iterator, for `json_pieces`: there may be hundreds of thousands.

    Lengths and angles have six decimals, scores four: micrometres are finer than any laser, and
    such numbers are the same on every machine.
    """
    loops = [
        {
            "from": loop.from_,
            "to": loop.to,
            **{f"d{name}": value for name, value in _pose(loop.pose).items()},
            "score": None if loop.score is None else round(loop.score, 4),
        }
        for loop in trace.loops
    ]
    files = [{"file": name, "sha256": digest} for name, digest in siblings.items()]
    content = {
        "summary": summary,
        "files": files,
        "loops": loops,
        "poses": map(_row, trace.poses),
    }
    return document(POSE_TRACE, inputs, parameters, content)


def _row(traced: TracedPose) -> dict[str, Any]:
    return {
        "stamp_ns": traced.stamp_ns,
        **_pose(traced.pose),
        "odom": None if traced.odom is None else _pose(traced.odom),
        "score": None if traced.score is None else round(traced.score, 4),
        "status": traced.status,
    }


def _pose(pose: Pose2D) -> dict[str, float]:
    # + 0.0: no -0.0, whose sign is noise.
    return {
        "x": round(pose.x, 6) + 0.0,
        "y": round(pose.y, 6) + 0.0,
        "theta": round(pose.theta, 6) + 0.0,
    }
