"""m, the current map of Algorithm 9.2: what each new scan is compared with.

A map that never forgets is the book's. But after a long way round the robot comes back with an
error; compared with walls from the first visit and from just now at once, scans would tear the
map. So where loops are closed afterwards, the current map holds the last metres only, and old
walls are met again in `loops`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.model.pose import Pose2D

ROOM_M = 15.0
"""Metres around the robot that a new map has room for from the start."""


@dataclass(frozen=True)
class LocalMapParameters:
    """When the current map is written to, and what it forgets.

    Attributes:
        update_m, update_deg: the map is updated when the robot has moved or turned this far.
            Writing every scan lets the small errors of many poses smear the walls they are
            matched against, and a map that is smeared lets the next poses drift.
        most_m: metres driven that the map remembers at most; None never forgets.
        least_m, least_updates: metres driven, and updates, that it remembers at least.
        fewest: a scan of fewer points is nothing to start a map with.
        frozen: the map is not written to at all.
    """

    update_m: float = 0.3
    update_deg: float = 17.0
    most_m: float | None = 30.0
    least_m: float = 7.5
    least_updates: int = 10
    fewest: int = 5
    frozen: bool = False


class LocalMap:
    """The map being made (stateful: `update` changes it).

    It forgets by giving way, after `most_m`, to a younger map that was begun `least_m` before.

    Attributes:
        grid: what to compare with.
    """

    def __init__(self, grid: OccupancyGrid, parameters: LocalMapParameters) -> None:
        self.grid, self.parameters = grid, parameters
        self._younger: OccupancyGrid | None = None
        self._updated_at: Pose2D | None = None
        self._young_scans: list[tuple[Pose2D, Perception]] = []
        self._metres = self._young_from = 0.0

    def update(self, pose: Pose2D, perception: Perception) -> bool:
        """Line 10, if the robot has come far enough since the last update; whether it has."""
        last = self._updated_at
        if self.parameters.frozen:
            return False
        if last is not None and not self._is_new_ground(last.between(pose)):
            return False
        self.grid.integrate(pose, perception)
        if len(perception.hits) < self.parameters.fewest:
            return last is not None
        self._metres += last.distance(pose) if last else 0.0
        self._updated_at = pose
        self._forget(pose, perception)
        return True

    def _is_new_ground(self, since: Pose2D) -> bool:
        p = self.parameters
        far = math.hypot(since.x, since.y) >= p.update_m
        return far or abs(since.theta) >= math.radians(p.update_deg)

    def _forget(self, pose: Pose2D, perception: Perception) -> None:
        """Begin a younger map when it is time, write to it, and let it take over."""
        p = self.parameters
        if p.most_m is None:
            return
        if self._younger is None and self._metres >= p.most_m - p.least_m:
            self._younger, self._young_from = self._begun_at(pose), self._metres
        if self._younger is None:
            return
        self._younger.integrate(pose, perception, field=False)
        self._young_scans.append((pose, perception))
        if self._metres >= p.most_m and len(self._young_scans) >= p.least_updates:
            self._take_over(self._younger)

    def _take_over(self, younger: OccupancyGrid) -> None:
        younger.make_field()
        for pose, perception in self._young_scans:
            younger.bridge(pose, perception)
        self.grid, self._younger, self._young_scans = younger, None, []
        self._metres -= self._young_from

    def _begun_at(self, pose: Pose2D) -> OccupancyGrid:
        """An empty map with room for what is likely to come, so that it need not grow often."""
        grid, here = OccupancyGrid(self.grid.parameters), np.array([pose.x, pose.y])
        grid.cover(here - ROOM_M, here + ROOM_M)
        return grid
