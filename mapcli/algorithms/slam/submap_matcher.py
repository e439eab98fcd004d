"""Finding one submap in the map that another one made: the measurement of a loop.

The points of some metres of trajectory, taken together, are far less ambiguous than one scan. They
are searched for in a wide window by branch and bound (correlative scan matching), fitted to the
surfels, and then asked what else would have fitted: a match is as uncertain as the poses that
score nearly as much (Olson 2009, real-time correlative scan matching).
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam._kernels.window_scores import rotated_scans, score_shifts
from mapcli.algorithms.slam.agreement import FULL_SCORE, agreement
from mapcli.algorithms.slam.correlative_search import (
    SearchWindow,
    best_in_window,
    prediction_prior,
)
from mapcli.algorithms.slam.keyframes import Keyframe
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.scan_points import voxel_filtered, window_box
from mapcli.algorithms.slam.submaps import keyframes_around
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import (
    Covariance,
    PositionCovariance,
    StandardDeviations,
    covariance_from_information,
    turned_covariance,
)

POINTS_M, MAP_M = 5.0, 10.0
"""Metres of trajectory before and after an origin whose points, or whose map, are taken: the map
reaches farther, so that points near its end find their walls."""

FARTHEST_POINT = 20.0
"""Metres from the robot; what is farther makes maps large for little."""

KEYFRAME_STEP_M, KEYFRAME_STEP = 0.7, math.radians(45.0)
"""Metres and radians; of keyframes nearer than both to the last one taken, nothing new is seen."""

SEARCH_CELL, POINT_CELL = 0.2, 0.1
"""Metres along a square that keeps one point: of those searched for, and of those fitted. Coarser
points find the same place in less time; finer ones fit better."""

TURN_STEP = math.radians(0.5)
"""Between headings that are searched: at 6 m a cell of 5 cm."""

PRIOR_WEIGHT = 0.1
"""What a pose loses by being unlikely, at most, as a share of a perfect score."""

SCORE_SCALE = 0.02
"""Poses that score this much less, as a share of a perfect score, are e times less likely."""

SCORE_STRIDE = 2
"""Cells between poses that are asked whether they would have fitted as well."""

LEAST_DEVIATIONS = StandardDeviations(0.02, math.radians(0.2))
"""Of a match, however well it fits: the submaps themselves are a little bent."""

EDGE = 2
"""Cells, or steps of the turn, from the edge of a window at which a better fit may lie outside."""

CACHED_MAPS = 8
"""Maps kept for the next comparison: enough for the candidates of two submaps."""


@dataclass(frozen=True, slots=True, eq=False)
class SubmapMatch:
    """Where a submap was found in another's map.

    Attributes:
        pose: of the found submap's origin, as seen from the other's.
        covariance: of it, in its own frame.
        score: agreement of the points that the map knows something about, 0 to 1.
        overlap: the share of the points that it knows something about, 0 to 1.
        at_edge: the best fit is at the edge of the window, so a better one may lie outside.
    """

    pose: Pose2D
    covariance: Covariance
    score: float
    overlap: float
    at_edge: bool


class SubmapMatcher:
    """Compares submaps of a trajectory (stateful: keeps some of their maps).

    A submap is named by its origin, a keyframe's number.
    """

    def __init__(
        self, keyframes: list[Keyframe], map_: MapParameters, cached_maps: int = CACHED_MAPS
    ) -> None:
        self.keyframes, self.map, self.cached_maps = keyframes, map_, cached_maps
        self._maps: OrderedDict[int, OccupancyGrid] = OrderedDict()

    def match(
        self,
        old: int,
        new: int,
        predicted: Pose2D,
        window: SearchWindow,
        deviations: StandardDeviations,
    ) -> SubmapMatch | None:
        """Look for the submap `new` in the map of `old`; None if `new` saw nothing.

        Args:
            predicted: `new` as seen from `old`; window: around it.
            deviations: of the prediction, which weigh against poses far from it.
        """
        points = self.points(new)
        if not len(points):
            return None
        cell = self.map.resolution
        poses = window.poses(cell, TURN_STEP)
        far, wide = (poses.reach + max(LEVEL_WIDTHS)) * cell, (poses.turns + 1) * TURN_STEP
        grid = self.map_around(old, window_box(points, predicted, far, wide))
        start = grid.pose_to_cells(predicted)
        cells = voxel_filtered(points, SEARCH_CELL) / cell
        most = PRIOR_WEIGHT * FULL_SCORE * len(cells)
        prior = prediction_prior(most, deviations, cell, TURN_STEP)
        found = best_in_window(grid, cells, start, poses, prior)
        best = found.cells(start, TURN_STEP)
        fit = grid.surfels.fit(points, grid.pose_from_cells(best))
        score, known, _ = agreement(grid, cells, grid.pose_to_cells(fit.pose))
        at_edge = max(abs(found.du), abs(found.dv)) >= poses.reach - EDGE
        at_edge = at_edge or abs(found.turn) >= poses.turns - EDGE
        spread = self._score_covariance(grid, cells, best, (start - best)[:2].round(), poses.reach)
        covariance = covariance_from_information(fit.information_in_own_frame())
        covariance += LEAST_DEVIATIONS.covariance()
        covariance += turned_covariance(spread, -fit.pose.theta)
        return SubmapMatch(fit.pose, covariance, score, known / len(cells), at_edge)

    def points(self, origin: int) -> NDArray[np.float64]:
        """What was seen in a submap, shape (n, 2), metres in the frame of its origin."""
        seen = [pose.apply(one.hits) for pose, one in self.seen_in(origin)]
        return voxel_filtered(np.concatenate(seen), POINT_CELL)

    def seen_in(self, origin: int, metres: float = POINTS_M) -> list[tuple[Pose2D, Perception]]:
        """What was hit in a submap, near the robot, with the poses in the frame of its origin."""
        at = self.keyframes[origin].pose
        return [
            (at.between(self.keyframes[k].pose), self._near_hits(k))
            for k in self._chosen(origin, metres)
        ]

    def map_around(self, origin: int, room: NDArray[np.float64] | None = None) -> OccupancyGrid:
        """The map that was made around an origin, in its frame.

        Args:
            room: a box that the map must hold as well, its lowest and highest (x, y), metres.
        """
        grid = self._maps.pop(origin, None) or self._make_map(origin, room)
        if room is not None:
            grid.extend_to(*room)
        self._maps[origin] = grid
        if len(self._maps) > self.cached_maps:
            self._maps.popitem(last=False)
        return grid

    def _make_map(self, origin: int, room: NDArray[np.float64] | None) -> OccupancyGrid:
        """`map_around`, which has room for the box from the start, so that it need not grow."""
        grid, seen = OccupancyGrid(self.map), self.seen_in(origin, MAP_M)
        ends = [pose.apply(one.hits) for pose, one in seen]
        held = np.concatenate(ends if room is None else [*ends, room])
        if len(held):
            grid.extend_to(held.min(axis=0), held.max(axis=0))
        for pose, perception in seen:
            grid.integrate(pose, perception, update_field=False)
        grid.build_likelihood_field()
        return grid

    def _near_hits(self, keyframe: int) -> Perception:
        """What a keyframe hit near the robot; no beams without a hit."""
        seen = self.keyframes[keyframe].perception
        hits = seen.hits[(seen.hits**2).sum(axis=1) <= FARTHEST_POINT**2]
        return Perception(hits, np.empty((0, 2)), seen.laser)

    def _chosen(self, origin: int, metres: float) -> list[int]:
        """Keyframes around an origin, as many as it takes to see everything there."""
        chosen: list[int] = []
        for k in keyframes_around(self.keyframes, origin, metres):
            last = self.keyframes[chosen[-1] if chosen else k].pose
            step = last.between(self.keyframes[k].pose)
            far = math.hypot(step.x, step.y) >= KEYFRAME_STEP_M
            if not chosen or k == origin or far or abs(step.theta) >= KEYFRAME_STEP:
                chosen.append(k)
        return chosen

    def _score_covariance(
        self,
        grid: OccupancyGrid,
        cells: NDArray[np.float64],
        best: NDArray[np.float64],
        centre: NDArray[np.float64],
        reach: int,
    ) -> PositionCovariance:
        """Second moments, about the best pose, of the positions in a window, weighted by how they
        score at the best heading; in the axes of the map.

        Args:
            cells: points, shape (n, 2), in cells in the frame of the submap.
            best: (u, v, theta) of the best pose, in cells of the array and radians.
            centre: of the window, (u, v) in cells from the best pose; reach: its half-width.
        """
        columns, count = grid.log_odds.shape[1], 2 * reach // SCORE_STRIDE
        scan = rotated_scans(cells, best, 0, 0.0, columns)[0]
        # Whole strides from the best pose, so that it is one of those that are asked.
        low_u, low_v = (
            math.ceil((c - reach) / SCORE_STRIDE) * SCORE_STRIDE for c in centre.tolist()
        )
        sums = np.empty((count, count), np.int64)
        field = grid.pyramid[1].reshape(-1)
        score_shifts(field, scan, columns, (low_u, low_v), SCORE_STRIDE, sums)
        share = (sums - sums.max()) / (FULL_SCORE * len(cells) * SCORE_SCALE)
        weights = np.exp(share)
        steps = np.arange(count) * SCORE_STRIDE
        x, y = ((steps + low) * self.map.resolution for low in (low_u, low_v))
        total = weights.sum()
        xx, yy = (weights * x**2).sum() / total, (weights.T * y**2).sum() / total
        xy = (weights * np.outer(y, x)).sum() / total
        return np.array([[xx, xy], [xy, yy]])
