"""The book's fifteen test positions (Sect. 9.5)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.room import HERE, NARROW, assert_at, look, mapped, moved, seen

from mapcli.algorithms.similarity.grid_table import scan_table
from mapcli.algorithms.similarity.measures import SIMILARITIES
from mapcli.algorithms.slam.book_matcher import FIFTEEN, best_of_fifteen
from mapcli.algorithms.slam.match import MatchParameters
from mapcli.algorithms.slam.scan_matcher import match_scan
from mapcli.model.perception import IntendedPose, ScanPerception
from mapcli.model.pose import Pose2D


@pytest.mark.parametrize("turn", [0, -15, 15])
@pytest.mark.parametrize("step", [(0, 0), (0, 1), (0, -1), (-1, 0), (1, 0)])
def test_each_of_the_fifteen_can_win(step: tuple[int, int], turn: int) -> None:
    cell = 0.2
    grid = mapped(resolution=cell)
    tried = moved(HERE, -step[0] * cell, -step[1] * cell, -turn)
    match = match_scan(grid, look(HERE), tried, NARROW, MatchParameters(search="book"))
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
        place = IntendedPose(tried.theta, (tried.x, tried.y))
        perception = ScanPerception(place, beams, 100.0, no_return="ignore", walls="ends")
        for similarity in SIMILARITIES:
            match = best_of_fifteen(grid, scan, tried, similarity)
            table = scan_table(grid.to_grid_map(), perception, FIFTEEN, similarity)
            best = table.winners()[0]
            assert best.pose is not None
            assert_at(match, best.pose, xy=1e-9, degrees=1e-9)
