"""Algorithm 9.2 in its own form: the fifteen test positions of Sect. 9.5."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.corner_room import START, driven
from support.room import HERE, NARROW, assert_at, look, mapped, moved, seen

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.similarity.measures import SIMILARITIES, Similarity
from mapcli.algorithms.slam.book_matcher import best_of_fifteen
from mapcli.algorithms.slam.book_perception import (
    PerceivedPlaces,
    expected_places,
    perceived_places,
)
from mapcli.algorithms.slam.match import MatchParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.scan_matcher import match_scan
from mapcli.model.pose import Pose2D

BOOK = MatchParameters(search="book")

UP = [Pose2D(START.x, START.y + k, START.theta) for k in range(7)]
"""Seven poses in the corner room, a cell apart."""


@pytest.mark.parametrize("turn", [0, -15, 15])
@pytest.mark.parametrize("step", [(0, 0), (0, 1), (0, -1), (-1, 0), (1, 0)])
def test_each_of_the_fifteen_can_win(step: tuple[int, int], turn: int) -> None:
    cell = 0.2
    tried = moved(HERE, -step[0] * cell, -step[1] * cell, -turn)
    match = match_scan(mapped(resolution=cell), look(HERE), tried, NARROW, BOOK)
    assert_at(match, HERE, xy=1e-9, degrees=1e-9)
    assert match.found


@pytest.mark.parametrize("turns_deg", [(0.0, -15.0, 15.0), (10.0, -10.0)])
def test_nothing_but_the_test_positions_is_tried(turns_deg: tuple[float, ...]) -> None:
    tried = moved(HERE, 0.13, 0.08, 6)
    parameters = MatchParameters(search="book", turns_deg=turns_deg)
    match = best_of_fifteen(mapped(), look(HERE), tried, parameters)
    steps = [abs(round(d / 0.05, 6)) for d in (match.pose.x - tried.x, match.pose.y - tried.y)]
    assert sorted(steps) in ([0, 0], [0, 1])
    turn = math.degrees(match.pose.theta - tried.theta)
    assert min(abs(turn - t) for t in (0.0, *turns_deg)) < 1e-9


def test_where_nothing_is_known_odometry_is_believed() -> None:
    there = Pose2D(50, 50, 1)
    match = best_of_fifteen(mapped(), seen([(1, 0)], [(0, 1)]), there, BOOK)
    assert match.pose == there
    assert not match.found


def test_what_is_expected_behind_a_wall_is_nothing() -> None:
    """A wall in column 3: in it an end is expected, behind it none, beyond its end nobody knows."""
    grid = OccupancyGrid()
    grid.extend_to(np.full(2, -1.0), np.full(2, 1.0))
    cells = grid.pose_to_cells(Pose2D()).astype(int)
    grid.log_odds[cells[1], cells[0] : cells[0] + 3] = -100
    grid.log_odds[cells[1], cells[0] + 3] = 100
    ends = np.array([[3.5, 0.5], [4.5, 0.5], [3.5, 1.5], [2.5, 0.5]])
    p = PerceivedPlaces(ends, np.ones(4, np.int8), np.arange(4), ends - (1, 0))
    pose = np.array([*cells[:2], 0.0])
    assert expected_places(grid, p, pose).tolist() == [1, -1, 0, -1]


@pytest.mark.parametrize("similarity", SIMILARITIES)
def test_perfect_odometry_is_left_alone(similarity: Similarity) -> None:
    """Seven cells up in the corner room: S, a sum over all that is known, would rather stay."""
    assert driven(UP, UP, similarity, START) == UP


@pytest.mark.parametrize("similarity", SIMILARITIES)
@pytest.mark.parametrize("cells", [2, 3, 4, 5])
def test_a_wheel_that_slips_is_found_out(similarity: Similarity, cells: int) -> None:
    """Figs. 9.15 to 9.22: the last step ends in the intended cell, but 15 degrees clockwise."""
    counted = UP[: cells + 1]
    turned = Pose2D(counted[-1].x, counted[-1].y, START.theta - math.radians(15))
    found = driven([*counted[:-1], turned], counted, similarity, START)[-1]
    assert found.distance(turned) < 0.5
    assert abs(math.degrees(found.between(turned).theta)) < 7.5


def test_what_may_be_chance_waits_for_a_second_look() -> None:
    """Twelve beams, of which five speak for the cell to the right and one against it: a majority of
    less than two standard deviations. Twice the same is more."""
    few, tried = seen(look(HERE).hits[::20]), moved(HERE, -0.2, 0, 0)
    grid = mapped(resolution=0.2)
    first = best_of_fifteen(grid, few, tried, BOOK)
    assert first.pose == tried
    suspected = first.alternative
    assert suspected is not None
    assert suspected.pose.distance(HERE) < 1e-9
    assert suspected.votes == (5, 1)
    again = best_of_fifteen(grid, few, tried, BOOK, suspected)
    assert_at(again, HERE, xy=1e-9, degrees=1e-9)
    assert again.alternative is None
    no_more = best_of_fifteen(grid, seen(look(tried).hits[::20]), tried, BOOK, suspected)
    assert no_more.pose == tried
    assert no_more.alternative is None


def test_places_of_a_few_sensors_lie_on_their_beams() -> None:
    """Two readings of sensor 0 ahead and one of sensor 1 to the left, in cells of 0.1 m."""
    ahead = [
        Perception(np.array([[0.5, y]]), np.empty((0, 2)), np.array([0.0, y])) for y in (0, 0.2)
    ]
    left = Perception(np.empty((0, 2)), np.array([[0.0, 0.3]]), np.zeros(2))
    p = Perception(
        np.concatenate([one.hits for one in ahead]), left.open_ends, np.zeros(2),
        readings=(*ahead, left), sensors=(0, 0, 1),
    )  # fmt: skip
    places, signs, witnesses, _ = perceived_places(p, 0.1, np.zeros(3))
    row = np.array([0.5, 1.5, 2.5, 3.5])  # the wall is at 5; half a cell and a centimetre are left
    empty = [*((u, 0) for u in row), *((u, 2) for u in row), (0, 0.5), (0, 1.5), (0, 2.5)]
    assert places == pytest.approx(np.array([(5, 0), (5, 2), *empty]))
    assert signs.tolist() == [1, 1] + [-1] * 11
    assert witnesses.tolist() == [0, 0] + [0] * 8 + [1] * 3


def test_cells_of_a_scan_were_seen_by_the_nearest_beam() -> None:
    """A fan of beams every half degree, against the nearest one by its angle."""
    bearings = np.radians(np.arange(-180, 180, 0.5))
    p = seen([(2 * math.cos(b), 2 * math.sin(b)) for b in bearings], [])
    places, signs, witnesses, _ = perceived_places(p, 0.05, np.array([0.3, 0.4, 0.2]))
    assert witnesses[: len(bearings)].tolist() == list(range(len(bearings)))
    empty = places[signs < 0]
    rays = np.arctan2(empty[:, 1], empty[:, 0])
    off = np.abs((rays[:, None] - bearings + math.pi) % math.tau - math.pi)
    chosen = off[np.arange(len(empty)), witnesses[signs < 0]]
    assert len(empty) > 4000
    assert chosen == pytest.approx(off.min(axis=1), abs=1e-9)
