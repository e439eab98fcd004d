"""Finding one submap in the map that another one made: the measurement of a loop.

The points of some metres of trajectory, taken together, are far less ambiguous than one scan. They
are searched for in a wide window by branch and bound, fitted to the walls, and then asked what else
would have fitted (Olson 2009: a match is as uncertain as the poses that score nearly as much).
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam._kernels import branch_and_bound as kernels
from mapcli.algorithms.slam._kernels.window_scores import fits
from mapcli.algorithms.slam.agreement import FULL_SCORE, agreement
from mapcli.algorithms.slam.keyframes import Keyframe
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS
from mapcli.algorithms.slam.occupancy_grid import MapParameters, OccupancyGrid
from mapcli.algorithms.slam.scan_points import thinned, window_box
from mapcli.algorithms.slam.submaps import keyframes_around
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import (
    Covariance,
    PositionCovariance,
    StandardDeviations,
    covariance_from_information,
    turned_covariance,
)

TURN_STEP = math.radians(0.5)

STRIDE = 2
"""Cells between poses that are asked whether they would have fitted as well."""

EDGE = 2
"""Cells, or steps of the turn, from the edge of a window at which a better fit may lie outside."""


@dataclass(frozen=True)
class SubmapMatchParameters:
    """How submaps are compared.

    Attributes:
        points_m, map_m: metres before and after an origin whose points, or whose map, are taken.
        farthest: metres from the robot to what counts.
        apart_m, apart_deg: keyframes nearer to the last one taken than both are left out.
        search_cell, cell: metres between points that are searched for, and that are fitted.
        prior: the most that a pose loses by being unlikely, as a share of a perfect score.
        nearly: poses that score this much less, as a share of a perfect score, are e times less
            likely.
        floor, floor_deg: how far off a match may be besides, metres and degrees: the submaps
            themselves are a little bent.
        maps: how many maps are kept for the next comparison.
    """

    points_m: float = 5.0
    map_m: float = 10.0
    farthest: float = 20.0
    apart_m: float = 0.7
    apart_deg: float = 45.0
    search_cell: float = 0.2
    cell: float = 0.1
    prior: float = 0.1
    nearly: float = 0.02
    floor: float = 0.02
    floor_deg: float = 0.2
    maps: int = 8


@dataclass(frozen=True, slots=True, eq=False)
class SubmapMatch:
    """Where a submap was found in another's map.

    Attributes:
        pose: the one's origin as seen from the other's.
        covariance: of it, shape (3, 3), in the found origin's frame.
        score: agreement of the points that the map knows something about, 0 to 1.
        overlap: the share of the points that it knows something about.
        at_edge: the best fit is at the edge of the window, so a better one may lie outside.
    """

    pose: Pose2D
    covariance: Covariance
    score: float
    overlap: float
    at_edge: bool


class SubmapMatcher:
    """Compares submaps of a trajectory (stateful: keeps some of their maps)."""

    def __init__(
        self,
        keyframes: list[Keyframe],
        map_: MapParameters,
        parameters: SubmapMatchParameters | None = None,
    ) -> None:
        self.keyframes, self.map = keyframes, map_
        self.parameters = parameters or SubmapMatchParameters()
        self._maps: OrderedDict[int, OccupancyGrid] = OrderedDict()

    def match(
        self,
        old: int,
        new: int,
        predicted: Pose2D,
        window: tuple[float, float],
        deviations: StandardDeviations,
    ) -> SubmapMatch | None:
        """Look for the surroundings of keyframe `new` in those of `old`.

        Args:
            predicted: `new` as seen from `old`.
            window: half-widths around it, metres and radians.
            deviations: how far off it is likely to be: standard deviations.
        """
        points = self.points(new)
        if not len(points):
            return None
        cell = self.map.resolution
        half = math.ceil(window[0] / cell), math.ceil(window[1] / TURN_STEP)
        far, wide = (half[0] + max(LEVEL_WIDTHS)) * cell, (half[1] + 1) * TURN_STEP
        grid = self.map_around(old, window_box(points, predicted, far, wide))
        start = grid.pose_to_cells(predicted)
        cells = thinned(points, self.parameters.search_cell) / cell
        du, dv, turn, _, _ = kernels.search(
            grid.fields, LEVEL_WIDTHS, cells, start, half, (1, TURN_STEP),
            self._prior(len(cells), deviations), kernels.top_level(half[0]),
        )  # fmt: skip
        best = start + np.array([du, dv, turn * TURN_STEP])
        fit = grid.surfels.fit(points, grid.pose_from_cells(best))
        score, known, _ = agreement(grid, cells, grid.pose_to_cells(fit.pose))
        at_edge = max(abs(du), abs(dv)) >= half[0] - EDGE or abs(turn) >= half[1] - EDGE
        doubt = self._doubt(grid, cells, best, (start - best)[:2].round(), half[0])
        covariance = covariance_from_information(fit.information_in_own_frame()) + self._floor()
        covariance += turned_covariance(doubt, -fit.pose.theta)
        return SubmapMatch(fit.pose, covariance, score, known / len(cells), at_edge)

    def points(self, origin: int) -> NDArray[np.float64]:
        """What was seen around a keyframe, shape (n, 2), in its frame."""
        p, at = self.parameters, self.keyframes[origin].pose
        seen = [
            at.between(self.keyframes[k].pose).apply(self._near(k).hits)
            for k in self._some(origin, p.points_m)
        ]
        return thinned(np.concatenate(seen), p.cell)

    def map_around(self, origin: int, room: NDArray[np.float64] | None = None) -> OccupancyGrid:
        """The map that was made around a keyframe, in its frame; it holds a box as well, the
        lowest and the highest (x, y)."""
        grid = self._maps.pop(origin, None) or self._make_map(origin, room)
        if room is not None:
            grid.cover(*room)
        self._maps[origin] = grid
        if len(self._maps) > self.parameters.maps:
            self._maps.popitem(last=False)
        return grid

    def _make_map(self, origin: int, room: NDArray[np.float64] | None) -> OccupancyGrid:
        """`map_around`, which has room for the box from the start, so that it need not grow."""
        grid, at = OccupancyGrid(self.map), self.keyframes[origin].pose
        chosen = self._some(origin, self.parameters.map_m)
        poses = [at.between(self.keyframes[k].pose) for k in chosen]
        seen = [self._near(k) for k in chosen]
        ends = [pose.apply(one.hits) for pose, one in zip(poses, seen, strict=True)]
        held = np.concatenate(ends if room is None else [*ends, room])
        if len(held):
            grid.cover(held.min(axis=0), held.max(axis=0))
        for pose, perception in zip(poses, seen, strict=True):
            grid.integrate(pose, perception, field=False)
        grid.make_field()
        return grid

    def _near(self, keyframe: int) -> Perception:
        """What a keyframe saw near the robot; what is far away makes maps large for little."""
        seen, farthest = self.keyframes[keyframe].perception, self.parameters.farthest
        hits = seen.hits[(seen.hits**2).sum(axis=1) <= farthest**2]
        return Perception(hits, np.empty((0, 2)), seen.laser)

    def _some(self, origin: int, metres: float) -> list[int]:
        """Keyframes around an origin, as many as it takes to see everything there."""
        p = self.parameters
        chosen: list[int] = []
        for k in keyframes_around(self.keyframes, origin, metres):
            last = self.keyframes[chosen[-1] if chosen else k].pose
            step = last.between(self.keyframes[k].pose)
            far = math.hypot(step.x, step.y) >= p.apart_m
            if not chosen or k == origin or far or abs(step.theta) >= math.radians(p.apart_deg):
                chosen.append(k)
        return chosen

    def _prior(self, points: int, deviations: StandardDeviations) -> kernels.Prior:
        """What poses lose that the graph thinks unlikely, see `_kernels.matching.penalty`."""
        most = self.parameters.prior * FULL_SCORE * points
        xy, turn = deviations
        return most, 9.0, (self.map.resolution / xy) ** 2, (TURN_STEP / turn) ** 2

    def _floor(self) -> Covariance:
        p = self.parameters
        return StandardDeviations(p.floor, math.radians(p.floor_deg)).covariance()

    def _doubt(
        self,
        grid: OccupancyGrid,
        cells: NDArray[np.float64],
        best: NDArray[np.float64],
        centre: NDArray[np.float64],
        reach: int,
    ) -> PositionCovariance:
        """Covariance, shape (2, 2), of the positions in a window, weighted by how they score.

        `centre` is the window's, in cells from the best pose.
        """
        columns, count = grid.log_odds.shape[1], 2 * reach // STRIDE
        places = kernels.turned(cells, best, 0, 0.0, columns)[0]
        # Whole strides from the best pose, so that it is one of those that are asked.
        low_u, low_v = (math.ceil((c - reach) / STRIDE) * STRIDE for c in centre.tolist())
        sums = np.empty((count, count), np.int64)
        fits(grid.fields[1].reshape(-1), places, columns, (low_u, low_v), STRIDE, sums)
        share = (sums - sums.max()) / (FULL_SCORE * len(cells) * self.parameters.nearly)
        weights = np.exp(share)
        steps = np.arange(count) * STRIDE
        x, y = ((steps + low) * self.map.resolution for low in (low_u, low_v))
        total = weights.sum()
        xx, yy = (weights * x**2).sum() / total, (weights.T * y**2).sum() / total
        xy = (weights * np.outer(y, x)).sum() / total
        return np.array([[xx, xy], [xy, yy]])
