"""Turns of a laser that come as several messages, each a segment of the turn (SICK picoScan and
multiScan, Hokuyo through Cartographer's bags), put together to one scan each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from mapcli.formats.logs.ros.decode import LaserScan
from mapcli.model.scan import NANOSECONDS

CONTINUES = 0.6
"""Steps between beams by which a segment may begin elsewhere than after the last one's end."""

LONGEST_TURN_S = 1.0
"""Segments farther apart belong to different turns."""


class TurnAssembler:
    """Takes the scans of one topic, and gives whole turns (stateful).

    Whether they are segments is decided by the first two: the second one begins where the first
    ends. Scans that are whole are given as they come.

    Attributes:
        segments: of a turn, as many as the longest had; 1 where scans are whole.
    """

    def __init__(self) -> None:
        self.segments = 1
        self._is_whole = False
        self._turn: list[LaserScan] = []

    def add(self, scan: LaserScan) -> Iterator[LaserScan]:
        """The next message; gives the turns that are complete."""
        if self._is_whole:
            yield scan
            return
        if self._turn and not self._continues(scan):
            self._is_whole = self.segments == len(self._turn) == 1
            yield from self.rest()
            if self._is_whole:
                yield scan
                return
        self._turn.append(scan)
        self.segments = max(self.segments, len(self._turn))

    def rest(self) -> Iterator[LaserScan]:
        """The turn that is not complete yet."""
        if self._turn:
            yield joined(self._turn)
            self._turn = []

    def _continues(self, scan: LaserScan) -> bool:
        """Whether a scan is the next segment of the turn."""
        first, last = self._turn[0], self._turn[-1]
        step = last.angle_increment
        elsewhere = (scan.frame, scan.origin) != (last.frame, last.origin)
        if not step or elsewhere or not math.isclose(scan.angle_increment, step, rel_tol=1e-3):
            return False
        beams = sum(len(one.ranges) for one in self._turn) + len(scan.ranges)
        if beams * abs(step) > math.tau + CONTINUES * abs(step):
            return False
        expected = last.angle_min + len(last.ranges) * step
        away = math.remainder(scan.angle_min - expected, math.tau)
        seconds = (scan.stamp_ns - first.stamp_ns) / NANOSECONDS
        return abs(away) <= CONTINUES * abs(step) and 0 <= seconds <= LONGEST_TURN_S


def joined(segments: Sequence[LaserScan]) -> LaserScan:
    """One scan from the segments of a turn, in the order in which they came; its beams have their
    own times if the segments have."""
    first, last = segments[0], segments[-1]
    if len(segments) == 1:
        return first
    ranges = np.concatenate([segment.ranges for segment in segments])
    before = len(ranges) - len(last.ranges)
    seconds = (last.stamp_ns - first.stamp_ns) / NANOSECONDS / before
    return first._replace(
        angle_max=first.angle_min + (len(ranges) - 1) * first.angle_increment,
        time_increment=seconds or first.time_increment,
        ranges=ranges,
    )
