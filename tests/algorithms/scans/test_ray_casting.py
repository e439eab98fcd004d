"""Exact beams against polygons and cells."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapcli.algorithms.scans.ray_casting import cast, clearance, edges_near, edges_of, is_inside
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D
from mapcli.model.world import World

UNKNOWN = math.nan
INF = math.inf

SQUARE = World.of([[[2, -1], [3, -1], [3, 1], [2, 1]]])
ROOM = World.of(
    [
        [[-1, -1], [5, -1], [5, 0], [-1, 0]],
        [[-1, 3], [5, 3], [5, 4], [-1, 4]],
        [[-1, 0], [0, 0], [0, 3], [-1, 3]],
        [[4, 0], [5, 0], [5, 3], [4, 3]],
    ]
)
"""4 m by 3 m inside, the corner at the origin."""


def slow_cast(edges, laser, angle_min, increment, beams, reach):
    """Every beam against every edge, one at a time, from the textbook formula."""
    ranges = []
    for k in range(beams):
        bearing = laser.theta + angle_min + k * increment
        dx, dy = math.cos(bearing), math.sin(bearing)
        best = INF
        for (ax, ay), (bx, by) in edges:
            ex, ey, wx, wy = bx - ax, by - ay, ax - laser.x, ay - laser.y
            across = dx * ey - dy * ex
            if across == 0:
                continue
            along = (wx * ey - wy * ex) / across
            fraction = (wx * dy - wy * dx) / across
            if along > 0 and 0 <= fraction <= 1 and along <= reach:
                best = min(best, along)
        ranges.append(best)
    return np.array(ranges)


def test_hand_worked_ranges() -> None:
    # Beams to the right, up, left, down from the origin: only the square's near side is hit.
    ranges = cast(edges_of(SQUARE), Pose2D(), 0.0, math.pi / 2, 4, 10.0)
    assert ranges == pytest.approx([2, INF, INF, INF])
    # At 3-4-5: the beam with slope 3/4 from (0, 1) meets y = 3 ... after 10/3 m.
    ranges = cast(edges_of(ROOM), Pose2D(0.0, 1.0), math.atan2(3, 4), 1.0, 1, 10.0)
    assert ranges == pytest.approx([10 / 3])


def test_the_laser_turns_with_the_robot() -> None:
    laser = Pose2D(1.0, 1.0, math.pi / 2)
    ranges = cast(edges_of(ROOM), laser, -math.pi, math.pi / 2, 4, 10.0)
    assert ranges == pytest.approx([1, 3, 2, 1])  # behind, right, ahead, left of the robot


def test_beyond_reach_is_inf() -> None:
    edges = edges_of(SQUARE)
    assert cast(edges, Pose2D(), 0.0, 1.0, 1, 1.999).tolist() == [INF]
    assert cast(edges, Pose2D(), 0.0, 1.0, 1, 2.0).tolist() == [2.0]


def test_a_world_of_astronomic_size() -> None:
    edges = edges_of(World.of([[[-1e308, -1e308], [1e308, -1e308], [0, 1e308]]]))
    assert cast(edges, Pose2D(), 0.0, 1.0, 3, 9.0).tolist() == [INF] * 3
    assert clearance(edges, np.zeros((1, 2)), 9.0).tolist() == [INF]


def test_no_edges_no_return() -> None:
    assert cast(edges_of(World()), Pose2D(), 0.0, 1.0, 3, 9.0).tolist() == [INF] * 3


@pytest.mark.parametrize(
    ("pose", "angle_min", "field", "beams"),
    [
        (Pose2D(0.3, -0.2, 0.3), -math.pi, math.tau, 90),
        (Pose2D(-4, 3, 2.0), -1.0, 2.0, 60),
        (Pose2D(5, 5, -3.1), -math.pi / 2, math.pi, 91),
        (Pose2D(0, 0, 1.0), 2.5, math.tau, 45),
    ],
)
def test_as_the_slow_twin(pose: Pose2D, angle_min: float, field: float, beams: int) -> None:
    rng = np.random.default_rng(4)
    edges = rng.uniform(-10, 10, (200, 1, 2)) + rng.uniform(-1, 1, (200, 2, 2))
    fan = angle_min, field / beams, beams, 6.0
    slow = slow_cast(edges, pose, *fan)
    assert np.isinf(slow).any()
    assert np.isfinite(slow).any()
    assert cast(edges, pose, *fan) == pytest.approx(slow, abs=1e-9)


@given(
    x=st.integers(1, 39),
    y=st.integers(1, 29),
    corner=st.sampled_from([(0, 0), (4, 0), (4, 3), (0, 3)]),
    turns=st.integers(-3, 3),
)
def test_no_beam_slips_through_a_corner(x: int, y: int, corner: tuple[int, int], turns: int):
    laser = Pose2D(x / 10, y / 10)
    away = corner[0] - laser.x, corner[1] - laser.y
    bearing = math.atan2(away[1], away[0]) + turns * math.tau
    ranges = cast(edges_of(ROOM), laser, bearing, math.tau / 8, 8, 50.0)
    assert np.isfinite(ranges).all()
    assert ranges[0] == pytest.approx(math.hypot(*away))


def test_edges_of_cells_are_joined() -> None:
    # An L of three cells has six corners, so six edges.
    grid = GridMap(np.array([[1, 0], [1, 1]], dtype=np.float32), 2.0, Pose2D(10, 20))
    edges = edges_of(grid)
    assert len(edges) == 6
    assert {tuple(corner) for corner in edges.reshape(-1, 2)} == {
        (10, 20), (14, 20), (14, 22), (12, 22), (12, 24), (10, 24),
    }  # fmt: skip


def test_cells_of_one_half_are_solid_and_unknown_ones_are_not() -> None:
    grid = GridMap(np.array([[0.1, UNKNOWN, 0.49, 0.5, 1.0]], dtype=np.float32))
    ranges = cast(edges_of(grid), Pose2D(0.5, 0.5), -math.pi, math.pi, 2, 10.0)
    assert ranges == pytest.approx([INF, 2.5])  # to the left the map just ends
    assert is_inside(grid, 3.5, 0.5)
    assert not is_inside(grid, 1.5, 0.5)
    assert not is_inside(grid, 9.0, 0.5)


def test_grid_as_the_slow_twin() -> None:
    rng = np.random.default_rng(2)
    cells = (rng.random((12, 17)) < 0.2).astype(np.float32)
    cells[6, 8] = 0
    grid = GridMap(cells, 0.5, Pose2D(-3, 2, 0.7))
    corners = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]])
    squares = [grid.world_of_cells(*(corners + cell).T) for cell in np.argwhere(cells == 1)]
    x, y = grid.world_of_cells([6.1], [8.2])[0]
    fan = Pose2D(x, y, 0.4), -math.pi, math.tau / 100, 100, 4.0
    slow = slow_cast(edges_of(World.of(squares)), *fan)
    assert cast(edges_of(grid), *fan) == pytest.approx(slow, abs=1e-9)


def test_inside_polygons() -> None:
    overlapping = World.of([[[0, 0], [2, 0], [2, 2], [0, 2]], [[1, 1], [1, 3], [3, 3], [3, 1]]])
    assert is_inside(overlapping, 0.5, 0.5)
    assert is_inside(overlapping, 1.5, 1.5)  # in both
    assert not is_inside(overlapping, 0.5, 2.5)
    assert not is_inside(overlapping, -1.0, 1.0)


def test_clearance_by_hand() -> None:
    points = np.array([[0.0, 0.0], [1.0, 2.0], [2.5, 5.0]])
    gaps = clearance(edges_of(SQUARE), points, 3.0)
    assert gaps == pytest.approx([2.0, math.sqrt(2), INF])  # side, corner, beyond reach


def test_edges_near_keeps_what_touches() -> None:
    edges = edges_of(SQUARE)
    assert len(edges_near(edges, np.array([0, -9]), np.array([2, 9]))) == 3
    assert len(edges_near(edges, np.array([0, -9]), np.array([1.9, 9]))) == 0
