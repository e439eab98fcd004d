"""What says that another recording begins where odometry goes on from somewhere else."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mapcli.formats.logs.odometry_track import OdometryTrack, Seen
from mapcli.formats.logs.scan_likeness import FEWEST_POINTS, likeness
from mapcli.model.scan import NANOSECONDS

LEAST_ALIKE = 0.75
"""Likeness of the scans on either side, as a share of that of the two before, from which on the
laser may have stayed where it was."""

APART_M, APART_M_S, APART_RAD, APART_RAD_S = 0.5, 1.0, math.radians(20), 1.0
"""Metres and radians, and as many more per second for which nothing told of odometry, by which the
robot may have moved from the one to the other beside what is known of it."""

FARTHEST_M = 6.0
"""Metres that it may have moved so, from which on scans do not tell."""


class Break(NamedTuple):
    """Where another recording begins.

    Attributes:
        what: was found, for a person.
        before_ns, after_ns: stamps of the last record before it, and of its first.
        parts: numbers of the files of these two.
        mixed: its stamps are not all later than those before.
    """

    what: str
    before_ns: int
    after_ns: int
    parts: tuple[int, int]
    mixed: bool = False


class Suspicion(NamedTuple):
    """A break that is not certain yet.

    Attributes:
        found: the break, if it is one.
        is_gap: nothing told of odometry for a while; without scans meanwhile, it is certain.
        is_certain: it is, whatever the scans say.
        left, begun: the tracks that odometry left, and began; None without odometry.
    """

    found: Break
    is_gap: bool
    is_certain: bool = False
    left: OdometryTrack | None = None
    begun: OdometryTrack | None = None

    def by_scans(self, first: Seen | None) -> Break | None:
        """The break, if the scans on either side say that it is one.

        Args:
            first: scan of the log.
        """
        after = None if self.begun is None else self.begun.first
        if after is None:
            return None
        if first is not None and _is_the_same(first, after):
            return self.found._replace(what=f"{self.found.what}, and the log from its start on")
        if self._is_elsewhere(after):
            return self.found._replace(what=f"{self.found.what}, and the laser sees another place")
        return None

    def _is_elsewhere(self, after: Seen) -> bool:
        """Whether the laser saw one place before, and another one after."""
        left, begun = self.left, self.begun
        if left is None or begun is None or not left.seen:
            return False
        *earlier, before = left.seen.get(after.scan.mount) or next(iter(left.seen.values()))
        seconds = max((self.found.after_ns - self.found.before_ns) / NANOSECONDS, 0.0)
        metres = APART_M + APART_M_S * seconds
        if not earlier or metres > FARTHEST_M:
            return False
        counted = before.odometry.between(after.odometry)
        motion = before.odometry.between(left.pose)
        motion = motion.compose(begun.start.between(after.odometry))
        radians = APART_RAD + APART_RAD_S * seconds
        step = earlier[0].odometry.between(before.odometry)
        usual = likeness(earlier[0].scan, before.scan, step, metres, radians) or 0.0
        # Only the wheels have jumped, or they have told late what the robot did.
        alike = [
            likeness(before.scan, after.scan, moved, metres, radians) for moved in (motion, counted)
        ]
        return all(one is not None and one < LEAST_ALIKE * usual for one in alike)


def _is_the_same(one: Seen, other: Seen) -> bool:
    """Whether two scans are one, reading by reading: noise makes any two differ."""
    readings = one.scan.ranges
    is_telling = np.count_nonzero(np.isfinite(readings)) >= FEWEST_POINTS
    return bool(is_telling) and np.array_equal(readings, other.scan.ranges)


def duration(seconds: float) -> str:
    """For a person."""
    if seconds >= 5400:
        return f"{seconds / 3600:,.1f} h"
    return f"{seconds / 60:.0f} min" if seconds >= 120 else f"{seconds:.1f} s"
