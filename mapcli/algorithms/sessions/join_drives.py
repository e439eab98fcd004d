"""Several drives through one building become one map, and a trace of each in its frame.

1. Every drive was tracked by itself (`drive`). One after the other they are one trajectory, of
   which each drive is a piece that hangs on the rest by nothing (`joined_trajectory`).
2. Loop closure finds the pieces in each other, anywhere and at any heading, by submaps and with
   loops that must agree in pairs, as it finds a robot that was carried; loops with which the beams
   are explained worse are dropped (`slam.loop_closure`, `slam.loop_check`).
3. Drives that loops lead between belong together. The scans of all of them are refined at once
   (`slam.back_end`), and their maps become one (`fused_map`). Drives of which nobody knows how they
   lie to the others are kept apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapcli.algorithms.sessions.closed_drives import ClosedDrives
from mapcli.algorithms.sessions.drive import Drive
from mapcli.algorithms.sessions.drive_agreement import (
    compare_drives,
    confirmed_by,
    drive_reasons,
    with_names,
)
from mapcli.algorithms.sessions.fused_map import fuse
from mapcli.algorithms.sessions.joined_trajectory import joined_trajectory
from mapcli.algorithms.slam.back_end import piece_begins, refine_all
from mapcli.algorithms.slam.contradictions import Agreement, compare_scans
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.map_refinement import map_from_keyframes
from mapcli.algorithms.slam.scan_sample import sample_of_keyframes
from mapcli.algorithms.slam.slam_parameters import SlamParameters
from mapcli.algorithms.slam.verdict import map_reasons, verdict_of, wrong_lines
from mapcli.model.grid import GridMap
from mapcli.model.knowledge import NOTHING_KNOWN, Knowledge
from mapcli.model.pose import Pose2D
from mapcli.model.reason import MAP_REASONS
from mapcli.model.seen_part import seen_part
from mapcli.model.summary import ReplaySummary
from mapcli.model.trace import PoseTrace


@dataclass(frozen=True, eq=False)
class JoinedDrive:
    """A drive in the common frame.

    Attributes:
        drive: as it was by itself.
        trace: its poses in the common frame, and its own loops.
        summary: with the verdict on its part of the common map.
        loops_to: how many loops lead to each other drive, by name.
    """

    drive: Drive
    trace: PoseTrace
    summary: ReplaySummary
    loops_to: dict[str, int]


@dataclass(frozen=True, eq=False)
class JointMap:
    """Drives that belong together, the oldest first, and their map in the frame of that one."""

    drives: tuple[JoinedDrive, ...]
    map: GridMap


def join_drives(
    drives: Sequence[Drive],
    parameters: SlamParameters,
    knowledge: Knowledge = NOTHING_KNOWN,
    *,
    static: bool = False,
    progress: Callable[[int], None] = lambda submap: None,
) -> list[JointMap]:
    """Find drives in each other and make one map of those that belong together.

    Args:
        drives: the oldest first, each of one scan at least; where they disagree the later one is
            right.
        knowledge: what a person knows of them.
        static: keep of the map only what all drives agree on.
        progress: called with the number of each submap when its loops have been searched.

    Returns:
        The map of the oldest drive, with all that was joined with it, and those of the others.
    """
    closed = ClosedDrives(drives, parameters, knowledge, progress)
    return [_joint_map(closed, group, parameters, static=static) for group in closed.groups()]


def _joint_map(
    closed: ClosedDrives, group: list[int], parameters: SlamParameters, *, static: bool
) -> JointMap:
    """Refine the scans of drives that belong together, and make their map."""
    drives = [closed.drives[k] for k in group]
    poses = [pose for k in group for pose in closed.poses[k]]
    map_ = parameters.map
    trajectory = joined_trajectory(drives)
    refined = refine_all(trajectory, poses, map_.resolution, parameters.odometry)
    parts = parts_of(refined.trajectory, refined.poses)
    agreements = compare_drives(parts, refined.poses, trajectory.begins)
    joined = tuple(
        _joined_drive(closed, k, part, group[0], others)
        for k, part, others in zip(group, parts, agreements, strict=True)
    )
    maps = [map_from_keyframes(part, part.poses, map_).to_grid_map() for part in parts]
    path = np.array([(pose.x, pose.y) for pose in refined.poses])
    return JointMap(joined, seen_part(fuse(maps, static=static), path))


def parts_of(joined: TrackedTrajectory, poses: Sequence[Pose2D]) -> list[TrackedTrajectory]:
    """The drives of a joined trajectory apart again, at new poses: of each its poses, and its
    keyframes by the numbers of its own scans."""
    parts = []
    for begin, end in joined.spans():
        keyframes = []
        for one in joined.keyframes:
            if begin <= one.scan < end:
                lost_since = None if one.lost_since is None else one.lost_since - begin
                own = replace(one, scan=one.scan - begin, pose=poses[one.scan])
                keyframes.append(replace(own, lost_since=lost_since or None))  # 0: the drive begins
        parts.append(TrackedTrajectory(list(poses[begin:end]), keyframes=keyframes))
    return parts


def _joined_drive(
    closed: ClosedDrives, k: int, part: TrackedTrajectory, oldest: int, others: Sequence[Agreement]
) -> JoinedDrive:
    """Drive k with its poses in the map of the oldest one.

    Args:
        part: of the trajectory in the map; others: how its scans agree with all drives.
    """
    drive = closed.drives[k]
    poses = tuple(
        replace(traced, pose=pose) for traced, pose in zip(drive.poses, part.poses, strict=True)
    )
    loops = tuple(link.loop for link in closed.links if (link.from_drive, link.to_drive) == (k, k))
    trace = PoseTrace(poses, loops)
    lasting = [one for one in drive.summary.reasons if one.kind not in MAP_REASONS]
    unjoined = closed.unjoined(k, oldest)
    own = compare_scans(sample_of_keyframes(part.keyframes), part.poses)
    of_map = (
        *map_reasons(
            poses, confirmed_by(own, others), unjoined=unjoined, begins=piece_begins(part)
        ),
        *drive_reasons(poses, own, others),
        *wrong_lines(closed.wrong_lines, drive.summary.duration_s),
    )
    reasons = (*(with_names(one, drive.name) for one in of_map), *lasting)
    summary = replace(
        drive.summary, distance_m=trace.distance(), loops=len(loops), loop_check=None,
        unjoined=len(unjoined), verdict=verdict_of(reasons), reasons=reasons,
    )  # fmt: skip
    return JoinedDrive(drive, trace, summary, closed.loops_to(k))
