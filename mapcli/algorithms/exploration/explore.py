"""Exploring a map that stands in for the environment: parameters in, a trace out.

Algorithm 9.1 itself is `frontier`; the runner (`runner`) makes the arrays that it works on and
turns them into a trace at the end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from mapcli.algorithms.exploration.exploration_parameters import ExplorationParameters
from mapcli.algorithms.exploration.exploration_state import OPEN, classify_cells
from mapcli.algorithms.exploration.runner import ExplorationRun
from mapcli.errors import DataError
from mapcli.model.exploration import Cell, Exploration
from mapcli.model.grid import GridMap


class KnownMapError(DataError):
    """The known map is at fault, not the world."""


def explore(
    world: GridMap,
    robots: Sequence[Cell],
    parameters: ExplorationParameters | None = None,
    known: GridMap | None = None,
    *,
    compiled: bool | None = None,
    keep_cells: bool = True,
    progress: Callable[[float], None] = lambda coverage: None,
) -> Exploration:
    """Explore a world with Algorithm 9.1.

    Args:
        world: what the robots sense.
        robots: (row, column) where each starts.
        parameters: see there.
        known: what is known at the start, of the world's size; without it the robots first sense
            where they stand.
        compiled: run the loops compiled by numba, or as plain Python; both take the same steps.
            By default only large maps are worth the compiler's start-up.
        keep_cells: keep of each step which cells it sensed. Without, `Step.cells` is empty, and a
            map of many million cells is explored in half the memory.
        progress: called now and then with the coverage reached.

    Raises:
        DataError: no robot, a robot outside the map, on an obstacle, on an unknown cell, on
            another robot, or too large to stand anywhere.
        KnownMapError: `known` of another size, or a robot on no open cell of it.
    """
    parameters = parameters or ExplorationParameters()
    check(world, robots, parameters, known)
    run = ExplorationRun(world, robots, parameters, known, compiled, keep_cells=keep_cells)
    run.run(progress)
    return run.result(run.reason)


def plan(
    world: GridMap,
    robots: Sequence[Cell],
    parameters: ExplorationParameters | None = None,
    known: GridMap | None = None,
    *,
    compiled: bool | None = None,
) -> Exploration:
    """The frontier and the robots' next goals; nobody moves. Arguments as of `explore`."""
    parameters = parameters or ExplorationParameters()
    check(world, robots, parameters, known)
    run = ExplorationRun(world, robots, parameters, known, compiled)
    run.sense_at_start()
    return run.result("plan", run.next_goals())


def contradictions(world: GridMap, known: GridMap, low: float) -> int:
    """Cells that `known` holds to be open and the world to be an obstacle, or the reverse."""
    wrong = 0
    for one, other in zip(world.bands(), known.bands(), strict=True):
        both = one.known & other.known
        wrong += int(((one.cells < low) != (other.cells < low))[both].sum())
    return wrong


def check(
    world: GridMap,
    robots: Sequence[Cell],
    parameters: ExplorationParameters,
    known: GridMap | None,
) -> None:
    """Whether the robots can start.

    Raises:
        DataError: they cannot, see `explore`.
    """
    if not world.count(lambda cells: ~np.isnan(cells)):
        raise DataError("the world is all unknown", expected="a map with known cells")
    if known is not None and known.stored.shape != world.stored.shape:
        raise KnownMapError(
            f"the known map has {known.rows} rows and {known.columns} columns",
            expected=f"{world.rows} and {world.columns} as in the world",
        )
    if not robots:
        raise DataError("no robot", expected="a cell for each robot")
    for number, cell in enumerate(robots, start=1):
        check_robot(world, cell, number, parameters.low, "world", DataError)
        if known is not None:
            check_robot(known, cell, number, parameters.low, "known map", KnownMapError)
        if cell in robots[: number - 1]:
            first = robots.index(cell) + 1
            raise DataError(
                f"robots {first} and {number} both stand on {cell[0]},{cell[1]}",
                expected="a cell for each robot",
            )


def check_robot(
    grid: GridMap, cell: Cell, number: int, low: float, which: str, error: type[DataError]
) -> None:
    """Raise an error of this type unless a robot stands on an open cell of a map."""
    row, column = cell
    where = f"robot {number} at {row},{column}"
    if not grid.contains(row, column):
        raise error(
            f"{where} is outside the {which}",
            expected=f"a row from 0 to {grid.rows - 1}, a column from 0 to {grid.columns - 1}",
        )
    content = grid.part(row, column, row + 1, column + 1).cells
    if classify_cells(content, low, 0).item() != OPEN:
        value = content.item()
        kind = "an unknown cell" if math.isnan(value) else f"an obstacle ({value:g})"
        raise error(
            f"{where} stands on {kind} of the {which}", expected=f"an open cell, below {low:g}"
        )
