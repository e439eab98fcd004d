"""What a simulated laser sees beside walls: glass, and people who walk about."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mapcli import GridMap, Pose2D, World
from mapcli.algorithms.scans.ray_casting import cast, clearance, edges_of
from mapcli.algorithms.simulation.people import Walk, walk_about
from mapcli.algorithms.simulation.scene import Scene, glazed

PANE = np.array([[[1.0, -2.0], [1.0, 2.0]]])
WALL = np.array([[[4.0, -9.0], [4.0, 9.0]]])

ORIGIN = Pose2D()

NOW = np.zeros(1)


def fan(*degrees: float) -> tuple[float, float, int]:
    """Beams at even distances."""
    first, second, *_ = np.radians(degrees)
    return float(first), float(second - first), len(degrees)


@pytest.mark.parametrize("copies", [1, 3])
def test_glass_is_seen_straight_on_only(copies: int) -> None:
    """Whether the laser stands, or takes each beam from its own place (the same)."""
    lasers, times = [ORIGIN] * copies, np.zeros(copies)
    seen = Scene(WALL, PANE).distances(lasers, times, fan(0, 9, 18), 10.0)
    expected = [1, 1 / math.cos(math.radians(9)), 4 / math.cos(math.radians(18))]
    assert seen == pytest.approx(expected)


def test_beams_from_places_of_their_own() -> None:
    lasers = [Pose2D(0, 0), Pose2D(1, 0), Pose2D(2, 0)]
    seen = Scene(WALL).distances(lasers, np.zeros(3), fan(-60, 0, 60), 10.0)
    assert seen == pytest.approx([8, 3, 4])
    assert Scene(WALL).distances(lasers, np.zeros(3), fan(-60, 0, 60), 3.5).tolist() == [
        math.inf, pytest.approx(3), math.inf,
    ]  # fmt: skip


def test_both_ways_of_casting_agree() -> None:
    """From one place, the compiled loop over beams is the twin of `cast`."""
    edges = np.random.default_rng(4).uniform(-5, 5, (60, 2, 2))
    laser, angles = Pose2D(0.3, -0.2, 0.7), (-3.0, 0.02, 300)
    each = Scene(edges).distances([laser] * 300, np.zeros(300), angles, 6.0)
    assert each == pytest.approx(cast(edges, laser, *angles, 6.0))
    nothing = Scene(np.empty((0, 2, 2))).distances([laser] * 300, np.zeros(300), angles, 6.0)
    assert np.isposinf(nothing).all()


def test_a_person_by_hand() -> None:
    """A disc of 0.4 m that walks from (2, 0) to (4, 0) within 2 s; then it has left."""
    walk = Walk(np.array([0.0, 2.0]), np.array([[2.0, 0.0], [4.0, 0.0]]))
    scene = Scene(np.empty((0, 2, 2)), people=(walk,))
    for time, ahead in ((0.0, 1.8), (1.0, 2.8), (5.0, 3.8)):
        seen = scene.distances([ORIGIN], np.array([time]), fan(0, 30), 10.0)
        assert seen.tolist() == [pytest.approx(ahead), math.inf]
    sideways = scene.distances([ORIGIN], NOW, fan(0, math.degrees(math.asin(0.05))), 10.0)
    assert sideways[1] == pytest.approx(2 * math.sqrt(1 - 0.05**2) - math.sqrt(0.2**2 - 0.1**2))
    spinning = scene.distances([ORIGIN] * 2, np.array([0.0, 1.0]), fan(-1, 0), 10.0)
    assert spinning[1] == pytest.approx(2.8)


@pytest.mark.parametrize("x", [0.0, 0.3])
def test_people_step_aside(x: float) -> None:
    walk = Walk(np.zeros(1), np.array([[x, 0.0]]))
    seen = Scene(WALL, people=(walk,)).distances([ORIGIN], NOW, fan(0, 180), 10.0)
    assert seen.tolist() == [pytest.approx(0.3), math.inf]


def test_people_stay_between_walls() -> None:
    room = edges_of(World.of([[[0, 0], [5, 0], [5, 4], [0, 4]]]))
    walk = walk_about(room, (1.0, 1.0), 300.0, np.random.default_rng(1))
    assert walk.times[-1] >= 300
    points = walk.at(np.linspace(0, 300, 2000))
    assert points.min() > 0
    assert (points.max(axis=0) < (5, 4)).all()
    assert np.ptp(points, axis=0).min() > 2
    assert clearance(room, points[:1], 9.0)[0] == pytest.approx(1.0)
    speed = np.linalg.norm(np.diff(walk.points, axis=0), axis=1) / np.diff(walk.times)
    assert 0.6 <= speed.max() <= 1.4


def test_a_share_of_the_walls_is_glass() -> None:
    polygons = World.of([[[k, 0], [k + 0.5, 0], [k, 1]] for k in range(400)])
    grid = GridMap(np.ones((40, 40), dtype=np.float32), 1.0)
    for world, share in ((polygons, 0.0), (grid, 0.0), (polygons, 1.0), (grid, 1.0)):
        walls, panes = glazed(world, share, np.random.default_rng(0))
        assert np.array_equal(panes if share else walls, edges_of(world))
        assert len(walls if share else panes) == 0
    walls, panes = glazed(polygons, 0.25, np.random.default_rng(0))
    assert len(walls) + len(panes) == 1200
    assert len(panes) / 1200 == pytest.approx(0.25, abs=0.07)
