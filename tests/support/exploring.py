"""Worlds to explore, and explorations as records, for the tests of Algorithm 9.1."""

from __future__ import annotations

from typing import Any

import numpy as np
from conftest import FIXTURES
from hypothesis import strategies as st

from mapcli import GridMap, load_map
from mapcli.model.exploration import Exploration

BOOK = {name: load_map(FIXTURES / f"{name}.txt").grid for name in ("fig9_4", "fig9_9", "fig9_10")}

STRATEGIES = ["nearest", "priority", "gain"]
CONTENTS = [0.0, 0.1, 0.2, 0.3, 0.8, 1.0, float("nan")]


@st.composite
def worlds(draw: st.DrawFn, largest: int = 7, smallest: int = 1) -> np.ndarray:
    """Small worlds, from nearly empty to crowded, with cells that the world does not know."""
    rows, columns = draw(st.integers(smallest, largest)), draw(st.integers(smallest, largest))
    contents = draw(
        st.sampled_from([CONTENTS, [0.1, 0.1, 0.1, 0.9], [0.1, 0.9, float("nan")], [0.1]])
    )
    cells = draw(
        st.lists(st.sampled_from(contents), min_size=rows * columns, max_size=rows * columns)
    )
    return np.array(cells, dtype=np.float32).reshape(rows, columns)


def open_cells(*maps: np.ndarray) -> list[tuple[int, int]]:
    shape = maps[0].shape
    return [c for c in np.ndindex(shape) if all(m[c] < np.float32(0.5) for m in maps)]


@st.composite
def exploration_cases(draw: st.DrawFn, robots: int = 1, smallest: int = 1) -> dict[str, Any]:
    """A world, robots in it, and sometimes what they know at the start, which may be wrong."""
    world = draw(worlds(smallest=smallest).filter(lambda w: len(open_cells(w)) >= 1))
    known = None
    if draw(st.booleans()):
        known = world.copy()
        hidden = draw(st.lists(st.booleans(), min_size=world.size, max_size=world.size))
        known.ravel()[np.array(hidden)] = np.nan
        if draw(st.booleans()):
            wrong = draw(st.lists(st.integers(0, world.size - 1), max_size=4))
            for k in wrong:
                known.ravel()[k] = draw(st.sampled_from(CONTENTS))
    standing = open_cells(world) if known is None else open_cells(world, known)
    count = min(robots, len(standing))
    if not count:
        known, standing, count = None, open_cells(world), 1
    cells = draw(st.lists(st.sampled_from(standing), min_size=1, max_size=count, unique=True))
    return {"world": world, "known": known, "robots": cells}


def as_records(exploration: Exploration) -> list[dict[str, Any]]:
    return [
        {
            "robot": s.robot, "kind": s.kind, "time": s.time, "from": s.origin, "goal": s.goal,
            "path": [tuple(c) for c in s.path.tolist()],
            "sensed": [
                (*c, float(str(p)))
                for c, p in zip(s.cells.tolist(), s.probabilities, strict=True)
            ],
            "unknowable": [tuple(c) for c in s.unknowable.tolist()],
            "frontier_size": s.frontier_size, "priority": s.priority,
        }
        for s in exploration.steps
    ]  # fmt: skip


def grid_of(*rows: str) -> GridMap:
    """`.` open, `#` obstacle, `?` unknown."""
    contents = {".": 0.1, "#": 1.0, "?": np.nan}
    return GridMap(np.array([[contents[c] for c in row] for row in rows], dtype=np.float32))
