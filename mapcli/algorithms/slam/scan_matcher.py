"""Lines 5 to 8 of Algorithm 9.2: the best of the test positions T around the odometry's pose.

Three ways to search T:

- `window`: every cell and every half degree of a window, by branch and bound, then Gauss-Newton
  for the last millimetres. The window follows what odometry can err by; where the scan does not
  fit the map anywhere in it, odometry is taken to have failed and a far wider one is searched.
- `book`: the fifteen poses of Sect. 9.5 with S, the sum of products, or another `similarity`.
- `none`: the odometry's pose as it is.

The score of `window` is how well the ends of the beams fit the likelihood field, less a penalty
for leaving the odometry's pose. The penalty levels off: odometry that errs a little is believed
against a map that hardly cares (a corridor), odometry that is plainly wrong costs no more than a
fixed share of the score. Ends on unknown cells count nothing (Sect. 9.7: only where both overlap).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.similarity.candidate_poses import neighbours
from mapcli.algorithms.similarity.grid_table import scan_counts
from mapcli.algorithms.similarity.measures import SignMap, Similarity, better, of_counts
from mapcli.algorithms.similarity.perception_map import outline
from mapcli.algorithms.slam._kernels import branch_and_bound as kernels
from mapcli.algorithms.slam.agreement import FULL_SCORE, agreement
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS
from mapcli.algorithms.slam.match import Match, MatchHistory, MatchParameters
from mapcli.algorithms.slam.motion_model import OdometryUncertainty
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.scan_points import ScanPoints, points_of, window_box
from mapcli.model.perception import STEPS, TURNS_DEG
from mapcli.model.pose import Pose2D

FARTHEST_REFINEMENT = 24.0
"""Cells that the refinement may move a point: less than `occupancy.MARGIN`."""

NEAR_CELLS, NEAR_TURN = 4.0, math.radians(5)
"""How far from the right pose a fit still finds it: cells and radians."""

SHARES = 0.4, 1.0
"""Of the window: what is searched first, since odometry seldom errs by all that it may."""

FIFTEEN = neighbours(STEPS, TURNS_DEG)
"""The poses of Sect. 9.5."""


def best_pose(
    grid: OccupancyGrid,
    perception: Perception,
    predicted: Pose2D,
    uncertainty: OdometryUncertainty,
    parameters: MatchParameters,
    lately: MatchHistory | None = None,
) -> Match:
    """The position in T, around the predicted pose, whose perception fits the map best.

    `lately` is what is known from the scans before.
    """
    if parameters.search == "book":
        return best_of_fifteen(grid, perception, predicted, parameters.similarity)
    points = points_of(perception, grid.parameters.resolution)
    if parameters.search == "none" or len(points.metres) < parameters.fewest:
        return Match(predicted, 0.0, 0, found=False)
    return _Window(grid, points, predicted, uncertainty, parameters).best(lately or MatchHistory())


class ScanInMap:
    """A scan held against a map at this pose or that, without a search.

    Attributes:
        grid: the map; size: how many points the scan has.
    """

    def __init__(
        self, grid: OccupancyGrid, perception: Perception, parameters: MatchParameters
    ) -> None:
        self.grid, self.parameters = grid, parameters
        self._points = points_of(perception, grid.parameters.resolution)
        self._last: _Window | None = None

    @property
    def size(self) -> int:
        return len(self._points.metres)

    def contradictions(self, pose: Pose2D, uncertainty: OdometryUncertainty) -> int:
        """Points where the map knows that there is no wall."""
        return (
            self._window(pose, uncertainty).at_once().free_space_conflicts
            if self._says_something()
            else 0
        )

    def next_to(self, predicted: Pose2D, uncertainty: OdometryUncertainty) -> Match:
        """The match next to a predicted pose, or that pose where the scan says nothing."""
        if not self._says_something():
            return Match(predicted, 0.0, 0, found=False)
        match = self._window(predicted, uncertainty).next_to()
        return match if match.found else replace(match, pose=predicted)

    def _says_something(self) -> bool:
        return self.size >= self.parameters.fewest

    def _window(self, pose: Pose2D, uncertainty: OdometryUncertainty) -> _Window:
        """A window around a pose; the last one, moved, since making one takes longer than a look
        through it."""
        window = self._last or _Window(self.grid, self._points, pose, uncertainty, self.parameters)
        window.predicted, window.uncertainty, self._last = pose, uncertainty, window
        return window


class _Window:
    """One search of a window around a predicted pose."""

    def __init__(
        self,
        grid: OccupancyGrid,
        points: ScanPoints,
        predicted: Pose2D,
        uncertainty: OdometryUncertainty,
        parameters: MatchParameters,
    ) -> None:
        self.grid, self.parameters, self.uncertainty = grid, parameters, uncertainty
        self.predicted = predicted
        self.cell = grid.parameters.resolution
        self.points = points
        self.turn_step = math.radians(parameters.step_theta_deg)
        stride = 1 if parameters.step_xy is None else round(parameters.step_xy / self.cell)
        self.stride = max(1, stride)
        # The best of the windows searched so far, on the grid of poses and refined.
        self.found: tuple[NDArray[np.float64], Match] | None = None
        self.weight = FULL_SCORE * max(len(points.metres), parameters.usual) * parameters.prior

    def best(self, lately: MatchHistory) -> Match:
        """The best pose; a far wider window is searched when odometry seems lost."""
        p, uncertainty = self.parameters, self.uncertainty
        deviations = uncertainty.deviations
        half_xy = p.window_xy + uncertainty.window_sigmas * deviations.xy
        half_turn = math.radians(p.window_theta_deg) + uncertainty.window_sigmas * deviations.theta
        self._cover(half_xy, half_turn)
        stay = best = self._settle(self.predicted)
        if p.refine and self._is_trusted(stay, lately.score):
            return stay
        for share in SHARES:
            best = self._search(share * half_xy, share * half_turn)
            if self._is_usual(best, lately.score):
                break
        if best.score < p.lost_below * lately.score:
            best = self._doubt(best, lately, half_xy)
        elif p.refine and self._is_far(best.pose) and stay.score >= best.score - p.indifferent:
            # Along a wall the scan fits best where it covers most of the map, which is where
            # it was taken before; odometry knows better unless the map contradicts.
            best = stay
        return best if best.found else replace(best, pose=self.predicted)

    def next_to(self) -> Match:
        """The best pose beside the predicted one."""
        self._cover(FARTHEST_REFINEMENT * self.cell, NEAR_TURN)
        return self._settle(self.predicted)

    def at_once(self) -> Match:
        """The match at the predicted pose as it is."""
        self._cover(0.0, 0.0)
        return self._compare(self.predicted)

    def _is_trusted(self, match: Match, usual_score: float) -> bool:
        """Whether the pose next to the odometry's fits as well as any, so that none need be
        searched for."""
        if (
            self.uncertainty.deviations.xy > NEAR_CELLS * self.cell
            or self.uncertainty.deviations.theta > NEAR_TURN
        ):
            return False  # the fit may have ended beside the right place
        far = self._is_far(match.pose, self.parameters.trusted)
        return self._is_usual(match, usual_score) and not far

    def _is_usual(self, match: Match, usual_score: float) -> bool:
        """Whether a match is as good as others lately."""
        enough = match.known_points >= self.parameters.lost_overlap * len(self.points.metres)
        return enough and match.score >= usual_score - self.parameters.indifferent

    def _is_far(self, pose: Pose2D, deviations: float = 1.0) -> bool:
        """Whether a pose is farther from the predicted one than odometry usually errs."""
        turn = abs(self.predicted.between(pose).theta)
        far = self.predicted.distance(pose) > deviations * self.uncertainty.deviations.xy
        return far or turn > deviations * self.uncertainty.deviations.theta

    def _doubt(self, best: Match, lately: MatchHistory, half_xy: float) -> Match:
        """The scan fits the map worse than usual: odometry may be lost, or the map too young."""
        p, uncertainty, low = (
            self.parameters,
            self.uncertainty,
            self.parameters.lost_below * lately.score,
        )
        wide_xy = max(half_xy, p.lost_xy + p.lost_xy_per_m * uncertainty.metres)
        wide_turn = math.radians(p.lost_theta_deg)
        self._cover(wide_xy, wide_turn)
        other = self._search(wide_xy, wide_turn)
        enough = other.known_points >= p.lost_overlap * len(self.points.metres)
        gain = other.score - best.score if enough and other.score >= low else 0.0
        doubtful = gain >= p.lost_gain
        again = lately.doubted and self.predicted.distance(other.pose) <= p.lost_leap
        if doubtful and (again or gain >= p.lost_gain_at_once):
            return replace(other, doubtful=True)
        found = best.found and best.score >= p.odd_below * lately.score
        return replace(best, found=found, doubtful=doubtful)

    def _search(self, half_xy: float, half_turn: float) -> Match:
        """The best pose in a window around the predicted one, which is covered, refined; each
        window holds the one before."""
        start = self.grid.pose_to_cells(self.predicted)
        reach = math.ceil(half_xy / self.cell)
        cell_prior = (self.cell / self.uncertainty.deviations.xy) ** 2
        step_prior = (self.turn_step / self.uncertainty.deviations.theta) ** 2
        before = self.found and self.found[0]
        found = kernels.search(
            self.grid.fields,
            LEVEL_WIDTHS,
            self.points.cells,
            start,
            (reach, math.ceil(half_turn / self.turn_step)),
            (self.stride, self.turn_step),
            (self.weight, self.parameters.prior_knee, cell_prior, step_prior),
            kernels.top_level(reach),
            before,
        )
        if self.found is None or (found != before).any():
            du, dv, turn = found[:3].tolist()
            shift = np.array([du, dv, turn * self.turn_step])
            self.found = found, self._settle(self.grid.pose_from_cells(start + shift))
        return self.found[1]

    def _settle(self, near: Pose2D) -> Match:
        """Refine a pose, and see how well the scan agrees with the map there."""
        return self._compare(*self._refine(near)) if self.parameters.refine else self._compare(near)

    def _compare(self, pose: Pose2D, information: NDArray[np.float64] | None = None) -> Match:
        """How well the scan agrees with the map at a pose."""
        score, known, conflicts = agreement(
            self.grid, self.points.cells, self.grid.pose_to_cells(pose)
        )
        found = known >= self.parameters.fewest
        return Match(pose, score, known, found, information, conflicts)

    def _cover(self, half_xy: float, half_turn: float) -> None:
        """Make the map hold every point of every pose in the window."""
        far = half_xy + self.cell
        if not self.grid.holds(self.predicted, self.points.radius + far):
            turn = half_turn + self.turn_step
            self.grid.cover(*window_box(self.points.metres, self.predicted, far, turn))

    def _refine(self, near: Pose2D) -> tuple[Pose2D, NDArray[np.float64] | None]:
        """The last millimetres, unless they lead astray."""
        fit = self.grid.surfels.fit(
            self.points.metres, near, self.predicted, self.uncertainty.deviations
        )
        moved = near.distance(fit.pose) + abs(near.between(fit.pose).theta) * self.points.radius
        trusted = fit.matched >= self.parameters.fewest and moved < FARTHEST_REFINEMENT * self.cell
        return (fit.pose, fit.information_in_own_frame()) if trusted else (near, None)


def best_of_fifteen(
    grid: OccupancyGrid,
    perception: Perception,
    predicted: Pose2D,
    similarity: Similarity = "product",
) -> Match:
    """The best of the fifteen poses of Sect. 9.5; the first of equals, the intended one first.

    The table is that of `mapcli similarity-table` (see `similarity_table.scan_counts`).
    """
    cell = grid.parameters.resolution
    points = np.concatenate([perception.hits, perception.open_ends, perception.laser[None]])
    reach = 3 * cell + float(np.hypot(*points.T).max())
    centre = np.array([predicted.x, predicted.y])
    grid.cover(centre - reach, centre + reach)
    start = grid.pose_to_cells(predicted)
    # Only the part of the map that can be reached is compared.
    low = np.floor(start[:2] - reach / cell).astype(np.int64)
    high = np.ceil(start[:2] + reach / cell).astype(np.int64)
    part = np.sign(grid.log_odds[low[1] : high[1], low[0] : high[0]]).astype(np.int8)
    counts = scan_counts(
        SignMap(part),
        outline(perception, cell, walls="ends"),
        start - np.append(low, 0),
        np.radians(FIFTEEN.turns_deg),
        FIFTEEN.offsets,
        compiled=True,
    ).swapaxes(0, 1)
    scores = better(similarity, of_counts(similarity, counts))
    scores[counts.sum(axis=(2, 3)) == 0] = -np.inf
    position, turn = np.unravel_index(int(np.argmax(scores)), scores.shape)
    best = start + np.append(FIFTEEN.offsets[position], math.radians(FIFTEEN.turns_deg[turn]))
    score, known, conflicts = agreement(grid, perception.hits / cell, best)
    pose = grid.pose_from_cells(best)
    return Match(pose, score, known, found=known > 0, free_space_conflicts=conflicts)
