"""What is worked out once, over the whole map, before the first step of an exploration."""

from __future__ import annotations

from mapcli.algorithms.exploration.exploration_state import (
    EXPLORABLE,
    KIND,
    KNOWN_CELLS,
    KNOWN_EXPLORABLE,
    OBSTACLE,
    OPEN,
    OUTSIDE,
    UNKNOWABLE,
    Cells,
    ExplorationState,
    inflate,
    is_explorable,
)
from mapcli.algorithms.exploration.frontier import update_frontier
from mapcli.algorithms.exploration.path_search import PathSearch, forget_search, next_place


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
            state.counts[KNOWN_EXPLORABLE] += is_explorable(state, cell)


def mark_explorable(state: ExplorationState, search: PathSearch, cells: Cells) -> int:
    """Mark what robots at `cells` can get to know, were they points, and return how much it is:
    the open cells that they can reach in the world, and those beside them (left, right, up,
    down), as far as the world knows them."""
    forget_search(search)
    count = 0
    for robot in range(len(cells)):
        begin, end = 0, flood_start(search, cells[robot])
        while begin < end:
            for k in range(begin, end):
                cell = search.queue[k]
                count += mark_cell(state, cell)
                for m in range(4):  # the straight moves
                    count += mark_cell(state, cell + state.moves[m])
            begin, end = flood(state, search, begin, end)
    return count


def mark_cell(state: ExplorationState, cell: int) -> int:
    """Mark a cell that the world knows; returns whether it is new."""
    kind = state.world[cell] & KIND
    new = kind != UNKNOWABLE and kind != OUTSIDE and not is_explorable(state, cell)
    if new:
        state.world[cell] |= EXPLORABLE
    return int(new)


def flood_start(search: PathSearch, start: int) -> int:
    """Put a cell at the front of the queue, unless it was reached before; returns how many that
    are."""
    is_new = search.mark[start] < search.base[0]
    search.mark[start] = search.base[0]
    search.queue[0] = start
    return int(is_new)


def flood(state: ExplorationState, search: PathSearch, begin: int, end: int) -> tuple[int, int]:
    """Reach the cells beside queue[begin:end]; returns where in the queue they are."""
    first = reached = next_place(state, begin, end)
    for k in range(begin, end):
        cell = search.queue[k]
        for m in range(4):  # the straight moves
            there = cell + state.moves[m]
            if search.mark[there] < search.base[0] and is_passable(state, there):
                search.mark[there] = search.base[0]
                search.queue[reached] = there
                reached += 1
    return first, reached


def is_passable(state: ExplorationState, cell: int) -> bool:
    """Whether a point could be on a cell: the world says that it is open, or does not know and
    the robots have been told so."""
    kind = state.world[cell] & KIND
    return kind == OPEN or (kind == UNKNOWABLE and state.known[cell] == OPEN)


def has_place_to_stand(state: ExplorationState, search: PathSearch, start: int) -> bool:
    """Whether there is a cell that a robot at `start` could reach, were it a point, and where it
    touches no obstacle of the world."""
    forget_search(search)
    begin, end = 0, flood_start(search, start)
    while begin < end:
        for k in range(begin, end):
            if fits_in_world(state, search.queue[k]):
                return True
        begin, end = flood(state, search, begin, end)
    return False


def fits_in_world(state: ExplorationState, cell: int) -> bool:
    """Whether a robot on a cell touches no obstacle of the world."""
    row, column = cell // state.stride, cell % state.stride
    for k in range(len(state.disc_rows)):
        r, c = row + state.disc_rows[k], column + state.disc_columns[k]
        inside = 1 <= r <= state.rows and 1 <= c <= state.columns
        if inside and state.world[r * state.stride + c] & KIND == OBSTACLE:
            return False
    return True
