"""Pose traces for other tools: TUM, KITTI, g2o and CSV, by suffix.

    .tum    `t x y z qx qy qz qw`, one pose a line, seconds with all nine decimals (evo, rpg)
    .kitti  the upper 3 x 4 of the pose matrix, row by row, without times (evo, KITTI devkit)
    .g2o    VERTEX_SE2 and EDGE_SE2: the poses, the steps between them, the loops (g2o, GTSAM)
    .csv    everything that `trace.json` has, with a head line

Numbers have six decimals, micrometres: finer than any laser, and the same on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import PurePath

from mapcli.errors import DataError
from mapcli.model.pose import Pose2D
from mapcli.model.trace import PoseTrace

CSV_HEAD = "stamp_ns,x,y,theta,odom_x,odom_y,odom_theta,score,status"
STEP_INFORMATION = "10000 0 0 10000 0 40000"
"""Of an edge: 1 cm and 0.3 degrees of standard deviation, upper triangle."""


def dump_trajectory(trace: PoseTrace, path: str | PurePath) -> bytes:
    """The trace in the format that the file's suffix names; CSV for `-`.

    Raises:
        DataError: a suffix of no known format.
    """
    suffix = ".csv" if str(path) == "-" else PurePath(path).suffix.lower()
    if suffix not in WRITERS:
        known = " ".join(WRITERS)
        raise DataError(f"{str(path)!r} says no trace format", expected=f"a name in {known}")
    return "".join(f"{line}\n" for line in WRITERS[suffix](trace)).encode()


def _tum(trace: PoseTrace) -> Iterator[str]:
    for traced in trace.poses:
        seconds, nanoseconds = divmod(traced.stamp_ns, 1_000_000_000)
        pose = traced.pose
        z, w = math.sin(pose.theta / 2), math.cos(pose.theta / 2)
        place, turn = f"{_metres(pose.x)} {_metres(pose.y)}", f"{_ratio(z)} {_ratio(w)}"
        yield f"{seconds}.{nanoseconds:09d} {place} 0 0 0 {turn}"


def _kitti(trace: PoseTrace) -> Iterator[str]:
    for traced in trace.poses:
        pose = traced.pose
        cos, sin = math.cos(pose.theta), math.sin(pose.theta)
        upper = f"{_ratio(cos)} {_ratio(-sin)} 0 {_metres(pose.x)}"
        yield f"{upper} {_ratio(sin)} {_ratio(cos)} 0 {_metres(pose.y)} 0 0 1 0"


def _g2o(trace: PoseTrace) -> Iterator[str]:
    poses = [traced.pose for traced in trace.poses]
    for k, pose in enumerate(poses):
        yield f"VERTEX_SE2 {k} {_numbers(pose)}"
    for k, (a, b) in enumerate(pairwise(poses)):
        yield f"EDGE_SE2 {k} {k + 1} {_numbers(a.between(b))} {STEP_INFORMATION}"
    for loop in trace.loops:
        yield f"EDGE_SE2 {loop.from_} {loop.to} {_numbers(loop.pose)} {STEP_INFORMATION}"


def _csv(trace: PoseTrace) -> Iterator[str]:
    yield CSV_HEAD
    for traced in trace.poses:
        odom = _numbers(traced.odom, ",") if traced.odom else ",,"
        score = "" if traced.score is None else f"{traced.score:.4f}"
        yield f"{traced.stamp_ns},{_numbers(traced.pose, ',')},{odom},{score},{traced.status}"


def _numbers(pose: Pose2D, separator: str = " ") -> str:
    return separator.join(_metres(value) for value in (pose.x, pose.y, pose.theta))


def _metres(value: float) -> str:
    return f"{round(value, 6) + 0.0:.6f}"  # + 0.0: no "-0.000000", whose sign is noise


def _ratio(value: float) -> str:
    return f"{round(value, 9) + 0.0:.9f}"


WRITERS = {".tum": _tum, ".kitti": _kitti, ".g2o": _g2o, ".csv": _csv}
"""Suffix -> the lines of a file."""
