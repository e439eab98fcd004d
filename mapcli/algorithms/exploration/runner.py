"""One exploration while it runs: makes the arrays that the loops of Algorithm 9.1 share, runs the
loops, as plain Python or compiled, and reads the trace out of the arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from mapcli.algorithms.exploration import (
    field_of_view,
    frontier,
    goal_selection,
    initialisation,
    limits,
    path_search,
    return_home,
    trace_columns,
)
from mapcli.algorithms.exploration.exploration_parameters import ExplorationParameters
from mapcli.algorithms.exploration.exploration_state import (
    CONTRADICTED,
    FRONTIER_SIZE,
    KNOWN_CELLS,
    KNOWN_EXPLORABLE,
    ON_FRONTIER,
    unknown_neighbours,
)
from mapcli.algorithms.exploration.loop_arrays import (
    explorable_cells,
    known_at_the_end,
    make_robots,
    make_state,
    make_trace,
    noted_cells,
    read_steps,
    require_memory,
    with_room,
)
from mapcli.algorithms.exploration.viewpoints import make_viewpoints
from mapcli.algorithms.exploration.voronoi_partition import make_partition
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
from mapcli.model.grid import GridMap, all_unknown

Function = TypeVar("Function", bound=Callable[..., Any])
Arrays = TypeVar("Arrays", bound=tuple[Any, ...])

REASONS: dict[int, Reason] = {
    limits.MAX_STEPS: "max-steps",
    limits.MAX_DISTANCE: "max-distance",
    limits.COVERAGE: "coverage",
}

ROUNDS = 5000
"""Rounds of Algorithm 9.1 between two looks at the progress, and at Ctrl-C."""


LARGE = 20_000
"""Cells; plain Python explores a smaller map before numba would have been imported."""


def is_large(grid: GridMap, parameters: ExplorationParameters) -> bool:
    """Whether compiled loops pay for importing them (most of a second)."""
    work = 8 if parameters.strategy == "gain" else 1
    return grid.rows * grid.columns * work > LARGE


class ExplorationRun:
    """The status of one exploration (changes while it runs; see `explore.explore`)."""

    def __init__(
        self,
        world: GridMap,
        robots: Sequence[Cell],
        parameters: ExplorationParameters,
        known: GridMap | None,
        compiled: bool | None,
        *,
        keep_cells: bool = True,
    ) -> None:
        self.world, self.parameters, self.starts = world, parameters, tuple(robots)
        self.compiled = is_large(world, parameters) if compiled is None else compiled
        require_memory(world, parameters, robots=len(robots), keep_cells=keep_cells)
        self.before = known or all_unknown(world)
        self.state = self.views(make_state(world, known, parameters))
        cells = [self.index(cell) for cell in robots]
        self.homes = np.array(cells, dtype=np.int64)
        fov = field_of_view.make_field_of_view(self.state, parameters.sensor_range)
        self.planner = frontier.Planner(
            self.views(path_search.make_search(self.state)),
            self.views(make_partition(self.state, len(cells))),
            self.views(fov),
            self.views(
                goal_selection.make_chooser(parameters.strategy, self.state, fov, parameters.seed)
            ),
            self.views(make_viewpoints(self.state)),
        )
        self.robots = self.views(make_robots(cells, at_start=known is None))
        sensed = len(cells) * len(fov.seen) if keep_cells else 0
        self.trace = self.views(make_trace(sensed, len(cells)))
        if parameters.robot_radius:
            self.check_room(cells)
        mark_explorable = self.call(initialisation.mark_explorable)
        self.explorable = mark_explorable(self.state, self.planner.search, self.robots.cell)
        if known is not None:
            self.call(initialisation.register_known_map)(self.state)

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
        return (cell[0] + 1) * self.state.stride + cell[1] + 1

    def cell(self, index: int) -> Cell:
        row, column = divmod(int(index), self.state.stride)
        return row - 1, column - 1

    def check_room(self, cells: Sequence[int]) -> None:
        """Raise DataError when a robot is too large to stand anywhere it could get to."""
        for number, cell in enumerate(cells, start=1):
            if not self.call(initialisation.has_place_to_stand)(
                self.state, self.planner.search, cell
            ):
                row, column = self.cell(cell)
                raise DataError(
                    f"robot {number} at {row},{column} with a radius of "
                    f"{self.parameters.robot_radius:g} m fits nowhere that it could get to",
                    expected="a smaller radius, or another start",
                )

    def sense_at_start(self) -> None:
        """The steps before the first choice of a goal."""
        self._explore(limits.Limits(0, math.inf, path_search.NEVER), lambda coverage: None)

    def run(self, progress: Callable[[float], None]) -> None:
        """Explore until nobody has anywhere to go, and bring the robots to rest."""
        wanted, share = self.parameters, self.parameters.coverage
        self._explore(
            limits.Limits(
                path_search.NEVER if wanted.max_steps is None else wanted.max_steps,
                # A path of just the length allowed is allowed, whatever the rounding.
                (math.inf if wanted.max_distance is None else wanted.max_distance)
                / self.world.resolution + 1e-9,
                path_search.NEVER if share is None else math.ceil(share * self.explorable - 1e-9),
            ),
            progress,
        )  # fmt: skip
        if wanted.return_home:
            self._run_rounds(self.call(return_home.return_home), self.view(self.homes))
        self.call(return_home.record_stops)(self.robots, self.trace)

    def _explore(self, limit: limits.Limits, progress: Callable[[float], None]) -> None:
        """Algorithm 9.1 up to its end, with a look at the progress now and then."""
        explore = self.call(frontier.explore_frontier)
        self._run_rounds(
            lambda state, planner, robots, trace: explore(state, planner, limit, robots, trace),
            progress=lambda: progress(self.coverage),
        )

    def _run_rounds(
        self, loop: Callable[..., bool], *arguments: Any,
        progress: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        """Call a loop until it has come to its end, with room for each round in the trace."""
        ended = False
        while not ended:
            self.make_room()
            self.trace.counts[trace_columns.ROUNDS] = ROUNDS
            ended = loop(self.state, self.planner, self.robots, self.trace, *arguments)
            progress()

    def make_room(self) -> None:
        """Let the trace's columns hold another round."""
        round_ = self.state, self.planner.fov, self.robots, self.trace
        if not trace_columns.has_room(*round_):
            self.trace = self.views(with_room(self.trace, trace_columns.room_needed(*round_)))

    @property
    def coverage(self) -> float:
        """Share of the explorable cells that is known."""
        return int(self.state.counts[KNOWN_EXPLORABLE]) / max(self.explorable, 1)

    @property
    def reason(self) -> Reason:
        """Why nobody had anywhere to go."""
        held_back = self.trace.counts[trace_columns.HELD_BACK]
        if self.state.counts[FRONTIER_SIZE] == 0:
            return "complete"
        return REASONS.get(held_back, "unreachable")

    def result(self, reason: Reason, plan: tuple[NextGoal, ...] | None = None) -> Exploration:
        """What happened, and what is known now."""
        left = self.frontier_cells()
        del self.planner  # its memory may be larger than the maps'
        steps = read_steps(self.state, self.trace, self.world)
        away = [k for k, cell in enumerate(self.homes) if cell != self.robots.cell[k]]
        return Exploration(
            robots=self.starts,
            before=self.before,
            after=known_at_the_end(self.state, self.world, self.before),
            steps=steps,
            frontier=left,
            plan=plan,
            explorable=explorable_cells(self.state),
            summary=ExplorationSummary(
                reason=reason,
                steps=len(steps),
                time_steps=int(self.trace.counts[trace_columns.TIME]),
                distance_cells=len(steps.path),
                distance_m=float(move_lengths(steps).sum()) * self.world.resolution,
                known_cells=int(self.state.counts[KNOWN_CELLS]),
                coverage=self.coverage,
                unreachable=sum(cell.distance is None for cell in left),
                corrected=int(self.state.counts[CONTRADICTED]),
                not_home=len(away) if self.parameters.return_home else 0,
            ),
        )

    def frontier_cells(self) -> tuple[FrontierCell, ...]:
        """The frontier, with the nearest robot (ties: the first) and the way to it."""
        search, cells = self.planner.search, noted_cells(self.state, ON_FRONTIER)
        if len(cells) == 0:
            return ()
        nearest = np.full(len(cells), path_search.NEVER)
        robots = np.zeros(len(cells), np.int64)
        for robot, start in enumerate(np.asarray(self.robots.cell).tolist()):
            self.call(path_search.search_everything)(self.state, search, start)
            moves = np.asarray(search.mark)[cells] - search.base[0]
            fits = (np.asarray(self.state.inflated)[cells] == 0) | (moves == 0)
            nearer = (moves >= 0) & fits & (moves < nearest)
            nearest[nearer], robots[nearer] = moves[nearer], robot
        found = zip(cells.tolist(), robots.tolist(), nearest.tolist(), strict=True)
        return tuple(self.frontier_cell(*one) for one in found)

    def frontier_cell(self, cell: int, robot: int, moves: int) -> FrontierCell:
        unknown = int(self.call(unknown_neighbours)(self.state, cell))
        if moves == path_search.NEVER:
            return FrontierCell(self.cell(cell), unknown, None, None, None)
        return FrontierCell(self.cell(cell), unknown, robot, moves, self.priority(cell, moves))

    def priority(self, cell: int, moves: int) -> float | None:
        """Worth of a frontier cell per path length."""
        utility = self.call(goal_selection.reported_utility)
        planner = self.planner
        return utility(self.state, planner.fov, planner.chooser, cell) / moves if moves else None

    def next_goals(self) -> tuple[NextGoal, ...]:
        """Where each robot would go next, in the order in which they choose."""
        planned = []
        for robot in range(len(self.homes)):
            choose = self.call(frontier.choose_goal)
            goal = choose(self.state, self.planner, self.robots, robot)
            if goal.cell == trace_columns.NOWHERE:
                continue
            self.robots.goal[robot] = goal.cell
            path = np.zeros(goal.moves, np.int64)
            write_path = self.call(path_search.write_path)
            write_path(self.state, self.planner.search, goal.cell, self.view(path), goal.moves)
            at_frontier = goal.kind == trace_columns.FRONTIER
            priority = self.priority(goal.cell, goal.moves) if at_frontier else None
            cells = [self.cell(cell) for cell in path.tolist()]
            planned.append(NextGoal(robot, self.cell(goal.cell), cells, priority))
        return tuple(planned)
