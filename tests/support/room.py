"""A room with a pillar, its map, and scans in it, for the tests of scan matching."""

from __future__ import annotations

import math

import numpy as np

from mapcli import Pose2D, World
from mapcli.algorithms.scans.perception import Perception, PerceptionParameters, perceive
from mapcli.algorithms.scans.ray_casting import cast, edges_of
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.match import Match
from mapcli.algorithms.slam.motion_model import OdometryUncertainty
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.model.pose import wrap_angle
from mapcli.model.scan import RangeScan
from mapcli.model.se2_uncertainty import StandardDeviations

Points = list[tuple[float, float]]

ROOM = edges_of(
    World.of(
        [
            [[-2.03, -1.52], [4.04, -1.52], [4.04, 3.01], [-2.03, 3.01]],
            [[1.22, 0.83], [1.91, 0.83], [1.91, 1.44], [1.22, 1.44]],
        ]
    )
)
"""6.07 m by 4.53 m with a pillar."""
OTHER_ROOM = edges_of(World.of([[[-0.81, -0.42], [0.93, -0.37], [0.44, 0.95]]]))
HERE = Pose2D(0.02, 0.01, 0.3)


def uncertain(xy: float, degrees: float, metres: float) -> OdometryUncertainty:
    return OdometryUncertainty(StandardDeviations(xy, math.radians(degrees)), metres)


NARROW = uncertain(0.02, 0.5, 0.0)
WIDE = uncertain(0.1, 3, 0.3)


def seen(hits: Points, open_ends: Points = (), laser: tuple[float, float] = (0, 0)) -> Perception:
    ends = [np.array(points, np.float64).reshape(-1, 2) for points in (hits, open_ends)]
    return Perception(*ends, np.array(laser, np.float64))


def look(pose: Pose2D, edges: np.ndarray = ROOM, reach: float = 12.0) -> Perception:
    ranges = cast(edges, pose, -math.pi, math.tau / 240, 240, reach).astype(np.float32)
    scan = RangeScan(0, -math.pi, math.tau / 240, ranges, 0.0, reach)
    return perceive(scan, PerceptionParameters())


def mapped(*poses: Pose2D, edges: np.ndarray = ROOM, resolution: float = 0.05) -> OccupancyGrid:
    grid = OccupancyGrid(MapParameters(resolution=resolution))
    for pose in poses or (HERE,):
        grid.integrate(pose, look(pose, edges))
    return grid


def moved(pose: Pose2D, x: float, y: float, degrees: float = 0.0) -> Pose2D:
    """In the map's frame, not the robot's."""
    return Pose2D(pose.x + x, pose.y + y, wrap_angle(pose.theta + math.radians(degrees)))


def assert_at(match: Match, pose: Pose2D, xy: float = 0.02, degrees: float = 0.5) -> None:
    assert match.pose.distance(pose) <= xy
    assert abs(wrap_angle(match.pose.theta - pose.theta)) <= math.radians(degrees)
