"""The exploration that users run takes the very steps of the literal Algorithm 9.1."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from literal_frontier import LiteralFrontier

from mapcli.algorithms.explore import explore
from mapcli.algorithms.explore_parameters import ExploreParameters
from mapcli.errors import DataError
from mapcli.model.exploration import Exploration
from mapcli.model.grid import GridMap

STRATEGIES = ["nearest", "priority", "gain"]
CONTENTS = [0.0, 0.1, 0.2, 0.3, 0.8, 1.0, float("nan")]


@st.composite
def worlds(draw: st.DrawFn, largest: int = 7) -> np.ndarray:
    """Small worlds, from nearly empty to crowded, with cells that the world does not know."""
    rows, columns = draw(st.integers(1, largest)), draw(st.integers(1, largest))
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
def expeditions(draw: st.DrawFn, robots: int = 1) -> dict[str, Any]:
    """A world, robots in it, and sometimes what they know at the start, which may be wrong."""
    world = draw(worlds().filter(lambda w: len(open_cells(w)) >= 1))
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


def assert_same(case: dict[str, Any], compiled: bool = False, **options: Any) -> None:
    literal = LiteralFrontier(case["world"], case["robots"], case["known"], **options).run()
    ours = {"robot_radius" if k == "radius" else k: v for k, v in options.items()}
    exploration = explore(
        GridMap(case["world"]),
        case["robots"],
        ExploreParameters(**ours),
        None if case["known"] is None else GridMap(case["known"]),
        compiled=compiled,
    )
    assert as_records(exploration) == literal.steps
    after = np.full_like(case["world"], np.nan)
    for cell, p in literal.grid.items():
        after[cell] = p
    np.testing.assert_array_equal(exploration.after.cells, after)
    assert [f.cell for f in exploration.frontier] == literal.frontier()


@pytest.mark.parametrize("strategy", STRATEGIES)
@settings(max_examples=150, deadline=None)
@given(case=expeditions())
def test_one_robot(strategy: str, case: dict[str, Any]) -> None:
    assert_same(case, strategy=strategy)


@pytest.mark.parametrize("strategy", STRATEGIES)
@settings(max_examples=60, deadline=None)
@given(case=expeditions(robots=3))
def test_several_robots(strategy: str, case: dict[str, Any]) -> None:
    assert_same(case, strategy=strategy)


@pytest.mark.parametrize("strategy", STRATEGIES)
@settings(max_examples=60, deadline=None)
@given(case=expeditions(robots=2), sensor_range=st.integers(2, 9))
def test_sensing_at_a_distance(strategy: str, case: dict[str, Any], sensor_range: int) -> None:
    assert_same(case, strategy=strategy, sensor_range=sensor_range)


@settings(max_examples=100, deadline=None)
@given(
    case=expeditions(robots=2),
    strategy=st.sampled_from(STRATEGIES),
    connectivity=st.sampled_from([4, 8]),
    sensor_range=st.sampled_from([1, 1, 3]),
    max_steps=st.sampled_from([None, None, 0, 1, 3, 6]),
)
def test_diagonal_moves_and_limits(case: dict[str, Any], **options: Any) -> None:
    assert_same(case, **options)


@settings(max_examples=150, deadline=None)
@given(
    case=expeditions(robots=2),
    strategy=st.sampled_from(STRATEGIES),
    connectivity=st.sampled_from([4, 8]),
    sensor_range=st.sampled_from([1, 4]),
    radius=st.sampled_from([0.4, 0.6, 1.0, 1.6]),
)
def test_robots_with_a_radius(case: dict[str, Any], **options: Any) -> None:
    with suppress(DataError):  # the radius fits nowhere
        assert_same(case, **options)
