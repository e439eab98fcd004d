"""Explorations as a whole: what holds on any map, limits, robots, radius, bad input."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.exploring import BOOK, exploration_cases, grid_of, open_cells
from support.literal_frontier import LiteralFrontier

from mapcli import ExplorationParameters, GridMap, explore, plan
from mapcli.algorithms.exploration.explore import contradictions
from mapcli.errors import DataError
from mapcli.model.exploration import Exploration, coverage_curve
from mapcli.model.exploration_replay import ExplorationReplay

HALL = GridMap(np.full((12, 12), 0.1, dtype=np.float32), resolution=0.5)

OPTIONS = st.fixed_dictionaries(
    {
        "strategy": st.sampled_from(["nearest", "priority", "gain", "random"]),
        "connectivity": st.sampled_from([4, 8]),
        "sensor_range": st.sampled_from([1, 1, 2, 5]),
    }
)


def reachable(cells: np.ndarray, starts: list[tuple[int, int]]) -> set[tuple[int, int]]:
    """Open cells that can be reached from the starts over open cells, one straight move at a time
    (diagonal moves cut no corners, so they get no farther)."""
    seen, queue = set(starts), list(starts)
    for row, column in queue:
        for cell in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
            inside = 0 <= cell[0] < cells.shape[0] and 0 <= cell[1] < cells.shape[1]
            if inside and cell not in seen and cells[cell] < 0.5:
                seen.add(cell)
                queue.append(cell)
    return seen


def run(case: dict[str, Any], **options: Any) -> Exploration:
    known = None if case["known"] is None else GridMap(case["known"])
    return explore(GridMap(case["world"]), case["robots"], ExplorationParameters(**options), known)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(case=exploration_cases(robots=3), options=OPTIONS)
def test_everything_that_can_be_reached_and_sensed_is_known(
    case: dict[str, Any], options: dict[str, Any]
) -> None:
    case["known"] = None
    after = run(case, **options).after.cells
    world = case["world"]
    for row, column in reachable(world, case["robots"]):
        around = [(row, column), (row - 1, column), (row + 1, column)]
        for cell in (*around, (row, column - 1), (row, column + 1)):
            if 0 <= cell[0] < world.shape[0] and 0 <= cell[1] < world.shape[1]:
                np.testing.assert_equal(after[cell], world[cell])


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(case=exploration_cases(robots=3), options=OPTIONS)
def test_what_holds_of_every_trace(case: dict[str, Any], options: dict[str, Any]) -> None:
    exploration = run(case, **options)
    world, steps = case["world"], exploration.steps
    assert len(steps) <= world.size
    assert exploration.summary.reason in ("complete", "unreachable")
    known = exploration.before.cells.copy()
    at = dict(enumerate(case["robots"]))
    for step in steps:
        assert step.origin == at[step.robot]
        if step.kind == "frontier":
            assert known[step.goal] < 0.5
            assert len(step.cells) + len(step.unknowable) > 0
        way = np.vstack([[step.origin], step.path])
        longest = 1 if options["connectivity"] == 4 else 2
        assert all(np.abs(np.diff(way, axis=0)).max(axis=1) == 1)
        assert all(np.abs(np.diff(way, axis=0)).sum(axis=1) <= longest)
        assert all(known[cell] < 0.5 for cell in map(tuple, step.path))
        assert tuple(way[-1]) == step.goal
        known[tuple(step.cells.T)] = step.probabilities
        at[step.robot] = step.goal
    np.testing.assert_array_equal(known, exploration.after.cells)
    assert exploration.summary.distance_cells == sum(len(step.path) for step in steps)
    assert exploration.summary.known_cells == np.count_nonzero(~np.isnan(known))


@settings(max_examples=100, deadline=None)
@given(case=exploration_cases(robots=3), options=OPTIONS)
def test_replay_and_curve_tell_the_same(case: dict[str, Any], options: dict[str, Any]) -> None:
    exploration = run(case, **options)
    curve, replay = coverage_curve(exploration), ExplorationReplay(exploration)
    count = len(exploration.steps)
    for moment in sorted({0, count // 3, count // 2, count}):
        replay.advance(moment)
        assert curve.known_cells[moment] == replay.grid.known.sum()
    np.testing.assert_array_equal(replay.grid.cells, exploration.after.cells)
    frontier = [tuple(cell) for cell in np.argwhere(replay.frontier(0.5)).tolist()]
    assert frontier == [f.cell for f in exploration.frontier]
    assert curve.coverage[-1] == pytest.approx(exploration.summary.coverage)
    assert curve.distance_m[-1] == pytest.approx(exploration.summary.distance_m)


# --- limits ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [0, 1, 5])
def test_max_steps(steps: int) -> None:
    summary = explore(BOOK["fig9_9"], [(5, 9)], ExplorationParameters(max_steps=steps),
                      BOOK["fig9_4"]).summary  # fmt: skip
    assert (summary.steps, summary.reason) == (steps, "max-steps")


def test_max_distance_is_never_exceeded() -> None:
    for metres in (0.0, 2.9, 3.0, 6.99):
        parameters = ExplorationParameters(max_distance=metres)
        summary = explore(BOOK["fig9_9"], [(5, 9)], parameters, BOOK["fig9_4"]).summary
        # The first goals are 2, 1 and 4 cells away.
        assert summary.distance_m == {0.0: 0, 2.9: 2, 3.0: 3, 6.99: 3}[metres]
        assert summary.reason == "max-distance"


def test_max_distance_counts_metres() -> None:
    summary = explore(HALL, [(6, 6)], ExplorationParameters(max_distance=3.0)).summary
    assert (summary.distance_m, summary.distance_cells) == (3.0, 6)


def test_coverage() -> None:
    summary = explore(HALL, [(6, 6)], ExplorationParameters(coverage=0.5)).summary
    assert summary.reason == "coverage"
    assert 0.5 <= summary.coverage < 0.55


def test_limits_stop_every_robot_where_it_is() -> None:
    robots = [(0, 0), (11, 11), (0, 11)]
    for limits in ({"coverage": 0.5}, {"max_steps": 20}, {"max_distance": 10.0}):
        run = explore(HALL, robots, ExplorationParameters(**limits, return_home=True))
        assert run.summary.steps <= 20 + len(robots) or "max_steps" not in limits
        assert [s.goal for s in run.steps if s.kind == "home"][-3:] != []


def test_return_home() -> None:
    run = explore(BOOK["fig9_9"], [(5, 9)], ExplorationParameters(return_home=True), BOOK["fig9_4"])
    last = run.steps[-1]
    assert (last.kind, last.goal, last.origin) == ("home", (5, 9), (8, 13))
    assert len(last.path) == 7
    assert (run.summary.steps, run.summary.distance_cells) == (29, 54)
    assert run.summary.not_home == 0


# --- several robots -------------------------------------------------------------------------------


def test_each_robot_takes_the_part_of_the_frontier_nearest_to_it() -> None:
    corridor = grid_of("." * 21)
    known = GridMap(corridor.cells.copy())
    known.cells[0, :5] = known.cells[0, 16:] = np.nan
    planned = plan(corridor, [(0, 9), (0, 11)], known=known).plan or ()
    assert [goal.goal for goal in planned] == [(0, 5), (0, 15)]
    # Both nearer to the left end: the farther one goes right, though left is nearer to it too.
    planned = plan(corridor, [(0, 8), (0, 9)], known=known).plan or ()
    assert [goal.goal for goal in planned] == [(0, 5), (0, 15)]


def test_no_two_robots_hold_the_same_goal() -> None:
    corridor = grid_of("." * 9)
    known = GridMap(corridor.cells.copy())
    known.cells[0, 8:] = np.nan
    planned = plan(corridor, [(0, 1), (0, 2)], known=known).plan or ()
    assert [(goal.robot, goal.goal) for goal in planned] == [(0, (0, 7))]
    run = explore(corridor, [(0, 1), (0, 2)], known=known)
    assert [(step.robot, step.goal) for step in run.steps] == [(0, (0, 7))]


def test_robots_move_at_the_same_time() -> None:
    corridor = grid_of("." * 31)
    one = explore(corridor, [(0, 15)]).summary
    two = explore(corridor, [(0, 15), (0, 16)]).summary
    assert (one.time_steps, one.distance_cells) == (14 + 28, 42)
    assert two.time_steps == 14
    assert two.distance_cells == 14 + 13


# --- radius ---------------------------------------------------------------------------------------


def test_a_robot_up_to_a_cell_wide_is_a_point() -> None:
    small = explore(HALL, [(6, 6)], ExplorationParameters(robot_radius=0.25))
    point = explore(HALL, [(6, 6)])
    np.testing.assert_array_equal(small.steps.goal, point.steps.goal)


def test_a_robot_does_not_go_where_it_does_not_fit() -> None:
    """A gap of one cell in the wall: a robot of more than one cell stays on its side."""
    world = grid_of(*["......#......"] * 4, ".............", *["......#......"] * 4)
    wide = ExplorationParameters(robot_radius=0.6, sensor_range=20)
    run = explore(world, [(4, 1)], wide)
    assert all(step.goal[1] < 6 for step in run.steps)
    obstacles = np.argwhere(world.cells > 0.5)
    for row, column in run.steps.path:
        gap = np.maximum(np.abs(obstacles - (row, column)) - 0.5, 0)
        assert (np.hypot(*gap.T) >= 0.6).all()
    through = explore(world, [(4, 1)], ExplorationParameters(robot_radius=0.5, sensor_range=20))
    assert through.summary.coverage == 1.0
    assert run.summary.coverage < 1.0


def test_a_robot_looks_where_it_cannot_go() -> None:
    """It does not fit through the door, but sees all of the room behind it that it can."""
    world = grid_of(*["......#......"] * 4, ".............", *["......#......"] * 4)
    run = explore(world, [(4, 1)], ExplorationParameters(robot_radius=0.6, sensor_range=20))
    viewpoints = [step for step in run.steps if step.kind == "lookout"]
    assert viewpoints
    assert all(len(step.cells) for step in viewpoints)
    seen_behind = np.count_nonzero(~np.isnan(run.after.cells[:, 7:]))
    assert seen_behind > 20
    assert run.summary.reason == "unreachable"
    assert run.summary.unreachable == len(run.frontier) > 0


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(case=exploration_cases(robots=2), options=OPTIONS, radius=st.sampled_from([0.6, 1.0, 1.6]))
def test_a_robot_with_a_radius_misses_nothing(
    case: dict[str, Any], options: dict[str, Any], radius: float
) -> None:
    """Sensing once more from anywhere that it can get to would teach it nothing, unless an obstacle
    that the known map was wrong about hides it."""
    with suppress(DataError):  # the radius fits nowhere
        exploration = run(case, **options, robot_radius=radius)
        assert len(exploration.steps) <= case["world"].size + len(case["robots"])
        ends = dict(enumerate(case["robots"])) | {s.robot: s.goal for s in exploration.steps}
        after = LiteralFrontier(case["world"], list(ends.values()), exploration.after.cells,
                                sensor_range=options["sensor_range"], radius=radius,
                                connectivity=options["connectivity"])  # fmt: skip
        for step in exploration.steps:
            after.sensed |= {(r, c) for r, c in step.unknowable.tolist()}
        for robot in after.robots:
            reached = after.distances(robot.cell)
            for cell in (c for c in reached if not after.is_inflated(c)):
                shown = after.look(cell, lambda c: after.is_open(c) and c in after.world)
                assert not any(after.may_be_learned(c) for c in shown)


def test_a_robot_in_a_tight_spot_gets_out() -> None:
    """It starts in a niche one cell wide, where it touches walls as soon as it sees them."""
    world = grid_of(
        "#########", "#.......#", "#.......#", "#.......#", "#.......#", "###...###", "####.####"
    )
    run = explore(world, [(6, 4)], ExplorationParameters(robot_radius=0.6, return_home=True))
    assert run.after.cells[2, 4] == np.float32(0.1)
    assert run.steps[-1].kind == "home"
    # Home is too tight by now; it stops at the place nearest to it where it fits.
    assert run.steps[-1].goal != (6, 4)
    assert run.summary.not_home == 1


# --- what is known at the start is wrong ----------------------------------------------------------


def test_the_world_wins_where_it_is_sensed() -> None:
    world, known = grid_of(".....", "....."), grid_of("..#.?", "....?")
    assert contradictions(world, known, 0.5) == 1
    run = explore(world, [(1, 0)], known=known)
    np.testing.assert_array_equal(run.after.cells, world.cells)
    assert run.summary.corrected == 1


def test_an_obstacle_that_was_believed_to_be_open() -> None:
    world, known = grid_of("..#..", "....."), grid_of("....?", "????.")
    run = explore(world, [(0, 0)], known=known)
    assert run.steps[0].kind == "blocked" or run.steps[0].kind == "frontier"
    blocked = [step for step in run.steps if step.kind == "blocked"]
    assert all((0, 2) in map(tuple, step.cells) for step in blocked)
    np.testing.assert_array_equal(run.after.cells, world.cells)


# --- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("robots", "problem"),
    [
        ([], "no robot"),
        ([(5, 16)], "robot 1 at 5,16 is outside the world; expected a row from 0 to 10, "
                    "a column from 0 to 15"),
        ([(-1, 0)], "robot 1 at -1,0 is outside the world"),
        ([(1, 5)], "robot 1 at 1,5 stands on an obstacle (1) of the world"),
        ([(0, 0)], "robot 1 at 0,0 stands on an unknown cell of the world; "
                   "expected an open cell, below 0.5"),
        ([(5, 9), (5, 9)], "robots 1 and 2 both stand on 5,9"),
    ],
)  # fmt: skip
def test_where_a_robot_cannot_start(robots: list[tuple[int, int]], problem: str) -> None:
    with pytest.raises(DataError) as error:
        explore(BOOK["fig9_9"], robots)
    assert problem in str(error.value)


def test_a_robot_on_a_cell_that_is_not_known() -> None:
    with pytest.raises(DataError, match="2,1 stands on an unknown cell of the known map"):
        explore(BOOK["fig9_9"], [(2, 1)], known=BOOK["fig9_4"])


def test_a_world_that_is_all_unknown() -> None:
    with pytest.raises(DataError, match="the world is all unknown"):
        explore(grid_of("???"), [(0, 0)])


def test_known_of_another_size() -> None:
    with pytest.raises(DataError, match="has 7 rows and 7 columns; expected 11 and 16 as in"):
        explore(BOOK["fig9_9"], [(5, 9)], known=BOOK["fig9_10"])


@pytest.mark.parametrize("radius", [0.6, 3.0, 1e9])
def test_a_radius_that_fits_nowhere(radius: float) -> None:
    world = grid_of("#####", "#...#", "#####")
    with pytest.raises(DataError, match=r"robot 1 at 1,1 with a radius of .* m fits nowhere"):
        explore(world, [(1, 1)], ExplorationParameters(robot_radius=radius))


@pytest.mark.parametrize(
    "parameters",
    [
        {"low": 0.0}, {"low": 1.01}, {"low": float("nan")}, {"sensor_range": 0},
        {"connectivity": 6}, {"robot_radius": -1.0}, {"robot_radius": float("inf")},
        {"max_steps": -1}, {"max_distance": -0.1}, {"coverage": 0.0}, {"coverage": 1.5},
        {"strategy": "farthest"},
    ],
)  # fmt: skip
def test_parameters_outside_their_range(parameters: dict[str, Any]) -> None:
    with pytest.raises(DataError, match=next(iter(parameters)).replace("_", " ")):
        ExplorationParameters(**parameters)


def test_inputs_are_not_changed() -> None:
    world, known = BOOK["fig9_9"].cells.copy(), BOOK["fig9_4"].cells.copy()
    explore(BOOK["fig9_9"], [(5, 9)], known=BOOK["fig9_4"])
    np.testing.assert_array_equal(BOOK["fig9_9"].cells, world)
    np.testing.assert_array_equal(BOOK["fig9_4"].cells, known)


def test_a_single_cell() -> None:
    summary = explore(grid_of("."), [(0, 0)]).summary
    assert (summary.steps, summary.known_cells, summary.reason) == (1, 1, "complete")
    assert open_cells(np.array([[0.1]], dtype=np.float32)) == [(0, 0)]
