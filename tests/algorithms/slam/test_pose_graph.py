"""The pose graph: squares and wrong loops by hand."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from mapcli.algorithms.slam.pose_graph import LOOP_METRES, Edge, PoseGraph
from mapcli.model.pose import Pose2D

LOOSE = np.diag([0.1**2, 0.1**2, 0.05**2])
TIGHT = np.diag([0.01**2, 0.01**2, 0.005**2])
CORNERS = [
    Pose2D(0, 0, 0),
    Pose2D(4, 0, math.pi / 2),
    Pose2D(4, 4, -math.pi),
    Pose2D(0, 4, -math.pi / 2),
    Pose2D(0, 0, 0),
]


def chain(poses: list[Pose2D], covariance: np.ndarray = LOOSE) -> PoseGraph:
    graph = PoseGraph(poses)
    for k, (one, other) in enumerate(pairwise(poses)):
        graph.add(Edge(k, k + 1, one.between(other), covariance, one.distance(other)))
    return graph


def drifting(steps: int, error: Pose2D) -> list[Pose2D]:
    """Round the square, side by side, with the same error at each corner."""
    poses = [Pose2D()]
    for k in range(steps):
        motion = CORNERS[k % 4].between(CORNERS[k % 4 + 1])
        poses.append(poses[-1].compose(motion).compose(error))
    return poses


def as_row(pose: Pose2D) -> list[float]:
    return [pose.x, pose.y, pose.theta]


# --- edges


def test_the_error_of_an_edge_by_hand() -> None:
    poses = [Pose2D(1, 2, math.pi / 2), Pose2D(1, 5, math.pi)]
    assert poses[0].between(poses[1]).x == pytest.approx(3)
    covariance = np.diag([0.1**2, 0.2**2, 0.3**2])
    exact = Edge(0, 1, Pose2D(3, 0, math.pi / 2), covariance)
    assert exact.error(poses) == pytest.approx(0, abs=1e-9)
    # Measured 0.3 m short: seen from what was measured, facing left, the pose is to the right.
    short = Edge(0, 1, Pose2D(2.7, 0, math.pi / 2), covariance)
    assert short.error(poses) == pytest.approx(0.3 / 0.2)
    turned = Edge(0, 1, Pose2D(3, 0, math.pi / 2 - 0.6), covariance)
    assert turned.error(poses) == pytest.approx(2)
    both = Edge(0, 1, Pose2D(3, 0.4, math.pi / 2), covariance)
    assert both.error(poses) == pytest.approx(4)  # ahead, where it is known to 0.1 m


def test_only_edges_that_were_not_driven_are_loops() -> None:
    assert Edge(0, 1, Pose2D(), LOOSE).is_loop
    assert not Edge(0, 1, Pose2D(), LOOSE, 0.001).is_loop


# --- paths


def test_the_path_along_a_chain() -> None:
    # Straight on, two steps of 3 m. A turn of the middle pose moves the last one to the side.
    graph = chain([Pose2D(), Pose2D(3), Pose2D(6)])
    paths = graph.shortest_paths(0)
    assert [paths[k].metres for k in range(3)] == [0, 3, 6]
    assert not paths[0].covariance.any()
    assert paths[1].covariance == pytest.approx(LOOSE)
    expected = [
        [0.02, 0, 0],
        [0, 0.02 + 9 * 0.0025, 3 * 0.0025],
        [0, 3 * 0.0025, 2 * 0.0025],
    ]
    assert paths[2].covariance == pytest.approx(np.array(expected))


def test_the_path_back_along_a_chain() -> None:
    # Seen from the last pose, the middle one is also uncertain by how the last one's turn was.
    graph = chain([Pose2D(), Pose2D(3), Pose2D(6)])
    paths = graph.shortest_paths(2)
    assert [paths[k].metres for k in range(3)] == [6, 3, 0]
    middle = [[0.01, 0, 0], [0, 0.01 + 9 * 0.0025, -3 * 0.0025], [0, -3 * 0.0025, 0.0025]]
    assert paths[1].covariance == pytest.approx(np.array(middle))
    first = [
        [0.02, 0, 0],
        [0, 0.02 + (9 + 36) * 0.0025, -9 * 0.0025],
        [0, -9 * 0.0025, 2 * 0.0025],
    ]
    assert paths[0].covariance == pytest.approx(np.array(first))


def sampled(poses: list[Pose2D], path: list[int], count: int = 20_000) -> np.ndarray:
    """Covariance of a path's end as seen from its start, by drawing each edge's error."""
    rng = np.random.default_rng(0)
    factor = np.linalg.cholesky(SKEWED)
    errors = []
    for _ in range(count):
        pose = Pose2D()
        for a, b in pairwise(path):
            off = Pose2D(*(factor @ rng.normal(size=3)).tolist())
            measured = poses[min(a, b)].between(poses[max(a, b)]).compose(off)
            pose = pose.compose(measured if a < b else measured.inverse())
        end = poses[path[0]].between(poses[path[-1]]).between(pose)
        errors.append(as_row(end))
    return np.cov(np.array(errors).T)


SKEWED = np.array([[4.0, 1.0, 0.5], [1.0, 2.0, -0.3], [0.5, -0.3, 1.0]]) * 1e-4


@pytest.mark.parametrize("path", [[0, 1, 2, 3], [3, 2, 1, 0]])
def test_covariance_adds_up_as_if_it_were_drawn(path: list[int]) -> None:
    graph = chain(CORNERS[:4], SKEWED)
    added = graph.shortest_paths(path[0])[path[-1]].covariance
    drawn = sampled(CORNERS, path, 4000)
    # 4000 draws know each entry to about sqrt(2 / 4000) = 2 % of its variances.
    scale = np.sqrt(np.outer(np.diag(added), np.diag(added)))
    assert np.abs(drawn - added).max() <= 0.1 * scale.max()
    assert (np.abs(drawn - added) / scale).max() < 0.1


def test_a_loop_is_a_short_path() -> None:
    graph = chain(drifting(4, Pose2D()))
    assert graph.shortest_paths(4)[0].metres == 16
    loop = Edge(0, 4, Pose2D(), TIGHT)
    graph.add(loop)
    paths = graph.shortest_paths(4)
    assert paths[0].metres == LOOP_METRES
    assert paths[0].covariance == pytest.approx(TIGHT)
    assert paths[1].metres == LOOP_METRES + 4
    assert paths[2].metres == pytest.approx(8)  # the other way round
    graph.remove(loop)
    assert graph.shortest_paths(4)[0].metres == 16


def test_no_path_goes_farther_than_wanted() -> None:
    graph = chain(drifting(4, Pose2D()))
    assert set(graph.shortest_paths(4, [3])) == {3, 4}
    assert graph.shortest_paths(4, []) == {}
    assert graph.shortest_paths(4, [0])[0].metres == graph.shortest_paths(4)[0].metres


def test_positions_follow_the_poses() -> None:
    graph = chain(drifting(4, Pose2D(0.1)))
    before = graph.positions()
    graph.add(Edge(0, 4, Pose2D(), TIGHT))
    graph.optimise()
    assert (before != graph.positions()).any()
    assert graph.positions().tolist() == [[pose.x, pose.y] for pose in graph.poses]


# --- optimisation


def test_without_loops_nothing_moves() -> None:
    poses = drifting(9, Pose2D(0.1, -0.05, 0.02))
    graph = chain(poses)
    graph.optimise()
    for found, pose in zip(graph.poses, poses, strict=True):
        assert as_row(found) == pytest.approx(as_row(pose), abs=1e-6)


def test_an_error_along_a_line_is_spread_evenly() -> None:
    # Four steps of 1 m, counted as 1.05 m; then the end is found to be 4 m away, for certain.
    graph = chain([Pose2D(1.05 * k) for k in range(5)])
    graph.add(Edge(0, 4, Pose2D(4.0), TIGHT * 1e-2))
    graph.optimise()
    assert [pose.x for pose in graph.poses] == pytest.approx(range(5), abs=0.002)
    assert [pose.y for pose in graph.poses] == pytest.approx([0] * 5, abs=1e-6)


def test_a_square_closes() -> None:
    # Two degrees too little at each corner; the error belongs to all four of them alike.
    poses = drifting(4, Pose2D(0, 0, math.radians(-2)))
    assert poses[4].distance(CORNERS[4]) > 0.3
    graph = chain(poses, np.diag([0.01**2, 0.01**2, 0.05**2]))
    graph.add(Edge(0, 4, Pose2D(), TIGHT * 1e-2))
    graph.optimise()
    for found, corner in zip(graph.poses, CORNERS, strict=True):
        assert found.distance(corner) < 0.02
    turns = [a.between(b).theta for a, b in pairwise(graph.poses)]
    assert turns == pytest.approx([math.pi / 2] * 4, abs=math.radians(0.3))
    assert graph.poses[0] == Pose2D()


def test_the_first_pose_stays_wherever_it_is() -> None:
    start = Pose2D(-7, 3, 2.0)
    poses = [start.compose(pose) for pose in drifting(4, Pose2D(0.05, 0, 0.03))]
    graph = chain(poses)
    graph.add(Edge(0, 4, Pose2D(), TIGHT))
    graph.optimise()
    assert as_row(graph.poses[0]) == pytest.approx(as_row(start), abs=1e-9)
    assert graph.poses[4].distance(start) < 0.1


def test_a_wrong_loop_loses_against_right_ones() -> None:
    # Three times round, seen again at each corner; one loop says that a corner was another.
    poses = drifting(12, Pose2D(0.02, 0.01, math.radians(0.5)))
    graph = chain(poses, np.diag([0.03**2, 0.03**2, 0.02**2]))
    for k in range(4, 13):
        graph.add(Edge(k - 4, k, Pose2D(), TIGHT))
    wrong = Edge(2, 9, Pose2D(0.5, 0.0, 0.0), TIGHT)
    graph.add(wrong)
    graph.optimise()
    for k, pose in enumerate(graph.poses):
        assert pose.distance(CORNERS[k % 4]) < 0.1, k
    assert wrong.error(graph.poses) > 5
    assert max(e.error(graph.poses) for e in graph.edges if e is not wrong) < 3
