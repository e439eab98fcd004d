"""Where strategies part, and cells that no exploration senses, on the book's maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mapcli import GridMap, explore, load_map
from mapcli.algorithms.exploration.exploration_parameters import ExplorationParameters, Strategy
from mapcli.algorithms.exploration.first_difference import FirstDifference, first_difference
from mapcli.algorithms.exploration.never_sensed import never_sensed

FIXTURES = Path(__file__).parents[3] / "fixtures"
ROOMS, TWO_KNOWN, LABYRINTH = (
    load_map(FIXTURES / f"{name}.txt").grid for name in ("fig9_9", "fig9_4", "fig9_10")
)


def difference(
    world: GridMap, known: GridMap, robot: tuple[int, int], strategies: tuple[Strategy, Strategy]
) -> FirstDifference | None:
    a, b = (ExplorationParameters(strategy) for strategy in strategies)
    runs = [(p, explore(world, [robot], p, known)) for p in (a, b)]
    return first_difference(world, known, *runs)


def test_the_labyrinth_as_the_book_has_it() -> None:
    found = difference(LABYRINTH, LABYRINTH, (3, 3), ("nearest", "priority"))
    assert found is not None
    assert (found.step, found.origin, found.goals) == (1, (3, 3), ((3, 2), (1, 3)))
    assert found.choices is not None
    nearest, priority = found.choices
    assert (nearest.chosen.distance, nearest.tied, nearest.rule) == (1, 0, "")
    assert (priority.chosen.priority, priority.tied, priority.rule) == (1.5, 0, "")


def test_a_tie_names_its_rule() -> None:
    found = difference(ROOMS, TWO_KNOWN, (5, 9), ("nearest", "priority"))
    assert found is not None
    assert found.choices is not None
    assert found.step == 4
    nearest = found.choices[0]
    # The two others that are 5 steps away are in rows further down.
    assert (nearest.chosen.cell, nearest.tied, nearest.rule) == ((5, 5), 2, "smaller row")


def test_a_tie_in_one_row_is_decided_by_the_column() -> None:
    cells = np.zeros((1, 7), np.float32)
    known = np.full((1, 7), np.nan, np.float32)
    known[0, 2:5] = 0
    world, told = GridMap(cells), GridMap(known)
    nearest = ExplorationParameters("nearest")
    there = explore(world, [(0, 3)], nearest, told)
    assert there.steps[0].goal == (0, 2)
    seeds = (ExplorationParameters("random", seed=seed) for seed in range(20))
    runs = ((p, explore(world, [(0, 3)], p, told)) for p in seeds)
    other = next((p, run) for p, run in runs if run.steps[0].goal == (0, 4))
    found = first_difference(world, told, (nearest, there), other)
    assert found is not None
    assert found.choices is not None
    assert [choice.rule for choice in found.choices] == ["smaller column", ""]


def test_a_strategy_does_not_part_from_itself() -> None:
    assert difference(ROOMS, TWO_KNOWN, (5, 9), ("gain", "gain")) is None


def test_random_is_drawn_from_its_seed_and_goes_farther() -> None:
    def driven(seed: int) -> list[tuple[int, int]]:
        p = ExplorationParameters("random", seed=seed)
        return [step.goal for step in explore(ROOMS, [(5, 9)], p, TWO_KNOWN).steps]

    assert driven(1) == driven(1)
    assert driven(1) != driven(2)
    far = [
        explore(ROOMS, [(5, 9)], ExplorationParameters("random", seed=s), TWO_KNOWN).summary
        for s in range(10)
    ]
    assert all(summary.reason == "complete" for summary in far)
    assert min(summary.distance_cells for summary in far) > 2 * 47


def test_cells_of_figure_9_9_that_nobody_senses() -> None:
    run = explore(ROOMS, [(5, 9)], ExplorationParameters(), TWO_KNOWN)
    cells = never_sensed(ROOMS, run, 0.5)
    assert cells.at_corners.tolist() == [[9, 0], [9, 11]]
    assert (len(cells.left), len(cells.out_of_reach)) == (0, 0)


def test_what_lies_behind_walls_and_what_is_left() -> None:
    cells = np.array([[0, 0, 0, 0, 1, 0], [1, 1, 1, 1, 1, 0]], np.float32)
    world = GridMap(cells)
    run = explore(world, [(0, 0)], ExplorationParameters(max_steps=1))
    kinds = never_sensed(world, run, 0.5)
    assert kinds.left.tolist() == [[0, 2], [0, 3], [0, 4], [1, 2], [1, 3]]
    assert kinds.at_corners.tolist() == [[1, 4]]
    assert kinds.out_of_reach.tolist() == [[0, 5], [1, 5]]
