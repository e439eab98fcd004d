"""Shortest paths from cell to cell around known obstacles, by breadth-first search (Activity 9.2).

A robot moves over known open cells only, and keeps so far from known obstacles that it does not
touch them. Diagonal moves, where they are allowed, need both cells beside them as well: no
cutting of corners. A robot that finds itself too close to an obstacle, which it may have learned
only just now, leaves by the shortest way to a cell where it fits: up to the number of moves that
this takes, it may pass through inflated cells; no further.

Of the shortest paths to a cell one is canonical: going back from the goal, each cell's
predecessor is the first one on a shortest path, straight moves before diagonal ones, then the
smallest row, then the smallest column.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapcli.algorithms.exploration.exploration_state import OPEN, Cells, ExplorationState

NEVER = 2**31 - 1


class PathSearch(NamedTuple):
    """Scratch memory of the breadth-first search from one robot (mutable).

    A search never clears its memory: cells reached by it hold at least `base`, and earlier
    searches left less, so that its cost is that of the cells it reaches.

    Attributes:
        mark: base + moves from the robot, where the search has been (int32).
        queue: the cells reached by the last moves, in order (int32).
        base, depth, clear: shape (1,) (int64); `depth` is how many moves the search has
            gone, `clear` after how many moves a robot that stands on inflated cells has left
            them, 0 when it stands on none.
    """

    mark: Cells
    queue: Cells
    base: Cells
    depth: Cells
    clear: Cells


def make_search(state: ExplorationState) -> PathSearch:
    """Memory for searches."""
    size = len(state.known)
    one = np.zeros(1, np.int64)
    return PathSearch(
        np.zeros(size, np.int32), np.zeros(size, np.int32), one + 1, one.copy(), one.copy()
    )


def start_search(state: ExplorationState, search: PathSearch, cell: int) -> int:
    """Begin at a cell; returns the length of the queue, 1.

    What the search before had reached is forgotten: its paths must have been read by now.
    """
    forget_search(search)
    search.clear[0] = NEVER if state.inflated[cell] else 0
    search.mark[cell] = search.base[0]
    search.queue[0] = cell
    return 1


def forget_search(search: PathSearch) -> None:
    """Nothing is reached any longer."""
    search.base[0] += search.depth[0] + 2
    search.depth[0] = 0
    if search.base[0] > NEVER - 2 * len(search.mark):
        for place in range(len(search.mark)):
            search.mark[place] = 0
        search.base[0] = 1


def expand(
    state: ExplorationState, search: PathSearch, begin: int, end: int, moves: int
) -> tuple[int, int]:
    """Reach the cells one move beyond queue[begin:end], themselves `moves` - 1 moves from the
    robot; returns where in the queue they are."""
    mark, queue, base = search.mark, search.queue, search.base[0]
    first = reached = next_place(state, begin, end)
    search.depth[0] = moves
    for k in range(begin, end):
        cell = queue[k]
        if not is_expandable(state, search, cell):
            continue
        for m in range(len(state.moves)):
            there = cell + state.moves[m]
            if mark[there] < base and can_move(state, cell, there):
                mark[there] = base + moves
                queue[reached] = there
                reached += 1
                if not state.inflated[there] and search.clear[0] > moves:
                    search.clear[0] = moves
    return first, reached


def next_place(state: ExplorationState, begin: int, end: int) -> int:
    """Where in a queue to write the neighbours of queue[begin:end]: at its front, as soon as there
    is room for all, so that the memory touched is that of a few moves and not of the whole map."""
    return 0 if begin >= len(state.moves) * (end - begin) else end


def is_expandable(state: ExplorationState, search: PathSearch, cell: int) -> bool:
    """Whether paths go on from a reached cell: not from a inflated one once the robot is out."""
    return not state.inflated[cell] or search.mark[cell] - search.base[0] < search.clear[0]


def can_move(state: ExplorationState, cell: int, there: int) -> bool:
    """Whether a robot may move to a neighbouring cell."""
    if not may_enter(state, cell, there):
        return False
    if not is_diagonal(state, cell, there):
        return True
    beside = beside_diagonal(state, cell, there)
    return may_enter(state, cell, beside) and may_enter(state, cell, cell + there - beside)


def is_diagonal(state: ExplorationState, cell: int, there: int) -> bool:
    step = abs(there - cell)
    return step != 1 and step != state.stride


def beside_diagonal(state: ExplorationState, cell: int, there: int) -> int:
    """Of the two cells beside a diagonal move the one in the row of `cell`; the other one is
    cell + there - this."""
    return cell + (1 if (there - cell) % state.stride == 1 else -1)


def may_enter(state: ExplorationState, cell: int, there: int) -> bool:
    """Known to be open, and with room for the robot unless it has none where it stands."""
    return state.known[there] == OPEN and (not state.inflated[there] or state.inflated[cell] > 0)


def write_path(
    state: ExplorationState, search: PathSearch, goal: int, path: Cells, end: int
) -> None:
    """Write the canonical path to a reached cell into path[...:end], the robot's cell left out."""
    cell, place = goal, end
    while search.mark[cell] > search.base[0]:
        place -= 1
        path[place] = cell
        cell = predecessor(state, search, cell)


def predecessor(state: ExplorationState, search: PathSearch, cell: int) -> int:
    """The cell before a reached cell on its canonical path."""
    for m in range(len(state.moves)):
        before = cell + state.moves[m]
        if (
            search.mark[before] == search.mark[cell] - 1
            and is_expandable(state, search, before)
            and can_move(state, before, cell)
        ):
            return before
    return -1  # cannot be: the search reached the cell from somewhere


def moves_to(search: PathSearch, cell: int) -> int:
    """Path length in cells to a reached cell; -1 where the search has not been."""
    return max(search.mark[cell] - search.base[0], -1)


def search_everything(state: ExplorationState, search: PathSearch, cell: int) -> None:
    """Reach everything that can be reached from a cell."""
    begin, end, moves = 0, start_search(state, search, cell), 0
    while begin < end:
        moves += 1
        begin, end = expand(state, search, begin, end, moves)
