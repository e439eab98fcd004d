"""Algorithm 9.1 to the letter: slow, obvious, everything recomputed at each step.

The reference for `mapcli.algorithms.exploration.explore`.
It shares no code with it: cells are (row, column), maps are dictionaries, the frontier is looked
for in the whole grid, distances are worked out over the whole grid, and rays are followed one at
a time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np

Cell = tuple[int, int]
STRAIGHT = [(-1, 0), (0, -1), (0, 1), (1, 0)]
DIAGONAL = [(-1, -1), (-1, 1), (1, -1), (1, 1)]


@dataclass
class Robot:
    cell: Cell
    goal: Cell | None = None
    kind: str = "frontier"
    ahead: list[Cell] = field(default_factory=list)
    walked: list[Cell] = field(default_factory=list)
    origin: Cell | None = None
    frontier_size: int = 0
    priority: float | None = None
    collision: Cell | None = None


class LiteralFrontier:
    """Algorithm 9.1 by the book, for one robot or several."""

    def __init__(
        self,
        world: np.ndarray,
        robots: list[Cell],
        known: np.ndarray | None = None,
        *,
        strategy: str = "nearest",
        low: float = 0.5,
        sensor_range: int = 1,
        connectivity: int = 4,
        radius: float = 0.0,
        max_steps: int | None = None,
        seed: int = 0,
    ) -> None:
        self.rows, self.columns = world.shape
        self.low = np.float32(low)
        self.world = {c: world[c] for c in self.all_cells() if not np.isnan(world[c])}
        known = np.full_like(world, np.nan) if known is None else known
        self.grid = {c: known[c] for c in self.all_cells() if not np.isnan(known[c])}
        self.sensed: set[Cell] = set()  # and stayed unknown
        self.seed = seed
        self.strategy, self.range, self.radius = strategy, sensor_range, radius
        self.moves = STRAIGHT + (DIAGONAL if connectivity == 8 else [])
        self.max_steps = math.inf if max_steps is None else max_steps
        self.robots = [Robot(cell, origin=cell) for cell in robots]
        self.steps: list[dict[str, Any]] = []
        self.time = 0
        self.sensed_from: set[Cell] = set()
        if not self.grid:
            for robot in self.robots:
                robot.goal, robot.kind = robot.cell, "start"

    def all_cells(self) -> Iterable[Cell]:
        return [(r, c) for r in range(self.rows) for c in range(self.columns)]

    # --- what is what -------------------------------------------------------------------------

    def neighbours(self, cell: Cell) -> list[Cell]:
        near = [(cell[0] + r, cell[1] + c) for r, c in STRAIGHT]
        return [(r, c) for r, c in near if 0 <= r < self.rows and 0 <= c < self.columns]

    def is_open(self, cell: Cell) -> bool:
        return cell in self.grid and self.grid[cell] < self.low

    def is_obstacle_of_world(self, cell: Cell) -> bool:
        return cell in self.world and not self.world[cell] < self.low

    def may_be_learned(self, cell: Cell) -> bool:
        return cell not in self.grid and cell not in self.sensed

    def unknown_neighbours(self, cell: Cell) -> int:
        return sum(self.may_be_learned(n) for n in self.neighbours(cell))

    def frontier(self) -> list[Cell]:
        """Lines 2-6."""
        return [c for c in self.all_cells() if self.is_open(c) and self.unknown_neighbours(c)]

    def is_inflated(self, cell: Cell) -> bool:
        near = range(-math.ceil(self.radius + 0.5), math.ceil(self.radius + 0.5) + 1)
        for down, right in ((r, c) for r in near for c in near if (r, c) != (0, 0)):
            other = (cell[0] + down, cell[1] + right)
            gap = math.hypot(max(abs(down) - 0.5, 0), max(abs(right) - 0.5, 0))
            if other in self.grid and not self.is_open(other) and gap < self.radius - 1e-9:
                return True
        return False

    # --- motion -------------------------------------------------------------------------------

    def may_enter(self, cell: Cell, there: Cell) -> bool:
        return self.is_open(there) and (not self.is_inflated(there) or self.is_inflated(cell))

    def beside(self, cell: Cell, there: Cell) -> list[Cell]:
        """The two cells beside a diagonal move."""
        if cell[0] == there[0] or cell[1] == there[1]:
            return []
        return [(cell[0], there[1]), (there[0], cell[1])]

    def can_move(self, cell: Cell, there: Cell) -> bool:
        return all(self.may_enter(cell, c) for c in [there, *self.beside(cell, there)])

    def distances(self, start: Cell, as_point: bool = False) -> dict[Cell, int]:
        """Path length in cells to all cells that can be reached; a robot on inflated cells takes
        the shortest way off them."""
        if as_point:
            radius, self.radius = self.radius, 0
            distances, self.radius = self.distances(start), radius
            return distances
        distances, layer, out = {start: 0}, [start], not self.is_inflated(start)
        while layer:
            after = []
            for cell in layer:
                if self.is_inflated(cell) and out:
                    continue
                for down, right in self.moves:
                    there = (cell[0] + down, cell[1] + right)
                    if there not in distances and self.can_move(cell, there):
                        distances[there] = distances[cell] + 1
                        after.append(there)
            out = out or any(not self.is_inflated(cell) for cell in after)
            layer = after
        return distances

    def leads_on(self, cell: Cell, distances: dict[Cell, int]) -> bool:
        out = min((d for c, d in distances.items() if not self.is_inflated(c)), default=math.inf)
        return not self.is_inflated(cell) or distances[cell] < out

    def path(self, goal: Cell, distances: dict[Cell, int]) -> list[Cell]:
        """The canonical shortest path, without the robot's cell, with the goal."""
        path: list[Cell] = []
        cell = goal
        while distances[cell]:
            path.insert(0, cell)
            for down, right in self.moves:
                before = (cell[0] + down, cell[1] + right)
                if (
                    distances.get(before) == distances[cell] - 1
                    and self.leads_on(before, distances)
                    and self.can_move(before, cell)
                ):
                    cell = before
                    break
        return path

    # --- choice -------------------------------------------------------------------------------

    def random_rank(self, cell: Cell) -> int:
        """Drawn from the seed, the number of known cells and the cell's place on the map."""
        prime, place = 2**31 - 1, (cell[0] + 1) * (self.columns + 2) + cell[1] + 1
        x = (self.seed + 48271 * len(self.grid)) % prime
        for addend in (69621 * place + 1, 16807, 40692):
            x = (x**2 + addend) % prime
        return 1 + x % 2**16

    def utility(self, cell: Cell) -> int:
        if self.strategy == "nearest":
            return 1
        if self.strategy == "priority":
            return self.unknown_neighbours(cell)
        seen = self.look(cell, lambda c: self.may_be_learned(c) or self.is_open(c))
        return sum(self.may_be_learned(c) for c in seen)

    def choose(self, number: int) -> None:
        """Line 8: the robot's own part of the frontier first, then anywhere."""
        robot = self.robots[number]
        mine = self.distances(robot.cell)
        taken = {r.goal for r in self.robots if r is not robot}
        free = [
            c for c in self.frontier()
            if c in mine and c not in taken and (mine[c] == 0 or not self.is_inflated(c))
        ]  # fmt: skip
        all_distances = [self.distances(r.cell, as_point=True) for r in self.robots]

        def is_nearest(cell: Cell) -> bool:
            order = [(d[cell], k) for k, d in enumerate(all_distances) if cell in d]
            return min(order)[1] == number

        own = [c for c in free if is_nearest(c)]
        candidates = own or free
        if not candidates:
            if self.radius > 0.5:
                self.go_to_viewpoint(robot, mine, taken)
            return
        frontier_size = len(self.frontier())

        def rank(cell: Cell) -> Any:
            d = mine[cell]
            if self.strategy == "random":
                return (-self.random_rank(cell) if d else -math.inf, d, cell)
            value = Fraction(self.utility(cell), d) if d else math.inf
            return (-value, d, cell)

        goal = min(candidates, key=rank)
        robot.goal, robot.kind, robot.ahead = goal, "frontier", self.path(goal, mine)
        robot.frontier_size, robot.collision = frontier_size, None
        utility = (
            self.unknown_neighbours(goal)
            if self.strategy in ("nearest", "random")
            else self.utility(goal)
        )
        robot.priority = utility / mine[goal] if mine[goal] else None
        self.stop_before_collision(robot)

    def go_to_viewpoint(self, robot: Robot, mine: dict[Cell, int], taken: set[Cell | None]) -> None:
        """To the nearest cell where the robot fits, where nobody has sensed, and from which an
        unknown cell is to be seen."""
        for cell in sorted(mine, key=lambda c: (mine[c], c)):
            fits = mine[cell] == 0 or not self.is_inflated(cell)
            if fits and cell not in taken and self.is_viewpoint(cell):
                robot.goal, robot.kind, robot.ahead = cell, "lookout", self.path(cell, mine)
                robot.frontier_size, robot.priority = len(self.frontier()), None
                self.stop_before_collision(robot)
                return

    def is_viewpoint(self, cell: Cell) -> bool:
        seen = self.look(cell, self.is_open)
        return cell not in self.sensed_from and any(self.may_be_learned(c) for c in seen)

    def stop_before_collision(self, robot: Robot) -> None:
        here = robot.cell
        for k, there in enumerate(robot.ahead):
            for cell in [there, *self.beside(here, there)]:
                if self.is_obstacle_of_world(cell):
                    robot.ahead, robot.goal = robot.ahead[:k], here
                    robot.kind, robot.collision = "blocked", cell
                    return
            here = there

    def is_goal_valid(self, robot: Robot) -> bool:
        fits = robot.cell == robot.goal or not self.is_inflated(robot.goal)
        if robot.kind == "frontier":
            return robot.goal in self.frontier() and fits
        if robot.kind == "lookout":
            return fits and self.is_viewpoint(robot.goal)
        return robot.kind != "blocked" or self.is_open(robot.collision)

    # --- sensing ------------------------------------------------------------------------------

    def look(self, cell: Cell, passes: Any) -> set[Cell]:
        if self.range == 1:
            near = [(cell[0] + r, cell[1] + c) for r in (-1, 0, 1) for c in (-1, 0, 1)]
            return {(r, c) for r, c in near if 0 <= r < self.rows and 0 <= c < self.columns}
        return look_by_rays(cell, self.range, (self.rows, self.columns), passes)

    def sense(self, number: int) -> None:
        """Lines 10-12."""
        robot, found, stayed = self.robots[number], [], []
        passes = lambda c: c in self.world and self.world[c] < self.low  # noqa: E731
        for cell in sorted(self.look(robot.cell, passes)):
            if cell not in self.world:
                if self.may_be_learned(cell):
                    self.sensed.add(cell)
                    stayed.append(cell)
            elif self.grid.get(cell) != self.world[cell]:
                self.grid[cell] = self.world[cell]
                found.append((*cell, float(str(self.world[cell]))))
        self.sensed_from.add(robot.cell)
        self.record(number, robot.kind, found, stayed)

    def record(self, number: int, kind: str, found: list[Any], stayed: list[Cell]) -> None:
        robot = self.robots[number]
        self.steps.append(
            {
                "robot": number, "kind": kind, "time": self.time, "from": robot.origin,
                "goal": robot.cell, "path": robot.walked, "sensed": found, "unknowable": stayed,
                "frontier_size": robot.frontier_size, "priority": robot.priority,
            }
        )  # fmt: skip
        robot.origin, robot.walked, robot.goal = robot.cell, [], None

    # --- the loop -----------------------------------------------------------------------------

    def run(self) -> LiteralFrontier:
        while True:  # 1
            for robot in self.robots:
                if robot.goal is not None and not self.is_goal_valid(robot):
                    robot.goal, robot.ahead = None, []
            is_point = self.radius <= 0.5  # others may see something from where they fit
            if not self.frontier() and is_point and self.are_idle():  # 2-7
                break
            for number, robot in enumerate(self.robots):
                under_way = sum(r.goal is not None for r in self.robots)
                if robot.goal is None and len(self.steps) + under_way < self.max_steps:
                    self.choose(number)  # 8
            if self.are_idle():  # no way to the frontier, or a limit
                break
            self.move()  # 9
            for number, robot in enumerate(self.robots):
                if robot.goal is not None and not robot.ahead:
                    if self.is_goal_valid(robot):
                        self.sense(number)  # 10-12
                    else:
                        robot.goal = None
        for number, robot in enumerate(self.robots):
            if robot.walked:
                robot.priority = None
                self.record(number, "stop", [], [])
        return self

    def are_idle(self) -> bool:
        return all(robot.goal is None for robot in self.robots)

    def move(self) -> None:
        """One time step, unless somebody is there already or cannot go on."""
        for robot in self.robots:
            if robot.ahead and not self.can_move(robot.cell, robot.ahead[0]):
                robot.goal, robot.ahead = None, []
                return
        going = [robot for robot in self.robots if robot.goal is not None]
        if all(robot.ahead for robot in going):
            self.time += 1
            for robot in going:
                robot.cell = robot.ahead.pop(0)
                robot.walked.append(robot.cell)


