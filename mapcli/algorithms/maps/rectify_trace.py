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

from mapcli.errors import DataError
from mapcli.model.counting import counted
from mapcli.model.pose import Pose2D
from mapcli.model.rectified import Floats, RectifiedTrace, Wall
from mapcli.model.trace import PoseTrace, TracedPose
from mapcli.model.trajectory import Trajectory

QUARTER = math.pi / 2

DIAGONAL = math.radians(20), math.radians(70)
"""A segment between two turns in this range cuts a corner; it is no wall."""

MAX_CORNER_ERROR = math.radians(35)
"""A turn that is farther from 0 and from a right angle is no corner."""

MAX_WALL_DRIFT = math.radians(60)
"""Heading drift along a wall; a trace that turns more without a corner follows no walls."""

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


@dataclass(frozen=True, eq=False)
class _Segment:
    """A straight piece of the trace, from pose `first` to pose `last`."""

    first: int
    last: int
    start: Floats
    end: Floats

    @property
    def length(self) -> float:
        return math.dist(self.start, self.end)

    @property
    def angle(self) -> float:
        return math.atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])


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
    groups = _walls(_segments(poses, p.tolerance), p.shortest)
    joints = [
        poses[0, :2],
        *(_corner_point(a[-1], b[0]) for a, b in pairwise(groups)),
        poses[-1, :2],
    ]
    chains = [
        np.array([start, *(s.end for s in group[:-1]), end])
        for group, (start, end) in zip(groups, pairwise(joints), strict=True)
    ]
    corners = [_turn(a[-1], b[0]) for a, b in pairwise(groups)]
    quarters = list(accumulate((round(turn / QUARTER) for turn in corners), initial=0))
    measured = [float(np.hypot(*np.diff(chain, axis=0).T).sum()) for chain in chains]
    square = _closing_error(measured, quarters)
    gap_square = math.hypot(*square)
    loop = gap_square <= LOOP_SHARE * sum(measured) if p.loop is None else p.loop
    lengths = _close_loop(measured, quarters, square) if loop else measured
    theta = _first_direction(poses, groups[0][0])
    walls = tuple(
        Wall(q, m, length, _turn(g[0], g[-1]), corner)
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


def _first_direction(poses: Floats, first: _Segment) -> float:
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


def _segments(poses: Floats, tolerance: float) -> list[_Segment]:
    """The trace as straight pieces (Douglas and Peucker 1973)."""
    points = poses[:, :2]
    line = shapely.simplify(shapely.LineString(points), tolerance, preserve_topology=False)
    indices, k = [], 0
    for vertex in shapely.get_coordinates(line):
        while (points[k] != vertex).any():
            k += 1
        indices.append(k)
    indices[-1] = len(points) - 1
    return [_fitted_line(points, a, b, tolerance) for a, b in pairwise(indices)]


def _fitted_line(points: Floats, first: int, last: int, tolerance: float) -> _Segment:
    """The line through a segment's points (total least squares), without those near its ends: they
    may lie round a corner already."""
    a, b = points[first], points[last]
    part = points[first : last + 1]
    from_ends = np.minimum(np.hypot(*(part - a).T), np.hypot(*(part - b).T))
    inner = part[from_ends > 2 * tolerance]
    if len(inner) < 3:
        return _Segment(first, last, a, b)
    middle = inner.mean(axis=0)
    (xx, xy), (_, yy) = (inner - middle).T @ (inner - middle)
    angle = math.atan2(2 * xy, xx - yy) / 2
    along = np.array([math.cos(angle), math.sin(angle)])
    start, end = (middle + along * float((end - middle) @ along) for end in (a, b))
    return _Segment(first, last, start, end)


def _walls(segments: list[_Segment], shortest: float) -> list[list[_Segment]]:
    """The segments of each wall: long enough, and without a sharp turn among them.

    Raises:
        DataError: there are none, or one that is bent too much.
    """
    longer = [segment for segment in segments if segment.length >= shortest]
    straight = [
        s for k, s in enumerate(longer) if not _cuts_corner(longer[max(k - 1, 0) : k + 2], shortest)
    ]
    if not straight:
        raise DataError(f"no straight segment of {shortest:g} m", expected="a drive along walls")
    groups = [[straight[0]]]
    for a, b in pairwise(straight):
        turn = _turn(a, b)
        if abs(turn - round(turn / QUARTER) * QUARTER) > MAX_CORNER_ERROR:
            raise DataError(
                f"it turns by {math.degrees(turn):.0f} degrees",
                where=f"poses {a.last} to {b.first}",
                expected="walls that go straight on or meet at right angles",
            )
        if round(turn / QUARTER):
            groups.append([])
        groups[-1].append(b)
    for group in groups:
        drift = sum(_turn(a, b) for a, b in pairwise(group))
        if abs(drift) > MAX_WALL_DRIFT:
            raise DataError(
                f"it turns by {math.degrees(drift):.0f} degrees without a corner",
                where=f"poses {group[0].first} to {group[-1].last}",
                expected="straight walls that meet at corners",
            )
    return groups


def _cuts_corner(around: Sequence[_Segment], shortest: float) -> bool:
    """Whether the middle of three segments leads diagonally from one wall to the next."""
    if len(around) < 3 or around[1].length > 3 * shortest:
        return False
    turns = [_turn(a, b) for a, b in pairwise(around)]
    low, high = DIAGONAL
    return turns[0] * turns[1] > 0 and all(low <= abs(turn) <= high for turn in turns)


def _turn(a: _Segment, b: _Segment) -> float:
    """Radians from one segment to another, the shorter way round."""
    return (b.angle - a.angle + math.pi) % math.tau - math.pi


def _corner_point(a: _Segment, b: _Segment) -> Floats:
    """Where two walls meet: the robot may have cut the corner."""
    middle = (a.end + b.start) / 2
    turn = _turn(a, b)
    if abs(math.sin(turn)) < 0.5:
        return np.asarray(middle)  # it turned round: the walls are parallel
    (ux, uy), (dx, dy) = (math.cos(a.angle), math.sin(a.angle)), b.start - a.start
    vx, vy = math.cos(b.angle), math.sin(b.angle)
    along = (dx * vy - dy * vx) / (ux * vy - uy * vx)
    return np.asarray(a.start + along * np.array([ux, uy]))


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
    poses: Floats, groups: Sequence[Sequence[_Segment]], chains: Sequence[Floats], ends: Floats,
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
