"""What is worked out once, over the whole map, before the first step of an exploration."""

from __future__ import annotations

from mapcli.algorithms.exploration.exploration_state import (
    KNOWN_CELLS,
    KNOWN_EXPLORABLE,
    OBSTACLE,
    OPEN,
    OUTSIDE,
    UNKNOWABLE,
    Cells,
    Field,
    crowd,
)
from mapcli.algorithms.exploration.frontier import refresh
from mapcli.algorithms.exploration.path_search import Search


def take_stock(field: Field) -> None:
    """The frontier, the crowded cells and the counts of a map that is partly known already."""
    for cell in range(len(field.known)):
        kind = field.known[cell]
        if kind == OBSTACLE:
            crowd(field, cell, 1)
        elif kind == OPEN:
            refresh(field, cell)
        if kind in (OPEN, OBSTACLE):
            field.counts[KNOWN_CELLS] += 1
            field.counts[KNOWN_EXPLORABLE] += field.explorable[cell]


def mark_explorable(field: Field, search: Search, cells: Cells) -> int:
    """Mark what robots at `cells` can get to know, were they points, and return how much it is:
    the open cells that they can reach in the world, and those beside them (left, right, up,
    down), as far as the world knows them."""
    reached = 0
    for robot in range(len(cells)):
        reached = reach(field, search, cells[robot], reached)
    count = 0
    for k in range(reached):
        cell = search.queue[k]
        count += mark_one(field, cell)
        for m in range(4):  # the straight moves
            count += mark_one(field, cell + field.moves[m])
    for k in range(reached):
        search.mark[search.queue[k]] = 0
    return count


def mark_one(field: Field, cell: int) -> int:
    """Mark a cell that the world knows; returns whether it is new."""
    known = field.world[cell] != UNKNOWABLE and field.world[cell] != OUTSIDE
    new = known and not field.explorable[cell]
    if new:
        field.explorable[cell] = 1
    return int(new)


def reach(field: Field, search: Search, start: int, reached: int) -> int:
    """Append the cells that can be reached from `start`, and were not before, to the queue."""
    head = reached
    if search.mark[start] == 0:
        search.mark[start] = 1
        search.queue[reached] = start
        reached += 1
    while head < reached:
        cell = search.queue[head]
        head += 1
        for m in range(4):  # the straight moves
            there = cell + field.moves[m]
            if search.mark[there] == 0 and is_passable(field, there):
                search.mark[there] = 1
                search.queue[reached] = there
                reached += 1
    return reached


def is_passable(field: Field, cell: int) -> bool:
    """Whether a point could be on a cell: the world says that it is open, or does not know and
    the robots have been told so."""
    if field.world[cell] == UNKNOWABLE:
        return field.known[cell] == OPEN
    return field.world[cell] == OPEN


def finds_room(field: Field, search: Search, start: int) -> bool:
    """Whether there is a cell that a robot at `start` could reach, were it a point, and where it
    touches no obstacle of the world."""
    reached = reach(field, search, start, 0)
    found = False
    for k in range(reached):
        cell = search.queue[k]
        search.mark[cell] = 0
        found = found or fits(field, cell)
    return found


def fits(field: Field, cell: int) -> bool:
    """Whether a robot on a cell touches no obstacle of the world."""
    row, column = cell // field.stride, cell % field.stride
    for k in range(len(field.disc_rows)):
        r, c = row + field.disc_rows[k], column + field.disc_columns[k]
        inside = 1 <= r <= field.rows and 1 <= c <= field.columns
        if inside and field.world[r * field.stride + c] == OBSTACLE:
            return False
    return True
