"""Walls finer than cells: what they tell about a pose, and what they cannot."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from mapcli.algorithms.slam import surfel_map as surfels
from mapcli.algorithms.slam.surfel_map import ScanFit, SurfelMap
from mapcli.errors import DataError
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import StandardDeviations, covariance_from_information

Floats = NDArray[np.float64]
CELL = 0.05


def wall(start: tuple[float, float], end: tuple[float, float], step: float = 0.021) -> Floats:
    one, other = np.array(start), np.array(end)
    length = math.dist(start, end)
    return one + np.arange(0.003, length, step)[:, None] / length * (other - one)


def room(step: float = 0.021) -> Floats:
    """6.1 m by 4.3 m around the origin."""
    corners = [(-3.02, -2.07), (3.08, -2.07), (3.08, 2.23), (-3.02, 2.23), (-3.02, -2.07)]
    return np.concatenate([wall(a, b, step) for a, b in pairwise(corners)])


def corridor(heading: float, width: float = 2.0) -> Floats:
    """Two walls of 10 m, along the heading, on both sides of the origin."""
    sides = [wall((-5, y), (5, y)) for y in (-width / 2, width / 2)]
    return Pose2D(0, 0, heading).apply(np.concatenate(sides))


def map_of(points: Floats) -> SurfelMap:
    walls = SurfelMap(CELL)
    walls.add(points)
    return walls


def along(fit: ScanFit, heading: float) -> tuple[float, float]:
    """Information about the position along a heading, and across it."""
    ahead = np.array([math.cos(heading), math.sin(heading), 0])
    left = np.array([-ahead[1], ahead[0], 0])
    return float(ahead @ fit.information @ ahead), float(left @ fit.information @ left)


def test_a_room_fixes_a_pose() -> None:
    true = Pose2D(0.31, -0.22, 2.8)
    points = true.inverse().apply(room(0.06))
    start = true.compose(Pose2D(0.02, -0.03, 0.01))
    fit = map_of(room()).fit(points, start)
    assert fit.pose.distance(true) < 0.003
    assert abs(fit.pose.theta - true.theta) < math.radians(0.05)
    assert fit.matched > 0.99 * len(points)
    deviations = np.sqrt(np.diag(covariance_from_information(fit.information_in_own_frame())))
    assert (deviations > 0).all()
    assert (deviations < [0.01, 0.01, 0.01]).all()  # 100 points a side, 15 mm each


@pytest.mark.parametrize("sides_are_known", [True, False])
def test_what_is_behind_a_wall_draws_no_scan(sides_are_known: bool) -> None:
    # A corner whose walls are 10 cm thick and have been seen from behind as well, and its inside
    # only in part: a line through both sides, or a point taken for one of the other side, moves a
    # scan by centimetres.
    top, right = wall((1.08, 2.23), (3.08, 2.23)), wall((3.08, 0.23), (3.08, 2.23))
    walls = SurfelMap(CELL)
    for points, laser in ((top, (1.5, 0.5)), (right, (1.5, 0.5))):
        walls.add(points[::5], np.array(laser) if sides_are_known else None)
    behind = Pose2D(0, 0.1).apply(top), Pose2D(0.1, 0).apply(right)
    for points, laser in zip(behind, ((2.0, 4.0), (5.0, 1.0)), strict=True):
        walls.add(points, np.array(laser) if sides_are_known else None)
    fit = walls.fit(np.concatenate([top, right])[::3], Pose2D(0.02, 0.02, 0.0))
    assert (fit.pose.distance(Pose2D()) < 0.003) == sides_are_known


def test_growing_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    scans = [rng.uniform(-20, 20, (700, 2)) for _ in range(8)] + [room()]
    assert sum(map(len, scans)) > 4 * surfels.START  # or it would not have to grow
    grown = SurfelMap(CELL)
    points, start = room(0.06), Pose2D(0.02, 0.01, 0.01)
    for scan in scans:
        grown.add(scan)
        grown.fit(points, start)  # what was fitted before must not be kept
    monkeypatch.setattr(surfels, "START", 1 << 14)
    at_once = SurfelMap(CELL)
    for scan in scans:
        at_once.add(scan)
    one, other = grown.fit(points, start), at_once.fit(points, start)
    assert one.pose == other.pose
    assert one.matched == other.matched > 0
    assert one.information.tobytes() == other.information.tobytes()


def test_new_points_are_seen() -> None:
    # One wall is no room: only the second one says how far ahead the robot is.
    surfels, points, start = map_of(wall((-3, 1), (3, 1))), room(0.06), Pose2D()
    one = surfels.fit(points, start).information_in_own_frame()
    assert covariance_from_information(one)[0, 0] > 1
    surfels.add(room())
    both = surfels.fit(points, start).information_in_own_frame()
    assert covariance_from_information(both)[0, 0] < 0.01**2


@pytest.mark.parametrize("heading", [0.0, 0.5, math.pi / 2, 2.0, -2.5])
def test_a_corridor_says_nothing_about_how_far_along_it_the_robot_is(heading: float) -> None:
    true = Pose2D(0.1, 0.05, 0.7)
    points = true.inverse().apply(corridor(heading))
    fit = map_of(corridor(heading)).fit(points, true)
    ahead, across = along(fit, heading)
    assert across > 1e4  # better than a centimetre
    assert ahead < 1e-6 * across
    covariance = covariance_from_information(fit.information_in_own_frame())
    # In the robot's frame the corridor is at `heading` less its own.
    axis = np.array([math.cos(heading - 0.7), math.sin(heading - 0.7)])
    assert axis @ covariance[:2, :2] @ axis > 100  # metres squared: not known at all
    assert abs(np.linalg.det(covariance[:2, :2])) < 100**2


def test_information_in_the_robots_own_frame_by_hand() -> None:
    # Facing up: ahead is the world's y, left is its -x.
    information = np.array([[100.0, 7.0, 60.0], [7.0, 25.0, 5.0], [60.0, 5.0, 400.0]])
    fit = ScanFit(Pose2D(3, 4, math.pi / 2), information, 50)
    expected = [[25, -7, 5], [-7, 100, -60], [5, -60, 400]]
    assert fit.information_in_own_frame() == pytest.approx(np.array(expected))


@pytest.mark.parametrize("heading", [0.0, 1.1])
def test_the_prediction_decides_along_a_corridor_and_the_walls_across(heading: float) -> None:
    walls = map_of(corridor(heading))
    frame = Pose2D(0, 0, heading)
    true, predicted = frame.compose(Pose2D(0, 0.03, 0)), frame.compose(Pose2D(0.2, 0, 0.01))
    points = true.inverse().apply(frame.apply(short(frame.inverse().apply(corridor(heading)))))
    fit = walls.fit(points, true, predicted, StandardDeviations(0.1, 0.05).along_axes())
    found = frame.between(fit.pose)
    assert found.x == pytest.approx(0.2, abs=2e-3)
    # The walls know to 0.015 / sqrt(0.3 * 160 points) = 2 mm, the prediction to 10 cm.
    assert found.y == pytest.approx(0.03, abs=2e-3)
    assert found.theta == pytest.approx(0.0, abs=2e-3)


def short(points: Floats) -> Floats:
    """The middle of the corridor, so that no wall ends within it."""
    return points[np.abs(points[:, 0]) < 3][::4]


def test_without_a_prediction_the_start_is_kept_along_a_corridor() -> None:
    start = Pose2D(0.4, 0.02, 0.0)
    fit = map_of(corridor(0.0)).fit(short(corridor(0.0)), start)
    assert fit.pose.x == pytest.approx(0.4, abs=1e-3)
    assert fit.pose.y == pytest.approx(0.0, abs=2e-3)


def test_a_prediction_far_away_has_little_say() -> None:
    # 0.5 m are 50 standard deviations: odometry has failed, and the room is right.
    walls, points = map_of(room()), room(0.06)
    fit = walls.fit(
        points, Pose2D(0.01, 0.01), Pose2D(0.5, 0.0), StandardDeviations(0.01, 0.01).along_axes()
    )
    assert fit.pose.distance(Pose2D()) < 0.003


def test_a_prediction_on_another_turn_of_the_circle_is_the_same() -> None:
    walls, true = map_of(room()), Pose2D(0.1, 0.1, math.pi - 0.002)
    points = true.inverse().apply(room(0.06))
    fit = walls.fit(
        points,
        true,
        Pose2D(0.1, 0.1, -math.pi + 0.002),
        StandardDeviations(0.05, 0.05).along_axes(),
    )
    assert fit.pose.distance(true) < 0.003
    assert abs(true.between(fit.pose).theta) < 0.002


@pytest.mark.parametrize("shift", [(-100, -100), (100, -60), (5000, 7000)])
def test_it_is_the_same_everywhere(shift: tuple[int, int]) -> None:
    away = Pose2D(shift[0] * CELL, shift[1] * CELL)
    points, start = room(0.06), Pose2D(0.02, -0.01, 0.01)
    here, there = map_of(room()), map_of(away.apply(room()))
    one, other = here.fit(points, start), there.fit(points, away.compose(start))
    # Sums that begin at other numbers differ in their last bits; points may change their cells.
    assert away.between(other.pose).distance(one.pose) < 1e-4
    assert other.matched == one.matched
    scale = np.sqrt(np.outer(np.diag(one.information), np.diag(one.information)))
    assert (np.abs(other.information - one.information) < 0.02 * scale).all()


def test_points_on_all_sides_are_kept() -> None:
    sides = [(0.0, 0.0), (70.0, 1.0), (-33.0, 2.0), (5.0, 90.0), (4.0, -250.0), (-400.0, -251.0)]
    walls, pillar = SurfelMap(CELL), room(0.06)[:40]
    for side in sides:
        walls.add(pillar + side)
    for x, y in sides:
        fit = walls.fit(pillar, Pose2D(x + 0.01, y - 0.01, 0.0))
        assert fit.matched == len(pillar)
    assert walls.fit(pillar, Pose2D(1e7, 0.0, 0.0)).matched == 0


def test_points_absurdly_far_apart() -> None:
    walls = map_of(room())
    with pytest.raises(DataError, match=r"the map would be 1,000,0\d\d m x .* m"):
        walls.add(np.array([(1e6, 0.0)]))
