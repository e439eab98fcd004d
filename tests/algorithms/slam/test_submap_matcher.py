"""Finding one submap of a trajectory in the map of another."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.looping import MAP, box, laps, ring, see, trajectory_of

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.scans.ray_casting import edges_of
from mapcli.algorithms.slam.correlative_search import SearchWindow
from mapcli.algorithms.slam.keyframes import Keyframe
from mapcli.algorithms.slam.submap_matcher import SubmapMatcher
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import StandardDeviations
from mapcli.model.world import World

NOTHING = Perception(np.empty((0, 2)), np.empty((0, 2)), np.zeros(2))
WINDOW, DEVIATIONS = SearchWindow(1.5, math.radians(12)), StandardDeviations(0.5, math.radians(4))
OLD, NEW, ELSEWHERE = 30, 119, 63
"""Keyframes of `round_again`: the second is near the first, a lap later; the third is
half-way along a side, not at a corner as they are."""


@pytest.fixture(scope="module")
def round_again() -> list[Keyframe]:
    """A lap and a half around the ring, tracked without any error."""
    world, poses = ring(), laps(52)
    return trajectory_of(poses, [see(world, pose) for pose in poses]).keyframes


def seen_from(keyframes: list[Keyframe], old: int, new: int) -> Pose2D:
    return keyframes[old].pose.between(keyframes[new].pose)


def test_the_place_is_the_same(round_again: list[Keyframe]) -> None:
    assert seen_from(round_again, OLD, NEW).x < 2
    assert round_again[OLD].pose.distance(round_again[ELSEWHERE].pose) > 6


@pytest.mark.parametrize(
    "off",
    [Pose2D(), Pose2D(0.8, -0.6, math.radians(8)), Pose2D(-1.0, 0.9, math.radians(-9))],
    ids=["where it is", "off", "off the other way"],
)
def test_a_submap_is_found_in_the_map_from_before(round_again: list[Keyframe], off: Pose2D) -> None:
    true = seen_from(round_again, OLD, NEW)
    match = SubmapMatcher(round_again, MAP).match(OLD, NEW, true.compose(off), WINDOW, DEVIATIONS)
    assert match is not None
    assert match.pose.distance(true) < MAP.resolution / 2
    assert abs(true.between(match.pose).theta) < math.radians(0.3)
    assert 0.6 < match.score <= 1
    assert 0.8 < match.overlap <= 1
    assert not match.at_edge
    # Posts and walls on all sides leave it nowhere else to be.
    assert np.sqrt(np.diag(match.covariance)).max() < 0.15


def test_its_covariance_holds_its_error(round_again: list[Keyframe]) -> None:
    true = seen_from(round_again, OLD, NEW)
    off = true.compose(Pose2D(0.3, 0.2, 0.05))
    match = SubmapMatcher(round_again, MAP).match(OLD, NEW, off, WINDOW, DEVIATIONS)
    assert match is not None
    error = match.pose.between(true)
    row = np.array([error.x, error.y, error.theta])
    assert row @ np.linalg.solve(match.covariance, row) < 9
    assert np.allclose(match.covariance, match.covariance.T)
    assert (np.linalg.eigvalsh(match.covariance) > 0).all()


def test_another_place_does_not_pass_for_this_one(round_again: list[Keyframe]) -> None:
    matcher = SubmapMatcher(round_again, MAP)
    right = matcher.match(OLD, NEW, seen_from(round_again, OLD, NEW), WINDOW, DEVIATIONS)
    wrong = matcher.match(OLD, ELSEWHERE, Pose2D(), WINDOW, DEVIATIONS)
    assert right is not None
    assert wrong is not None
    assert wrong.score * wrong.overlap < 0.6 * right.score * right.overlap


@pytest.mark.parametrize(
    ("off", "at_edge"), [(Pose2D(0.9), False), (Pose2D(1.5), True), (Pose2D(0, 0, 0.2), True)]
)
def test_a_fit_at_the_edge_of_the_window_is_told(
    round_again: list[Keyframe], off: Pose2D, at_edge: bool
) -> None:
    # The best pose is this far from the middle of a window of 1.5 m and 12 degrees.
    predicted = seen_from(round_again, OLD, NEW).compose(off.inverse())
    match = SubmapMatcher(round_again, MAP).match(
        OLD, NEW, predicted, WINDOW, StandardDeviations(9.0, 9.0)
    )
    assert match is not None
    assert match.at_edge == at_edge


@pytest.mark.parametrize("heading", [0.0, 0.6])
def test_in_a_bare_corridor_it_says_that_it_does_not_know_how_far_along(heading: float) -> None:
    # The ends are out of sight: any place fits. The robot came back the other way.
    frame = Pose2D(3, -2, heading)
    walls = [frame.apply(np.array(box(-60, y, 60, y + 0.2))).tolist() for y in (-1.23, 1.02)]
    world = edges_of(World.of(walls))
    there = [Pose2D(0.5 * k, 0.0, 0.0) for k in range(20)]
    back = [Pose2D(9.5 - 0.5 * k, 0.2, 3.0) for k in range(20)]
    poses = [frame.compose(pose) for pose in there + back]
    keyframes = trajectory_of(poses, [see(world, pose) for pose in poses]).keyframes
    old, new, window = 10, 30, SearchWindow(1.0, math.radians(5))
    true = seen_from(keyframes, old, new)
    match = SubmapMatcher(keyframes, MAP).match(
        old, new, true, window, StandardDeviations(0.3, 0.02)
    )
    assert match is not None
    # In the frame of the one found, which looks back along the corridor, turned by 3 - pi.
    ahead = np.array([math.cos(-3.0), math.sin(-3.0)])
    left = np.array([-ahead[1], ahead[0]])
    covariance = match.covariance[:2, :2]
    # Alike everywhere in a window of +-1 m: a deviation of 1 / sqrt(3) m, or more from the fit.
    assert math.sqrt(ahead @ covariance @ ahead) > 0.5
    assert math.sqrt(left @ covariance @ left) < 0.1


# --- points and maps


def gaps(points: np.ndarray) -> np.ndarray:
    """Metres from points to the nearest wall of the ring."""
    a, b = ring().swapaxes(0, 1)
    along = b - a
    share = ((points[:, None] - a) * along).sum(axis=2) / (along**2).sum(axis=1)
    nearest = a + np.clip(share, 0, 1)[..., None] * along
    return np.hypot(*(points[:, None] - nearest).transpose(2, 0, 1)).min(axis=1)


def test_points_are_those_around_the_origin_in_its_frame(round_again: list[Keyframe]) -> None:
    points = SubmapMatcher(round_again, MAP).points(OLD)
    assert len(points) > 300
    assert gaps(round_again[OLD].pose.apply(points)).max() < 1e-6
    # One for each square of 10 cm, at most.
    squares = {tuple(square) for square in np.floor(points / 0.1).astype(int).tolist()}
    assert len(squares) == len(points)


def test_a_map_has_its_origin_in_the_middle(round_again: list[Keyframe]) -> None:
    grid = SubmapMatcher(round_again, MAP).map_around(OLD).to_grid_map()
    walls = round_again[OLD].pose.apply(grid.world_of_cells(*np.nonzero(grid.cells > 0.65)))
    assert len(walls) > 300
    assert gaps(walls).max() < MAP.resolution  # half the diagonal of a cell, and no more


def test_few_maps_are_kept(round_again: list[Keyframe]) -> None:
    matcher = SubmapMatcher(round_again, MAP, cached_maps=2)
    first = matcher.map_around(10)
    matcher.map_around(20)
    assert matcher.map_around(10) is first  # and so it is the newest
    matcher.map_around(30)
    assert matcher.map_around(10) is first
    assert len(matcher._maps) == 2


def test_what_is_kept_does_not_change_the_answer(round_again: list[Keyframe]) -> None:
    predicted = seen_from(round_again, OLD, NEW).compose(Pose2D(0.3, 0.2, 0.05))
    used = SubmapMatcher(round_again, MAP)
    used.match(
        OLD, ELSEWHERE, Pose2D(4, 4, 1), SearchWindow(6.0, 0.4), DEVIATIONS
    )  # makes the map grow
    one = used.match(OLD, NEW, predicted, WINDOW, DEVIATIONS)
    other = SubmapMatcher(round_again, MAP).match(OLD, NEW, predicted, WINDOW, DEVIATIONS)
    assert one is not None
    assert other is not None
    assert (one.pose, one.score, one.overlap) == (other.pose, other.score, other.overlap)
    assert one.covariance.tobytes() == other.covariance.tobytes()


def test_a_submap_that_saw_nothing_matches_nothing(round_again: list[Keyframe]) -> None:
    seen = [frame.perception if k >= 60 else NOTHING for k, frame in enumerate(round_again)]
    keyframes = trajectory_of([frame.pose for frame in round_again], seen).keyframes
    matcher = SubmapMatcher(keyframes, MAP)
    assert matcher.match(100, 10, Pose2D(), WINDOW, DEVIATIONS) is None
    # And in a map of nothing there is nothing to agree with.
    match = matcher.match(10, 100, Pose2D(), WINDOW, DEVIATIONS)
    assert match is not None
    assert (match.overlap, match.score) == (0, 0)
