"""Straight and perpendicular walls of traces and maps (Sect. 9.4, Fig. 9.11)."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from mapcli import (
    GridMap,
    Pose2D,
    World,
    plan_drive,
    rasterize,
    rectify_map,
    rectify_trace,
)
from mapcli.algorithms.maps.rasterize import empty_map
from mapcli.algorithms.maps.rectify_trace import RectifyParameters
from mapcli.errors import DataError
from mapcli.model.waypoint import Waypoint

ROOM = [(0, 0), (5, 0), (5, 3), (3, 3), (3, 4.5), (0, 4.5), (0, 0)]
"""Six walls, one corner of which points inwards."""


def followed(
    corners: list[tuple[float, float]] = ROOM, drift_deg: float = 0.0, scale: float = 1.0
) -> NDArray[np.float64]:
    """What wheels say of a drive along walls, a pose every 0.1 s, shape (n, 3)."""
    drive = plan_drive([Waypoint(x, y) for x, y in corners])
    true = [drive.pose_at(k / 10) for k in range(math.ceil(drive.duration * 10) + 1)]
    pose = true[0]
    rows = [(pose.x, pose.y, pose.theta)]
    for a, b in pairwise(true):
        moved = a.between(b)
        turn = moved.theta + math.radians(drift_deg) * math.hypot(moved.x, moved.y)
        pose = pose.compose(Pose2D(moved.x * scale, moved.y * scale, turn))
        rows.append((pose.x, pose.y, pose.theta))
    return np.array(rows)


@pytest.mark.parametrize("drift", [-5, -2, 0, 2, 5])
def test_a_room_comes_out_right(drift: float) -> None:
    poses = followed(drift_deg=drift)
    result = rectify_trace(poses)
    assert [wall.quarter % 4 for wall in result.walls] == [0, 1, 2, 1, 2, 3]
    assert result.corners == pytest.approx(np.array(ROOM), abs=0.02 + 0.02 * abs(drift))
    assert result.is_loop
    assert result.gap_before == pytest.approx(math.dist(poses[0, :2], poses[-1, :2]))
    assert result.gap_square < 0.15
    assert result.gap_after == pytest.approx(0, abs=1e-12)
    if abs(drift) > 1:
        assert result.gap_before > 1


def test_poses_lie_on_walls_and_look_along_them() -> None:
    result = rectify_trace(followed(drift_deg=2))
    x, y, theta = result.poses.T
    on_wall = np.zeros(len(x), dtype=bool)
    for (ax, ay), (bx, by) in pairwise(result.corners):
        along = np.array([bx - ax, by - ay]) / math.dist((ax, ay), (bx, by))
        off = np.abs((x - ax) * along[1] - (y - ay) * along[0])
        on_wall |= off < 1e-9
    assert on_wall.all()
    middle = np.hypot(x - 2.5, y) < 1  # of the first wall
    assert np.abs(theta[middle]).max() < math.radians(4)
    assert result.poses[0] == pytest.approx([0, 0, 0], abs=1e-9)


def test_lengths_share_the_gap_by_their_lengths() -> None:
    # East 4, north 3, west 3.6, south 3: the east and west walls share 0.4.
    points = [(0, 0), (4, 0), (4, 3), (0.4, 3), (0.4, 0)]
    poses = np.array([(x, y, 0.0) for x, y in points])
    result = rectify_trace(poses)
    lengths = [wall.length for wall in result.walls]
    assert lengths == pytest.approx([4 - 0.4 * 4 / 7.6, 3, 3.6 + 0.4 * 3.6 / 7.6, 3])
    assert (result.gap_square, result.gap_after) == pytest.approx((0.4, 0))
    kept = rectify_trace(poses, RectifyParameters(loop=False))
    assert [wall.length for wall in kept.walls] == pytest.approx([4, 3, 3.6, 3])
    assert kept.gap_after == pytest.approx(0.4)


def test_rectifying_twice_changes_nothing() -> None:
    once = rectify_trace(followed(drift_deg=3, scale=1.02))
    twice = rectify_trace(once.poses)
    assert twice.corners == pytest.approx(once.corners, abs=2e-3)


def test_an_open_trace_stays_open() -> None:
    result = rectify_trace(followed(ROOM[:4], drift_deg=2))
    assert not result.is_loop
    assert result.gap_after == pytest.approx(result.gap_square)
    with pytest.raises(DataError, match="one way and never back"):
        rectify_trace(followed(ROOM[:3]), RectifyParameters(loop=True))


CIRCLE = [(math.cos(k / 10), math.sin(k / 10)) for k in range(63)]


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([], "0 poses; expected a drive along walls"),
        ([(1, 1)], "1 pose; expected"),
        ([(1, 1), (1, 1)], "2 poses at one place"),
        (CIRCLE, "expected walls that go straight on or meet at right angles"),
        ([(0, 0), (3, 0), (5, 2)], "it turns by 45 degrees"),
    ],
)
def test_traces_that_follow_no_walls(points: list[tuple[float, float]], message: str) -> None:
    with pytest.raises(DataError) as error:
        rectify_trace(np.array([(x, y, 0.0) for x, y in points]).reshape(-1, 3))
    assert message in str(error.value)


def test_a_bend_is_no_wall() -> None:
    circle = np.array([(x, y, 0.0) for x, y in CIRCLE])
    with pytest.raises(DataError, match="degrees without a corner; expected straight walls"):
        rectify_trace(circle, RectifyParameters(tolerance=0.005, shortest=0.01))


def room_map(turn_deg: float = 0.0, wobble: float = 0.0) -> GridMap:
    """A room of 6 x 4 m with walls 0.2 m thick and a pillar, at 0.1 m a cell; walls wobble."""
    rng = np.random.default_rng(1)
    inner = rasterize(World.of([[(1, 1), (7, 1), (7, 5), (1, 5)]]), empty_map((0, 0, 8, 6), 0.1))
    outer = rasterize(
        World.of([[(0.8, 0.8), (7.2, 0.8), (7.2, 5.2), (0.8, 5.2)]]), empty_map((0, 0, 8, 6), 0.1)
    )
    cells = np.where(inner.cells == 1, 0, np.where(outer.cells == 1, 1, np.nan))
    cells[28:32, 38:42] = 1
    bumps = (rng.random(cells.shape) < wobble) & (inner.cells == 1)
    edge = np.zeros(cells.shape, dtype=bool)
    edge[10, 10:70] = edge[49, 10:70] = edge[10:50, 10] = edge[10:50, 69] = True
    cells[bumps & edge] = 1
    return GridMap(cells.astype(np.float32), 0.1, Pose2D(-2, 1, math.radians(turn_deg)))


def test_a_straight_map_stays_as_it_is() -> None:
    grid = room_map(turn_deg=30)
    result = rectify_map(grid, 0.2)
    assert result.direction == 0
    np.testing.assert_array_equal(result.grid.cells, grid.cells)
    assert (result.grid.origin, result.changed) == (grid.origin, 0)


def test_bumps_on_walls_go() -> None:
    result = rectify_map(room_map(wobble=0.3), 0.2)
    cells = result.grid.cells
    assert (cells[11, 12:68] == 0).all()
    assert len({tuple(row) for row in cells[12:26, 8:37]}) == 1
    assert result.changed > 20


def test_a_slanting_wall_is_put_straight() -> None:
    frame = empty_map((0, 0, 8, 6), 0.1)
    room = rasterize(World.of([[(1, 1), (7, 1), (7, 5), (1, 5.3)]]), frame)
    walls = rasterize(World.of([[(0.8, 0.8), (7.2, 0.8), (7.2, 5.2), (0.8, 5.5)]]), frame)
    cells = np.where(room.cells == 1, 0, np.where(walls.cells == 1, 1, np.nan))
    result = rectify_map(frame.replaced(cells.astype(np.float32)), 0.3)
    first_open = (result.grid.cells == 0).argmax(axis=0)[10:70]
    assert np.ptp(first_open) == 0
    assert 7 <= first_open[0] <= 10  # between the ends of the slanting wall


def test_the_direction_of_turned_walls() -> None:
    corners = Pose2D(3, 1, math.radians(20)).apply(np.array([[0, 0], [6, 0], [6, 4], [0, 4.0]]))
    frame = empty_map((0, 0, 10, 8), 0.1)
    cells = rasterize(World.of([corners]), frame).cells
    result = rectify_map(frame.replaced(1 - cells), 0.2)
    assert math.degrees(result.direction) == pytest.approx(20, abs=0.7)  # half a cell on 4 m
    assert (result.rectified, result.outlines) == (1, 1)
    assert (result.grid.cells != 1 - cells).sum() < 60  # of 400 cells along the walls


def test_what_slants_by_design_stays() -> None:
    frame = empty_map((0, 0, 8, 6), 0.1)
    hexagon = World.of([[(0.5, 3), (2, 0.5), (6, 0.5), (7.5, 3), (6, 5.5), (2, 5.5)]])
    cells = 1 - rasterize(hexagon, frame).cells
    result = rectify_map(frame.replaced(cells), 0.2)
    assert result.rectified == 0
    np.testing.assert_array_equal(result.grid.cells, cells)


def test_a_map_without_rooms() -> None:
    with pytest.raises(DataError, match="no cell of the map is open"):
        rectify_map(GridMap(np.full((3, 3), np.nan)), 1)
