"""Line 2 of Algorithm 9.2: the robot moves a short distance before scans are compared again."""

from __future__ import annotations

import math

from mapcli import Pose2D
from mapcli.algorithms.slam.match import MatchParameters
from mapcli.algorithms.slam.short_distance import ShortDistance, short_distance
from mapcli.model.scan import Mount

AHEAD, BEHIND = Mount(), Mount(Pose2D(-0.2, 0.0, math.pi))


def test_a_cell_is_far_enough_and_so_is_a_step_of_the_heading() -> None:
    moved = short_distance(MatchParameters(search="book"), 0.05)
    assert moved.is_moved(None, AHEAD)  # the first scan
    for _ in range(3):
        steps = [moved.is_moved(Pose2D(0.0125), AHEAD) for _ in range(4)]
        assert steps == [False, False, False, True]
    turns = [moved.is_moved(Pose2D(0, 0, math.radians(5)), AHEAD) for _ in range(3)]
    assert turns == [False, False, True]


def test_going_back_and_forth_is_no_way() -> None:
    moved = ShortDistance(0.05, 1.0)
    moved.is_moved(None, AHEAD)
    assert not any(moved.is_moved(Pose2D(0.04 * (-1) ** k), AHEAD) for k in range(6))


def test_each_laser_has_its_own_and_an_unknown_motion_may_be_far() -> None:
    moved = ShortDistance(0.05, 1.0)
    assert [moved.is_moved(Pose2D(), laser) for laser in (AHEAD, BEHIND)] == [True, True]
    steps = [moved.is_moved(Pose2D(0.03), laser) for laser in (AHEAD, BEHIND, AHEAD, BEHIND)]
    assert steps == [False, True, True, True]
    assert moved.is_moved(None, AHEAD)


def test_other_searches_compare_every_scan() -> None:
    moved = short_distance(MatchParameters(search="window"), 0.05)
    assert all(moved.is_moved(Pose2D(), AHEAD) for _ in range(3))
