"""The book's own numbers: Figs. 9.4 to 9.10, ties, paths."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.exploring import BOOK, STRATEGIES, as_records, grid_of, open_cells
from support.literal_frontier import LiteralFrontier

from mapcli import ExplorationParameters, GridMap, explore, plan
from mapcli.model.exploration import Exploration, Step


def sensed(step: Step) -> list[tuple[Any, ...]]:
    probabilities = [float(str(p)) for p in step.probabilities]
    return [(*cell, p) for cell, p in zip(step.cells.tolist(), probabilities, strict=True)]


def book_run(**options: Any) -> Exploration:
    return explore(BOOK["fig9_9"], [(5, 9)], ExplorationParameters(**options), BOOK["fig9_4"])


def test_figures_9_5_to_9_8() -> None:
    first, second, third = book_run().steps[:3]
    assert first.goal == (3, 9)
    assert first.path.tolist() == [[4, 9], [3, 9]]
    assert sensed(first) == [(2, 8, 1.0), (2, 9, 0.1), (2, 10, 0.1)]
    assert second.goal == (2, 9)
    assert second.path.tolist() == [[2, 9]]
    assert sensed(second) == [(1, 8, 0.8), (1, 9, 1.0), (1, 10, 1.0)]
    assert third.goal == (2, 7)
    assert third.path.tolist() == [[3, 9], [3, 8], [3, 7], [2, 7]]
    assert (first.time, second.time, third.time) == (2, 3, 7)


def test_figure_9_4_has_thirteen_frontier_cells() -> None:
    planned = plan(BOOK["fig9_9"], [(5, 9)], known=BOOK["fig9_4"])
    assert [f.cell for f in planned.frontier] == [
        (2, 6), (2, 7), (3, 8), (3, 9), (3, 10), (5, 5), (5, 12), (6, 5), (6, 6), (6, 12),
        (7, 7), (7, 11), (7, 12),
    ]  # fmt: skip


def test_figure_9_9() -> None:
    """At the end everything is known as in the figure, but for two corners: those touch open cells
    at a corner only, so no frontier cell ever leads there (frontier adjacency is 4), and this
    robot did not come past."""
    book, after = BOOK["fig9_9"].cells, book_run().after.cells
    differing = np.argwhere(~np.isclose(book, after, equal_nan=True)).tolist()
    assert differing == [[9, 0], [9, 11]]
    assert np.isnan(after[9, [0, 11]]).all()
    summary = book_run().summary
    assert (summary.reason, summary.coverage, summary.known_cells) == ("complete", 1.0, 124)
    assert (summary.steps, summary.distance_cells, summary.time_steps) == (28, 47, 47)


def test_figure_9_10() -> None:
    labyrinth = BOOK["fig9_10"]
    planned = plan(labyrinth, [(3, 3)], ExplorationParameters("priority"), labyrinth)
    assert {f.cell: (f.unknown, f.distance, f.priority) for f in planned.frontier} == {
        (1, 3): (3, 2, 1.5),
        (2, 2): (2, 2, 1.0),
        (3, 2): (1, 1, 1.0),
    }


@pytest.mark.parametrize(
    ("strategy", "goal", "priority"), [("nearest", (3, 2), 1.0), ("priority", (1, 3), 1.5)]
)
def test_figure_9_10_first_goal(strategy: Any, goal: tuple[int, int], priority: float) -> None:
    labyrinth, parameters = BOOK["fig9_10"], ExplorationParameters(strategy)
    (planned,) = plan(labyrinth, [(3, 3)], parameters, labyrinth).plan or ()
    first = explore(labyrinth, [(3, 3)], parameters, labyrinth).steps[0]
    assert planned.goal == first.goal == goal
    assert planned.path == [tuple(cell) for cell in first.path.tolist()]
    assert planned.priority == first.priority == priority


def test_cells_that_stay_unknown_are_not_tried_again() -> None:
    """Nothing of Fig. 9.10 can be learned: every frontier cell is visited once at most."""
    labyrinth = BOOK["fig9_10"]
    run = explore(labyrinth, [(3, 3)], known=labyrinth)
    assert [step.goal for step in run.steps] == [(3, 2), (2, 2), (1, 3)]
    assert [len(step.unknowable) for step in run.steps] == [2, 2, 4]
    assert run.summary.reason == "complete"


def test_a_robot_on_a_frontier_cell_senses_there_first() -> None:
    step = explore(BOOK["fig9_9"], [(7, 12)], known=BOOK["fig9_4"]).steps[0]
    assert (step.origin, step.goal, step.path.tolist()) == ((7, 12), (7, 12), [])
    assert (step.time, step.priority) == (0, None)
    assert [cell[:2] for cell in sensed(step)] == [(6, 13), (7, 13), (8, 11), (8, 12), (8, 13)]


@pytest.mark.slow
@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("known", ["fig9_4", None])
def test_literal_algorithm_on_the_two_rooms(strategy: Any, known: str | None) -> None:
    world = BOOK["fig9_9"]
    told = BOOK[known] if known else None
    for robot in [(5, 9), (2, 6), (7, 7)] if known else [(5, 9), (8, 13), (2, 1), (5, 2)]:
        run = explore(world, [robot], ExplorationParameters(strategy), told)
        literal = LiteralFrontier(
            world.cells, [robot], told.cells if told else None, strategy=strategy
        )
        assert as_records(run) == literal.run().steps


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_literal_algorithm_in_the_labyrinth(strategy: Any) -> None:
    labyrinth = BOOK["fig9_10"]
    for known in (labyrinth, None):
        for robot in open_cells(labyrinth.cells):
            run = explore(labyrinth, [robot], ExplorationParameters(strategy), known)
            literal = LiteralFrontier(
                labyrinth.cells, [robot], known.cells if known else None, strategy=strategy
            )
            assert as_records(run) == literal.run().steps


def test_ties_go_to_the_smallest_row_then_the_smallest_column() -> None:
    hall = GridMap(np.full((7, 7), 0.1, dtype=np.float32))
    goals = [step.goal for step in explore(hall, [(3, 3)]).steps]
    assert goals[:3] == [(3, 3), (2, 3), (1, 3)]
    known = grid_of("???????", "???????", "??...??", "??...??", "??...??", "???????", "???????")
    cells = [f.cell for f in plan(hall, [(3, 3)], known=known).frontier]
    assert cells == [(2, 2), (2, 3), (2, 4), (3, 2), (3, 4), (4, 2), (4, 3), (4, 4)]


def test_the_canonical_path() -> None:
    """From the goal back: straight before diagonal, then the smallest row, then column."""
    known = grid_of("....", "....", "..??")
    (goal,) = plan(grid_of("....", "....", "...?"), [(0, 0)], known=known).plan or ()
    # (1, 2) and (2, 1) are three moves away; to (1, 2) the way from above comes first.
    assert (goal.goal, goal.path) == ((1, 2), [(0, 1), (0, 2), (1, 2)])


def test_diagonal_moves() -> None:
    diagonal = ExplorationParameters(connectivity=8)
    two_rows = grid_of("......", "......"), grid_of("....??", "....??")
    (goal,) = plan(two_rows[0], [(1, 0)], diagonal, two_rows[1]).plan or ()
    assert goal.path == [(0, 1), (0, 2), (0, 3)]
    # Two moves around the obstacle instead of one across its corner.
    corner = grid_of(".#?", "..."), grid_of(".#?", "..?")
    (goal,) = plan(corner[0], [(0, 0)], diagonal, corner[1]).plan or ()
    assert goal.path == [(1, 0), (1, 1)]


def test_a_diagonal_move_is_one_move_and_longer_than_a_straight_one() -> None:
    world, known = grid_of("..#", "..#", "###"), grid_of("..#", "..?", "#??")
    halved = [GridMap(grid.cells, resolution=0.5) for grid in (world, known)]
    run = explore(halved[0], [(0, 0)], ExplorationParameters(connectivity=8), halved[1])
    assert [step.path.tolist() for step in run.steps] == [[[1, 1]]]
    assert (run.summary.distance_cells, run.summary.time_steps) == (1, 1)
    assert run.summary.distance_m == pytest.approx(0.5 * 2**0.5)


def test_probability_is_compared_with_low_as_it_is_written() -> None:
    """0.7 as float32 is a little less than 0.7, yet a cell of 0.7 is not below --low 0.7."""
    world = GridMap(np.array([[0.1, 0.7, 0.1]], dtype=np.float32))
    run = explore(world, [(0, 0)], ExplorationParameters(low=0.7))
    assert run.summary.known_cells == 2
    run = explore(world, [(0, 0)], ExplorationParameters(low=0.71))
    assert run.summary.known_cells == 3


def test_beyond_the_edge_there_is_nothing_to_learn() -> None:
    assert plan(grid_of("..."), [(0, 1)]).frontier == ()
