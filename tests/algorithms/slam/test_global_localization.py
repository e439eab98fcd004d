"""Finding a robot anywhere in a known map, and the known maps themselves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.looping import MAP, blind, box, scan_at, see

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.scans.ray_casting import edges_of
from mapcli.algorithms.slam import global_localization as locating
from mapcli.algorithms.slam.global_localization import localize_globally
from mapcli.algorithms.slam.log_odds import (
    LOG_ODDS_PER_COUNT,
    MAX_COUNTS,
    MIN_COUNTS,
    log_odds_from_probabilities,
)
from mapcli.algorithms.slam.match import MatchParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.slam import MOST_GLOBAL_SCANS, Slam, SlamParameters
from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.world import World

MATCH = MatchParameters()
SLAM = SlamParameters().without_loops()


def flat() -> np.ndarray:
    """Three rooms that are not alike, 9 m by 6 m in all."""
    outline = box(-0.52, -0.53, 8.58, 5.47)
    walls = [box(3.1, -0.5, 3.2, 2.1), box(3.1, 3.2, 3.2, 5.4), box(3.2, 3.4, 6.9, 3.5)]
    things = [box(0.3, 4.1, 1.4, 4.9), box(5.2, 0.6, 5.9, 1.1), box(7.4, 4.6, 8.5, 5.0)]
    return edges_of(World.of([outline, *walls, *things]))


FLAT = flat()
ROUND = [[3 * math.cos(a), 3 * math.sin(a)] for a in np.arange(0, math.tau, 0.1).tolist()]
HALL = edges_of(World.of([ROUND]))
HALL_POSES = [Pose2D(0.1 * k, 0.05 * k, 0.3 * k) for k in range(MOST_GLOBAL_SCANS)]
"""A round hall, and a drive in it: nothing in the flat is like it."""

PLACES = [(0.4, 0.7), (2.2, 2.7), (4.3, 2.2), (7.6, 1.6), (5.5, 4.5), (3.9, 4.8), (1.9, 4.5)]


@pytest.fixture(scope="module")
def known() -> GridMap:
    """Its map, as a robot would have made it."""
    grid = OccupancyGrid(MAP)
    for x, y in PLACES:
        grid.integrate(Pose2D(x, y), see(FLAT, Pose2D(x, y)))
    return grid.to_grid_map()


def opened(grid: GridMap) -> OccupancyGrid:
    return OccupancyGrid.from_grid_map(grid, MAP)


# --- localize_globally


@pytest.mark.parametrize("heading", [0.0, 1.3, -2.2, math.pi])
def test_the_pose_is_found_anywhere_at_any_heading(known: GridMap, heading: float) -> None:
    rng = np.random.default_rng(round(10 * abs(heading)))
    grid = opened(known)
    for x, y in PLACES:
        x, y = x + rng.uniform(-0.15, 0.15), y + rng.uniform(-0.15, 0.15)
        true = Pose2D(x, y, wrap_angle(heading + rng.uniform(-0.2, 0.2)))
        match = localize_globally(grid, see(FLAT, true), MATCH)
        assert match.found
        assert match.pose.distance(true) < MAP.resolution
        assert abs(true.between(match.pose).theta) < math.radians(0.5)
        assert match.score > 0.6


@pytest.mark.slow
def test_a_hall_is_not_in_this_flat(known: GridMap) -> None:
    for pose in HALL_POSES:
        match = localize_globally(opened(known), see(HALL, pose), MATCH)
        assert not match.found
        assert match.pose == Pose2D()


def test_a_scan_of_nothing_is_found_nowhere(known: GridMap) -> None:
    few = np.array([[1.0, 0.0], [1.0, 0.5], [1.0, 1.0], [2.0, 1.0]])
    for hits in (few[:0], few):
        match = localize_globally(opened(known), Perception(hits, few[:0], np.zeros(2)), MATCH)
        assert not match.found


def test_a_map_far_from_its_origin(known: GridMap) -> None:
    away = replace(known, origin=Pose2D(known.origin.x - 1000.0, known.origin.y + 500.0))
    true = Pose2D(4.4, 2.3, 2.0)
    match = localize_globally(opened(away), see(FLAT, true), MATCH)
    assert match.found
    assert match.pose.distance(Pose2D(-995.6, 502.3)) < MAP.resolution


def test_too_large_a_map_is_refused(known: GridMap, monkeypatch: pytest.MonkeyPatch) -> None:
    # 9.1 m at 5 cm are 12 squares of 16 cells at most, at 721 headings: 121,849 nodes.
    scan = see(FLAT, Pose2D(*PLACES[0]))
    monkeypatch.setattr(locating, "MOST_NODES", 130_000)
    assert localize_globally(opened(known), scan, MATCH).found
    monkeypatch.setattr(locating, "MOST_NODES", 90_000)
    with pytest.raises(DataError, match="too large to look everywhere: 9 m across") as error:
        localize_globally(opened(known), scan, MATCH)
    assert "a start pose" in str(error.value.expected)


# --- a run in a known map


def test_a_run_begins_where_the_robot_is_found(known: GridMap) -> None:
    true = [Pose2D(4.0 + 0.2 * k, 2.2, 0.05 * k) for k in range(8)]
    slam = Slam(SLAM, known=opened(known))
    found = [slam.step(scan_at(FLAT, p, k), true[0].between(p)) for k, p in enumerate(true)]
    assert [traced.status for traced in found] == ["first"] + ["matched"] * 7
    for traced, pose in zip(found, true, strict=True):
        assert traced.pose.distance(pose) < MAP.resolution


def test_a_robot_that_is_nowhere_is_told(known: GridMap) -> None:
    slam = Slam(SLAM, known=opened(known))
    *first, last = [scan_at(HALL, pose, k) for k, pose in enumerate(HALL_POSES)]
    for scan, pose in zip(first, HALL_POSES, strict=False):
        slam.step(scan, pose)
    with pytest.raises(DataError, match="10 scans are found nowhere in the known map"):
        slam.step(last, HALL_POSES[-1])


def test_a_robot_that_is_lost_writes_nothing_into_the_map(known: GridMap) -> None:
    grid = opened(known)
    before = grid.to_grid_map().cells
    slam = Slam(SLAM, known=grid)
    slam.step(scan_at(HALL, HALL_POSES[0], 0), None)  # it is somewhere else
    assert np.array_equal(grid.to_grid_map().cells, before, equal_nan=True)
    true = Pose2D(4.0, 2.2, 1.0)
    assert slam.step(scan_at(FLAT, true, 1), None).pose.distance(true) < MAP.resolution


def test_a_robot_that_sees_nothing_at_first_is_found_later(known: GridMap) -> None:
    true = [Pose2D(4.0 + 0.1 * k, 2.2) for k in range(4)]
    scans = [scan_at(FLAT, pose, k) for k, pose in enumerate(true)]
    slam = Slam(SLAM, known=opened(known))
    found = [slam.step(blind(s) if k < 2 else s, None) for k, s in enumerate(scans)]
    assert [traced.status for traced in found] == ["first", "odometry", "matched", "matched"]
    assert found[3].pose.distance(true[3]) < MAP.resolution


# --- OccupancyGrid.from_grid_map


@pytest.mark.parametrize("origin", [(0.0, 0.0), (-3.2, 7.45), (0.017, -0.031), (1e4 + 0.02, 5.0)])
def test_a_known_map_comes_back_as_it_was(known: GridMap, origin: tuple[float, float]) -> None:
    # Also where its cells do not begin at a multiple of their size.
    moved = replace(known, origin=Pose2D(*origin))
    again = opened(moved).to_grid_map()
    assert again.resolution == moved.resolution
    assert (again.origin.x, again.origin.y) == pytest.approx(origin, abs=1e-9)
    assert again.cells.shape == moved.cells.shape
    assert np.array_equal(np.isnan(again.cells), np.isnan(moved.cells))
    assert np.nanmax(np.abs(again.cells - moved.cells)) < 1e-6


def test_cells_by_hand() -> None:
    cells = np.array([[np.nan, 1.0, 0.0], [0.5, 0.9, 0.1]], np.float32)
    grid = OccupancyGrid.from_grid_map(GridMap(cells, 0.5, Pose2D(10.25, -3.1)), MAP)
    assert grid.parameters.resolution == 0.5  # the map's own, whatever was asked
    centres = np.array([[x, y] for y in (-2.35, -2.85) for x in (10.5, 11.0, 11.5)])
    u, v = np.floor(grid.to_cells(centres)).astype(int).T
    log_odds = grid.log_odds[v, u] * LOG_ODDS_PER_COUNT
    assert log_odds[0] == 0  # unknown
    assert log_odds[1] > 10
    assert log_odds[2] < -10
    assert log_odds[3] == -LOG_ODDS_PER_COUNT  # as good as open, but known
    assert log_odds[4:] == pytest.approx([math.log(9), -math.log(9)], abs=LOG_ODDS_PER_COUNT / 2)
    assert (grid.log_odds != 0).sum() == 5
    # Walls, and nothing else, are what scans are compared with.
    assert (grid.pyramid[0, v, u] == 255).tolist() == [False, True, False, False, True, False]


def test_log_odds_keep_to_the_limits_of_a_map() -> None:
    # ln(1e9) is 20.7: 352 counts; a probability of 0 or 1 is taken as 1e-9 from it.
    counts = log_odds_from_probabilities(np.array([[0.0, 1.0, 0.5, np.nan]], np.float32))
    assert counts.tolist() == [[-352, 352, -1, 0]]
    assert counts.min() >= MIN_COUNTS
    assert counts.max() <= MAX_COUNTS


def test_walls_of_a_known_map_are_fitted_to(known: GridMap) -> None:
    grid, true = opened(known), Pose2D(4.4, 2.3, 0.7)
    points = see(FLAT, true).hits
    fit = grid.surfels.fit(points, true.compose(Pose2D(0.03, -0.02, 0.01)))
    assert fit.matched > 0.9 * len(points)
    assert fit.pose.distance(true) < MAP.resolution / 2


def test_a_yaw_is_refused(known: GridMap) -> None:
    turned = replace(known, origin=Pose2D(0, 0, math.radians(30)))
    with pytest.raises(DataError, match="the origin's yaw is 30 deg") as error:
        opened(turned)
    assert "along the axes" in str(error.value.expected)


@pytest.mark.parametrize("value", [np.nan, 0.0, 0.5])
def test_a_map_without_walls_is_refused(value: float) -> None:
    with pytest.raises(DataError, match="no occupied cell"):
        opened(GridMap(np.full((20, 30), value, np.float32), 0.05))
