"""Some scans tracked as if their beams were taken at one time and at another (`sweep_search`)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.algorithms.slam.slam import SlamParameters
from mapcli.algorithms.slam.sweep_trial import CERTAIN, SweepTrial
from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan, Record, in_order, turning
from mapcli.model.sweep import AT_ONCE, BeamOrder

SUSPECT = 3.0
"""Standard deviations of what scans ask for as the time of a turn, from which on times are tried:
more than one in 400 logs shows by chance."""

FEWEST, MOST = 10, 80
"""Scans under which the robot moves: that tell an order at least, and after which all is tried."""

SURE = 5.0
"""Standard deviations of what scans ask for as the time of a turn, from which on its sign is that
of the right one."""

LIKELY = 2.0
"""Standard errors by which scores must be better with a time that the scans ask for that surely."""

LONGEST_TURN_S = 0.5
"""Lasers on robots turn twice a second at least."""

TRIES, STEP, LEFT = 6, 0.3, 0.1
"""Times that are tried for a turn, at most; how far a time is from the last until the right one
lies between two, a share; and how much scans may still ask for there, of what they asked for
without."""


ORDERS: tuple[BeamOrder, BeamOrder] = "forward", "backward"


def search_for(scan: RangeScan, parameters: SlamParameters | None) -> OrderSearch | TimeSearch:
    """The search for what is not known of the times of a scan's beams.

    Args:
        parameters: of the replay, for what is seen and how the map is made.
    """
    p = parameters or SlamParameters()
    p = replace(SlamParameters(), perception=p.perception, map=p.map)
    return OrderSearch(p) if scan.timing.increment else TimeSearch(p)


class OrderSearch:
    """Scans tracked as if their beams were taken at once, and in either order if that does not
    tell (stateful: `step`)."""

    def __init__(self, parameters: SlamParameters) -> None:
        self._parameters, self._at_once = parameters, SweepTrial(parameters)

    def step(self, scan: RangeScan, odom: Pose2D | None) -> None:
        """Track a scan."""
        self._at_once.step(replace(scan, timing=AT_ONCE, motion=None), odom)

    @property
    def is_over(self) -> bool:
        """Whether the order is certain, or more scans would hardly tell it."""
        return self._asked() is not None or self._at_once.has_moved(MOST)

    def result(self, held: Iterable[Record]) -> tuple[BeamOrder | None, float]:
        """The order by the scans among these records, if it is certain; the log tells the time."""
        if (asked := self._asked()) is not None:
            return asked, 0.0
        records = list(held)
        forward, backward = (self._tracked(records, order) for order in ORDERS)
        if forward.is_better_than(backward):
            return "forward", 0.0
        return ("backward" if backward.is_better_than(forward) else None), 0.0

    def _asked(self) -> BeamOrder | None:
        """The order that the scans ask for, if they do so beyond doubt."""
        asked = self._at_once.estimate()
        if not self._at_once.has_moved(FEWEST) or abs(asked.seconds) <= SURE * asked.error:
            return None
        return "forward" if asked.seconds > 0 else "backward"

    def _tracked(self, records: list[Record], order: BeamOrder) -> SweepTrial:
        timed = (
            in_order(record, order) if isinstance(record, RangeScan) else record
            for record in records
        )
        return SweepTrial(self._parameters).steps(odometry_at_scans(timed))


class TimeSearch:
    """Scans tracked as if their beams were taken at once, and with times if they ask for some
    (stateful: `step`)."""

    def __init__(self, parameters: SlamParameters) -> None:
        self._parameters, self._at_once = parameters, SweepTrial(parameters)

    def step(self, scan: RangeScan, odom: Pose2D | None) -> None:
        """Track a scan."""
        self._at_once.step(scan, odom)

    @property
    def is_over(self) -> bool:
        """Whether there are scans enough."""
        return self._at_once.has_moved(MOST)

    def result(self, held: Iterable[Record]) -> tuple[BeamOrder | None, float]:
        """The order of the beams and the seconds of a turn, as the scans among these records show
        them; None and 0 if they do not."""
        asked, period_s = self._at_once.estimate(), self._at_once.period_s
        if abs(asked.seconds) <= SUSPECT * asked.error or not 0 < period_s <= LONGEST_TURN_S:
            return None, 0.0
        order: BeamOrder = "forward" if asked.seconds > 0 else "backward"
        close_s = LEFT * abs(asked.seconds)
        turn_s, trial = self._best(list(held), order, period_s, close_s)
        sigmas = LIKELY if abs(asked.seconds) > SURE * asked.error else CERTAIN
        return (order, turn_s) if trial.is_better_than(self._at_once, sigmas) else (None, 0.0)

    def _best(
        self, records: list[Record], order: BeamOrder, period_s: float, close_s: float
    ) -> tuple[float, SweepTrial]:
        """The seconds of a turn that the scans fit best with. What they ask for beyond them is 0
        there: found by false position, from the time between two scans on."""
        trials, left = dict[float, SweepTrial](), dict[float, float]()
        turn_s = period_s
        while len(trials) < TRIES:
            trials[turn_s] = trial = self._turning(records, turn_s, order)
            asked = trial.estimate()
            left[turn_s] = asked.seconds if order == "forward" else -asked.seconds
            if abs(left[turn_s]) <= max(close_s, asked.error):
                return turn_s, trial
            turn_s = _next_try(left, turn_s)
        return max(trials.items(), key=lambda tried: tried[1].mean_score)

    def _turning(self, records: list[Record], turn_s: float, order: BeamOrder) -> SweepTrial:
        """The scans tracked as if a turn took so long."""
        timed = (
            turning(record, turn_s, order) if isinstance(record, RangeScan) else record
            for record in records
        )
        return SweepTrial(self._parameters).steps(odometry_at_scans(timed))


def _next_try(left: dict[float, float], turn_s: float) -> float:
    """The next time to be tried, after `turn_s`.

    Args:
        left: seconds of a turn that were tried -> what scans asked for beyond, seconds.
    """
    short = max((tried for tried, asked in left.items() if asked > 0), default=None)
    long = min((tried for tried, asked in left.items() if asked <= 0), default=None)
    if short is None or long is None or short > long:
        return turn_s * (1 + math.copysign(STEP, left[turn_s]))
    return short + (long - short) * left[short] / (left[short] - left[long])