def look_by_rays(origin: Cell, reach: int, shape: tuple[int, int], passes: Any) -> set[Cell]:
    """What rays from the middle of a cell enter, each up to the first cell it does not pass.

    Between two neighbouring corners of cells all rays enter the same cells, so one ray between
    each two is enough.
    """
    near = range(1, 2 * reach + 2, 2)
    corners = {Fraction(aside, ahead) for aside in near for ahead in near if aside <= ahead}
    slopes = sorted({Fraction(0), Fraction(1)} | corners)
    seen = {origin}
    for low, high in pairwise(slopes):
        slope = (low + high) / 2
        for down, right in DIAGONAL:
            for steep in (True, False):
                seen |= follow_ray(origin, reach, shape, passes, slope, down, right, steep)
    return seen


def follow_ray(
    origin: Cell, reach: int, shape: tuple[int, int], passes: Any, slope: Fraction,
    down: int, right: int, steep: bool,
) -> set[Cell]:  # fmt: skip
    seen = set()
    for ahead in range(1, reach + 1):
        half = Fraction(1, 2)
        first = math.floor(slope * (ahead - half) + half)
        last = math.floor(slope * (ahead + half) + half)
        for aside in range(first, last + 1):
            rows, columns = (ahead, aside) if steep else (aside, ahead)
            cell = (origin[0] + down * rows, origin[1] + right * columns)
            on_map = 0 <= cell[0] < shape[0] and 0 <= cell[1] < shape[1]
            if not on_map or rows**2 + columns**2 > reach**2:
                return seen
            seen.add(cell)
            if not passes(cell):
                return seen
    return seen
