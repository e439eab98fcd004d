"""Pieces between which tracking was lost: a robot that was carried, and comes back or not."""

from __future__ import annotations

from functools import cache

import pytest
from support.looping import NOTHING, box, laps, log_of, ring, scan_at, worst

from mapcli.algorithms.scans.ray_casting import edges_of
from mapcli.algorithms.slam.keyframes import TEAR_M, Keyframe
from mapcli.algorithms.slam.pieces import Pieces
from mapcli.algorithms.slam.replay import Replayed, replay
from mapcli.algorithms.slam.submaps import Submap
from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan
from mapcli.model.se2_uncertainty import StandardDeviations
from mapcli.model.world import World

COVARIANCE = StandardDeviations(0.1, 0.1).covariance()


def pieces_of(firsts: set[int], count: int) -> Pieces:
    """Submaps of one keyframe each; with some of them a piece begins."""
    keyframes = [
        Keyframe(k, Pose2D(k), NOTHING, COVARIANCE, k * TEAR_M, k if k in firsts else None)
        for k in range(count)
    ]
    return Pieces(keyframes, [Submap(k, k, k) for k in range(count)])


def test_pieces_are_joined_by_loops() -> None:
    pieces = pieces_of({2, 5, 7}, 9)
    assert pieces.of == [0, 0, 1, 1, 1, 2, 2, 3, 3]
    assert pieces.unjoined() == [2, 5, 7]
    assert pieces.others(8) == [0, 1, 2]
    assert pieces.members(1, 4) == [2, 3]
    pieces.join(1, 6)
    assert pieces.are_joined(0, 5)
    assert not pieces.are_joined(0, 3)
    assert pieces.unjoined() == [2, 7]
    assert pieces.members(0, 9) == [0, 1, 5, 6]
    assert pieces.others(3) == [0]
    pieces.join(3, 8)
    assert pieces.others(8) == [0]
    assert pieces.others(6) == [1]
    pieces.join(3, 5)
    assert pieces.unjoined() == []


def test_what_hangs_on_a_piece_moves_with_it() -> None:
    pieces = pieces_of({2, 5, 7}, 9)
    assert pieces.with_all_that_hangs_on(3) == [2, 3, 4, 5, 6, 7, 8]
    pieces.join(0, 5)
    assert pieces.with_all_that_hangs_on(3) == [2, 3, 4]
    assert pieces.with_all_that_hangs_on(6) == [0, 1, 2, 3, 4, 5, 6, 7, 8]


LAPS = laps(60, 0.2)
HALL = edges_of(
    World.of([box(-7, -5, 9, 6), box(-2, -2, -1, 0), box(3, 2, 4.5, 2.6), box(5, -3, 5.6, -2)])
)
THROUGH_IT = [Pose2D(0.2 * k - 5, 1.0, 0.1) for k in range(50)]


@cache
def carried(*, comes_back: bool) -> tuple[Replayed, list[Pose2D]]:
    """A robot drives round the ring, is carried to a hall while its wheels count nothing, and
    drives on; it may be carried back then. What was made of that, and the true poses."""
    ways = [(ring(), LAPS[:150]), (HALL, THROUGH_IT), (ring(), LAPS[60:150])]
    scans, odom, true = list[RangeScan](), list[Pose2D](), list[Pose2D]()
    for world, poses in ways if comes_back else ways[:2]:
        scans += [scan_at(world, pose, len(scans) + k) for k, pose in enumerate(poses)]
        away = (odom[-1] if odom else poses[0]).compose(poses[0].inverse())
        odom += [away.compose(pose) for pose in poses]
        true += poses
    return replay(log_of(scans, odom)), true


@pytest.mark.parametrize("comes_back", [False, True])
def test_a_piece_that_is_joined_with_no_other_is_said(comes_back: bool) -> None:
    replayed, true = carried(comes_back=comes_back)
    (reason,) = [one for one in replayed.summary.reasons if one.kind == "unjoined"]
    assert (reason.from_s, reason.to_s) == pytest.approx((150 * 0.2, 199 * 0.2))
    assert replayed.summary.verdict == "bad"
    found = [one.pose for one in replayed.trace.poses]
    assert worst(found[:150], true[:150]) < 0.05  # each piece is right by itself
    assert worst(found[150:200], true[150:200]) < 0.05


def test_a_carried_robot_is_joined_where_it_comes_back() -> None:
    replayed, true = carried(comes_back=True)
    found = [one.pose for one in replayed.trace.poses]
    assert worst([*found[:150], *found[200:]], [*true[:150], *true[200:]]) < 0.05
