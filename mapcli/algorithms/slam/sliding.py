"""How far off a map may be where its scans do not fix the robot's position.

Along a corridor, or where a laser hardly sees a wall, a scan fits as well half a metre away, and
odometry decides. How far that errs shows where scans tell: by how far it leaves the map over every
few metres of way, beyond what it always errs by, which is calibrated; its heading does not count
where walls tell that, as those of a corridor do. So wheels that failed somewhere are trusted
nowhere, and good ones are trusted for long. The errors of stretches add up as their squares, until
a scan is fixed by those of another visit: there the map was joined.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam.contradictions import Agreement
from mapcli.model.pose import Pose2D
from mapcli.model.trace import TracedPose

STRETCH_M = 5.0
"""Metres of way over which odometry is held against the map: enough for an error of its heading to
show, and few enough for a drive to have many."""

USUAL_SHARE = 0.1
"""Of the way, that wheels err by as long as nothing is known of them."""

Span = tuple[int, int]
"""Numbers of a first and a last scan."""


def sliding_stretches(agreements: Sequence[Agreement]) -> list[list[Span]]:
    """Stretches along which scans that follow each other do not fix the robot's position.

    Args:
        agreements: in time order.

    Returns:
        For each part of the drive between places that another visit fixes, those in it, if any.
        It fixes two scans in a row there: one may fit by chance.
    """
    parts: list[list[Span]] = [[]]
    for one, after in pairwise(agreements):
        if one.fixed_apart and after.fixed_apart and parts[-1]:
            parts.append([])
        if one.fixed_near or after.fixed_near:
            continue
        spans = parts[-1]
        if spans and spans[-1][1] == one.scan:
            spans[-1] = spans[-1][0], after.scan
        else:
            spans.append((one.scan, after.scan))
    return [spans for spans in parts if spans]


def headings_are_fixed(agreements: Sequence[Agreement], spans: Sequence[Span]) -> bool:
    """Whether all scans of some stretches fix the robot's heading: along a corridor the walls do,
    and only how far the robot has come is for odometry to tell."""
    return all(
        one.fixed_heading
        for one in agreements
        if any(first <= one.scan <= last for first, last in spans)
    )


def odometry_error(
    poses: Sequence[TracedPose], metres: Sequence[float], *, with_headings: bool = True
) -> float:
    """How far odometry leaves the map over `STRETCH_M` of way: root mean square, metres, beyond
    what it always does.

    Args:
        metres: of way until each pose.
        with_headings: by its headings; otherwise by those of the map.
    """
    way = np.asarray(metres)
    ends = np.searchsorted(way, way + STRETCH_M)
    starts = np.flatnonzero(ends < len(way))
    if not len(starts):
        return USUAL_SHARE * STRETCH_M
    mapped = [pose.pose for pose in poses]
    odoms = [pose.odom for pose in poses]
    counted = _displacements(
        odoms if with_headings else _turned(odoms, mapped), starts, ends[starts]
    )
    off = _displacements(mapped, starts, ends[starts])
    known = np.isfinite(counted)  # elsewhere odometry knows of no motion
    off[known] -= counted[known]
    if known.any():
        off[known] -= complex(np.median(off[known].real), np.median(off[known].imag))
    return math.sqrt(float(np.mean(np.abs(off) ** 2)))


def error_over(way: float, error_m: float) -> float:
    """What odometry that errs by so much over `STRETCH_M` errs by over a way, metres: not more
    than all of it."""
    share = way / STRETCH_M
    return min(way, error_m * min(share, math.sqrt(share)))


def _turned(odoms: Sequence[Pose2D | None], mapped: Sequence[Pose2D]) -> list[Pose2D | None]:
    """The path that odometry's steps make with the headings of the map."""
    path: list[Pose2D | None] = []
    last, there = None, Pose2D()
    for odom, pose in zip(odoms, mapped, strict=True):
        if odom is None:
            path.append(None)
            continue
        step = last.between(odom) if last is not None else Pose2D()
        there = replace(there.compose(step), theta=pose.theta)
        path.append(there)
        last = odom
    return path


def _displacements(
    poses: Sequence[Pose2D | None], starts: NDArray[np.int64], ends: NDArray[np.int64]
) -> NDArray[np.complex128]:
    """From some poses to others, seen from the first, x + yi; nan where one is missing."""
    nowhere = complex(math.nan, math.nan)
    places = np.array([complex(pose.x, pose.y) if pose else nowhere for pose in poses])
    headings = np.array([pose.theta if pose else math.nan for pose in poses])
    moved = (places[ends] - places[starts]) * np.exp(-1j * headings[starts])
    return np.asarray(moved, dtype=np.complex128)
