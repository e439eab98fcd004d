"""The back end: what is done when the log has ended.

1. Loop closure (`loop_closure`): where did the robot come back, and what does the pose graph say
   then about the submaps' poses? Loops with which the beams are explained worse are dropped
   (`loop_check`).
2. Corrections (`submaps.apply_corrections`): every scan moves with its submap.
3. Map refinement: all scans are fitted at once to the surfels of the whole map
   (`map_refinement`), point by point where beams were taken one after another
   (`sweep_refinement`).
4. The map is made anew from the keyframes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.known_places import KnownPlaces
from mapcli.algorithms.slam.loop_check import keep_loops_that_help
from mapcli.algorithms.slam.loop_closure import LoopCloser, LoopClosureResult, LoopParameters
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.map_refinement import map_from_keyframes, refine
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.submaps import apply_corrections
from mapcli.algorithms.slam.sweep_refinement import Refined, refine_sweeps
from mapcli.model.loop_check import LoopCheck
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import information_from_covariance
from mapcli.model.sweep_summary import Crispness
from mapcli.model.trace import Loop


@dataclass(frozen=True, slots=True, eq=False)
class BackEndResult:
    """The result of a run.

    Attributes:
        poses: of every scan, in the map; the first is where it was tracked.
        grid: the map that the keyframes make at these poses.
        loops: that were closed, between scans.
        crispness: what deskewing was worth; None if all beams of a scan were taken at once.
        loop_check: what loops were worth; None if none was found.
        unjoined: first and last scans of pieces that no loop has joined with the first one.
        wrong_lines: what a person told that is not so.
        begins: first scans of the pieces that begin after one was lost.
    """

    poses: list[Pose2D]
    grid: OccupancyGrid
    loops: tuple[Loop, ...] = ()
    crispness: Crispness | None = None
    unjoined: tuple[tuple[int, int], ...] = ()
    loop_check: LoopCheck | None = None
    wrong_lines: tuple[str, ...] = ()
    begins: tuple[int, ...] = ()


def finalise(
    trajectory: TrackedTrajectory,
    map_: MapParameters,
    loops: LoopParameters,
    odometry: MotionModel,
    progress: Callable[[int], None] = lambda submap: None,
    places: KnownPlaces | None = None,
) -> BackEndResult:
    """Close the loops of a trajectory, refine its poses, make the map.

    Args:
        trajectory: with one keyframe at least.
        progress: called with the number of each submap when its loops have been searched.
        places: that a person knows.
    """
    closer = LoopCloser(trajectory.keyframes, map_, loops, places)
    closer.run(progress)
    check = keep_loops_that_help(closer, trajectory)
    closed = closer.result()
    poses = apply_corrections(trajectory, closed.submaps, closed.origins)
    refined = refine_all(trajectory, poses, map_.resolution, odometry)
    grid = map_from_keyframes(refined.trajectory, refined.poses, map_)
    loops_closed = loops_between_scans(trajectory, closed)
    unjoined = unjoined_scans(trajectory, closed)
    return BackEndResult(
        refined.poses, grid, loops_closed, refined.crispness, unjoined, check,
        tuple(closer.wrong_lines()), tuple(piece_begins(trajectory)),
    )  # fmt: skip


def refine_all(
    trajectory: TrackedTrajectory, poses: list[Pose2D], cell: float, odometry: MotionModel
) -> Refined:
    """Fit all scans at once; the first stays where it was tracked.

    Args:
        poses: of every scan, loops closed; cell: metres along a side of a surfel's cell.
    """
    if trajectory.sweeps:
        refined = refine_sweeps(trajectory, poses, cell, odometry)
    else:
        refined = Refined(trajectory, refine(trajectory, poses, cell, odometry))
    first, poses = trajectory.poses[0], refined.poses
    start = first.compose(poses[0].inverse())
    return replace(refined, poses=[first, *(start.compose(pose) for pose in poses[1:])])


def loops_between_scans(
    trajectory: TrackedTrajectory, closed: LoopClosureResult
) -> tuple[Loop, ...]:
    """Loops between submaps as a trace keeps them: between the scans at the submaps' origins."""
    scans = [trajectory.keyframes[submap.origin].scan for submap in closed.submaps]
    return tuple(
        Loop(
            scans[edge.from_],
            scans[edge.to],
            edge.measured,
            score,
            information_from_covariance(edge.covariance),
        )
        for edge, score in zip(closed.loops, closed.scores, strict=True)
    )


def piece_begins(trajectory: TrackedTrajectory) -> list[int]:
    """The first scans of the pieces but the first one."""
    return [one.lost_since for one in trajectory.keyframes if one.lost_since is not None]


def unjoined_scans(
    trajectory: TrackedTrajectory, closed: LoopClosureResult
) -> tuple[tuple[int, int], ...]:
    """First and last scans of the pieces that no loop has joined with the first one."""
    begins = piece_begins(trajectory)
    ends = [*(scan - 1 for scan in begins[1:]), len(trajectory.poses) - 1]
    pieces = dict(zip(begins, ends, strict=False))  # the first piece begins with nothing lost
    firsts = (trajectory.keyframes[closed.submaps[k].first].lost_since for k in closed.unjoined)
    return tuple((first, pieces[first]) for first in firsts if first is not None)
