"""Algorithm 9.1 as the book prints it, its twelve lines in its order, and nothing else.

One robot that senses the eight cells around it. What the book leaves open is decided as everywhere
in mapcli: the nearest frontier cell is nearest along open cells (ties: smallest row, then smallest
column), cells beyond the edge are not unknown, a sensed cell that stays unknown does not come back,
and frontier cells that cannot be reached are no goals.
"""

from __future__ import annotations

import numpy as np

Cell = tuple[int, int]


def neighbours(cell: Cell, grid: np.ndarray) -> list[Cell]:
    """Left, right, up and down, as far as the map goes."""
    r, c = cell
    near = [(r - 1, c), (r, c - 1), (r, c + 1), (r + 1, c)]
    return [(i, j) for i, j in near if 0 <= i < grid.shape[0] and 0 <= j < grid.shape[1]]


def distances(robot: Cell, grid: np.ndarray, low: np.float32) -> dict[Cell, int]:
    """Moves over open cells to every cell that can be reached."""
    found, queue = {robot: 0}, [robot]
    for cell in queue:
        for there in neighbours(cell, grid):
            if there not in found and grid[there] < low:
                found[there] = found[cell] + 1
                queue.append(there)
    return found


def explore(
    environment: np.ndarray, grid: np.ndarray, robot: Cell, low: np.float32
) -> tuple[list[Cell], np.ndarray]:
    """The frontier cells that the robot goes to, and the completed map."""
    grid, sensed, goals = grid.copy(), set[Cell](), list[Cell]()
    while True:  # 1: loop
        frontier = []  # 2: frontier <- empty
        for c in [tuple(cell) for cell in np.argwhere(~np.isnan(grid)).tolist()]:  # 3: known cells
            is_unknown = [np.isnan(grid[n]) and n not in sensed for n in neighbours(c, grid)]
            if grid[c] < low and any(is_unknown):  # 4, 5: open, exists unknown neighbor of c
                frontier.append(c)  # 6: append c to frontier
        far = distances(robot, grid, low)
        frontier = [c for c in frontier if c in far]
        if not frontier:  # 7: exit if frontier empty
            return goals, grid
        closest = min(frontier, key=lambda c: (far[c], c))  # 8: cell in frontier nearest robot
        robot = closest  # 9: robot <- closest
        goals.append(robot)
        for c in np.ndindex(grid.shape):  # 10: for all unknown neighbors c of closest
            if max(abs(c[0] - robot[0]), abs(c[1] - robot[1])) <= 1 and np.isnan(grid[c]):
                sensed.add(c)  # 11: sense if c is occupied
                grid[c] = environment[c]  # 12: mark grid(c) with occupancy probability
