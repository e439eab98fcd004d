"""m, the map of Algorithm 9.2 that each new scan is matched with: a local map that forgets.

A map that never forgets is the book's. But after a long way round the robot comes back with an
error; compared with walls from the first visit and from just now at once, scans would tear the
map. So where loops are closed afterwards, the local map holds the last metres only, and old walls
are met again by `loop_closure`. It is a sliding map of up to two grids, as Cartographer's active
submaps: the older one is matched with, the younger one is written to as well and replaces it when
the older has reached its length. (The submaps of `submaps` are pieces of trajectory instead.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.match import MIN_POINTS
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount

MIDDLE = Mount()
"""A laser in the middle of the robot, looking ahead."""

ROOM_M = 15.0
"""Metres around the robot that a new map has room for from the start."""


@dataclass(frozen=True)
class LocalMapParameters:
    """When the local map is updated, and how long a piece of trajectory it covers.

    Attributes:
        update_m, update_deg: the map is updated when the robot has moved or turned this far.
            Writing every scan lets the small errors of many poses smear the walls they are
            matched against, and a map that is smeared lets the next poses drift.
        max_length_m: metres driven that it covers at most; None is all of them.
        min_length_m, min_updates: metres driven, and updates, that it covers at least.
        frozen: the map is not written to at all.
    """

    update_m: float = 0.3
    update_deg: float = 17.0
    max_length_m: float | None = 30.0
    min_length_m: float = 7.5
    min_updates: int = 10
    frozen: bool = False


class LocalMap:
    """The map being made (stateful: `update` changes it).

    After `max_length_m` its grid is retired for the next one, which was begun `min_length_m`
    before.

    Attributes:
        grid: what scans are matched with, the older of the two.
    """

    def __init__(self, grid: OccupancyGrid, parameters: LocalMapParameters) -> None:
        self.grid, self.parameters = grid, parameters
        self._next: OccupancyGrid | None = None
        self._next_scans: list[tuple[Pose2D, Perception]] = []
        # Where each laser's last scan was written, and any laser's.
        self._updated_at: dict[Mount, Pose2D] = {}
        self._last: Pose2D | None = None
        self._metres = self._next_from = 0.0

    def update(self, pose: Pose2D, perception: Perception, laser: Mount = MIDDLE) -> bool:
        """Line 10, if the robot has come far enough since the last update; whether it has.

        Args:
            pose: of the robot in the map.
            laser: that saw it; each laser of a robot has an update of its own.
        """
        # What several sensors told on a short way was not told before; it is never left out.
        if not self.is_due(pose, laser) and (self.parameters.frozen or not perception.readings):
            return False
        self.grid.integrate(pose, perception)
        if len(perception.hits) < MIN_POINTS:
            return self._last is not None
        self._metres += self._last.distance(pose) if self._last else 0.0
        self._updated_at[laser] = self._last = pose
        self._forget(pose, perception)
        return True

    def is_due(self, pose: Pose2D, laser: Mount = MIDDLE) -> bool:
        """Whether the robot has come far enough since the last update."""
        last, p = self._updated_at.get(laser), self.parameters
        if p.frozen or last is None:
            return not p.frozen
        since = last.between(pose)
        far = math.hypot(since.x, since.y) >= p.update_m
        return far or abs(since.theta) >= math.radians(p.update_deg)

    def begin_anew(self, pose: Pose2D) -> None:
        """Forget everything: the robot is elsewhere."""
        self.grid, self._next, self._next_scans = self._begin_at(pose), None, []
        self._updated_at, self._last = {}, None
        self._metres = self._next_from = 0.0

    def _forget(self, pose: Pose2D, perception: Perception) -> None:
        """Begin the next active submap when it is time, write to it, and let it take over."""
        p = self.parameters
        if p.max_length_m is None:
            return
        if self._next is None and self._metres >= p.max_length_m - p.min_length_m:
            self._next, self._next_from = self._begin_at(pose), self._metres
        if self._next is None:
            return
        self._next.integrate(pose, perception, update_field=False)
        self._next_scans.append((pose, perception))
        if self._metres >= p.max_length_m and len(self._next_scans) >= p.min_updates:
            self._take_over(self._next)

    def _take_over(self, grid: OccupancyGrid) -> None:
        grid.build_likelihood_field()
        for pose, perception in self._next_scans:
            grid.interpolate_gaps(pose, perception)
        self.grid, self._next, self._next_scans = grid, None, []
        self._metres -= self._next_from

    def _begin_at(self, pose: Pose2D) -> OccupancyGrid:
        """An empty map with room for what is likely to come, as much as the map before reaches, so
        that it need not grow often; that costs nothing until it is written."""
        grid, here = OccupancyGrid(self.grid.parameters), np.array([pose.x, pose.y])
        room = np.full(2, max(ROOM_M, self.grid.reach))
        grid.extend_to(here - room, here + room)
        return grid
