"""Algorithm 9.2: simultaneous localization and mapping, one scan at a time.

The numbers in the comments are the lines of the book's algorithm. What makes it work on real logs
sits in the modules it calls: `odometry` (3), `perception` (4), `matching` (5-8), `occupancy` (10).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from mapcli.algorithms.matching import Match, MatchParameters, OdometryModel, best_pose
from mapcli.algorithms.occupancy import MapParameters, OccupancyGrid
from mapcli.algorithms.odometry import odometry_at_scans
from mapcli.algorithms.perception import PerceptionParameters, perceive
from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan, Record
from mapcli.model.trace import Status, TracedPose

HIGHEST_SPEED = 5.0
"""Metres per second; odometry that claims more (and more than a metre) has jumped."""

SCORE_MEMORY = 0.05
"""The weight of the newest score in the running mean that tells what score is usual."""


@dataclass(frozen=True)
class SlamParameters:
    """One group of parameters per stage."""

    map: MapParameters = field(default_factory=MapParameters)
    perception: PerceptionParameters = field(default_factory=PerceptionParameters)
    odometry: OdometryModel = field(default_factory=OdometryModel)
    match: MatchParameters = field(default_factory=MatchParameters)


class Slam:
    """A run of Algorithm 9.2 (stateful: `map` and `pose` change with every scan).

    Attributes:
        map: m, the current map.
        pose: c, the current position; the first scan is taken at the start pose.
        odometry_jumps: steps in which the odometry leapt and was not believed.
    """

    def __init__(self, parameters: SlamParameters | None = None, start: Pose2D | None = None):
        self.parameters = parameters or SlamParameters()
        self.map = OccupancyGrid(self.parameters.map)
        self.pose = start or Pose2D()
        self.odometry_jumps = 0
        self._usual_score = 0.9
        self._updated_at: Pose2D | None = None
        self._last: tuple[int, Pose2D | None] | None = None

    def replay(self, records: Iterable[Record]) -> Iterator[TracedPose]:
        """Every scan of a log with the pose it was taken at, in time order."""
        for scan, odom in odometry_at_scans(records):
            yield self.step(scan, odom)

    def step(self, scan: RangeScan, odom: Pose2D | None) -> TracedPose:
        """One turn of the book's loop for a scan, with the odometry's pose at its stamp."""
        first = self._last is None
        motion = self._motion(scan.stamp_ns, odom)  # 2: the robot has moved a short distance
        n = self.pose.compose(motion or Pose2D())  # 3: new position based on odometry
        p = perceive(scan, self.parameters.perception)  # 4: analyze sensor data
        b = Match(n, 0.0, 0, found=False)
        if not first:  # 5-8: the best test position around n
            spread = self.parameters.odometry.spread(motion)
            b = best_pose(self.map, p, n, spread, self.parameters.match, self._usual_score)
            self._usual_score += SCORE_MEMORY * (b.score - self._usual_score) if b.found else 0.0
        n = b.pose  # 9: replace new position by best position
        if self._is_new_ground(n):
            self.map.integrate(n, p)  # 10: update map based on new position
            if len(p.hits) >= self.parameters.match.fewest:  # else there is nothing to match yet
                self._updated_at = n
        self.pose = n  # 11: current position is new position
        status: Status = "first" if first else "matched" if b.found else "odometry"
        return TracedPose(scan.stamp_ns, n, odom, b.score if b.found else None, status)

    def _is_new_ground(self, pose: Pose2D) -> bool:
        """Whether the robot has moved far enough since the last update for another one."""
        if self._updated_at is None:
            return True
        p, since = self.parameters.map, self._updated_at.between(pose)
        return math.hypot(since.x, since.y) >= p.update_m or abs(since.theta) >= math.radians(
            p.update_deg
        )

    def _motion(self, stamp_ns: int, odom: Pose2D | None) -> Pose2D | None:
        """What odometry says the robot did since the last scan; None if it cannot be told."""
        last, self._last = self._last, (stamp_ns, odom)
        if last is None or last[1] is None or odom is None:
            return None
        motion = last[1].between(odom)
        metres, seconds = last[1].distance(odom), (stamp_ns - last[0]) * 1e-9
        if metres > 1.0 + HIGHEST_SPEED * seconds:
            self.odometry_jumps += 1
            return None
        return motion
