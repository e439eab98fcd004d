"""Floor plans of buildings that do not exist, drawn from random numbers, in cells of 5 cm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mapcli import GridMap

CELL = 0.05
"""Metres."""

WALL = 0.1
"""Metres that walls are thick."""

Plan = Callable[[np.random.Generator], GridMap]


class Floor:
    """A rectangle of so many metres within walls, in which boxes are put up (mutable)."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        self.cells = np.zeros((round(height / CELL), round(width / CELL)), dtype=np.float32)
        for side in ((0, 0, width, WALL), (0, height - WALL, width, height),
                     (0, 0, WALL, height), (width - WALL, 0, width, height)):  # fmt: skip
            self.box(*side)

    def box(self, x0: float, y0: float, x1: float, y1: float, solid: float = 1.0) -> None:
        """Solid, or open, from one corner to the other."""
        left, bottom, right, top = (max(round(value / CELL), 0) for value in (x0, y0, x1, y1))
        self.cells[bottom:top, left:right] = solid

    def grid(self) -> GridMap:
        return GridMap(self.cells[::-1].copy(), CELL)


def rooms(rng: np.random.Generator) -> GridMap:
    """Furnished rooms on both sides of a corridor, one door each."""
    depth, corridor = rng.uniform(3.5, 5), rng.uniform(1.8, 2.4)
    widths = rng.uniform(3, 5.5, rng.integers(3, 6))
    floor = Floor(float(widths.sum()) + WALL, 2 * depth + corridor)
    for wall, outer, side in ((depth, 0.0, -1), (depth + corridor, floor.height, 1)):
        floor.box(0, wall, floor.width, wall + WALL)
        x = 0.0
        for width in widths:
            floor.box(x, min(wall, outer), x + WALL, max(wall, outer))
            door = x + rng.uniform(0.4, width - 1.6)
            floor.box(door, wall, door + 1.2, wall + WALL, 0.0)
            long, deep = rng.uniform(0.6, 1.6), rng.uniform(0.3, 0.7)
            left = x + rng.uniform(0.2, width - long)
            low = outer - deep - WALL if side > 0 else outer + WALL
            floor.box(left, low, left + long, low + deep)
            x += width
    return floor.grid()


def corridor(rng: np.random.Generator) -> GridMap:
    """A long corridor in which doors lie 15 cm deep in the walls, metres apart."""
    length, width = rng.uniform(28, 38), rng.uniform(1.8, 2.4)
    floor = Floor(length, width + 0.5)
    for low in (0.0, floor.height - 0.25):
        floor.box(0, low, length, low + 0.25)
        x = rng.uniform(1, 4)
        while x < length - 2:
            inside = (low + WALL, low + 0.25) if low == 0 else (low, low + 0.25 - WALL)
            floor.box(x, inside[0], x + 1, inside[1], 0.0)
            x += rng.uniform(3, 9)
    return floor.grid()


def aisles(rng: np.random.Generator) -> GridMap:
    """Shelves that are all alike, and as far apart; a few crates beside the walls."""
    count, long = int(rng.integers(3, 6)), rng.uniform(7, 11)
    deep, aisle = rng.uniform(0.8, 1.2), rng.uniform(1.8, 2.4)
    floor = Floor(long + 4.4, count * (deep + aisle) + aisle)
    for k in range(count):
        low = aisle + k * (deep + aisle)
        floor.box(2.2, low, 2.2 + long, low + deep)
    for _ in range(3):
        x, size = rng.uniform(1, floor.width - 2), rng.uniform(0.3, 0.5)
        low = WALL if rng.random() < 0.5 else floor.height - WALL - size
        floor.box(x, low, x + size, low + size)
    return floor.grid()


def hall(rng: np.random.Generator) -> GridMap:
    """A hall with pillars and boxes anywhere."""
    floor = Floor(rng.uniform(14, 22), rng.uniform(11, 16))
    for _ in range(int(rng.integers(7, 13))):
        x, y = rng.uniform(1.5, floor.width - 3), rng.uniform(1.5, floor.height - 3)
        floor.box(x, y, x + rng.uniform(0.3, 1.4), y + rng.uniform(0.3, 1.4))
    return floor.grid()


PLANS: tuple[Plan, ...] = (rooms, hall, aisles, corridor, rooms)
"""The five worlds of a kind of trouble that is not one of floor plans."""
