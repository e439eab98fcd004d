"""Loops that help are kept, and those with which the beams are explained worse are not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.looping import MAP, around_the_ring, drifted, trajectory_of, worst

from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.loop_check import groups_of, keep_loops_that_help
from mapcli.algorithms.slam.loop_closure import LoopCloser, LoopParameters, ScoredLoop
from mapcli.algorithms.slam.pose_graph import Edge
from mapcli.model.pose import Pose2D

DRIFT = 0.05
"""Degrees for each metre of a lap and a half."""

TIGHT = np.diag([0.03**2, 0.03**2, 0.005**2])


def ring() -> tuple[TrackedTrajectory, LoopCloser, list[Pose2D]]:
    """A drifted trajectory, its loops closed, and the true poses."""
    true, seen = around_the_ring(52)
    trajectory = trajectory_of(drifted(true, 1.0, DRIFT), seen)
    closer = LoopCloser(trajectory.keyframes, MAP, LoopParameters())
    closer.run()
    return trajectory, closer, true


def error(closer: LoopCloser, true: list[Pose2D]) -> float:
    origins = [true[closer.keyframes[one.origin].scan] for one in closer.submaps]
    return worst(closer.graph.poses, origins)


def test_right_loops_are_kept() -> None:
    trajectory, closer, true = ring()
    loops, poses = list(closer.accepted), list(closer.graph.poses)
    check = keep_loops_that_help(closer, trajectory)
    assert check is not None
    assert check.dropped == 0
    assert check.found == check.kept > check.without
    assert closer.accepted == loops
    assert closer.graph.poses == poses
    assert error(closer, true) < 0.1


def test_without_loops_there_is_nothing_to_check() -> None:
    true, seen = around_the_ring(20)
    trajectory = trajectory_of(true, seen)
    closer = LoopCloser(trajectory.keyframes, MAP, LoopParameters())
    closer.run()
    assert keep_loops_that_help(closer, trajectory) is None


WRONG = Pose2D(1.5, 0.5, math.radians(8))
ERRORS = WRONG, Pose2D(0, -1.2), Pose2D(0, 0.8, -0.1), Pose2D(2, 0, -0.1), Pose2D(-1.5, 0, 0.1)


@pytest.mark.parametrize("off", ERRORS)
def test_wrong_loops_that_agree_are_kept_only_if_the_map_is_better(off: Pose2D) -> None:
    """All loops say the same wrong thing, so that nothing in the graph contradicts them. The robust
    kernel may weigh them so that the map is better still."""
    trajectory, closer, true = ring()
    right = closer.accepted
    wrong = [
        ScoredLoop(replace(one.edge, measured=one.edge.measured.compose(off)), one.score)
        for one in right
    ]
    for one, other in zip(right, wrong, strict=True):
        closer.graph.remove(one.edge)
        closer.graph.add(other.edge)
    closer.accepted = wrong
    closer.graph.optimise()
    origins = [true[closer.keyframes[one.origin].scan] for one in closer.submaps]
    without, found = worst(closer.tracked.poses, origins), error(closer, true)
    check = keep_loops_that_help(closer, trajectory)
    assert check is not None
    assert (check.dropped > 0) == (found > without)
    assert (check.kept > check.found) == (found > without)
    assert error(closer, true) == pytest.approx(min(found, without))


def test_a_wrong_group_is_dropped_and_the_right_ones_stay() -> None:
    """Loops of the last metres are wrong, and certain of themselves."""
    trajectory, closer, true = ring()
    right, n = list(closer.accepted), len(closer.submaps)
    first = max(one.edge.to for one in right)
    off = Pose2D(0.0, 1.3, math.radians(6))
    for old in (n // 3, n // 3 + 1):
        measured = closer.graph.poses[old].between(closer.graph.poses[first]).compose(off)
        edge = Edge(old, first, measured, TIGHT * 1e-4)
        closer.graph.add(edge)
        closer.accepted.append(ScoredLoop(edge, 0.6))
    closer.graph.optimise()
    assert error(closer, true) > 0.3
    check = keep_loops_that_help(closer, trajectory)
    assert check is not None
    assert check.kept > check.found
    assert closer.accepted == right
    assert error(closer, true) < 0.1


def test_loops_that_say_the_same_are_a_group() -> None:
    _, closer, _ = ring()
    right, tracked = list(closer.accepted), closer.tracked.poses
    elsewhere = [
        Edge(a, b, tracked[a].inverse().compose(WRONG).compose(tracked[b]), TIGHT)
        for a, b in ((one.edge.from_, one.edge.to) for one in right)
    ]
    wrong = [ScoredLoop(edge, 0.6) for edge in elsewhere]
    assert groups_of([right[0], wrong[0], *right[1:], *wrong[1:]], closer) == [right, wrong]
