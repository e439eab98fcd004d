"""Walls are straight and perpendicular: what a robot can make of that (Sect. 9.4, Fig. 9.11).

A robot follows walls, and the heading error of its odometry bends straight walls. Where it turns
sharply, two walls meet at 90 degrees. What its heading does between corners is drift. The lengths
of the walls remain, and if the robot came back to where it started, they are adjusted until the
loop closes: each wall in proportion to its length.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import numpy as np
import shapely

from mapcli.algorithms.maps.wall_segments import (
    DIAGONAL,
    QUARTER,
    WallSegment,
    bend_of,
    corner_point,
    straight_segments,
    turn_between,
    walls_of,
)
from mapcli.errors import DataError
from mapcli.model.counting import counted
from mapcli.model.pose import Pose2D
from mapcli.model.rectified import Floats, RectifiedTrace, Wall
from mapcli.model.trace import PoseTrace, TracedPose
from mapcli.model.trajectory import Trajectory

LOOP_SHARE = 0.1
"""A trace whose ends are closer than this share of its length is taken for a loop."""


@dataclass(frozen=True)
class RectifyParameters:
    """What counts as a wall.

    Attributes:
        tolerance: how far the trace may be from a straight segment, metres; None for a hundredth
            of the trace's extent.
        shortest: metres of the shortest wall; None for a twentieth of the extent.
        loop: whether the end is where the start is; None finds out.
    """

    tolerance: float | None = None
    shortest: float | None = None
    loop: bool | None = None


def rectify_trace(poses: Floats, parameters: RectifyParameters | None = None) -> RectifiedTrace:
    """Make the walls of a trace straight, its corners right angles, and close its loop.

    Args:
        poses: shape (n, 3), x, y, theta, of a robot that follows walls.

    Raises:
        DataError: a trace that goes nowhere, follows no straight walls, or is to be closed and
            never comes back.
    """
    p = _filled_in(parameters or RectifyParameters(), poses)
    assert p.tolerance is not None
    assert p.shortest is not None
    groups = walls_of(straight_segments(poses, p.tolerance), p.shortest)
    joints = [
        poses[0, :2],
        *(corner_point(a[-1], b[0]) for a, b in pairwise(groups)),
        poses[-1, :2],
    ]
    chains = [
        np.array([start, *(s.end for s in group[:-1]), end])
        for group, (start, end) in zip(groups, pairwise(joints), strict=True)
    ]
    corners = [turn_between(a[-1], b[0]) for a, b in pairwise(groups)]
    quarters = list(accumulate((round(turn / QUARTER) for turn in corners), initial=0))
    measured = [float(np.hypot(*np.diff(chain, axis=0).T).sum()) for chain in chains]
    square = _closing_error(measured, quarters)
    gap_square = math.hypot(*square)
    loop = gap_square <= LOOP_SHARE * sum(measured) if p.loop is None else p.loop
    lengths = _close_loop(measured, quarters, square) if loop else measured
    theta = _first_direction(poses, groups[0][0])
    walls = tuple(
        Wall(q, m, length, bend_of(poses, g, p.tolerance), corner)
        for q, m, length, g, corner in zip(
            quarters, measured, lengths, groups, [*corners, None], strict=True
        )
    )
    ends = _wall_ends(poses[0, :2], theta, walls)
    moved = _poses_on_walls(poses, groups, chains, ends, theta, walls)
    gap_before = math.dist(poses[0, :2], poses[-1, :2])
    return RectifiedTrace(
        moved, walls, ends, loop, gap_before, gap_square, math.dist(ends[0], ends[-1])
    )


def rectified_trace(before: Trajectory, rectified: RectifiedTrace) -> PoseTrace:
    """The rectified poses as a trace, each with the pose that it had as its odometry."""
    assert before.stamps_ns is not None, "a trace with times"
    rows = zip(
        before.stamps_ns.tolist(), rectified.poses.tolist(), before.poses.tolist(), strict=True
    )
    return PoseTrace(
        tuple(
            TracedPose(stamp, Pose2D(*after), Pose2D(*was), None, "odometry")
            for stamp, after, was in rows
        )
    )


def _first_direction(poses: Floats, first: WallSegment) -> float:
    """The first wall's: where the robot set out along it, its heading has the least error."""
    heading = float(poses[first.first, 2])
    off = (heading - first.angle + math.pi) % math.tau - math.pi
    return heading if abs(off) < DIAGONAL[0] else first.angle


