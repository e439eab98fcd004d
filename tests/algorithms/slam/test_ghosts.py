"""Obstacles that are gone leave the final map; walls stay however beams graze them."""

from __future__ import annotations

import math

import numpy as np
from support.looping import MAP, ring_trajectory
from support.room import seen

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.map_refinement import map_from_keyframes
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.model.pose import Pose2D

WALL = [(5.0, y / 20) for y in range(-40, 41)]


def trajectory_of(*perceptions: Perception) -> TrackedTrajectory:
    """Keyframes of a robot that stands at the origin."""
    trajectory = TrackedTrajectory()
    for perception in perceptions:
        trajectory.add(Pose2D(), perception.hits)
        trajectory.add_keyframe(perception, None, MotionModel())
    return trajectory


def made_of(*perceptions: Perception) -> OccupancyGrid:
    trajectory = trajectory_of(*perceptions)
    return map_from_keyframes(trajectory, trajectory.poses, MAP)


def is_occupied(grid: OccupancyGrid, x: float, y: float) -> bool:
    (u, v) = np.floor(grid.to_cells(np.array([[x, y]]))[0]).astype(int)
    return bool(grid.log_odds[v, u] > 0)


def test_who_walked_through_is_gone_when_two_scans_have_passed() -> None:
    someone = seen([(2.0, 0.0), *(end for end in WALL if abs(end[1]) > 0.2)])
    empty = seen(WALL)
    assert is_occupied(made_of(empty, someone, empty), 2.02, 0.02)
    assert not is_occupied(made_of(empty, someone, empty, empty), 2.02, 0.02)
    assert is_occupied(made_of(empty, empty, someone), 2.02, 0.02), "was there at last"
    assert is_occupied(made_of(someone, empty, empty), 5.02, 0.02)


def test_what_came_back_is_there() -> None:
    someone, empty = seen([(2.0, 0.0)]), seen(WALL)
    assert is_occupied(made_of(someone, empty, empty, someone), 2.02, 0.02)


def test_a_wall_that_is_grazed_stays() -> None:
    """Beams along a wall, half a cell before it, end far behind a piece that was hit before."""
    wall = seen([(x / 20, 1.0) for x in range(10, 120)])
    grazing = seen([(6.0, 1.02), (7.0, 1.03), (8.0, 1.04)])
    grid = made_of(wall, wall, grazing, grazing, grazing)
    walls = [is_occupied(grid, x / 20 + 0.025, 1.02) for x in range(10, 119)]
    assert np.mean(walls) > 0.98


def test_nothing_is_lost_where_nothing_moves() -> None:
    trajectory, poses = ring_trajectory(0.0)
    plain = OccupancyGrid(MAP)
    for keyframe in trajectory.keyframes:
        plain.integrate(poses[keyframe.scan], keyframe.perception)
    cleaned = map_from_keyframes(trajectory, poses, MAP).to_grid_map()
    occupied = plain.to_grid_map().cells > 0.5
    assert np.count_nonzero(occupied & (cleaned.cells <= 0.5)) <= 0.01 * occupied.sum()
    assert math.isclose(cleaned.resolution, MAP.resolution)
