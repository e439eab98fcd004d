"""Candidates for a loop: which old submaps are compared, and how far around."""

from __future__ import annotations

import numpy as np
from support.looping import LAP, MAP, NOTHING, around_the_ring, closer_of, trajectory_of

from mapcli.algorithms.slam.keyframes import Keyframe
from mapcli.algorithms.slam.loop_candidates import APART_M
from mapcli.algorithms.slam.loop_closure import LoopCloser, LoopParameters
from mapcli.algorithms.slam.pose_graph import Edge
from mapcli.model.pose import Pose2D

TIGHT = np.diag([0.03**2, 0.03**2, 0.005**2])


def test_candidates_are_the_nearest_of_each_earlier_visit() -> None:
    true, seen = around_the_ring(2.9 * LAP)
    closer = closer_of(true, seen)
    poses, metres = (
        closer.graph.poses,
        [closer.keyframes[s.origin].metres for s in closer.submaps],
    )
    new = len(closer.submaps) - 2
    found = closer.candidates(new)
    assert len(found) == 2  # the robot has been here twice before
    for k in found:
        assert metres[new] - metres[k] >= APART_M
        visit = [j for j in range(new) if abs(metres[j] - metres[k]) < LAP / 2]
        assert poses[k].distance(poses[new]) == min(poses[j].distance(poses[new]) for j in visit)


def test_no_candidates_where_the_graph_knows_it_already() -> None:
    true, seen = around_the_ring(52)
    closer = closer_of(true, seen)
    new = 8
    (old,) = closer.candidates(new)
    measured = closer.graph.poses[old].between(closer.graph.poses[new])
    closer.graph.add(Edge(old, new, measured, TIGHT))
    assert closer.candidates(new) == {}


def test_the_less_is_known_the_farther_is_looked() -> None:
    # Straight on for 25 m there is nothing near; only who hardly knows where he is looks there.
    poses = [Pose2D(0.5 * k) for k in range(50)]
    keyframes = trajectory_of(poses, [NOTHING] * 50).keyframes

    def candidates(covariance: np.ndarray) -> list[int]:
        vague = [Keyframe(k.scan, k.pose, k.perception, covariance, k.metres) for k in keyframes]
        closer = LoopCloser(vague, MAP, LoopParameters(widest_xy=30.0))
        new = len(closer.submaps) - 1
        return list(closer.candidates(new))

    assert candidates(np.diag([0.01**2, 0.01**2, 0.001**2])) == []
    assert candidates(np.diag([1.0, 1.0, 0.001**2])) == [0]
