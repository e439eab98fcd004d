"""Odometry that is plainly wrong for seconds, and what the robot may be doing meanwhile.

Wheels fail in few ways: they count backwards, or nothing while the robot keeps going. Where a scan
fixes the pose, the map shows that at once. Along a corridor one scan hardly tells, and odometry is
believed. So each failure is followed as an alternative to the active hypothesis, and the
log-likelihood ratio of the two adds up from scan to scan until the active one must be wrong (the
cumulative sum test, CUSUM, of Page 1954). Three things count: inertia, for no robot turns round
between two scans; points of the scan in the map's free space; and how far the match must leave
what was predicted. All are in nats, and a point in free space counts as one.

Other failures of odometry are dealt with elsewhere: a jump, faster than any robot, is rejected by
`motion_model.DeadReckoning`; a reading that comes late is found out by `stale_odometry`; a scan
that fits nowhere near the prediction is relocalised by `scan_matcher`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from mapcli.algorithms.slam.inertia import Inertia
from mapcli.algorithms.slam.match import Match, MatchHistory
from mapcli.algorithms.slam.motion_model import OdometryUncertainty
from mapcli.algorithms.slam.pose_refinement import ScanInMap
from mapcli.model.pose import Pose2D

Hypothesis = Literal["odometry", "reversed", "keeps going"]
"""Odometry is right; it has the wrong sign; it counts nothing while the robot keeps its speed."""

HYPOTHESES: tuple[Hypothesis, ...] = "odometry", "reversed", "keeps going"

ACCEPT_RATIO, ACCEPT_ODOMETRY_RATIO = 12.0, 6.0
"""Log-likelihood ratio from which a failure becomes the active hypothesis, and from which odometry
does so again, which is right most of the time."""

DROP_RATIO = -10.0
"""Log-likelihood ratio below which an alternative is dropped."""

SUSPECT_RATIO = 3.0
"""What inertia must say before a failure is followed in a map that remembers old laps, or was there
before: it contradicts right poses as well, when the robot comes back with an error, and all poses
when it is of another place."""

MOST_INERTIA_RATIO = 30.0
"""What inertia counts at most."""

MOST_SCANS = 200
"""Scans after which an alternative hypothesis expires: wheels fail for seconds."""

SAME_SIGMAS = 2.0
"""Standard deviations of odometry within which two predictions say the same."""

DROP_CONFLICT_SHARE = 0.4
"""The share of a scan's points by which the free-space conflicts of an alternative may exceed those
of the active hypothesis before it is refined; beyond, it is dropped at once."""

MIN_KNOWN_SHARE = 0.7
"""An alternative's match has at least this share of the active one's known points."""

EXPECTED_CONFLICT_SHARE = 0.05
"""The share of the known points that may lie in free space, as new things come into sight."""

UNKNOWN_WEIGHT = 0.5
"""What a point counts that lies on unknown cells, beyond the running mean."""

MEAN_WEIGHT = 0.05
"""The weight of the newest scan in the running mean of the share of known points."""

MIN_SCORE_SHARE = 0.6
"""The share of the running score below which an alternative fits the map no better than chance,
and cannot become active."""

MOST_DEVIATIONS = 3.0
"""Standard deviations beyond which leaving the prediction costs no more."""

STANDSTILL = 0.05
"""Metres per second below which odometry counts nothing."""


@dataclass(frozen=True, slots=True)
class AlternativeHypothesis:
    """A hypothesis that parted from the active one some scans ago.

    Attributes:
        log_ratio: its log-likelihood less that of the active hypothesis, since they parted.
        pose: where the robot would be, in the map.
        motion: its motion since the scan before.
        past_poses: where it would have been at the scans since they parted, but the last.
    """

    log_ratio: float
    pose: Pose2D
    motion: Pose2D
    past_poses: tuple[Pose2D, ...] = ()


class OdometryFaults:
    """Which hypothesis about the odometry is true (stateful: log-likelihood ratios add up).

    Args:
        map_remembers: the map never forgets, or was there before.

    Attributes:
        active: the hypothesis that predicts the next pose.
        alternatives: the others that are followed.
        past_poses: after an alternative became active, where the robot was at the scans before the
            last, which were thought to be elsewhere.
        failures: the hypothesis that was true of each scan's motion, by its number, where odometry
            was wrong, as far as is known by now.
    """

    def __init__(self, *, map_remembers: bool = False) -> None:
        self._least_onset = SUSPECT_RATIO if map_remembers else -math.inf
        self.active: Hypothesis = "odometry"
        self.alternatives: dict[Hypothesis, AlternativeHypothesis] = {}
        self.past_poses: tuple[Pose2D, ...] = ()
        self.failures: dict[int, Hypothesis] = {}
        self._scan = -1  # the number of the last one
        self._counted: Pose2D | None = None
        self._inertia = Inertia()
        # Where the robot was at the scan before the last, and its motion from there.
        self._before, self._found_motion = Pose2D(), Pose2D()
        # Seconds from the scan before to this one, and of the step before.
        self._stamp_ns, self._step_s, self._step_before_s = 0, 0.0, 0.0
        self._is_at_standstill, self._known_share = True, 0.0

    def begin_anew(self) -> None:
        """The map that alternatives were held against is gone."""
        self.active, self.alternatives, self.past_poses = "odometry", {}, ()

    def motion(self, stamp_ns: int, counted: Pose2D | None) -> Pose2D | None:
        """What the robot did since the last scan by the active hypothesis, in its frame then.

        Args:
            counted: what odometry says; None if nothing, which ends all hypotheses.
        """
        self._scan += 1
        self._step_s, self._stamp_ns = (stamp_ns - self._stamp_ns) * 1e-9, stamp_ns
        self._counted = counted
        if counted is None:
            self.active, self.alternatives, self._step_s = "odometry", {}, 0.0
            return None
        self._is_at_standstill = abs(counted.x) <= STANDSTILL * self._step_s
        # A robot that stands may start anew; wheels that count have not stopped counting.
        if self.active == ("reversed" if self._is_at_standstill else "keeps going"):
            self.active, self.alternatives = "odometry", {}
        return self._predict(self.active, counted, self._found_motion)

    def _predict(self, hypothesis: Hypothesis, counted: Pose2D, last: Pose2D) -> Pose2D:
        """A motion as a hypothesis has it, `last` the one before."""
        if hypothesis == "odometry":
            return counted
        if hypothesis == "reversed":
            return Pose2D(-counted.x, -counted.y, counted.theta)
        share = min(self._step_s / self._step_before_s, 2.0) if self._step_before_s > 0 else 0.0
        return Pose2D(share * last.x, share * last.y, share * last.theta)

    def select(
        self,
        before: Pose2D,
        uncertainty: OdometryUncertainty,
        best: Match,
        scan: ScanInMap,
        history: MatchHistory,
    ) -> Match:
        """The match of the active hypothesis, or that of an alternative that becomes active now.

        Args:
            before: where the robot was at the last scan; uncertainty: of odometry since.
            best: the match around the pose that the active hypothesis predicts.
            scan: for matches near the poses of the others.
        """
        matches: dict[Hypothesis, Match] = {}
        if self._counted is not None:
            motion = self._predict(self.active, self._counted, self._found_motion)
            predicted = before.compose(motion)
            self._follow(before, self._counted, motion)
            others = self.alternatives.values()
            if any(uncertainty.separates(predicted, one.pose, SAME_SIGMAS) for one in others):
                matches = self._compare(predicted, best, uncertainty, scan)
            self._inertia.add(motion, self._step_s)
        if best.found:
            share = best.known_points / scan.size
            self._known_share += MEAN_WEIGHT * (share - self._known_share)
        self._before, self._step_before_s = before, self._step_s
        self._found_motion = before.between(best.pose)
        self.past_poses = ()
        selected = self._accept(matches, MIN_SCORE_SHARE * history.running_score) or best
        for number in range(self._scan - len(self.past_poses), self._scan + 1):
            self.failures.pop(number, None)
            if self.active != "odometry":
                self.failures[number] = self.active
        return selected

    def _follow(self, before: Pose2D, counted: Pose2D, motion: Pose2D) -> None:
        """Move the alternatives on, and let those begin that are likelier to begin now."""
        for name in HYPOTHESES:
            other = self.alternatives.pop(name, None)
            if name == self.active or (name == "keeps going" and not self._is_at_standstill):
                continue
            new = self._beginning(name, before, counted, motion)
            if (
                other is None
                or other.log_ratio < new.log_ratio
                or len(other.past_poses) >= MOST_SCANS
            ):
                other = new
            else:
                other = replace(other, past_poses=(*other.past_poses, other.pose))
            if other.log_ratio >= DROP_RATIO:
                moved = self._predict(name, counted, other.motion)
                pose = other.pose.compose(moved)
                self.alternatives[name] = replace(other, pose=pose, motion=moved)

    def _beginning(
        self, name: Hypothesis, before: Pose2D, counted: Pose2D, motion: Pose2D
    ) -> AlternativeHypothesis:
        """An alternative that parts from the active hypothesis, and its motion, now or during the
        step before."""
        other = self._predict(name, counted, self._found_motion)
        onset = self._inertia.onset(motion, other, self._step_s)
        ratio = min(MOST_INERTIA_RATIO, onset.ratio)
        if name == "odometry":  # it usually is right, so it gets a chance whatever inertia says
            ratio = max(DROP_RATIO, ratio)
        elif ratio < self._least_onset:
            ratio = -MOST_INERTIA_RATIO
        if onset.metres is None:
            return AlternativeHypothesis(ratio, before, self._found_motion)
        step = replace(self._found_motion, x=onset.metres)
        pose = self._before.compose(step)
        return AlternativeHypothesis(ratio, pose, step, (pose,))

    def _compare(
        self, predicted: Pose2D, best: Match, uncertainty: OdometryUncertainty, scan: ScanInMap
    ) -> dict[Hypothesis, Match]:
        """Add up what the scan says of each alternative; the matches of those that are left."""
        matches: dict[Hypothesis, Match] = {}
        # What odometry usually errs by is no failure: the search may have found the place.
        far = uncertainty.separates(predicted, best.pose, uncertainty.window_sigmas)
        active = scan.match_near(predicted, uncertainty) if far else best
        conflicts = self._conflicts(active, scan)
        cost = _prediction_cost(predicted, active.pose, uncertainty)
        for name, other in list(self.alternatives.items()):
            match = self._match(other, active, best, uncertainty, scan)
            if match is None:
                del self.alternatives[name]
                continue
            more = conflicts - self._conflicts(match, scan)
            beyond = max(0.0, abs(more) - EXPECTED_CONFLICT_SHARE * active.known_points)
            ratio = other.log_ratio + math.copysign(beyond, more)
            ratio += cost - _prediction_cost(other.pose, match.pose, uncertainty)
            self.alternatives[name] = replace(other, log_ratio=ratio, pose=match.pose)
            matches[name] = match
        return matches

    @staticmethod
    def _match(
        other: AlternativeHypothesis,
        active: Match,
        best: Match,
        uncertainty: OdometryUncertainty,
        scan: ScanInMap,
    ) -> Match | None:
        """The match next to an alternative's pose; None if the map contradicts it."""
        match = best
        if uncertainty.separates(other.pose, best.pose, SAME_SIGMAS):
            more = scan.free_space_conflicts(other.pose) - active.free_space_conflicts
            if more > DROP_CONFLICT_SHARE * scan.size:
                return None
            match = scan.match_near(other.pose, uncertainty)
        return None if match.known_points < MIN_KNOWN_SHARE * active.known_points else match

    def _conflicts(self, match: Match, scan: ScanInMap) -> float:
        """Points that speak against a match: in free space, or on unknown cells beyond the mean."""
        unknown = max(0.0, self._known_share * scan.size - match.known_points)
        return match.free_space_conflicts + UNKNOWN_WEIGHT * unknown

    def _accept(self, matches: dict[Hypothesis, Match], low: float) -> Match | None:
        """The match of the likeliest alternative, at least of score `low`, if it becomes active."""
        if not matches:
            return None
        name = max(matches, key=lambda one: self.alternatives[one].log_ratio)
        match, other = matches[name], self.alternatives[name]
        enough = ACCEPT_ODOMETRY_RATIO if name == "odometry" else ACCEPT_RATIO
        fits = not match.found or match.score >= low
        if other.log_ratio < enough or not fits:
            return None
        self._inertia.restart(other.motion, self._step_s)
        self._found_motion = other.motion
        self._before = (self._before, *other.past_poses)[-1]
        self.past_poses = other.past_poses
        self.active, self.alternatives = name, {}
        return match


def _prediction_cost(predicted: Pose2D, found: Pose2D, uncertainty: OdometryUncertainty) -> float:
    """How unlikely it is that odometry errs so much: negative log-likelihood, up to a limit."""
    sigmas = predicted.distance(found) / uncertainty.deviations.xy
    return min(MOST_DEVIATIONS, sigmas) ** 2 / 2
