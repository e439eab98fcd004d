"""One exploration while it runs: makes the arrays that the loops of Algorithm 9.1 share, runs the
loops, as plain Python or compiled, and reads the trace out of the arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from mapcli.algorithms.exploration import field_of_view as sensing
from mapcli.algorithms.exploration import frontier
from mapcli.algorithms.exploration import goal_selection as goals
from mapcli.algorithms.exploration import initialisation as outset
from mapcli.algorithms.exploration import path_search as motion
from mapcli.algorithms.exploration import return_home as homecoming
from mapcli.algorithms.exploration import robots as fleet
from mapcli.algorithms.exploration.exploration_parameters import ExploreParameters
from mapcli.algorithms.exploration.exploration_state import (
    CONTRADICTED,
    FRONTIER_SIZE,
    KNOWN_CELLS,
    KNOWN_EXPLORABLE,
    unflatten,
    unknown_neighbours,
)
from mapcli.algorithms.exploration.loop_arrays import (
    grown,
    make_field,
    make_robots,
    make_trace,
    read_steps,
)
from mapcli.algorithms.exploration.viewpoints import make_lookouts
from mapcli.algorithms.exploration.voronoi_partition import make_parts
from mapcli.errors import DataError
from mapcli.model.exploration import (
    Cell,
    Exploration,
    ExplorationSummary,
    FrontierCell,
    NextGoal,
    Reason,
    move_lengths,
)
from mapcli.model.grid import GridMap

Function = TypeVar("Function", bound=Callable[..., Any])
Arrays = TypeVar("Arrays", bound=tuple[Any, ...])

HELD_BACK: dict[int, Reason] = {
    frontier.MAX_STEPS: "max-steps",
    frontier.MAX_DISTANCE: "max-distance",
    frontier.COVERAGE: "coverage",
}

ROUNDS = 5000
"""Rounds of Algorithm 9.1 between two looks at the progress, and at Ctrl-C."""


LARGE = 20_000
"""Cells; plain Python explores a smaller map before numba would have been imported."""


def is_large(grid: GridMap, parameters: ExploreParameters) -> bool:
    """Whether compiled loops pay for importing them (most of a second)."""
    work = 8 if parameters.strategy == "gain" else 1
    return grid.cells.size * work > LARGE


class Expedition:
    """The state of one exploration (changes while it runs; see `explore.explore`)."""

    def __init__(
        self,
        world: GridMap,
        robots: Sequence[Cell],
        parameters: ExploreParameters,
        known: GridMap | None,
        compiled: bool | None,
    ) -> None:
        self.world, self.parameters, self.starts = world, parameters, tuple(robots)
        self.compiled = is_large(world, parameters) if compiled is None else compiled
        self.before = known or world.replaced(np.full_like(world.cells, np.nan))
        self.field = self.views(make_field(world, self.before, parameters))
        cells = [self.index(cell) for cell in robots]
        self.homes = np.array(cells, dtype=np.int64)
        sight = sensing.make_sight(self.field, parameters.sensor_range)
        self.planner = frontier.Planner(
            self.views(motion.make_search(self.field)),
            self.views(make_parts(self.field, len(cells))),
            self.views(sight),
            self.views(goals.make_chooser(parameters.strategy, self.field, sight)),
            self.views(make_lookouts(self.field)),
        )
        self.robots = self.views(make_robots(cells, at_start=known is None))
        self.trace = self.views(make_trace(len(cells) * len(sight.seen), len(cells)))
        if parameters.robot_radius:
            self.check_room(cells)
        mark_explorable = self.call(outset.mark_explorable)
        self.explorable = mark_explorable(self.field, self.planner.search, self.robots.cell)
        if known is not None:
            self.call(outset.take_stock)(self.field)

    def views(self, arrays: Arrays) -> Arrays:
        """Arrays as the loops want them: plain Python is faster with memoryviews."""
        return type(arrays)(
            *(self.views(a) if isinstance(a, tuple) else self.view(a) for a in arrays)
        )

    def view(self, array: Any) -> Any:
        """One array likewise; anything else as it is."""
        is_array = isinstance(array, np.ndarray)
        return array.data if is_array and not self.compiled else array

    def call(self, function: Function) -> Function:
        """A loop as plain Python, or its compiled twin."""
        if not self.compiled:
            return function
        from mapcli.algorithms.exploration._kernels.compiled_loops import compiled

        return compiled(function)

    def index(self, cell: Cell) -> int:
        return (cell[0] + 1) * self.field.stride + cell[1] + 1

    def cell(self, index: int) -> Cell:
        row, column = divmod(int(index), self.field.stride)
        return row - 1, column - 1

    def check_room(self, cells: Sequence[int]) -> None:
        """Raise DataError when a robot is too large to stand anywhere it could get to."""
        for number, cell in enumerate(cells, start=1):
            if not self.call(outset.finds_room)(self.field, self.planner.search, cell):
                row, column = self.cell(cell)
                raise DataError(
                    f"robot {number} at {row},{column} with a radius of "
                    f"{self.parameters.robot_radius:g} m fits nowhere that it could get to",
                    expected="a smaller radius, or another start",
                )

    def sense_at_start(self) -> None:
        """The steps before the first choice of a goal."""
        self._explore(frontier.Limits(0, math.inf, motion.NEVER), lambda coverage: None)

    def run(self, progress: Callable[[float], None]) -> None:
        """Explore until nobody has anywhere to go, and bring the robots to rest."""
        wanted, share = self.parameters, self.parameters.coverage
        self._explore(
            frontier.Limits(
                motion.NEVER if wanted.max_steps is None else wanted.max_steps,
                # A path of just the length allowed is allowed, whatever the rounding.
                (math.inf if wanted.max_distance is None else wanted.max_distance)
                / self.world.resolution + 1e-9,
                motion.NEVER if share is None else math.ceil(share * self.explorable - 1e-9),
            ),
            progress,
        )  # fmt: skip
        if wanted.return_home:
            go_home, state = self.call(homecoming.go_home), frontier.MORE
            homes = self.view(self.homes)
            while state != frontier.ENDED:
                state = go_home(self.field, self.planner, self.robots, self.trace, homes)
                self.make_room(state)
        self.call(homecoming.stay)(self.robots, self.trace)

    def _explore(self, limits: frontier.Limits, progress: Callable[[float], None]) -> None:
        """Algorithm 9.1 up to its end, with a look at the progress now and then."""
        explore, state = self.call(frontier.explore), frontier.MORE
        while state != frontier.ENDED:
            state = explore(self.field, self.planner, limits, self.robots, self.trace, ROUNDS)
            self.make_room(state)
            progress(self.coverage)

    def make_room(self, state: int) -> None:
        """Double the trace's columns when the loops ask for it."""
        if state == frontier.ROOM:
            self.trace = self.views(grown(self.trace))

    @property
    def coverage(self) -> float:
        """Share of the explorable cells that is known."""
        return int(self.field.counts[KNOWN_EXPLORABLE]) / max(self.explorable, 1)

    @property
    def reason(self) -> Reason:
        """Why nobody had anywhere to go."""
        held_back = self.trace.counts[fleet.HELD_BACK]
        if self.field.counts[FRONTIER_SIZE] == 0:
            return "complete"
        return HELD_BACK.get(held_back, "unreachable")

    def result(self, reason: Reason, plan: tuple[NextGoal, ...] | None = None) -> Exploration:
        """What happened, and what is known now."""
        steps = read_steps(self.field, self.trace)
        left = self.frontier_cells()
        away = [k for k, cell in enumerate(self.homes) if cell != self.robots.cell[k]]
        return Exploration(
            robots=self.starts,
            before=self.before,
            after=self.world.replaced(unflatten(self.field, self.field.grid)),
            steps=steps,
            frontier=left,
            plan=plan,
            explorable=unflatten(self.field, self.field.explorable).astype(bool),
            summary=ExplorationSummary(
                reason=reason,
                steps=len(steps),
                time_steps=int(self.trace.counts[fleet.TIME]),
                distance_cells=len(steps.path),
                distance_m=float(move_lengths(steps).sum()) * self.world.resolution,
                known_cells=int(self.field.counts[KNOWN_CELLS]),
                coverage=self.coverage,
                unreachable=sum(cell.distance is None for cell in left),
                corrected=int(self.field.counts[CONTRADICTED]),
                not_home=len(away) if self.parameters.return_home else 0,
            ),
        )

    def frontier_cells(self) -> tuple[FrontierCell, ...]:
        """The frontier, with the nearest robot (ties: the first) and the way to it."""
        search, cells = self.planner.search, np.flatnonzero(np.asarray(self.field.frontier))
        if len(cells) == 0:
            return ()
        nearest = np.full(len(cells), motion.NEVER)
        robots = np.zeros(len(cells), np.int64)
        for robot, start in enumerate(np.asarray(self.robots.cell).tolist()):
            self.call(motion.spread_all)(self.field, search, start)
            moves = np.asarray(search.mark)[cells] - search.base[0]
            fits = (np.asarray(self.field.crowded)[cells] == 0) | (moves == 0)
            nearer = (moves >= 0) & fits & (moves < nearest)
            nearest[nearer], robots[nearer] = moves[nearer], robot
        rows = zip(cells.tolist(), robots.tolist(), nearest.tolist(), strict=True)
        return tuple(self.frontier_cell(*row) for row in rows)

    def frontier_cell(self, cell: int, robot: int, moves: int) -> FrontierCell:
        unknown = int(self.call(unknown_neighbours)(self.field, cell))
        if moves == motion.NEVER:
            return FrontierCell(self.cell(cell), unknown, None, None, None)
        return FrontierCell(self.cell(cell), unknown, robot, moves, self.priority(cell, moves))

    def priority(self, cell: int, moves: int) -> float | None:
        """Worth of a frontier cell per path length."""
        worth = self.call(goals.shown_worth)
        planner = self.planner
        return worth(self.field, planner.sight, planner.chooser, cell) / moves if moves else None

    def next_goals(self) -> tuple[NextGoal, ...]:
        """Where each robot would go next, in the order in which they choose."""
        planned = []
        for robot in range(len(self.homes)):
            choose = self.call(frontier.choose_goal)
            goal = choose(self.field, self.planner, self.robots, robot)
            if goal.cell == goals.NOWHERE:
                continue
            self.robots.goal[robot] = goal.cell
            path = np.zeros(goal.moves, np.int64)
            write_path = self.call(motion.write_path)
            write_path(self.field, self.planner.search, goal.cell, self.view(path), goal.moves)
            at_frontier = goal.kind == goals.FRONTIER
            priority = self.priority(goal.cell, goal.moves) if at_frontier else None
            cells = [self.cell(cell) for cell in path.tolist()]
            planned.append(NextGoal(robot, self.cell(goal.cell), cells, priority))
        return tuple(planned)
