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
    ExplorationState,
    inflate,
)
from mapcli.algorithms.exploration.frontier import update_frontier
from mapcli.algorithms.exploration.path_search import PathSearch


def register_known_map(state: ExplorationState) -> None:
    """The frontier, the inflated cells and the counts of a map that is partly known already."""
    for cell in range(len(state.known)):
        kind = state.known[cell]
        if kind == OBSTACLE:
            inflate(state, cell, 1)
        elif kind == OPEN:
            update_frontier(state, cell)
        if kind in (OPEN, OBSTACLE):
            state.counts[KNOWN_CELLS] += 1
            state.counts[KNOWN_EXPLORABLE] += state.explorable[cell]


def mark_explorable(state: ExplorationState, search: PathSearch, cells: Cells) -> int:
    """Mark what robots at `cells` can get to know, were they points, and return how much it is:
    the open cells that they can reach in the world, and those beside them (left, right, up,
    down), as far as the world knows them."""
    reached = 0
    for robot in range(len(cells)):
        reached = flood_fill(state, search, cells[robot], reached)
    count = 0
    for k in range(reached):
        cell = search.queue[k]
        count += mark_cell(state, cell)
        for m in range(4):  # the straight moves
            count += mark_cell(state, cell + state.moves[m])
    for k in range(reached):
        search.mark[search.queue[k]] = 0
    return count


def mark_cell(state: ExplorationState, cell: int) -> int:
    """Mark a cell that the world knows; returns whether it is new."""
    known = state.world[cell] != UNKNOWABLE and state.world[cell] != OUTSIDE
    new = known and not state.explorable[cell]
    if new:
        state.explorable[cell] = 1
    return int(new)


def flood_fill(state: ExplorationState, search: PathSearch, start: int, reached: int) -> int:
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
            there = cell + state.moves[m]
            if search.mark[there] == 0 and is_passable(state, there):
                search.mark[there] = 1
                search.queue[reached] = there
                reached += 1
    return reached


def is_passable(state: ExplorationState, cell: int) -> bool:
    """Whether a point could be on a cell: the world says that it is open, or does not know and
    the robots have been told so."""
    if state.world[cell] == UNKNOWABLE:
        return state.known[cell] == OPEN
    return state.world[cell] == OPEN


def has_place_to_stand(state: ExplorationState, search: PathSearch, start: int) -> bool:
    """Whether there is a cell that a robot at `start` could reach, were it a point, and where it
    touches no obstacle of the world."""
    reached = flood_fill(state, search, start, 0)
    found = False
    for k in range(reached):
        cell = search.queue[k]
        search.mark[cell] = 0
        found = found or fits_in_world(state, cell)
    return found


def fits_in_world(state: ExplorationState, cell: int) -> bool:
    """Whether a robot on a cell touches no obstacle of the world."""
    row, column = cell // state.stride, cell % state.stride
    for k in range(len(state.disc_rows)):
        r, c = row + state.disc_rows[k], column + state.disc_columns[k]
        inside = 1 <= r <= state.rows and 1 <= c <= state.columns
        if inside and state.world[r * state.stride + c] == OBSTACLE:
            return False
    return True
