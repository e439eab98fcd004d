"""The majority rule of Sect. 9.5: which cells a scan says to be obstacle, empty or unknown."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.similarity.perception_map import (
    PerceptionMap,
    covered_area,
    perception_map,
    scan_outline,
)
from mapcli.errors import DataError
from mapcli.model.perception import Walls

SIGNS = {-1: ".", 0: "?", 1: "#"}
SMALL = settings(max_examples=40, deadline=None)


def seen(beams: list[tuple[float, float | None]], range_max: float = 5.0) -> Perception:
    """Beams as (bearing in degrees, range or None for no return)."""
    hits, open_ends = [], []
    for degrees, reach in beams:
        a, r = math.radians(degrees), range_max if reach is None else reach
        (open_ends if reach is None else hits).append((math.cos(a) * r, math.sin(a) * r))
    return Perception(
        np.array(hits).reshape(-1, 2), np.array(open_ends).reshape(-1, 2), np.zeros(2)
    )


def drawn(
    perception: Perception,
    pose: tuple[float, float, float] = (0.5, 0.5, 0.0),
    walls: Walls = "thick",
) -> PerceptionMap:
    return perception_map(scan_outline(perception, 1.0, walls), np.array(pose))


def row(map_: PerceptionMap, v: int, first: int, end: int) -> str:
    """A row of the map from column `first` on, as characters."""
    return "".join(SIGNS[value_at(map_, u, v)] for u in range(first, end))


def value_at(map_: PerceptionMap, u: int, v: int) -> int:
    r, c = v - map_.bottom, u - map_.left
    rows, columns = map_.values.shape
    return int(map_.values[r, c]) if 0 <= r < rows and 0 <= c < columns else 0


def wall_at(distance: float) -> Perception:
    """A straight wall across, seen by beams every five degrees to 60 degrees on either side."""
    return seen([(b, distance / math.cos(math.radians(b))) for b in range(-60, 61, 5)], 99)


# Cell 0 holds the robot in its middle, so a wall at distance d is at u = d + 0.5.
@pytest.mark.parametrize(
    ("distance", "expected"),
    [
        (2.6, "...#?"),  # 90 % of cell 3 is behind the face
        (2.9, "...#?"),  # 60 %
        (3.1, "....#"),  # 40 %: cell 3 is empty and cell 4 has 60 % wall
        (3.4, "....#"),
        (3.0, "...#?"),  # half of cell 3: the nearer of the two cells, and only that
        (3.5, "....#"),  # exactly on the border
    ],
)
def test_a_wall_is_one_cell_where_most_of_it_is_behind_the_face(
    distance: float, expected: str
) -> None:
    assert row(drawn(wall_at(distance)), 0, 1, 5) == expected[1:]
    assert row(drawn(wall_at(distance)), 1, 2, 5) == expected[2:]


@pytest.mark.parametrize(("distance", "expected"), [(2.6, "..#??"), (2.9, "..#??"), (3.4, "..#??")])
def test_by_the_rule_of_ends_a_wall_is_where_beams_end(distance: float, expected: str) -> None:
    map_ = drawn(wall_at(distance), walls="ends")
    assert row(map_, 0, 1, 6) == expected
    assert (map_.values == 1).sum() == (drawn(wall_at(distance)).values == 1).sum()


def test_behind_the_wall_is_hidden() -> None:
    assert row(drawn(wall_at(2.6)), 0, 3, 8) == "#????"


def test_a_wall_seen_at_an_angle_is_as_thick() -> None:
    """The wall y = 2.1, along which the robot looks: its cells are row 2, wherever seen."""
    beams = [(b, 1.6 / math.sin(math.radians(b))) for b in range(18, 91, 2)]
    map_ = drawn(seen(beams, 99))
    assert row(map_, 2, 1, 5) == "####"
    assert row(map_, 1, 1, 4) == "..."
    assert row(map_, 3, 0, 6) == "??????"


def test_open_beams_are_empty_up_to_the_range_and_no_wall() -> None:
    map_ = drawn(seen([(b, None) for b in range(-90, 91, 10)], 3.0))
    assert row(map_, 0, 1, 6) == "..???"  # 3.5 is the end: half of cell 3 is not most of it
    assert not (map_.values == 1).any()


def test_nothing_is_known_between_beams_far_apart() -> None:
    map_ = drawn(seen([(0, 3.6), (90, 3.6)]))
    assert row(map_, 0, 4, 5) == "#"
    assert value_at(map_, 0, 4) == 1
    assert value_at(map_, 3, 3) == 0


def test_a_jump_from_near_to_far_is_no_wall() -> None:
    """A pillar at 1.6 in front of a wall at 5.6: the gap between them is not filled."""
    beams = [(float(b), 1.6 if b <= 0 else 5.6) for b in range(-30, 31, 2)]
    map_ = drawn(seen(beams))
    assert [value_at(map_, u, 0) for u in (3, 4)] == [0, 0]
    assert (map_.values[:, 3 - map_.left : 5 - map_.left] == 1).sum() == 0


def test_a_turned_robot_sees_the_turned_map() -> None:
    ahead = drawn(wall_at(2.6))
    up = drawn(wall_at(2.6), (0.5, 0.5, math.pi / 2))
    for u in range(-6, 7):
        for v in range(-6, 7):
            assert value_at(up, -v, u) == value_at(ahead, u, v)


def test_the_laser_may_sit_off_the_robot() -> None:
    scan = wall_at(2.6)
    there = Perception(scan.hits + np.array([1.0, 0.0]), scan.open_ends, np.array([1.0, 0.0]))
    assert row(drawn(there), 0, 2, 6) == "..#?"


def test_no_beams_no_map() -> None:
    assert drawn(seen([])).values.size == 0


def test_an_absurdly_large_perception() -> None:
    with pytest.raises(DataError, match="cells wide; expected ranges in the unit of the map"):
        perception_map(scan_outline(seen([(0, None)], 1e12), 1.0), np.zeros(3))


# --- areas


def test_areas_by_hand() -> None:
    square = np.array([[0.5, 0.5], [3.25, 0.5], [3.25, 2.0], [0.5, 2.0]])
    expected = [[0.25, 0.5, 0.5, 0.125, 0], [0.5, 1, 1, 0.25, 0], [0, 0, 0, 0, 0]]
    assert covered_area(square, (0, 0, 5, 3)) == pytest.approx(np.array(expected))
    triangle = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]])
    assert covered_area(triangle, (0, 0, 2, 2)) == pytest.approx(np.array([[1, 0.5], [0.5, 0]]))
    # Only a part of it is asked for.
    assert covered_area(square, (1, 1, 3, 2)) == pytest.approx(np.ones((1, 2)))


def star(seed: int, n: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angles = (np.arange(n) + rng.uniform(0, 0.9, n)) * math.tau / n
    radii = rng.uniform(0.5, 6.0, n)
    return np.column_stack([np.cos(angles) * radii, np.sin(angles) * radii]) + rng.uniform(-2, 2, 2)


@SMALL
@given(st.integers(0, 10_000), st.integers(4, 30))
def test_areas_sum_up_to_the_polygons(seed: int, n: int) -> None:
    path = star(seed, n)
    x, y = path.T
    area = 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    shares = covered_area(path, (-9, -9, 9, 9))
    assert shares.sum() == pytest.approx(area)
    assert shares.min() > -1e-9


def sampled_values(perception: Perception, pose: np.ndarray, k: int = 24) -> np.ndarray:
    """The majority rule the slow way, by sampling points; 2 where it is a close call."""
    scan = scan_outline(perception, 1.0)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    turn = np.array([[cos, sin], [-sin, cos]])
    face, back = scan.face @ turn + pose[:2], scan.back @ turn + pose[:2]
    map_ = perception_map(scan, pose)
    result = np.zeros(map_.values.shape, int)
    for r, c in np.ndindex(result.shape):
        offsets = (np.arange(k) + 0.5) / k
        points = [(map_.left + c + du, map_.bottom + r + dv) for du in offsets for dv in offsets]
        free = np.mean([_inside(face, *point) for point in points])
        wall = np.mean([_inside(back, *point) for point in points]) - free
        if min(abs(free - 0.5), abs(wall - 0.5), abs(wall - (1 - free - wall))) < 0.03:
            result[r, c] = 2
        elif wall > 0.5:
            result[r, c] = 1
        elif free > 0.5:
            result[r, c] = -1
    return result


def _inside(path: np.ndarray, x: float, y: float) -> bool:
    (ax, ay), (bx, by) = path.T, np.roll(path, -1, axis=0).T
    crossing = (ay > y) != (by > y)
    rise = np.where(crossing, by - ay, 1.0)
    return bool(np.count_nonzero(crossing & (x < ax + (y - ay) / rise * (bx - ax))) % 2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_exact_areas_as_sampled_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    beams = [(float(b), None if rng.random() < 0.2 else rng.uniform(1, 4))
             for b in range(-180, 180, 20)]  # fmt: skip
    pose = np.array([0.3, -0.4, rng.uniform(-3, 3)])
    slow, fast = sampled_values(seen(beams, 4.0), pose), drawn(seen(beams, 4.0), tuple(pose)).values
    clear = slow != 2
    assert clear.mean() > 0.6
    np.testing.assert_array_equal(fast[clear], slow[clear])


@SMALL
@given(st.integers(0, 10_000), st.integers(1, 40))
def test_compiled_as_plain(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    beams = [(float(b), None if rng.random() < 0.3 else float(rng.uniform(0.1, 9)))
             for b in rng.uniform(-180, 180, n)]  # fmt: skip
    scan = scan_outline(seen(beams, 9.0), 0.7, "ends" if seed % 2 else "thick")
    pose = np.array([*rng.uniform(-5, 5, 2), rng.uniform(-4, 4)])
    for within in (None, (-4, -3, 6, 5)):
        plain = perception_map(scan, pose, within)
        compiled = perception_map(scan, pose, within, compiled=True)
        assert (plain.left, plain.bottom) == (compiled.left, compiled.bottom)
        np.testing.assert_array_equal(plain.values, compiled.values)
