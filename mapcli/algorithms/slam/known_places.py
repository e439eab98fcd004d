"""Places of which a person knows that they are one, or that they are not: loops that need no other
one that agrees, and loops that are never closed.

What a person says is looked for all the same, in a window as wide as a person errs: a place that is
not there is called wrong, and so is one with which the beams are explained worse (`loop_check`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from mapcli.algorithms.slam.correlative_search import SearchWindow
from mapcli.algorithms.slam.keyframes import Keyframe
from mapcli.algorithms.slam.submaps import SUBMAP_M, Submap
from mapcli.model.pose import Pose2D

HEADINGS = 12
"""At which the robot may look at "the same place"..."""

ABOUT = SearchWindow(2.0, math.pi / HEADINGS)
"""...and how far from there it may be, and from the nearest of them."""

AS_SAID = SearchWindow(1.5, math.radians(20.0))
"""The same where a person says where it was, and how it looked."""

BESIDE_M = 1.5 * SUBMAP_M
"""Metres of way around a place of which a person says that it is not another one."""


class SameScans(NamedTuple):
    """Two scans that were taken at the same place.

    Attributes:
        one, other: their numbers, the earlier first.
        pose: of the robot at the later one, seen from the earlier; None is about the same place.
        line: what a person typed.
    """

    one: int
    other: int
    pose: Pose2D | None
    line: str


@dataclass(frozen=True)
class KnownPlaces:
    """What a person knows, by the numbers of scans.

    Attributes:
        same: scans of the same place; apart: pairs of scans of different places.
    """

    same: tuple[SameScans, ...] = ()
    apart: tuple[tuple[int, int], ...] = ()


class Sought(NamedTuple):
    """Where a person says that a submap is: seen from an old one, in windows around some poses."""

    old: int
    poses: list[Pose2D]
    window: SearchWindow
    line: str


class PlacesOfSubmaps:
    """Known places by submaps."""

    def __init__(
        self, places: KnownPlaces, keyframes: list[Keyframe], submaps: list[Submap]
    ) -> None:
        self.places, self._keyframes, self._submaps = places, keyframes, submaps
        self._last_scans = [keyframes[one.last].scan for one in submaps]
        self._apart = [tuple(map(self._metres_at, pair)) for pair in places.apart]

    def _submap_of(self, scan: int) -> int:
        ends = enumerate(self._last_scans)
        return next((k for k, last in ends if scan <= last), len(self._submaps) - 1)

    def _metres_at(self, scan: int) -> float:
        return self._nearest(scan).metres

    def _nearest(self, scan: int) -> Keyframe:
        return min(self._keyframes, key=lambda keyframe: abs(keyframe.scan - scan))

    def sought(self, new: int) -> Iterator[Sought]:
        """The places of a submap that a person knows."""
        for same in self.places.same:
            if self._submap_of(same.other) == new:
                one, other = self._nearest(same.one).pose, self._nearest(same.other).pose
                old = self._submap_of(same.one)
                a, b = (self._keyframes[self._submaps[k].origin].pose for k in (old, new))
                turns = [Pose2D(0.0, 0.0, k * math.tau / HEADINGS) for k in range(HEADINGS)]
                there = [same.pose] if same.pose else turns
                poses = [a.between(one).compose(pose).compose(other.between(b)) for pose in there]
                yield Sought(old, poses, AS_SAID if same.pose else ABOUT, same.line)

    def are_apart(self, old: int, new: int) -> bool:
        """Whether a person knows that submaps are of different places."""
        here = sorted(self._keyframes[self._submaps[k].origin].metres for k in (old, new))
        return any(
            all(abs(a - b) <= BESIDE_M for a, b in zip(here, sorted(pair), strict=True))
            for pair in self._apart
        )
