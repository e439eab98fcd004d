"""Lines 5 to 8 of Algorithm 9.2: the best of the test positions T around the odometry's pose n.

`match_scan` knows three ways to search T, by `MatchParameters.search`:

- `window`: correlative scan matching, every cell and every half degree of a window by branch and
  bound (`correlative_search`), then Gauss-Newton on the distances of points from lines for the last
  millimetres (`pose_refinement`). The window follows what odometry can err by; where the scan
  does not fit the map anywhere in it, odometry is taken to have failed, and a far wider one is
  searched (relocalisation).
- `book`: the fifteen poses of Sect. 9.5 (`book_matcher`).
- `none`: the odometry's pose as it is.

The score of `window` is how well the ends of the beams fit the likelihood field, less a prior for
leaving the odometry's pose. Where the likelihood is flat, along a corridor, the prior decides; it
saturates, so that gross odometry errors cost no more than a fixed share of the score. Ends on
unknown cells count nothing (Sect. 9.7: only where both overlap).
"""

from __future__ import annotations

import math
from dataclasses import replace

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.agreement import FULL_SCORE
from mapcli.algorithms.slam.book_matcher import best_of_fifteen
from mapcli.algorithms.slam.correlative_search import (
    BestPose,
    SearchWindow,
    best_in_window,
    prediction_prior,
)
from mapcli.algorithms.slam.match import (
    MIN_OVERLAP,
    Alternative,
    Match,
    MatchHistory,
    MatchParameters,
)
from mapcli.algorithms.slam.motion_model import OdometryUncertainty
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.pose_refinement import (
    CONVERGENCE_CELLS,
    CONVERGENCE_TURN,
    ScanInMap,
)
from mapcli.model.pose import Pose2D

WINDOW_SHARES = 0.4, 1.0
"""Of the window: what is searched first, since odometry seldom errs by all that it may."""

WIDEST_XY = 12.0
"""Half-width of a window at most, metres, unless a wider one was asked for: odometry that may be
farther off than a room is wide is no prediction, and time and memory grow with the square."""

TRUSTED_SIGMAS = 2.0
"""Standard deviations of odometry within which the pose refined from the predicted one is taken
without a search, if the scan fits there as well as scans before."""

SCORE_MARGIN = 0.03
"""A match is as good as those before if its score is less than this below the running score."""

FEW_POINTS = 40
"""A scan of fewer points says less than it seems to: the prior weighs as if it had that many."""

RELOCALISE_BELOW, LOST_BELOW = 0.9, 0.6
"""Shares of the running score: below the first, odometry is suspected to have failed and the
relocalisation window is searched; below the second the map contradicts the pose."""

FITS_FROM = 0.8
"""The share of the running score from which on scans tell that the robot is elsewhere than odometry
has it: in a wide window any scan finds walls for half of its points, and so does the next one. That
it has turned they tell together, for there are fewer headings than places."""

DECISIVE = 5.0
"""Nats by which a match is likelier than odometry's pose, at least, where the map contradicts both:
odds of 150 to one."""

RELOCALISATION_XY, RELOCALISATION_XY_PER_M = 0.5, 2.2
"""Half-width of the relocalisation window: metres, and metres for each metre driven since the scan
before; wheels that count backwards err by twice what they count."""

SAME_SIGMAS = 2.0
"""Standard deviations of odometry within which an alternative is found again."""

RELOCALISATION_TURN = math.radians(45)
"""The same for the heading, radians."""

LOST_SIGMAS = 2.0
"""Standard deviations, of what has added up since the map told the pose last, by which the
relocalisation window is wider."""

POINT_EVIDENCE = 0.9
"""Nats that a point which fits says against a pose where it does not: ln 20, since one point in
twenty fits nowhere, times the share of the points that are evidence of their own."""


