"""Where in what was mapped before is a submap, when its pose is lost? A search as wide as that.

A window that holds a turn of 80 degrees and as many metres has too many poses for the cells of a
map, and too many places in it for its submaps one by one. So the submaps that were mapped before
are laid into one coarse map, in which the new one is searched for by branch and bound. What is
found is a prediction and no more: it is matched anew, closely, with the nearest submap.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam._kernels.window_scores import PoseGrid
from mapcli.algorithms.slam.agreement import agreement
from mapcli.algorithms.slam.correlative_search import NOTHING_YET, best_in_window
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.pose_graph import PoseGraph
from mapcli.algorithms.slam.scan_points import radius_of, voxel_filtered
from mapcli.algorithms.slam.submap_matcher import SubmapMatcher
from mapcli.model.pose import Pose2D

CELL, POINT_CELL = 0.2, 0.4
"""Metres along a cell of the coarse map, and along a square that keeps one point."""

TURNS = 180
"""Headings in half a circle: a cell of the coarse map at 11 m."""

BESIDE_M = 10.0
"""Metres from the submaps that were mapped before, at which a robot still sees them."""

NODES_A_SUBMAP = 50_000
"""Squares times headings that may be looked into for each submap of the trajectory: 30 ms..."""

SEARCHES_A_PIECE = 4
"""...and searches for each piece besides, so that a short one is found, too: two must agree."""

LEAST_SCORE = 0.4
"""Of what is found in the coarse map, to be matched anew."""

ALIKE = 0.9
"""Share of the best fit from which on another place looks like the one that was found, in a coarse
map. A room among many that are alike fits into each of them as well as this, and a place that is
like no other into the rest of a building three quarters as well."""

NEAREST = 3
"""Submaps in whose maps a place is looked for closely."""

MOST_RIVALS = 4
"""Other places that are told, at most."""

APART_CELLS, APART_TURNS = 10, 20
"""Squares of the coarse map, and headings, from which on a pose is another one: 2 m and 20 deg."""


class Found(NamedTuple):
    """Where a submap may be: seen from an old one."""

    old: int
    pose: Pose2D


class WideSearch:
    """Searches of submaps among others (stateful: it keeps the last coarse map, and counts
    what searches cost).

    Args:
        origins: the keyframes at the submaps' origins.
    """

    def __init__(
        self, graph: PoseGraph, matcher: SubmapMatcher, origins: list[int], map_: MapParameters
    ) -> None:
        self.graph, self.matcher, self.origins = graph, matcher, origins
        self._map = replace(map_, resolution=max(CELL, map_.resolution), blur=CELL)
        self._spent, self._searched = 0, set[int]()
        self._coarse: tuple[list[int], list[Pose2D], OccupancyGrid] | None = None

    def is_due(self, new: int, others: list[int], piece: int) -> bool:
        """Whether to search for a submap: what has been spent by now must be in proportion to the
        trajectory; and a submap is searched for with the next one, for only two together tell.

        Args:
            piece: the number of its piece.
        """
        _, poses = self._everywhere(others)
        nodes = int((2 * poses.reach / LEVEL_WIDTHS[-1] + 1) ** 2) * (2 * TURNS + 1)
        allowed = NODES_A_SUBMAP * (new + 1) + SEARCHES_A_PIECE * nodes * piece - self._spent
        if allowed < (nodes if new - 1 in self._searched else 2 * nodes):
            return False
        self._spent += nodes
        self._searched.add(new)
        return True

    def find(self, new: int, others: list[int]) -> list[list[Found]]:
        """The best place of a submap among others, if there is any, and places that look like it
        in a coarse map; each as seen from the submaps nearest to it."""
        points = self.matcher.points(self.origins[new])
        if not len(points):
            return []
        middle, poses = self._everywhere(others)
        grid, cell = self._coarse_map(others), self._map.resolution
        self._cover(grid, middle, poses, radius_of(points))
        cells, start = voxel_filtered(points, POINT_CELL) / cell, grid.pose_to_cells(middle)
        best = best_in_window(grid, cells, start, poses)
        place = best.cells(start, poses.turn_step)
        if agreement(grid, cells, place).score < LEAST_SCORE:
            return []
        least = NOTHING_YET._replace(score=ALIKE * best.fit)
        rivals = []
        for at, window in elsewhere(start, poses, place):
            rival = best_in_window(grid, cells, at, window, known=least)
            if rival.score > least.score:
                rivals.append((rival.score, rival.cells(at, poses.turn_step)))
        rivals.sort(key=lambda rival: -rival[0])
        places = [place, *(cells for _, cells in rivals[:MOST_RIVALS])]
        return [self._seen_from_others(grid.pose_from_cells(one), others) for one in places]

    def _seen_from_others(self, pose: Pose2D, others: list[int]) -> list[Found]:
        """A place in the map, as seen from the nearest submaps: the very nearest may have been
        mapped from behind a wall."""
        there = self.graph.positions()[others]
        order = np.argsort(np.hypot(*(there - (pose.x, pose.y)).T), kind="stable")
        near = [others[k] for k in order[:NEAREST].tolist()]
        return [Found(old, self.graph.poses[old].between(pose)) for old in near]

    def _everywhere(self, others: list[int]) -> tuple[Pose2D, PoseGrid]:
        """All poses at which others are seen."""
        there = self.graph.positions()[others]
        low, high = there.min(axis=0) - BESIDE_M, there.max(axis=0) + BESIDE_M
        x, y = ((low + high) / 2).tolist()
        reach = math.ceil(float((high - low).max()) / 2 / self._map.resolution)
        return Pose2D(x, y), PoseGrid(reach, TURNS, 1, math.pi / TURNS)

    def _coarse_map(self, others: list[int]) -> OccupancyGrid:
        """The map that submaps make where the graph has them."""
        poses = [self.graph.poses[k] for k in others]
        if self._coarse is not None and self._coarse[:2] == (others, poses):
            return self._coarse[2]
        grid, seen = OccupancyGrid(self._map), list[tuple[Pose2D, Perception]]()
        for k, pose in zip(others, poses, strict=True):
            seen += [(pose.compose(at), one) for at, one in self.matcher.seen_in(self.origins[k])]
        ends = np.concatenate([pose.apply(one.hits) for pose, one in seen])
        if len(ends):
            grid.extend_to(ends.min(axis=0), ends.max(axis=0))
        for pose, one in seen:
            grid.integrate(pose, one, update_field=False)
        grid.build_likelihood_field()
        self._coarse = others, poses, grid
        return grid

    def _cover(self, grid: OccupancyGrid, middle: Pose2D, poses: PoseGrid, radius: float) -> None:
        """Make a map hold every point at every pose, and the bounds of the field beyond."""
        slack = (poses.reach + int(LEVEL_WIDTHS[-1]) + 1) * self._map.resolution + radius
        centre: NDArray[np.float64] = np.array([middle.x, middle.y])
        grid.extend_to(centre - slack, centre + slack)


def elsewhere(
    middle: NDArray[np.float64], poses: PoseGrid, found: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.float64], PoseGrid]]:
    """Windows that together hold the poses of a window that are not near a found one: first other
    headings there, then other places, in ever smaller squares around it.

    Args:
        middle, found: (u, v, theta), in cells and radians; poses: of the window, at all headings.
    """
    behind = found + np.array([0.0, 0.0, math.pi])
    yield behind, poses._replace(reach=APART_CELLS, turns=poses.turns - APART_TURNS)
    squares = [(middle, poses.reach)]
    while squares:
        at, reach = squares.pop()
        away = float(np.abs(at - found)[:2].max())
        if away > reach + APART_CELLS:
            yield at, poses._replace(reach=reach)
        elif reach > APART_CELLS:
            half = (reach + 1) // 2
            corners = itertools.product((-half, half), repeat=2)
            squares += [(at + np.array([u, v, 0.0]), half) for u, v in corners]