def _filled_in(p: RectifyParameters, poses: Floats) -> RectifyParameters:
    extent = float(np.ptp(poses[:, :2], axis=0).max()) if len(poses) else 0.0
    if len(poses) < 2 or extent == 0:
        place = " at one place" if len(poses) > 1 else ""
        raise DataError(f"{counted(len(poses), 'poses')}{place}", expected="a drive along walls")
    tolerance = extent / 100 if p.tolerance is None else p.tolerance
    shortest = extent / 20 if p.shortest is None else p.shortest
    return replace(p, tolerance=tolerance, shortest=shortest)


def _closing_error(lengths: Sequence[float], quarters: Sequence[int]) -> tuple[float, float]:
    """Where walls of such lengths lead to: along the first wall, and to the left of it."""
    steps = [_unit(q) for q in quarters]
    along = sum(length * x for length, (x, _) in zip(lengths, steps, strict=True))
    left = sum(length * y for length, (_, y) in zip(lengths, steps, strict=True))
    return along, left


def _unit(quarter: int) -> tuple[int, int]:
    return ((1, 0), (0, 1), (-1, 0), (0, -1))[quarter % 4]


def _close_loop(
    lengths: Sequence[float], quarters: Sequence[int], gap: tuple[float, float]
) -> list[float]:
    """The lengths with the gap spread over the walls in its direction, by their lengths.

    Raises:
        DataError: all walls of a direction lead the same way, so that the drive cannot end where
            it began.
    """
    closed = list(lengths)
    for axis in range(2):
        whole = sum(length for length, q in zip(lengths, quarters, strict=True) if _unit(q)[axis])
        if whole and abs(gap[axis]) > 0.9 * whole:
            raise DataError(
                f"it goes {abs(gap[axis]):.2f} m one way and never back",
                expected="a drive that ends where it began",
            )
        for k, q in enumerate(quarters):
            if whole and _unit(q)[axis]:
                closed[k] *= 1 - _unit(q)[axis] * gap[axis] / whole
    return closed


def _wall_ends(start: Floats, theta: float, walls: Sequence[Wall]) -> Floats:
    """The ends of the walls, one after the other, shape (walls + 1, 2)."""
    ends = [start]
    for wall in walls:
        heading = theta + wall.quarter * QUARTER
        ends.append(ends[-1] + wall.length * np.array([math.cos(heading), math.sin(heading)]))
    return np.array(ends)


def _poses_on_walls(
    poses: Floats, groups: Sequence[Sequence[WallSegment]], chains: Sequence[Floats], ends: Floats,
    theta: float, walls: Sequence[Wall],
) -> Floats:  # fmt: skip
    """Every pose moved onto its wall, as far along it as in the trace, with its heading relative to
    the wall."""
    halfway = [(a[-1].last + b[0].first) // 2 + 1 for a, b in pairwise(groups)]
    moved = np.empty((len(poses), 3))
    for k, (first, last) in enumerate(pairwise([0, *halfway, len(poses)])):
        chain, wall, part = chains[k], walls[k], slice(first, last)
        points = shapely.points(poses[part, :2])
        along = shapely.line_locate_point(shapely.LineString(chain), points)
        share = (along / wall.measured)[:, None]
        moved[part, :2] = ends[k] * (1 - share) + ends[k + 1] * share
        steps = np.diff(chain, axis=0)
        begins = np.cumsum(np.hypot(*steps.T))[:-1]
        was = np.arctan2(steps[:, 1], steps[:, 0])[np.searchsorted(begins, along)]
        heading = theta + wall.quarter * QUARTER
        turned = (poses[part, 2] - was + math.pi) % math.tau - math.pi
        # Nearly along the path is along the wall, forwards or backwards.
        along_wall = np.rint(turned / math.pi) * math.pi
        off = np.where(np.abs(turned - along_wall) < DIAGONAL[0], along_wall, turned)
        moved[part, 2] = (heading + off + math.pi) % math.tau - math.pi
    return moved