def match_scan(
    grid: OccupancyGrid,
    perception: Perception,
    predicted: Pose2D,
    uncertainty: OdometryUncertainty,
    parameters: MatchParameters,
    history: MatchHistory | None = None,
) -> Match:
    """The pose in T, around the predicted pose, whose perception fits the map best.

    Args:
        grid: the map, in whose frame poses are.
        predicted: the robot's pose by odometry; uncertainty: how far off it may be.
        history: what is known from the scans before.
    """
    if parameters.search == "none":
        return Match(predicted, 0.0, 0, found=False)
    if parameters.search == "book":
        suspected = history.alternative if history else None
        return best_of_fifteen(grid, perception, predicted, parameters, suspected)
    scan = ScanInMap(grid, perception, parameters)
    if not scan.has_enough_points:
        return Match(predicted, 0.0, 0, found=False)
    history = history or MatchHistory()
    return _WindowMatcher(scan, predicted, uncertainty, parameters, history).match()


class _WindowMatcher:
    """One search around a predicted pose (stateful: windows searched before); `match` is the
    algorithm."""

    def __init__(
        self,
        scan: ScanInMap,
        predicted: Pose2D,
        uncertainty: OdometryUncertainty,
        parameters: MatchParameters,
        history: MatchHistory,
    ) -> None:
        self.scan, self.parameters, self.history = scan, parameters, history
        self.predicted, self.uncertainty = predicted, uncertainty
        # The best pose of the windows searched so far, and the match refined from it.
        self._searched: tuple[BestPose, Match] | None = None

    def match(self) -> Match:
        """The best pose of the window.

        1. Refine the odometry's pose: where the scan then fits as well as those before, done.
        2. Search a part of the window, then all of it, and refine the best pose.
        3. Odometry's pose is left for it only if the evidence outweighs odometry's: the score is
           biased to where the scan overlaps the map most, which is where it was taken before.
        4. Relocalise where the scan does not fit as before: odometry seems to have failed.
        """
        p, window = self.parameters, self._window()
        self.scan.cover(self.predicted, window)
        near = best = self._refine(self.predicted)  # 1
        if p.refine and self._is_trusted(near):
            return near
        for share in WINDOW_SHARES:  # 2
            best = self._search(SearchWindow(share * window.xy, share * window.theta))
            if self._is_as_good(best):
                break
        if p.refine and self._is_far(best.pose) and self._odds(best, near) <= 0:  # 3
            best = near
        if p.relocalise and best.score < RELOCALISE_BELOW * self.history.running_score:  # 4
            best = self._relocalise(best)
        return best if best.found else replace(best, pose=self.predicted)

    def _window(self) -> SearchWindow:
        """What odometry may err by, and a little more."""
        p, deviations = self.parameters, self.uncertainty.deviations
        sigmas = self.uncertainty.window_sigmas
        return SearchWindow(
            min(p.window_xy + sigmas * deviations.xy, max(p.window_xy, WIDEST_XY)),
            min(math.radians(p.window_theta_deg) + sigmas * deviations.theta, math.pi),
        )

    def _search(self, window: SearchWindow) -> Match:
        """Branch and bound over a window around the predicted pose, then refinement.

        The window is covered, and holds those searched before.
        """
        scan, known = self.scan, self._searched and self._searched[0]
        middle = scan.grid.pose_to_cells(self.predicted)
        poses = window.poses(scan.cell, scan.turn_step, self._stride())
        weight = FULL_SCORE * max(scan.size, FEW_POINTS) * self.parameters.odometry_prior
        deviations = self.uncertainty.deviations
        prior = prediction_prior(weight, deviations, scan.cell, scan.turn_step)
        best = best_in_window(scan.grid, scan.points.cells, middle, poses, prior, known)
        if self._searched is None or best != known:
            pose = scan.grid.pose_from_cells(best.cells(middle, scan.turn_step))
            self._searched = best, self._refine(pose)
        return self._searched[1]

    def _stride(self) -> int:
        """Cells between test positions."""
        step = self.parameters.step_xy
        return 1 if step is None else max(1, round(step / self.scan.cell))

    def _refine(self, near: Pose2D) -> Match:
        return self.scan.refine(near, self.predicted, self.uncertainty)

    def _relocalise(self, best: Match) -> Match:
        """Search a far wider window. What is found there is taken if the map contradicts `best`, if
        no robot moves as odometry counts, or if the scan before, moved on by odometry, was found
        there too; and only if the evidence outweighs that odometry seldom fails."""
        since = self.uncertainty.since_known
        xy = RELOCALISATION_XY + RELOCALISATION_XY_PER_M * self.uncertainty.metres
        xy = max(self._window().xy, min(xy + LOST_SIGMAS * since.xy, WIDEST_XY))
        turn = min(RELOCALISATION_TURN + LOST_SIGMAS * since.theta, math.pi)
        wide = SearchWindow(xy, turn)
        self.scan.cover(self.predicted, wide)
        other, before = self._search(wide), self.history.alternative
        evidence, again = self._evidence(other, best), 0.0
        if not self._overlaps(other) or evidence <= 0:
            return self._unless_lost(best)
        if before and not self.uncertainty.separates(before.pose, other.pose, SAME_SIGMAS):
            again = before.evidence
        is_suspect = again > 0 or self.uncertainty.is_suspect or self._is_lost(best)
        fits = other.score >= FITS_FROM * self.history.running_score
        has_turned = self.predicted.distance(other.pose) <= self._window().xy
        is_likely = fits or (again > 0 and has_turned)
        if is_suspect and is_likely and self._odds(other, best) + again >= 0:
            return other
        alternative = Alternative(other.pose, evidence + again)
        return replace(self._unless_lost(best), alternative=alternative)

    def _unless_lost(self, match: Match) -> Match:
        """A match; not found if the map contradicts it, unless it is where odometry may err to, and
        the pose as predicted is far less likely."""
        if not match.found or not self._is_lost(match):
            return match
        is_near = not self._is_far(match.pose, self.uncertainty.window_sigmas)
        found = is_near and self._odds(match, self.scan.compare(self.predicted)) > DECISIVE
        return replace(match, found=found, is_contradicted=not found)

    def _odds(self, match: Match, other: Match) -> float:
        """How much likelier a match is than another by scan and odometry together, nats."""
        return self._evidence(match, other) - self._cost(match) + self._cost(other)

    def _evidence(self, match: Match, other: Match) -> float:
        """What the scan says for a match and against another, nats. As many points count as are on
        known ground in both: that one overlaps the map more is no evidence (Sect. 9.7)."""
        points = min(match.known_points, other.known_points)
        points_alone = self.scan.independent * points
        return POINT_EVIDENCE * points_alone * (match.score - other.score)

    def _cost(self, match: Match) -> float:
        """What odometry says against a match, nats."""
        return self.uncertainty.cost(self.predicted, match.pose)

    def _is_lost(self, match: Match) -> bool:
        """Whether the map contradicts a match."""
        return match.score < LOST_BELOW * self.history.running_score

    def _is_trusted(self, match: Match) -> bool:
        """Whether the match refined from the predicted pose fits as well as any, so that nothing
        need be searched."""
        deviations = self.uncertainty.deviations
        if deviations.xy > CONVERGENCE_CELLS * self.scan.cell:
            return False  # the refinement may have ended beside the right pose
        if deviations.theta > CONVERGENCE_TURN:
            return False
        return self._is_as_good(match) and not self._is_far(match.pose, TRUSTED_SIGMAS)

    def _is_as_good(self, match: Match) -> bool:
        """Whether a match is as good as those of the scans before."""
        return self._overlaps(match) and match.score >= self.history.running_score - SCORE_MARGIN

    def _overlaps(self, match: Match) -> bool:
        return match.known_points >= MIN_OVERLAP * self.scan.size

    def _is_far(self, pose: Pose2D, sigmas: float = 1.0) -> bool:
        """Whether a pose is farther from the predicted one than odometry usually errs."""
        return self.uncertainty.separates(self.predicted, pose, sigmas)
