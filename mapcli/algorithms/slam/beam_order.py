"""In which order the beams of a scan are taken, found from the log.

Messages do not tell: many drivers of lasers that spin clockwise flip the array, so that its last
beam is the oldest. Deskewed in the wrong order, the scans of a robot that turns are torn twice as
far as without; they do not fit the map that they make. So the first scans that the robot moves
under are tracked both ways, until their scores tell which is right.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from mapcli.algorithms.scans.odometry_interpolation import ScanAtOdometry
from mapcli.algorithms.slam.slam import Slam, SlamParameters
from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan
from mapcli.model.sweep import BeamOrder

MOVED_M = 0.02
"""Metres that a beam's end moves during a sweep, from which on a scan tells the order."""

BEFORE = 5
"""Scans before the first that tells, which show what is there."""

FEWEST, MOST = 10, 60
"""Scans that an order is found from at least, and after which the search begins anew; it also does
after four times as many under which the robot hardly moves."""

MOST_SEARCHES = 10
"""Searches after which the order counts as that of the array: the log does not tell."""

CERTAIN = 4.0
"""Standard errors of the mean by which the scores of the one order exceed those of the other."""

ORDERS: tuple[BeamOrder, BeamOrder] = "forward", "backward"


class BeamOrderSearch:
    """The search for the order of a log's beams (stateful).

    Attributes:
        found: the order that the log shows; None before, and where it shows none.
        was_needed: whether there were scans whose order was not known.
    """

    def __init__(self, parameters: SlamParameters | None = None) -> None:
        p = parameters or SlamParameters()
        perception, map_ = p.perception, p.map
        self._parameters = replace(SlamParameters(), perception=perception, map=map_, loops=None)
        self.found: BeamOrder | None = None
        self.was_needed = False
        self._searches = 0

    def settled(self, scans: Iterable[ScanAtOdometry]) -> Iterator[ScanAtOdometry]:
        """The scans in their order; those whose beams have times of an order that is not known get
        the order that is found, and are held back until it is."""
        held: deque[ScanAtOdometry] = deque()
        trial: _Trial | None = None
        for scan, odom in scans:
            self.was_needed |= scan.timing.order is None
            if scan.timing.order is not None or self._is_over:
                yield self._ordered(scan), odom
                continue
            held.append((scan, odom))
            if trial is None and _metres_moved(scan) >= MOVED_M:
                trial = _Trial(self._parameters)
                for one in list(held)[:-1]:
                    trial.step(*one)
            if trial is not None and _metres_moved(scan) >= MOVED_M:
                self.found = trial.step(scan, odom)
            if trial is not None and (self.found or max(trial.scans, len(held) / 4) >= MOST):
                self._searches, trial = self._searches + 1, None
            if self._is_over or trial is None:
                while len(held) > (0 if self._is_over else BEFORE):
                    yield self._ordered(held[0][0]), held.popleft()[1]
        while held:
            yield self._ordered(held[0][0]), held.popleft()[1]

    @property
    def _is_over(self) -> bool:
        return self.found is not None or self._searches == MOST_SEARCHES

    def _ordered(self, scan: RangeScan) -> RangeScan:
        if scan.timing.order is not None:
            return scan
        return _in_order(scan, self.found or "forward")


def _in_order(scan: RangeScan, order: BeamOrder) -> RangeScan:
    return replace(scan, timing=replace(scan.timing, order=order))


def _metres_moved(scan: RangeScan) -> float:
    """How far the end of a beam of median range moves from the first beam to the last, about."""
    if scan.motion is None:
        return 0.0
    moved = scan.motion.poses[-1] - scan.motion.poses[0]
    x, y, theta = (float(number) for number in moved)
    ranges = scan.ranges[np.isfinite(scan.ranges)]
    return math.hypot(x, y) + abs(theta) * (float(np.median(ranges)) if len(ranges) else 0.0)


class _Trial:
    """Some scans tracked in either order (stateful).

    Attributes:
        scans: how many were.
    """

    def __init__(self, parameters: SlamParameters) -> None:
        self._slams = [Slam(parameters) for _ in ORDERS]
        self._gains: list[float] = []
        self.scans = 0

    def step(self, scan: RangeScan, odom: Pose2D | None) -> BeamOrder | None:
        """Track a scan; the order, if it is certain by now."""
        self.scans += 1
        scores = [
            slam.step(_in_order(scan, order), odom).score or 0.0
            for slam, order in zip(self._slams, ORDERS, strict=True)
        ]
        if _metres_moved(scan) >= MOVED_M:
            self._gains.append(scores[0] - scores[1])
        if len(self._gains) < FEWEST:
            return None
        mean = float(np.mean(self._gains))
        error = float(np.std(self._gains)) / math.sqrt(len(self._gains))
        if abs(mean) <= CERTAIN * error:
            return None
        return ORDERS[mean < 0]
