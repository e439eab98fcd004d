"""Lines 5 to 8 of Algorithm 9.2: the test positions, what they are scored with, who wins."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.room import (
    HERE,
    NARROW,
    OTHER_ROOM,
    WIDE,
    assert_at,
    look,
    mapped,
    moved,
    seen,
    uncertain,
)

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.scans.ray_casting import edges_of
from mapcli.algorithms.slam.match import (
    MIN_POINTS,
    Alternative,
    Match,
    MatchHistory,
    MatchParameters,
)
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.scan_matcher import match_scan
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.world import World

# --- window


@pytest.mark.parametrize(
    "off", [(0, 0, 0), (0.08, -0.06, 3), (-0.1, 0.1, -5), (0.22, 0.13, 8), (0.013, 0.021, 0.2)]
)
def test_the_window_search_finds_the_true_pose(off: tuple[float, float, float]) -> None:
    match = match_scan(mapped(), look(HERE), moved(HERE, *off), WIDE, MatchParameters())
    assert_at(match, HERE)
    assert match.found
    assert 0.7 < match.score <= 1
    assert match.known_points > 50


def test_the_window_search_finds_a_pose_the_robot_has_not_been_at() -> None:
    true = Pose2D(0.35, -0.3, 0.5)
    match = match_scan(mapped(), look(true), moved(true, 0.1, 0.1, -4), WIDE, MatchParameters())
    assert_at(match, true)


def test_headings_come_out_wrapped() -> None:
    here = Pose2D(0.02, 0.01, math.pi - 0.01)
    match = match_scan(mapped(here), look(here), moved(here, 0, 0, -3), WIDE, MatchParameters())
    assert_at(match, here)
    beyond = moved(here, 0, 0, 2)
    match = match_scan(mapped(here), look(beyond), here, WIDE, MatchParameters())
    assert_at(match, beyond)
    assert -math.pi <= match.pose.theta <= math.pi


def test_the_map_and_the_perception_stay_as_they_were() -> None:
    grid, perception = mapped(), look(HERE)
    log_odds, fields, hits = grid.log_odds.copy(), grid.pyramid.copy(), perception.hits.copy()
    for search in ("window", "book"):
        match_scan(grid, perception, HERE, WIDE, MatchParameters(search=search))
    assert (grid.log_odds == log_odds).all()
    assert (grid.pyramid == fields).all()
    assert (perception.hits == hits).all()


def test_a_window_that_leaves_the_map() -> None:
    # Far from everything known: the map is made to hold the window, and nothing is found.
    grid = mapped()
    there = Pose2D(60, -70, 1)
    match = match_scan(grid, look(HERE), there, WIDE, MatchParameters())
    assert not match.found
    assert match.known_points == 0
    assert_at(match, there, xy=1e-9, degrees=1e-9)


UNREFINED = MatchParameters(odometry_prior=0.0, relocalise=False, refine=False)
"""The field alone decides, on the grid of test positions."""


def test_the_test_positions_are_those_of_the_window() -> None:
    # 0.1 m and 4 x 0.02 m are 3.6 cells of 5 cm: 4. 2 and 4 x 0.5 degrees are 8 half degrees.
    match = match_scan(mapped(), look(HERE), moved(HERE, 0.4, -0.4, 11), NARROW, UNREFINED)
    tried = moved(HERE, 0.4, -0.4, 11)
    dx, dy = match.pose.x - tried.x, match.pose.y - tried.y
    turn = wrap_angle(match.pose.theta - tried.theta)
    assert dx / 0.05 == pytest.approx(round(dx / 0.05), abs=1e-6)
    assert dy / 0.05 == pytest.approx(round(dy / 0.05), abs=1e-6)
    assert max(abs(dx), abs(dy)) <= 0.2 + 1e-9
    assert math.degrees(turn) / 0.5 == pytest.approx(round(math.degrees(turn) / 0.5), abs=1e-6)
    assert abs(math.degrees(turn)) <= 4 + 1e-9
    # A wider window reaches the true one.
    wide = uncertain(0.1, 3, 0)
    match = match_scan(mapped(), look(HERE), tried, wide, UNREFINED)
    assert_at(match, HERE, xy=1e-6, degrees=1e-6)


@pytest.mark.parametrize(("step_xy", "cells"), [(None, 1), (0.001, 1), (0.1, 2), (0.2, 4)])
def test_steps_are_whole_cells(step_xy: float | None, cells: int) -> None:
    wanted = (0.15, -0.05)  # 3 cells and 1 cell
    tried = moved(HERE, -wanted[0], -wanted[1])
    parameters = replace(UNREFINED, step_xy=step_xy)
    match = match_scan(mapped(), look(HERE), tried, WIDE, parameters)
    steps = np.array([match.pose.x - tried.x, match.pose.y - tried.y]) / (0.05 * cells)
    assert steps == pytest.approx(np.round(steps), abs=1e-6)
    if cells == 1:
        assert_at(match, HERE, xy=1e-6)


def test_coarse_headings() -> None:
    parameters = replace(UNREFINED, step_theta_deg=4.0, window_theta_deg=10.0)
    match = match_scan(mapped(), look(HERE), moved(HERE, 0, 0, 8), NARROW, parameters)
    assert_at(match, HERE, xy=1e-6, degrees=1e-6)
    match = match_scan(mapped(), look(HERE), moved(HERE, 0, 0, 6), NARROW, parameters)
    turn = math.degrees(match.pose.theta - HERE.theta)
    assert turn in (pytest.approx(2), pytest.approx(-2))


def test_along_a_corridor_odometry_is_believed() -> None:
    edges = edges_of(World.of([[[-50, -1.02], [50, -1.02], [50, 1.03], [-50, 1.03]]]))
    grid = OccupancyGrid()
    for k in range(-40, 41):  # so that the walls have no gaps
        pose = moved(HERE, 0.137 * k, 0, 0.7 * k)
        grid.integrate(pose, look(pose, edges, 6.0))
    for along in (-0.13, 0.06, 0.2):
        tried = moved(HERE, along, 0.12, 4)
        match = match_scan(grid, look(HERE, edges, 6.0), tried, WIDE, MatchParameters())
        assert match.found
        assert match.pose.x == pytest.approx(tried.x, abs=0.03)
        assert match.pose.y == pytest.approx(HERE.y, abs=0.02)
        assert match.pose.theta == pytest.approx(HERE.theta, abs=math.radians(0.5))


# --- relocalisation, where odometry has failed


def test_relocalisation_finds_the_pose_far_around() -> None:
    for off in ((0.4, -0.35, 0), (-0.3, 0.3, 30), (0, 0, -40)):
        match = match_scan(mapped(), look(HERE), moved(HERE, *off), NARROW, MatchParameters())
        assert_at(match, HERE)
        assert match.found


def test_the_relocalisation_window_grows_with_the_metres_driven() -> None:
    tried = moved(HERE, 1.2, 0.0, 5)
    fast = uncertain(0.05, 1, 0.5)
    assert_at(match_scan(mapped(), look(HERE), tried, fast, MatchParameters()), HERE)
    match = match_scan(mapped(), look(HERE), tried, NARROW, MatchParameters())
    assert match.pose.distance(HERE) > 0.3


def test_what_fits_nowhere_stays_in_the_window() -> None:
    # Another room than the map's: no pose has the running score, so none far off is believed.
    p = MatchParameters()
    match = match_scan(mapped(), look(HERE, OTHER_ROOM), HERE, NARROW, p)
    half = p.window_xy + NARROW.window_sigmas * NARROW.deviations.xy + 0.05
    assert match.pose.distance(HERE) <= half * math.sqrt(2) + 0.1


def test_what_the_map_does_not_contradict_is_left_at_the_second_scan() -> None:
    # Nine decimetres off, three of five points still find a wall.
    tried, fast = moved(HERE, 0.9, 0.0, 5), uncertain(0.05, 1, 0.5)
    first = match_scan(mapped(), look(HERE), tried, fast, MatchParameters())
    assert first.pose.distance(HERE) > 0.3
    assert first.alternative is not None
    assert first.alternative.pose.distance(HERE) < 0.02
    history = MatchHistory(0.9, first.alternative)
    assert_at(match_scan(mapped(), look(HERE), tried, fast, MatchParameters(), history), HERE)
    elsewhere = MatchHistory(0.9, Alternative(moved(HERE, 0.3, 0.0), first.alternative.evidence))
    again = match_scan(mapped(), look(HERE), tried, fast, MatchParameters(), elsewhere)
    assert again.pose.distance(HERE) > 0.3


def test_odometry_that_no_robot_follows_is_left_at_once() -> None:
    tried, suspect = moved(HERE, 0.9, 0.0, 5), replace(uncertain(0.05, 1, 0.5), is_suspect=True)
    assert_at(match_scan(mapped(), look(HERE), tried, suspect, MatchParameters()), HERE)


def test_alternatives_move_with_the_robot() -> None:
    history = MatchHistory(0.8, Alternative(HERE, 12.0))
    step = Pose2D(0.3, 0.0, 0.2)
    assert history.moved(step) == MatchHistory(0.8, Alternative(HERE.compose(step), 12.0))
    assert history.moved(None) == MatchHistory(0.8)
    assert MatchHistory(0.8).moved(step) == MatchHistory(0.8)


# --- scans of few points


def test_none_looks_at_nothing() -> None:
    tried = moved(HERE, 0.1, 0.1, 3)
    match = match_scan(mapped(), look(HERE), tried, WIDE, MatchParameters(search="none"))
    assert match == Match(tried, 0.0, 0, found=False)


@pytest.mark.parametrize("count", [0, 1, MIN_POINTS - 1])
def test_too_few_points_say_nothing(count: int) -> None:
    tried = moved(HERE, 0.1, 0.1, 3)
    few = Perception(look(HERE).hits[::50][:count], np.empty((0, 2)), np.zeros(2))
    assert len(few.hits) == count
    match = match_scan(mapped(), few, tried, WIDE, MatchParameters())
    assert match == Match(tried, 0.0, 0, found=False)


def test_points_of_one_square_are_one_point() -> None:
    hits = look(HERE).hits[:1] + np.linspace(0, 1e-6, 100)[:, None]
    crowd = Perception(hits, np.empty((0, 2)), np.zeros(2))
    assert not match_scan(mapped(), crowd, HERE, WIDE, MatchParameters()).found


def test_too_small_an_overlap_says_nothing() -> None:
    # Three of many points meet the map, a little aside; the others lie in the unknown.
    wall = [(3.0, 0.0), (3.0, 1.0), (3.0, -1.0)]
    grid = OccupancyGrid()
    grid.integrate(HERE, seen(wall))
    perception = seen(wall + [(-2.0 - 0.1 * k, 1.0) for k in range(30)])
    tried = moved(HERE, 0.1, 0.05)
    match = match_scan(grid, perception, tried, WIDE, MatchParameters())
    assert not match.found
    assert_at(match, tried, xy=1e-9, degrees=1e-9)


def test_an_empty_map_has_nothing_to_say() -> None:
    for search in ("window", "book", "none"):
        match = match_scan(OccupancyGrid(), look(HERE), HERE, WIDE, MatchParameters(search=search))
        assert not match.found
        assert_at(match, HERE, xy=1e-9, degrees=1e-9)
