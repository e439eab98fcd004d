"""The map while it is being made: where it puts things, how it grows, what it answers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam import occupancy_grid as occupancy
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.occupancy_grid import BLOCK, OccupancyGrid
from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

Points = list[tuple[float, float]]


def seen(hits: Points, open_ends: Points = (), laser: tuple[float, float] = (0, 0)) -> Perception:
    ends = [np.array(points, np.float64).reshape(-1, 2) for points in (hits, open_ends)]
    return Perception(*ends, np.array(laser, np.float64))


def contents(grid: OccupancyGrid) -> dict[tuple[int, int], tuple[int, ...]]:
    """What is not zero: log-odds and every level of the field, by world cell (u, v)."""
    known = (grid.log_odds != 0) | grid.pyramid.any(axis=0)
    corner = grid.to_cells(np.zeros((1, 2)))[0].astype(int)
    return {
        (int(u - corner[0]), int(v - corner[1])): (
            int(grid.log_odds[v, u]),
            *grid.pyramid[:, v, u].tolist(),
        )
        for v, u in np.argwhere(known)
    }


def probability(grid: GridMap, x: float, y: float) -> float:
    row, column = grid.cells_of_world([[x, y]])[0]
    return float(grid.cells[row, column])


def random_scans(seed: int, count: int, extent: float) -> list[tuple[Pose2D, Perception]]:
    rng = np.random.default_rng(seed)
    return [
        (
            Pose2D(*rng.uniform(-extent, extent, 2), rng.uniform(-4, 4)),
            Perception(rng.normal(0, 2, (9, 2)), rng.normal(0, 2, (3, 2)), rng.normal(0, 0.1, 2)),
        )
        for _ in range(count)
    ]


# --- where things are


def test_a_wall_by_hand() -> None:
    # At (1.02, 2.02) facing up, a wall 1 m ahead: at (1.02, 3.02), in the cell of 5 cm that
    # begins at (1.00, 3.00). The beam passes the 20 cells below it, from y = 2.00 on.
    grid = OccupancyGrid(MapParameters(resolution=0.05))
    grid.integrate(Pose2D(1.02, 2.02, math.pi / 2), seen([(1, 0)]))
    result = grid.to_grid_map()
    assert result.cells.shape == (25, 5)  # 21 x 1 known cells, and a margin of 2
    assert result.resolution == 0.05
    assert (result.origin.x, result.origin.y) == pytest.approx((0.90, 1.90))
    assert result.origin.theta == 0
    assert result.cells[2, 2] > 0.5
    assert (result.cells[3:23, 2] < 0.5).all()
    assert result.known.sum() == 21
    assert result.cells_of_world([[1.02, 3.02], [1.02, 2.02]]).tolist() == [[2, 2], [22, 2]]


def test_a_laser_off_the_middle() -> None:
    # The robot faces left at (5, 5); the laser is 0.3 ahead and sees something 1 m further on.
    grid = OccupancyGrid(MapParameters(resolution=0.1))
    grid.integrate(Pose2D(5.05, 5.05, math.pi), seen([(1.3, 0)], laser=(0.3, 0)))
    result = grid.to_grid_map()
    assert probability(result, 3.75, 5.05) > 0.5
    assert [probability(result, x, 5.05) < 0.5 for x in (3.85, 4.25, 4.75)] == [True] * 3
    assert math.isnan(probability(result, 4.85, 5.05))


def test_open_ends_clear_and_do_not_block() -> None:
    grid = OccupancyGrid(MapParameters(resolution=0.1))
    grid.integrate(Pose2D(0.05, 0.05), seen([], [(1, 0)]))
    result = grid.to_grid_map()
    assert result.known.sum() == 10
    assert np.nanmax(result.cells) < 0.5


def test_positions_on_the_negative_side() -> None:
    grid = OccupancyGrid(MapParameters(resolution=0.5))
    grid.integrate(Pose2D(-10.1, -20.1), seen([(-1, 0)]))
    result = grid.to_grid_map()
    assert probability(result, -11.1, -20.1) > 0.5  # the cell from -11.5 to -11
    assert probability(result, -10.6, -20.1) < 0.5
    assert (result.origin.x, result.origin.y) == (-12.5, -21.5)


def test_poses_to_cells_and_back() -> None:
    # Made once, and not on the clock of the examples: the first scan may have loops to compile.
    grid = OccupancyGrid(MapParameters(resolution=0.1))
    grid.integrate(Pose2D(33, -44), seen([(1, 0)]))

    @given(st.floats(-90, 90), st.floats(-90, 90), st.floats(-3, 3))
    def there_and_back(x: float, y: float, theta: float) -> None:
        cells = grid.pose_to_cells(Pose2D(x, y, theta))
        assert grid.to_cells(np.array([[x, y]]))[0] == pytest.approx(cells[:2])
        back = grid.pose_from_cells(cells)
        assert (back.x, back.y, back.theta) == pytest.approx((x, y, theta), abs=1e-9)

    there_and_back()


# --- what cells answer

HERE = Pose2D(0.02, 0.02)
AHEAD, BEYOND = seen([(1, 0)]), seen([(2, 0)])


def test_one_beam_settles_a_cell() -> None:
    grid = OccupancyGrid()
    grid.integrate(HERE, AHEAD)
    result = grid.to_grid_map()
    # Nav2's own limits: free up to 0.196, occupied from 0.65 on.
    assert 0 < probability(result, 0.52, 0.02) <= 0.196
    assert 0.65 <= probability(result, 1.02, 0.02) < 1


def test_the_default_hit_is_worth_more_than_three_misses() -> None:
    assert MapParameters().log_odds_rules() == (85, 25, 1000, -500)


def test_cells_never_get_beyond_their_limits() -> None:
    grid = OccupancyGrid()
    p = grid.parameters.log_odds_rules()
    for _ in range(p.highest // p.hit + 2 - p.lowest // p.miss):
        grid.integrate(HERE, AHEAD)
    assert (grid.log_odds.min(), grid.log_odds.max()) == (p.lowest, p.highest)
    result = grid.to_grid_map()
    assert 0 < np.nanmin(result.cells) < 0.01
    assert 0.99 < np.nanmax(result.cells) <= 1


def test_a_cell_can_always_change() -> None:
    grid = OccupancyGrid()
    for first, then, crossed in ((AHEAD, BEYOND, np.less), (BEYOND, AHEAD, np.greater)):
        for _ in range(200):
            grid.integrate(HERE, first)
        scans = 0
        while not crossed(probability(grid.to_grid_map(), 1.02, 0.02), 0.5):
            grid.integrate(HERE, then)
            scans += 1
            assert scans < 100
        assert scans > 1  # but one odd scan does not change it


def test_probabilities_follow_the_log_odds() -> None:
    p_hit, p_miss = 1 / (1 + math.exp(-1)), 1 / (1 + math.exp(2))
    grid = OccupancyGrid(MapParameters(resolution=1.0, p_hit=p_hit, p_miss=p_miss))
    grid.integrate(Pose2D(0.5, 0.5), seen([(1, 0)]))
    result = grid.to_grid_map()
    # Log-odds of 1 and of -2.
    assert probability(result, 1.5, 0.5) == pytest.approx(p_hit, abs=1e-6)
    assert probability(result, 0.5, 0.5) == pytest.approx(p_miss, abs=1e-6)


def test_an_empty_map_is_one_unknown_cell() -> None:
    grid = OccupancyGrid()
    grid.integrate(Pose2D(3, 4), seen([]))
    assert grid.log_odds.shape == (0, 0)
    result = grid.to_grid_map()
    assert result.cells.shape == (1, 1)
    assert not result.known.any()


def test_a_covered_but_empty_map() -> None:
    grid = OccupancyGrid()
    grid.extend_to(np.array([0.0, 0.0]), np.array([1.0, 1.0]))
    assert not grid.to_grid_map().known.any()


def test_what_goes_in_stays_as_it_was() -> None:
    perception = seen([(1, 2), (3, 4)], [(5, 6)], (0.1, 0.2))
    OccupancyGrid().integrate(Pose2D(1, 2, 3), perception)
    assert perception.hits.tolist() == [[1, 2], [3, 4]]
    assert perception.open_ends.tolist() == [[5, 6]]
    assert perception.laser.tolist() == [0.1, 0.2]


# --- growing


def test_a_field_made_at_once() -> None:
    """The field is what the walls alone give; each level holds the highest values ahead."""
    grid = OccupancyGrid()
    for pose, perception in random_scans(3, 12, 4.0):
        grid.integrate(pose, perception, update_field=False)
    assert not grid.pyramid.any()
    log_odds = grid.log_odds.copy()
    grid.build_likelihood_field()
    assert (grid.log_odds == log_odds).all()
    gaussian = MapParameters().gaussian_kernel()
    expected = np.zeros_like(grid.pyramid[0])
    reach = len(gaussian) // 2
    for v, u in np.argwhere(log_odds > 0):
        part = expected[v - reach : v + reach + 1, u - reach : u + reach + 1]
        np.maximum(part, gaussian, out=part)
    assert (grid.pyramid[0] == expected).all()
    rng = np.random.default_rng(0)
    for width, level in zip(LEVEL_WIDTHS.tolist(), grid.pyramid, strict=True):
        for v, u in rng.integers(0, min(expected.shape) - 16, (300, 2)).tolist():
            assert level[v, u] == expected[v : v + width, u : u + width].max()
        walls = np.argwhere(log_odds > 0)[::7]
        for v, u in (walls - rng.integers(0, 20, walls.shape)).tolist():
            assert level[v, u] == expected[v : v + width, u : u + width].max()


@pytest.mark.parametrize("far", [(30, 0), (-30, 0), (0, 30), (0, -30), (-30, 30), (50, -50)])
def test_growth_keeps_what_was_known_where_it_was(far: tuple[float, float]) -> None:
    grid = OccupancyGrid()
    grid.integrate(Pose2D(0.3, 0.4, 1), seen([(1, 0), (0, 2), (-1, 1)]))
    before, shape = contents(grid), grid.log_odds.shape
    grid.extend_to(np.array(far) - 1.0, np.array(far) + 1.0)
    assert grid.log_odds.shape != shape
    assert contents(grid) == before


@pytest.mark.parametrize("block", [1, BLOCK])
def test_what_is_covered_is_held_with_room_around_it(
    block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # For the Gaussians of walls at the edge, and for the coarsest level beyond them.
    monkeypatch.setattr(occupancy, "BLOCK", block)
    grid = OccupancyGrid(MapParameters(resolution=0.1))
    room = len(grid.parameters.gaussian_kernel()) + LEVEL_WIDTHS[-1]
    for low, high in [((3, 4), (5, 9)), ((-40, 0), (-39, 1)), ((0, 80), (90, 81))]:
        grid.extend_to(np.array(low, np.float64), np.array(high, np.float64))
        rows, columns = grid.log_odds.shape
        assert grid.pyramid.shape == (len(LEVEL_WIDTHS), rows, columns)
        assert rows % block == columns % block == 0
        corners = grid.to_cells(np.array([low, high], np.float64))
        assert (corners[0] >= room).all()
        assert (corners[1] + room < (columns, rows)).all()


def test_nothing_grows_within_what_is_covered() -> None:
    grid = OccupancyGrid()
    grid.extend_to(np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
    log_odds = grid.log_odds
    grid.extend_to(np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
    grid.extend_to(np.array([0.5, 0.5]), np.array([0.6, 0.6]))
    assert grid.log_odds is log_odds


def test_a_long_way_needs_few_copies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(occupancy, "BLOCK", 8)
    grid = OccupancyGrid(MapParameters(resolution=1.0))
    copies, held = 0, grid.log_odds
    for x in range(1000):
        grid.extend_to(np.array([x - 5.0, -5.0]), np.array([x + 5.0, 5.0]))
        copies += grid.log_odds is not held
        held = grid.log_odds
    assert 5 < copies < 25


@pytest.mark.parametrize("seed", range(2))
def test_a_map_that_grew_is_the_map_that_was_large_at_once(seed: int) -> None:
    scans = random_scans(seed, 12, 15.0)
    grown, large = OccupancyGrid(), OccupancyGrid()
    large.extend_to(np.array([-20.0, -20.0]), np.array([20.0, 20.0]))
    for pose, perception in scans:
        grown.integrate(pose, perception)
        large.integrate(pose, perception)
    assert contents(grown) == contents(large)
    a, b = grown.to_grid_map(), large.to_grid_map()
    assert np.array_equal(a.cells, b.cells, equal_nan=True)
    assert (a.origin.x, a.origin.y) == pytest.approx((b.origin.x, b.origin.y))


def test_the_field_is_that_of_the_walls_that_are_left() -> None:
    # Scans that contradict each other, so that walls come and go.
    grid = OccupancyGrid()
    for pose, perception in random_scans(5, 40, 0.5):
        grid.integrate(pose, perception)
    gaussian = grid.parameters.gaussian_kernel()
    r = len(gaussian) // 2
    expected = np.zeros_like(grid.pyramid[0])
    for v, u in np.argwhere(grid.log_odds > 0):
        around = expected[v - r : v + r + 1, u - r : u + r + 1]
        np.maximum(around, gaussian, out=around)
    assert (grid.pyramid[0] == expected).all()
    assert expected.any()


@pytest.mark.parametrize("far", [1e6, -1e6, 1e9])
def test_an_absurd_size_is_refused(far: float) -> None:
    grid = OccupancyGrid()
    grid.integrate(Pose2D(), seen([(1, 0)]))
    before = contents(grid)
    with pytest.raises(DataError, match=r"the map would be .* m x .* m; expected sane odometry"):
        grid.integrate(Pose2D(far, far), seen([(1, 0)]))
    assert contents(grid) == before


# --- parameters


@pytest.mark.parametrize("resolution", [0.0, -0.05, 1e-4, math.nan, math.inf])
def test_a_resolution_must_be_sane(resolution: float) -> None:
    with pytest.raises(DataError, match=r"resolution .*expected 0.001 to 100 metres per cell"):
        MapParameters(resolution=resolution)


def test_the_gaussian_by_hand() -> None:
    # Standard deviation of one cell: 255 exp(-d^2 / 2), within a circle of 3 cells and a half.
    gaussian = MapParameters(resolution=0.05, blur=0.05).gaussian_kernel()
    assert gaussian.shape == (7, 7)
    assert gaussian.dtype == np.uint8
    assert gaussian[3].tolist() == [3, 35, 155, 255, 155, 35, 3]
    assert gaussian[2, 2:5].tolist() == [94, 155, 94]
    assert gaussian[0].tolist() == [0, 0, 2, 3, 2, 0, 0]
    assert (gaussian == gaussian.T).all()
    assert (gaussian == gaussian[::-1]).all()


def test_the_gaussian_is_as_wide_as_the_blur_and_at_least_a_cell() -> None:
    assert MapParameters(resolution=0.05, blur=0.1).gaussian_kernel().shape == (13, 13)
    assert MapParameters(resolution=0.05, blur=0.1).gaussian_kernel()[6, 8] == 155
    narrow = MapParameters(resolution=0.5, blur=0.05).gaussian_kernel()
    assert (narrow == MapParameters(resolution=0.05, blur=0.05).gaussian_kernel()).all()
