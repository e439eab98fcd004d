"""Closing the loop: what is compared, what is accepted, and what is dropped."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.looping import (
    LAP,
    around_the_ring,
    closer_of,
    drifted,
    rooms,
    see,
    there_and_back,
    worst,
)

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.loop_candidates import APART_M
from mapcli.algorithms.slam.loop_closure import LEAST_SCORE, LoopCloser, ScoredLoop
from mapcli.algorithms.slam.pose_graph import Edge
from mapcli.algorithms.slam.submap_matcher import SubmapMatch
from mapcli.algorithms.slam.submaps import SUBMAP_M
from mapcli.model.pose import Pose2D

TIGHT = np.diag([0.03**2, 0.03**2, 0.005**2])


@cache
def along_the_rooms() -> tuple[list[Pose2D], list[Perception]]:
    """40 m along rooms that are all alike, one every 3 m, and back."""
    world, poses = rooms(14), there_and_back(41)
    return poses, [see(world, pose, 5.0) for pose in poses]


def origins_of(closer: LoopCloser, poses: list[Pose2D]) -> list[Pose2D]:
    """The poses, of all scans, that origins have."""
    return [poses[closer.keyframes[s.origin].scan] for s in closer.submaps]


def errors_of(edges: list[Edge], true: list[Pose2D]) -> list[float]:
    """Metres by which loops between origins are wrong."""
    return [e.measured.distance(true[e.from_].between(true[e.to])) for e in edges]


# --- loops that are there


@pytest.mark.parametrize("drift", [0.1, -0.15, 0.2])
def test_a_ring_is_closed(drift: float) -> None:
    true, seen = around_the_ring(52)
    closer = closer_of(drifted(true, 1.0, drift), seen)
    origins = origins_of(closer, true)
    before = worst(closer.graph.poses, origins)
    closed = closer.run()
    assert len(closed.loops) >= 2
    assert len(closed.scores) == len(closed.loops)
    assert min(closed.scores) >= LEAST_SCORE
    # A submap is bent by the drift along its 10 m: by less than 5 m * sin(10 m * drift) / 2.
    bent = 2.5 * math.radians(10 * abs(drift))
    assert max(errors_of(closed.loops, origins)) < 0.02 + bent
    assert before > 0.35
    assert worst(closed.origins, origins) < before / 6
    assert closed.origins[0] == closer.keyframes[closer.submaps[0].origin].pose


def test_without_drift_nothing_gets_worse() -> None:
    true, seen = around_the_ring(52)
    closer = closer_of(true, seen)
    closed = closer.run()
    assert len(closed.loops) >= 2
    assert worst(closed.origins, origins_of(closer, true)) < 0.02


def test_before_the_robot_comes_back_there_are_no_loops() -> None:
    true, seen = around_the_ring(0.75 * LAP)
    tracked = drifted(true, 1.0, 0.1)
    closer = closer_of(tracked, seen)
    closed = closer.run()
    assert closed.loops == []
    assert closed.origins == origins_of(closer, tracked)


def test_two_runs_are_the_same() -> None:
    true, seen = around_the_ring(52)
    tracked = drifted(true, 1.0, 0.2)
    one, other = closer_of(tracked, seen).run(), closer_of(tracked, seen).run()
    assert one.origins == other.origins
    assert one.scores == other.scores
    assert [(e.from_, e.to, e.measured) for e in one.loops] == [
        (e.from_, e.to, e.measured) for e in other.loops
    ]
    assert [e.covariance.tobytes() for e in one.loops] == [
        e.covariance.tobytes() for e in other.loops
    ]


def test_progress_is_told_for_each_submap() -> None:
    true, seen = around_the_ring(30)
    closer, heard = closer_of(true, seen), []
    closer.run(heard.append)
    assert heard == list(range(len(closer.submaps)))


# --- loops that are not there


@pytest.mark.parametrize("metres", [1.0, 1.02, 1.035, 1.05, 1.06, 1.07])
def test_rooms_that_are_all_alike_make_no_wrong_loop(metres: float) -> None:
    # The wheels count too much on the way out only: back at the start, the robot is lost by up to
    # 2.8 m, which is nearly a whole room. A loop must be right to a tenth of a room, or say itself
    # (to three standard deviations) that it does not know which room this is, or not be.
    true, seen = along_the_rooms()
    half = len(true) // 2
    out = drifted(true[:half], metres, 0.0)
    tracked = [*out, *(out[-1].compose(true[half - 1].between(pose)) for pose in true[half:])]
    closer = closer_of(tracked, seen)
    origins = origins_of(closer, true)
    before = worst(closer.graph.poses, origins)
    closed = closer.run()
    for loop, error in zip(closed.loops, errors_of(closed.loops, origins), strict=True):
        assert error < 0.3 or loop.error(origins) < 3
    assert worst(closed.origins, origins) < before + 0.05
    if metres < 1.03:
        assert closed.loops  # where no other room is meant, they are found


def test_a_hall_where_nothing_is_seen() -> None:
    true, seen = around_the_ring(52)
    nothing = Perception(np.empty((0, 2)), np.empty((0, 2)), np.zeros(2))
    half_blind = [nothing if 40 <= k < 75 else p for k, p in enumerate(seen)]
    closer = closer_of(drifted(true, 1.0, 0.1), half_blind)
    origins = origins_of(closer, true)
    before = worst(closer.graph.poses, origins)
    closed = closer.run()
    assert closed.loops
    assert max(errors_of(closed.loops, origins)) < 0.1
    assert worst(closed.origins, origins) < before / 3
    all_blind = closer_of(true, [nothing] * len(true)).run()
    assert all_blind.loops == []


# --- what a match must be


GOOD = SubmapMatch(Pose2D(1.0), TIGHT, score=0.9, overlap=0.9, at_edge=False)
VAGUE_AHEAD, VAGUE = np.diag([2.0, 0.03, 0.005]) ** 2, np.diag([2.0, 1.0, 0.005]) ** 2


@pytest.mark.parametrize(
    ("match", "reliable"),
    [
        (GOOD, True),
        (replace(GOOD, score=0.45), False),
        (replace(GOOD, overlap=0.35), False),
        (replace(GOOD, at_edge=True), False),
        (replace(GOOD, covariance=VAGUE_AHEAD), True),  # a corridor: it knows the way across
        (replace(GOOD, covariance=VAGUE), False),
        (None, False),
    ],
    ids=["good", "fits badly", "elsewhere", "at the edge", "vague ahead", "vague", "none"],
)
def test_only_reliable_matches_wait(
    ring_closer: LoopCloser,
    match: SubmapMatch | None,
    reliable: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ring_closer.matcher, "match", lambda *asked: match)
    ring_closer.compare(0, 7, ring_closer.graph.shortest_paths(7)[0])
    assert [(e.from_, e.to, e.measured) for e, _ in ring_closer.unconfirmed] == [
        (0, 7, Pose2D(1.0))
    ] * reliable


# --- pairwise consistency


def waiting(closer: LoopCloser, *loops: tuple[int, int, Pose2D]) -> None:
    """Loops (from, to, error) that wait for agreement."""
    poses = closer.graph.poses
    for old, new, error in loops:
        measured = poses[old].between(poses[new]).compose(error)
        closer.propose(ScoredLoop(Edge(old, new, measured, TIGHT), 0.9))


@pytest.fixture
def ring_closer() -> LoopCloser:
    true, seen = around_the_ring(52)
    return closer_of(true, seen)


def test_one_loop_alone_is_not_accepted(ring_closer: LoopCloser) -> None:
    waiting(ring_closer, (0, 7, Pose2D()))
    assert not ring_closer.accept()
    assert not ring_closer.accepted
    assert len(ring_closer.unconfirmed) == 1


def test_two_that_agree_are_accepted_even_where_tracking_was_wrong(
    ring_closer: LoopCloser,
) -> None:
    # Both say that the second lap is a metre ahead of where it was tracked.
    ahead = Pose2D(1.0, -0.5, 0.1)
    poses = list(ring_closer.graph.poses)
    waiting(ring_closer, (0, 7, ahead))
    moved = poses[7].compose(ahead).compose(poses[7].between(poses[8]))
    ring_closer.propose(ScoredLoop(Edge(1, 8, poses[1].between(moved), TIGHT), 0.9))
    assert ring_closer.accept()
    assert [(e.from_, e.to) for e, _ in ring_closer.accepted] == [(0, 7), (1, 8)]
    assert ring_closer.unconfirmed == []
    assert sum(edge.is_loop for edge in ring_closer.graph.edges) == 2


@pytest.mark.parametrize("error", [Pose2D(0.5), Pose2D(0, -0.5), Pose2D(0, 0, 0.1)])
def test_two_that_contradict_each_other_are_not(ring_closer: LoopCloser, error: Pose2D) -> None:
    waiting(ring_closer, (0, 7, Pose2D()), (1, 8, error))
    assert not ring_closer.accept()
    assert len(ring_closer.unconfirmed) == 2


def test_the_same_submap_twice_is_no_agreement(ring_closer: LoopCloser) -> None:
    waiting(ring_closer, (0, 7, Pose2D()), (1, 7, Pose2D()))
    assert not ring_closer.accept()


def test_a_loop_waits_until_another_agrees(ring_closer: LoopCloser) -> None:
    waiting(ring_closer, (0, 7, Pose2D()))
    ring_closer.accept()
    waiting(ring_closer, (1, 8, Pose2D(0.02, 0.02)))
    assert ring_closer.accept()
    assert [(e.from_, e.to) for e, _ in ring_closer.accepted] == [(0, 7), (1, 8)]


def test_a_loop_far_from_the_newest_ones_is_no_support() -> None:
    true, seen = around_the_ring(2.9 * LAP)
    closer = closer_of(true, seen)
    new = len(closer.submaps) - 1
    assert closer.metres[new] - closer.metres[7] > APART_M + SUBMAP_M
    waiting(closer, (0, 7, Pose2D()), (1, new, Pose2D()))
    assert not closer.accept()


def test_loops_that_say_nothing_new_wait_for_others(
    ring_closer: LoopCloser, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bool] = []
    monkeypatch.setattr(
        ring_closer.graph, "optimise", lambda *, is_near_optimum: asked.append(is_near_optimum)
    )
    waiting(ring_closer, (0, 7, Pose2D()), (1, 8, Pose2D()))
    first = ring_closer.accept()
    ring_closer.update_graph(first)
    assert asked == [True]  # few are known yet, so two are a lot
    ring_closer.accepted += ring_closer.accepted * 50
    ring_closer.update_graph(first)
    assert asked == [True]
    waiting(ring_closer, (2, 9, Pose2D(0.1)))
    ring_closer.update_graph(ring_closer.accept())
    assert asked == [
        True,
        False,
    ]  # it contradicts: at once, from the loosest kernel on
    ring_closer.update_graph([])
    assert asked == [True, False]


# --- pruning


def test_a_loop_that_contradicts_the_others_is_dropped(ring_closer: LoopCloser) -> None:
    waiting(ring_closer, (0, 7, Pose2D()), (1, 8, Pose2D()), (2, 9, Pose2D()))
    wrong = Pose2D(0.8, 0.8, 0.0)
    assert ring_closer.accept()
    poses = ring_closer.graph.poses
    edge = Edge(0, 8, poses[0].between(poses[8]).compose(wrong), TIGHT)
    ring_closer.graph.add(edge)
    ring_closer.accepted.append(ScoredLoop(edge, 0.9))
    ring_closer.graph.optimise()
    ring_closer.prune()
    assert [(e.from_, e.to) for e, _ in ring_closer.accepted] == [(0, 7), (1, 8), (2, 9)]
    assert edge not in ring_closer.graph.edges
    true, _ = around_the_ring(52)
    assert worst(ring_closer.graph.poses, origins_of(ring_closer, true)) < 1e-3


def test_loops_that_agree_stay(ring_closer: LoopCloser) -> None:
    waiting(ring_closer, (0, 7, Pose2D(0.02)), (1, 8, Pose2D()), (2, 9, Pose2D(0, 0.02)))
    ring_closer.accept()
    ring_closer.graph.optimise()
    ring_closer.prune()
    assert len(ring_closer.accepted) == 3
