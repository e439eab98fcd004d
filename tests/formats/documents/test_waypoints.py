"""Paths for simulated robots that are traces."""

from __future__ import annotations

import numpy as np

from mapcli.formats.documents.waypoints import OFF_PATH_M, waypoints_along
from mapcli.model.waypoint import Waypoint


def test_the_corners_of_a_trace() -> None:
    there = [(x, 0.0, 0.0) for x in np.linspace(0, 4, 50)]
    up = [(4.0, y, np.pi / 2) for y in np.linspace(0.1, 3, 50)]
    back = [(4.0, y, np.pi / 2) for y in np.linspace(2.9, 1, 50)]
    poses = np.array([*there, *up, *back])
    poses[20:30, 1] += OFF_PATH_M / 2  # stands out less than is told
    assert waypoints_along(poses) == [
        Waypoint(0, 0), Waypoint(4, 0), Waypoint(4, 3), Waypoint(4, 1, back=True),
    ]  # fmt: skip


def test_a_robot_that_stands_still_first() -> None:
    poses = np.array([(1.0, 1.0, 0.0)] * 9 + [(3.0, 1.0, 0.0)] * 5)
    assert waypoints_along(poses) == [Waypoint(1, 1), Waypoint(3, 1)]


def test_too_few_poses() -> None:
    assert waypoints_along(np.empty((0, 3))) == []
    assert waypoints_along(np.array([[1.0, 2.0, 3.0]])) == [Waypoint(1, 2)]
