"""Lines 5 to 8 of Algorithm 9.2: the test positions, what they are scored with, who wins."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mapcli.algorithms.scans.perception import Perception, PerceptionParameters, perceive
from mapcli.algorithms.scans.ray_casting import cast, edges_of
from mapcli.algorithms.similarity.grid_table import scan_table
from mapcli.algorithms.similarity.measures import SIMILARITIES
from mapcli.algorithms.slam.match import Match, MatchParameters
from mapcli.algorithms.slam.motion_model import MotionModel, OdometryUncertainty
from mapcli.algorithms.slam.occupancy_grid import MapParameters, OccupancyGrid
from mapcli.algorithms.slam.scan_matcher import FIFTEEN, ScanInMap, best_of_fifteen, best_pose
from mapcli.algorithms.slam.scan_points import thinned
from mapcli.model.perception import ScanPerception, Standpoint
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.scan import RangeScan
from mapcli.model.se2_uncertainty import StandardDeviations
from mapcli.model.world import World

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


# --- how far odometry may err


def test_the_uncertainty_of_odometry_by_hand() -> None:
    model = MotionModel(
        xy_floor=0.01, xy_per_m=0.1, xy_per_rad=0.2,
        turn_floor_deg=1.0, turn_per_rad=0.5, turn_deg_per_m=2.0,
        silent_xy=0.4, silent_turn_deg=30.0,
    )  # fmt: skip
    uncertainty = model.uncertainty(Pose2D(3, -4, -0.1))  # 5 m, 0.1 rad
    deviations = uncertainty.deviations
    assert deviations.xy == pytest.approx(0.01 + 0.5 + 0.02)
    assert deviations.theta == pytest.approx(math.radians(1 + 10) + 0.05)
    assert uncertainty.metres == pytest.approx(5)
    assert model.uncertainty(Pose2D()) == uncertain(0.01, 1, 0)
    assert model.uncertainty(None) == replace(uncertain(0.4, 30, 0), window_sigmas=2)


# --- a scan at this pose or that


def test_contradictions_by_hand() -> None:
    # The right wall of the room is 4.04 m ahead; a beam has passed 1.5 m ahead.
    here, ends = Pose2D(), [(4.04, 0.0), (1.5, 0.0), (4.9, 0.0)]
    scan = ScanInMap(mapped(here), seen(ends), MatchParameters(fewest=1, refine=False))
    assert scan.next_to(here, NARROW).free_space_conflicts == 1  # nothing is known beyond the wall
    assert (
        scan.next_to(Pose2D(-0.86), NARROW).free_space_conflicts == 2
    )  # now the farthest is the wall


def test_next_to_searches_nothing() -> None:
    scan = ScanInMap(mapped(), look(HERE), MatchParameters())
    assert_at(scan.next_to(moved(HERE, 0.05, 0.03, 1), WIDE), HERE)
    far = moved(HERE, 0.6, 0.0)
    assert scan.next_to(far, NARROW).pose.distance(far) < 0.3
    few = ScanInMap(mapped(), seen([(1, 1)]), MatchParameters())
    assert few.next_to(far, NARROW) == Match(far, 0.0, 0, found=False)


# --- window


@pytest.mark.parametrize(
    "off", [(0, 0, 0), (0.08, -0.06, 3), (-0.1, 0.1, -5), (0.22, 0.13, 8), (0.013, 0.021, 0.2)]
)
def test_window_finds_the_true_pose(off: tuple[float, float, float]) -> None:
    match = best_pose(mapped(), look(HERE), moved(HERE, *off), WIDE, MatchParameters())
    assert_at(match, HERE)
    assert match.found
    assert 0.7 < match.score <= 1
    assert match.known_points > 50


def test_window_finds_a_pose_it_has_not_been_at() -> None:
    true = Pose2D(0.35, -0.3, 0.5)
    match = best_pose(mapped(), look(true), moved(true, 0.1, 0.1, -4), WIDE, MatchParameters())
    assert_at(match, true)


def test_headings_come_out_wrapped() -> None:
    here = Pose2D(0.02, 0.01, math.pi - 0.01)
    match = best_pose(mapped(here), look(here), moved(here, 0, 0, -3), WIDE, MatchParameters())
    assert_at(match, here)
    beyond = moved(here, 0, 0, 2)
    match = best_pose(mapped(here), look(beyond), here, WIDE, MatchParameters())
    assert_at(match, beyond)
    assert -math.pi <= match.pose.theta <= math.pi


def test_the_map_and_the_perception_stay_as_they_were() -> None:
    grid, perception = mapped(), look(HERE)
    log_odds, fields, hits = grid.log_odds.copy(), grid.fields.copy(), perception.hits.copy()
    for search in ("window", "book"):
        best_pose(grid, perception, HERE, WIDE, MatchParameters(search=search))
    assert (grid.log_odds == log_odds).all()
    assert (grid.fields == fields).all()
    assert (perception.hits == hits).all()


def test_a_window_that_leaves_the_map() -> None:
    # Far from everything known: the map is made to hold the window, and nothing is found.
    grid = mapped()
    there = Pose2D(60, -70, 1)
    match = best_pose(grid, look(HERE), there, WIDE, MatchParameters())
    assert not match.found
    assert match.known_points == 0
    assert_at(match, there, xy=1e-9, degrees=1e-9)


UNREFINED = MatchParameters(
    refine=False, window_xy=0.1, window_theta_deg=2.0, lost_below=0.0, prior=0.0
)


def test_the_test_positions_are_those_of_the_window() -> None:
    # 0.1 m and 4 x 0.02 m are 3.6 cells of 5 cm: 4. 2 and 4 x 0.5 degrees are 8 half degrees.
    match = best_pose(mapped(), look(HERE), moved(HERE, 0.4, -0.4, 11), NARROW, UNREFINED)
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
    match = best_pose(mapped(), look(HERE), tried, wide, UNREFINED)
    assert_at(match, HERE, xy=1e-6, degrees=1e-6)


@pytest.mark.parametrize(("step_xy", "cells"), [(None, 1), (0.001, 1), (0.1, 2), (0.2, 4)])
def test_steps_are_whole_cells(step_xy: float | None, cells: int) -> None:
    wanted = (0.15, -0.05)  # 3 cells and 1 cell
    tried = moved(HERE, -wanted[0], -wanted[1])
    parameters = MatchParameters(step_xy=step_xy, refine=False, prior=0.0, lost_below=0.0)
    match = best_pose(mapped(), look(HERE), tried, WIDE, parameters)
    steps = np.array([match.pose.x - tried.x, match.pose.y - tried.y]) / (0.05 * cells)
    assert steps == pytest.approx(np.round(steps), abs=1e-6)
    if cells == 1:
        assert_at(match, HERE, xy=1e-6)


def test_coarse_headings() -> None:
    parameters = MatchParameters(
        step_theta_deg=4.0, window_theta_deg=10.0, refine=False, prior=0.0, lost_below=0.0
    )
    match = best_pose(mapped(), look(HERE), moved(HERE, 0, 0, 8), NARROW, parameters)
    assert_at(match, HERE, xy=1e-6, degrees=1e-6)
    match = best_pose(mapped(), look(HERE), moved(HERE, 0, 0, 6), NARROW, parameters)
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
        match = best_pose(grid, look(HERE, edges, 6.0), tried, WIDE, MatchParameters())
        assert match.found
        assert match.pose.x == pytest.approx(tried.x, abs=0.03)
        assert match.pose.y == pytest.approx(HERE.y, abs=0.02)
        assert match.pose.theta == pytest.approx(HERE.theta, abs=math.radians(0.5))


# --- where odometry has failed


def test_lost_odometry_is_searched_for_far_around() -> None:
    for off in ((0.4, -0.35, 0), (-0.3, 0.3, 30), (0, 0, -40)):
        match = best_pose(mapped(), look(HERE), moved(HERE, *off), NARROW, MatchParameters())
        assert_at(match, HERE)
        assert match.found


def test_the_far_window_grows_with_the_way() -> None:
    tried = moved(HERE, 0.9, 0.0, 5)
    fast = uncertain(0.05, 1, 0.5)
    assert_at(best_pose(mapped(), look(HERE), tried, fast, MatchParameters()), HERE)
    match = best_pose(mapped(), look(HERE), tried, NARROW, MatchParameters())
    assert match.pose.distance(HERE) > 0.3


def test_what_fits_nowhere_stays_in_the_window() -> None:
    # Another room than the map's: no pose is usual, so none farther off is believed.
    p = MatchParameters()
    match = best_pose(mapped(), look(HERE, OTHER_ROOM), HERE, NARROW, p)
    half = p.window_xy + NARROW.window_sigmas * NARROW.deviations.xy + 0.05
    assert match.pose.distance(HERE) <= half * math.sqrt(2) + 0.1


# --- scans that say little


def test_none_looks_at_nothing() -> None:
    tried = moved(HERE, 0.1, 0.1, 3)
    match = best_pose(mapped(), look(HERE), tried, WIDE, MatchParameters(search="none"))
    assert match == Match(tried, 0.0, 0, found=False)


@pytest.mark.parametrize("count", [0, 1, 4])
def test_too_few_points_say_nothing(count: int) -> None:
    tried = moved(HERE, 0.1, 0.1, 3)
    few = Perception(look(HERE).hits[::50][:count], np.empty((0, 2)), np.zeros(2))
    assert len(few.hits) == count
    match = best_pose(mapped(), few, tried, WIDE, MatchParameters(fewest=5))
    assert match == Match(tried, 0.0, 0, found=False)


def test_points_of_one_square_are_one_point() -> None:
    hits = look(HERE).hits[:1] + np.linspace(0, 1e-6, 100)[:, None]
    crowd = Perception(hits, np.empty((0, 2)), np.zeros(2))
    assert not best_pose(mapped(), crowd, HERE, WIDE, MatchParameters(fewest=5)).found


def test_too_small_an_overlap_says_nothing() -> None:
    # Three of many points meet the map, a little aside; the others lie in the unknown.
    wall = [(3.0, 0.0), (3.0, 1.0), (3.0, -1.0)]
    grid = OccupancyGrid()
    grid.integrate(HERE, seen(wall))
    perception = seen(wall + [(-2.0 - 0.1 * k, 1.0) for k in range(30)])
    tried = moved(HERE, 0.1, 0.05)
    match = best_pose(grid, perception, tried, WIDE, MatchParameters(fewest=5))
    assert not match.found
    assert_at(match, tried, xy=1e-9, degrees=1e-9)


def test_an_empty_map_has_nothing_to_say() -> None:
    for search in ("window", "book", "none"):
        match = best_pose(OccupancyGrid(), look(HERE), HERE, WIDE, MatchParameters(search=search))
        assert not match.found
        assert_at(match, HERE, xy=1e-9, degrees=1e-9)


# --- the book's fifteen


@pytest.mark.parametrize("turn", [0, -15, 15])
@pytest.mark.parametrize("step", [(0, 0), (0, 1), (0, -1), (-1, 0), (1, 0)])
def test_each_of_the_fifteen_can_win(step: tuple[int, int], turn: int) -> None:
    cell = 0.2
    grid = mapped(resolution=cell)
    tried = moved(HERE, -step[0] * cell, -step[1] * cell, -turn)
    match = best_pose(grid, look(HERE), tried, NARROW, MatchParameters(search="book"))
    assert_at(match, HERE, xy=1e-9, degrees=1e-9)
    assert match.found


def test_nothing_but_the_fifteen_is_tried() -> None:
    tried = moved(HERE, 0.13, 0.08, 6)
    match = best_of_fifteen(mapped(), look(HERE), tried)
    steps = sorted(
        abs(round(d / 0.05, 6)) for d in (match.pose.x - tried.x, match.pose.y - tried.y)
    )
    assert steps in ([0, 0], [0, 1])
    turn = math.degrees(match.pose.theta - tried.theta)
    assert min(abs(turn - t) for t in (0, -15, 15)) < 1e-9


def test_of_equals_the_intended_pose_wins() -> None:
    # A robot in the open, in a map that says nothing about what it sees.
    grid = mapped()
    there = Pose2D(50, 50, 1)
    match = best_of_fifteen(grid, seen([(1, 0)], [(0, 1)]), there)
    assert_at(match, there, xy=1e-9, degrees=1e-9)
    assert not match.found


def test_the_replay_scores_as_the_similarity_table() -> None:
    """`slam-replay --search book` and `mapcli similarity-table` use the same code: on the same map
    and scan the table's best pose is the replay's, whatever the similarity."""
    grid, scan = mapped(resolution=0.2), look(HERE)
    ends = scan.hits - scan.laser
    beams = np.column_stack([np.arctan2(ends[:, 1], ends[:, 0]), np.hypot(*ends.T)])
    for tried in (HERE, moved(HERE, 0.2, 0, -15), moved(HERE, 0.13, 0.08, 6)):
        place = Standpoint(tried.theta, (tried.x, tried.y))
        perception = ScanPerception(place, beams, 100.0, no_return="ignore", walls="ends")
        for similarity in SIMILARITIES:
            match = best_of_fifteen(grid, scan, tried, similarity)
            table = scan_table(grid.to_grid_map(), perception, FIFTEEN, similarity)
            best = table.winners()[0]
            assert best.pose is not None
            assert_at(match, best.pose, xy=1e-9, degrees=1e-9)


def test_thinned_keeps_the_first_of_each_square() -> None:
    points = np.array([[0.01, 0.01], [0.02, 0.03], [0.06, 0.01], [-0.01, 0.01]])
    assert thinned(points, 0.05).tolist() == points[[0, 2, 3]].tolist()
    assert thinned(np.empty((0, 2)), 0.05).shape == (0, 2)
