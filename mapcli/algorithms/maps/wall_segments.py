"""Walls in the trace of a robot that follows them: straight segments between right angles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from mapcli.errors import DataError
from mapcli.model.rectified import Floats

QUARTER = math.pi / 2

DIAGONAL = math.radians(20), math.radians(70)
"""A segment between two turns in this range cuts a corner; it is no wall."""

MAX_CORNER_ERROR = math.radians(35)
"""A turn that is farther from 0 and from a right angle is no corner."""

MAX_WALL_DRIFT = math.radians(60)
"""Heading drift along a wall; a trace that turns more without a corner follows no walls."""


@dataclass(frozen=True, eq=False)
class WallSegment:
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


def straight_segments(poses: Floats, tolerance: float) -> list[WallSegment]:
    """The trace as straight pieces (Douglas and Peucker 1973)."""
    points = poses[:, :2]
    # Less than a nanometre is rounding noise; distances of 1e-200 m have squares of 0.
    rounded = np.round(points, 9)
    line = shapely.simplify(shapely.LineString(rounded), tolerance, preserve_topology=False)
    indices, k = [], 0
    for vertex in shapely.get_coordinates(line):
        while (rounded[k] != vertex).any():
            k += 1
        indices.append(k)
    indices[-1] = len(points) - 1
    return [_fitted_line(points, a, b, tolerance) for a, b in pairwise(indices)]


def _fitted_line(points: Floats, first: int, last: int, tolerance: float) -> WallSegment:
    """The line through a segment's points (total least squares), without those near its ends: they
    may lie round a corner already."""
    a, b = points[first], points[last]
    part = points[first : last + 1]
    from_ends = np.minimum(np.hypot(*(part - a).T), np.hypot(*(part - b).T))
    inner = part[from_ends > 2 * tolerance]
    if len(inner) < 3:
        return WallSegment(first, last, a, b)
    middle = inner.mean(axis=0)
    (xx, xy), (_, yy) = (inner - middle).T @ (inner - middle)
    angle = math.atan2(2 * xy, xx - yy) / 2
    along = np.array([math.cos(angle), math.sin(angle)])
    start, end = (middle + along * float((end - middle) @ along) for end in (a, b))
    return WallSegment(first, last, start, end)


def walls_of(segments: list[WallSegment], shortest: float) -> list[list[WallSegment]]:
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
        turn = turn_between(a, b)
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
        drift = sum(turn_between(a, b) for a, b in pairwise(group))
        if abs(drift) > MAX_WALL_DRIFT:
            raise DataError(
                f"it turns by {math.degrees(drift):.0f} degrees without a corner",
                where=f"poses {group[0].first} to {group[-1].last}",
                expected="straight walls that meet at corners",
            )
    return groups


def _cuts_corner(around: Sequence[WallSegment], shortest: float) -> bool:
    """Whether the middle of three segments leads diagonally from one wall to the next."""
    if len(around) < 3 or around[1].length > 3 * shortest:
        return False
    turns = [turn_between(a, b) for a, b in pairwise(around)]
    low, high = DIAGONAL
    return turns[0] * turns[1] > 0 and all(low <= abs(turn) <= high for turn in turns)


def bend_of(poses: Floats, wall: Sequence[WallSegment], tolerance: float) -> float:
    """Radians by which the way along a wall turns from its beginning to its end.

    A parabola is fitted to the way, by least squares; to an arc of 15 degrees it is right within
    a hundredth, to one of 60 within a tenth. What is near the ends may lie round a corner already.
    """
    start, end = wall[0].start, wall[-1].end
    chord = math.atan2(*(end - start)[::-1])
    part = poses[wall[0].first : wall[-1].last + 1, :2]
    from_ends = np.minimum(np.hypot(*(part - start).T), np.hypot(*(part - end).T))
    inner = part[from_ends > 2 * tolerance] - start
    unit = np.array([math.cos(chord), math.sin(chord)])
    along, across = inner @ unit, inner @ np.array([-unit[1], unit[0]])
    if len(inner) < 3 or np.ptp(along) == 0:
        return turn_between(wall[0], wall[-1])
    slope = np.polynomial.Polynomial.fit(along, across, 2).deriv()
    first, last = np.arctan(slope(np.array([0.0, math.dist(start, end)])))
    return float(last - first)


def turn_between(a: WallSegment, b: WallSegment) -> float:
    """Radians from one segment to another, the shorter way round."""
    return (b.angle - a.angle + math.pi) % math.tau - math.pi


def corner_point(a: WallSegment, b: WallSegment) -> Floats:
    """Where two walls meet: the robot may have cut the corner."""
    middle = (a.end + b.start) / 2
    turn = turn_between(a, b)
    if abs(math.sin(turn)) < 0.5:
        return np.asarray(middle)  # it turned round: the walls are parallel
    (ux, uy), (dx, dy) = (math.cos(a.angle), math.sin(a.angle)), b.start - a.start
    vx, vy = math.cos(b.angle), math.sin(b.angle)
    along = (dx * vy - dy * vx) / (ux * vy - uy * vx)
    return np.asarray(a.start + along * np.array([ux, uy]))
