"""Wheels that are plainly wrong for seconds, and what the robot may be doing meanwhile.

Wheels fail in few ways: they count backwards, or nothing while the robot goes on. Where a scan
fixes the pose, the map shows that at once. Along a corridor one scan hardly tells, and odometry is
believed. So each failure is followed as a rival of the hypothesis that is believed, and what
speaks for it adds up from scan to scan until the other one must be wrong (the cumulative sum test
of Page 1954). Three things speak: inertia, for no robot turns round between two scans; points of
the scan where the map knows that nothing is; and how far the fit must leave what was predicted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from mapcli.algorithms.slam.match import Match
from mapcli.algorithms.slam.motion_model import OdometryUncertainty
from mapcli.algorithms.slam.scan_matcher import ScanInMap
from mapcli.model.pose import Pose2D

Hypothesis = Literal["wheels", "reversed", "goes on"]

HYPOTHESES: tuple[Hypothesis, ...] = "wheels", "reversed", "goes on"

NEAR = 2.0
"""Standard deviations of odometry within which two predictions say the same."""


KNOWN_MEMORY = 0.05
"""The weight of the newest scan in the running mean of how much of a scan the map knows."""


MOST_SCANS = 200
"""After so many scans a rival has had its chance: wheels fail for seconds."""


@dataclass(frozen=True)
class FaultParameters:
    """When wheels are taken to have failed. Evidence is in points of a scan; a point at odds with
    the map counts as much as a nat of log-likelihood.

    Attributes:
        enough: evidence after which a failure is believed; enough_for_wheels: after which the
            wheels are believed again.
        least: evidence below which a rival is given up.
        hopeless: the share of the points by which a rival may contradict the map more, before
            it is fitted, than the believed pose; beyond, it is given up at once.
        most: what inertia is worth at most.
        expected: the share of the points that may contradict the map, as new things come into
            sight.
        unknown: what a point counts that lies on ground the map does not know, beyond the usual.
        far: standard deviations beyond which leaving the prediction costs no more.
        overlap: a rival's scan overlaps the map by this share of what the other's does.
        fits: the share of the usual agreement below which a rival fits the map no better than
            chance, and is not believed.
        acceleration: metres per second squared, a standard deviation of what robots do.
        jitter: metres by which the count of one step is off anyway.
        shortest: seconds between stamps that are not just two scans read out at once.
        standing: metres per second below which wheels count nothing.
    """

    enough: float = 12.0
    enough_for_wheels: float = 6.0
    least: float = -10.0
    hopeless: float = 0.4
    most: float = 30.0
    expected: float = 0.05
    unknown: float = 0.5
    far: float = 3.0
    overlap: float = 0.7
    fits: float = 0.6
    acceleration: float = 1.0
    jitter: float = 0.005
    shortest: float = 0.02
    standing: float = 0.05


@dataclass(frozen=True, slots=True)
class AlternativeHypothesis:
    """A hypothesis that parted from the believed one some scans ago.

    Attributes:
        evidence: what speaks for it, less what speaks for the believed one.
        pose: where the robot would be.
        motion: its motion since the scan before.
        way: where it would have been at the scans since it parted, the last one not included.
    """

    evidence: float
    pose: Pose2D
    motion: Pose2D
    way: tuple[Pose2D, ...] = ()


class OdometryFaults:
    """What the robot may be doing (stateful: evidence adds up).

    Attributes:
        believed: the hypothesis that predicts the next pose.
        rivals: the others that are followed.
        way: after a rival came to be believed, where the robot was at the scans before the last,
            which were thought to be elsewhere.
        scans: at how many scans the wheels were not believed, as far as is known by now.
    """

    def __init__(self, parameters: FaultParameters | None = None) -> None:
        self.parameters = parameters or FaultParameters()
        self.believed: Hypothesis = "wheels"
        self.rivals: dict[Hypothesis, AlternativeHypothesis] = {}
        self.way: tuple[Pose2D, ...] = ()
        self.scans = 0
        self._counted: Pose2D | None = None
        self._motion = self._found = Pose2D()  # the last one, as predicted and as the map has it
        self._stamp_ns, self._seconds, self._elapsed = 0, 0.0, 0.0
        self._stands, self._known = True, 0.0

    def motion(self, stamp_ns: int, counted: Pose2D | None) -> Pose2D | None:
        """What the robot did since the last scan, by the hypothesis that is believed; `counted` is
        what the wheels say, None if nothing."""
        self._elapsed, self._stamp_ns = (stamp_ns - self._stamp_ns) * 1e-9, stamp_ns
        self._counted = counted
        if counted is None:
            self.believed, self.rivals, self._elapsed = "wheels", {}, 0.0
            return None
        self._stands = abs(counted.x) <= self.parameters.standing * self._elapsed
        # A robot that stands may start anew; wheels that count have not stopped counting.
        if self.believed == ("reversed" if self._stands else "goes on"):
            self.believed, self.rivals = "wheels", {}
        return self._predict(self.believed, counted, self._found)

    def _predict(self, hypothesis: Hypothesis, counted: Pose2D, last: Pose2D) -> Pose2D:
        """A motion as a hypothesis has it, `last` the one before."""
        if hypothesis == "wheels":
            return counted
        if hypothesis == "reversed":
            return Pose2D(-counted.x, -counted.y, counted.theta)
        share = min(self._elapsed / self._seconds, 2.0) if self._seconds > 0 else 0.0
        return Pose2D(share * last.x, share * last.y, share * last.theta)

    def weigh(
        self,
        before: Pose2D,
        uncertainty: OdometryUncertainty,
        best: Match,
        scan: ScanInMap,
        usual: float,
    ) -> Match:
        """The best match of the believed hypothesis, or that of a rival that must be believed now.

        Args:
            before: where the robot was at the last scan; uncertainty: how far odometry may err;
                usual: the agreement that is usual in this log.
        """
        matches: dict[Hypothesis, Match] = {}
        if self._counted is not None:
            motion = self._predict(self.believed, self._counted, self._found)
            predicted = before.compose(motion)
            self._follow(before, self._counted, motion)
            if any(_apart(predicted, rival.pose, uncertainty) for rival in self.rivals.values()):
                matches = self._judge(predicted, best, uncertainty, scan)
            self._motion = motion
        if best.found:
            share = best.known_points / scan.size
            self._known += KNOWN_MEMORY * (share - self._known)
        self._found, self._seconds, self.way = before.between(best.pose), self._elapsed, ()
        decided = self._decide(matches, self.parameters.fits * usual) or best
        self.scans += 0 if self.believed == "wheels" else 1 + len(self.way)
        return decided

    def _follow(self, before: Pose2D, counted: Pose2D, motion: Pose2D) -> None:
        """Move the rivals on, and let those begin that have more reason to begin now."""
        for name in HYPOTHESES:
            rival = self.rivals.pop(name, None)
            if name == self.believed or (name == "goes on" and not self._stands):
                continue
            reason = self._reason(name, counted, motion)
            if rival is None or rival.evidence < reason or len(rival.way) == MOST_SCANS:
                rival = AlternativeHypothesis(reason, before, self._found)
            else:
                rival = replace(rival, way=(*rival.way, rival.pose))
            if rival.evidence >= self.parameters.least:
                moved = self._predict(name, counted, rival.motion)
                self.rivals[name] = replace(rival, pose=rival.pose.compose(moved), motion=moved)

    def _reason(self, name: Hypothesis, counted: Pose2D, motion: Pose2D) -> float:
        """What inertia says for a rival that begins now, against the motion that is believed."""
        p, other = self.parameters, self._predict(name, counted, self._found)
        reason = self._inertia(motion) - self._inertia(other)
        # Wheels usually are right, so they get a chance whatever inertia says.
        return min(p.most, max(p.least if name == "wheels" else -p.most, reason))

    def _inertia(self, motion: Pose2D) -> float:
        """How unlikely a motion is after the last one (minus its log-likelihood)."""
        p, seconds = self.parameters, (self._elapsed + self._seconds) / 2
        if min(self._elapsed, self._seconds) < p.shortest:
            return 0.0
        change = motion.x / self._elapsed - self._motion.x / self._seconds
        usual = math.hypot(p.acceleration * seconds, math.sqrt(2) * p.jitter / seconds)
        return (change / usual) ** 2 / 2

    def _judge(
        self, predicted: Pose2D, best: Match, uncertainty: OdometryUncertainty, scan: ScanInMap
    ) -> dict[Hypothesis, Match]:
        """What the scan says of each rival; their matches."""
        p, matches = self.parameters, {}
        # What wheels usually err by is no failure: the search may have found the place.
        near = not _apart(predicted, best.pose, uncertainty, uncertainty.window_sigmas)
        stay = best if near else scan.next_to(predicted, uncertainty)
        against, left = self._against(stay, scan), _left(predicted, stay.pose, uncertainty, p.far)
        for name, rival in list(self.rivals.items()):
            near = not _apart(rival.pose, best.pose, uncertainty)
            more = (
                0
                if near
                else scan.contradictions(rival.pose, uncertainty) - stay.free_space_conflicts
            )
            if more > p.hopeless * scan.size:
                del self.rivals[name]
                continue
            match = best if near else scan.next_to(rival.pose, uncertainty)
            if match.known_points < p.overlap * stay.known_points:
                del self.rivals[name]
                continue
            points = against - self._against(match, scan)
            beyond = max(0.0, abs(points) - p.expected * stay.known_points)
            evidence = rival.evidence + math.copysign(beyond, points)
            evidence += left - _left(rival.pose, match.pose, uncertainty, p.far)
            self.rivals[name] = replace(rival, evidence=evidence, pose=match.pose)
            matches[name] = match
        return matches

    def _against(self, match: Match, scan: ScanInMap) -> float:
        """Points that speak against a match."""
        unknown = max(0.0, self._known * scan.size - match.known_points)
        return match.free_space_conflicts + self.parameters.unknown * unknown

    def _decide(self, matches: dict[Hypothesis, Match], low: float) -> Match | None:
        """The match of the strongest rival, if it must be believed; none below this score."""
        if not matches:
            return None
        name = max(matches, key=lambda one: self.rivals[one].evidence)
        p, match = self.parameters, matches[name]
        enough = p.enough_for_wheels if name == "wheels" else p.enough
        fits = not match.found or match.score >= low
        if self.rivals[name].evidence < enough or not fits:
            return None
        self._motion = self._found = self.rivals[name].motion
        self.way = self.rivals[name].way
        self.believed, self.rivals = name, {}
        return match


def _left(predicted: Pose2D, found: Pose2D, uncertainty: OdometryUncertainty, far: float) -> float:
    """How unlikely it is that odometry errs so much (minus its log-likelihood, up to a limit)."""
    return min(far, predicted.distance(found) / uncertainty.deviations.xy) ** 2 / 2


def _apart(
    one: Pose2D, other: Pose2D, uncertainty: OdometryUncertainty, deviations: float = NEAR
) -> bool:
    """Whether two poses differ by more than odometry usually errs."""
    turn = abs(one.between(other).theta)
    return (
        one.distance(other) > deviations * uncertainty.deviations.xy
        or turn > deviations * uncertainty.deviations.theta
    )
