"""Loading a trajectory: the content decides which format it is, not the suffix.

Our own `trace.json`, the formats of `trajectory_text`, `t x y theta` text, logs of messages (MCAP,
ROS bags) with poses such as those that `mapcli simulate` writes, and CARMEN logs with true poses.
Plain or packed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mapcli.errors import FormatError
from mapcli.formats.documents.pose_trace import read_trace_poses
from mapcli.formats.documents.trajectory_text import EXPECTED, read_trajectory
from mapcli.formats.file_kind import Role, expecting
from mapcli.formats.file_role import log_format_of
from mapcli.formats.input import SNIFFED_BYTES, read_file, sha256_of, spooled, unpacked
from mapcli.model.trajectory import Trajectory

if TYPE_CHECKING:
    from mapcli.formats.logs.log import Source


@dataclass(frozen=True, eq=False)
class LoadedTrajectory:
    """A trajectory, the SHA-256 of its file, and what was wrong with it, a sentence per kind."""

    trajectory: Trajectory
    sha256: str
    warnings: tuple[str, ...] = ()


def load_trajectory(path: str | Path, topic: str | None = None) -> LoadedTrajectory:
    """Load a trajectory from trace.json, TUM, KITTI, g2o, CSV, or the poses in a log.

    `-` is standard input.

    Args:
        topic: where the poses of a log are; None finds the only candidate.

    Raises:
        FormatError: no such file, of no known format, malformed, without poses, or with stamps
            that go back.
        DataError: no topic with poses, or no obvious one.
    """
    path = str(path)
    if Path(path).is_dir():
        return logged_trajectory(path, topic)
    with expecting(path, "a trace", Role.TRACE):
        packed = read_file(Path(path), EXPECTED)
        data, digest = unpacked(packed, path), sha256_of(packed)
        if (truth := _true_poses(data, topic)) is not None:
            return LoadedTrajectory(truth, digest)
        if log_format_of(data) is None:
            return LoadedTrajectory(_from_text(data, path, topic), digest)
    return logged_trajectory(path, topic, data, digest)


def _true_poses(data: bytes, topic: str | None) -> Trajectory | None:
    """Those of a CARMEN log; None if it is none, or has none."""
    from mapcli.formats.logs.carmen_lines import looks_like_carmen
    from mapcli.formats.logs.carmen_truth import TRUE_POSES, read_true_poses

    is_asked_for = topic in (None, TRUE_POSES.decode())
    return (
        read_true_poses(data) if is_asked_for and looks_like_carmen(data[:SNIFFED_BYTES]) else None
    )


def _from_text(data: bytes, file: str, topic: str | None) -> Trajectory:
    if topic is not None:
        raise FormatError(f"has no topic {topic}", file=file, expected="a log of messages")
    if data.lstrip()[:1] != b"{":
        return read_trajectory(data, file)
    trajectory = read_trace_poses(data, file)
    _check(trajectory, file)
    return trajectory


def logged_trajectory(
    path: str, topic: str | None, data: bytes = b"", digest: str | None = None
) -> LoadedTrajectory:
    """The poses of a log of messages; raises as `load_trajectory`.

    Args:
        data: what was read of standard input.
        digest: SHA-256 of the file, where it is known; else that of all files of a folder.
    """
    from mapcli.formats.logs.log import Source
    from mapcli.formats.logs.open_log import sources_of
    from mapcli.formats.logs.pose_reader import read_logged_poses
    from mapcli.model.log import Damage

    if path == "-":
        copy = spooled([data])
        sources = [Source(path, copy.path, copy)]
    else:
        sources = list(sources_of(path))
    damage = Damage()
    trajectory = read_logged_poses(sources, topic, damage)
    sha256 = digest or _digest_of(sources)
    return LoadedTrajectory(trajectory, sha256, tuple(damage.lines()))


def _digest_of(sources: Iterable[Source]) -> str:
    """SHA-256 of files one after the other."""
    digest = hashlib.sha256()
    for source in sources:
        with source.path.open("rb") as file:
            for block in iter(lambda: file.read(1 << 20), b""):
                digest.update(block)
    return digest.hexdigest()


def _check(trajectory: Trajectory, file: str) -> None:
    """Refuse a trace without poses, or one whose stamps go back."""
    stamps = trajectory.stamps_ns
    assert stamps is not None
    if not len(trajectory):
        raise FormatError("has no poses", file=file, expected=EXPECTED)
    back = np.flatnonzero(np.diff(stamps) < 0)
    if len(back):
        k = int(back[0]) + 1
        raise FormatError(
            f"the stamp goes back from {stamps[k - 1]} to {stamps[k]} ns",
            file=file, where=f"pose {k}", expected="poses in time order",
        )  # fmt: skip
