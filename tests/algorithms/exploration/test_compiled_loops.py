"""The loops compiled by numba take the same steps as plain Python; small maps never load it."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from conftest import FIXTURES, modules_loaded_by
from support.exploring import BOOK

from mapcli.algorithms.exploration.exploration_parameters import ExplorationParameters
from mapcli.algorithms.exploration.explore import explore
from mapcli.algorithms.exploration.runner import LARGE, is_large
from mapcli.errors import DataError
from mapcli.model.exploration import Exploration
from mapcli.model.grid import GridMap

OPTIONS: list[dict[str, Any]] = [
    {},
    {"strategy": "priority", "connectivity": 8},
    {"strategy": "gain"},
    {"strategy": "random", "seed": 7},
    {"strategy": "gain", "sensor_range": 6, "connectivity": 8},
    {"sensor_range": 25, "return_home": True},
    {"robot_radius": 1.2, "sensor_range": 8, "return_home": True},
    {"robot_radius": 0.6, "max_distance": 90.5},
    {"max_steps": 17},
    {"coverage": 0.6},
]


def random_case(seed: int) -> tuple[GridMap, list[tuple[int, int]], GridMap | None]:
    random = np.random.default_rng(seed)
    contents = np.array([0.1, 0.1, 0.1, 0.2, 0.3, 0.9, 1.0, np.nan], dtype=np.float32)
    shares = [0.3, 0.3, 0.1, 0.1, 0.05, 0.05, 0.05, 0.05]
    cells = random.choice(contents, size=random.integers(8, 24, size=2), p=shares)
    known = None
    if seed % 3 == 0:
        known = np.where(random.random(cells.shape) < 0.5, cells, np.float32(np.nan))
        wrong = random.random(cells.shape) < 0.03
        known[wrong] = np.float32(0.1)
    stand = (cells < 0.5) if known is None else (cells < 0.5) & (known < 0.5)
    robots = random.permutation(np.argwhere(stand))[: 1 + seed % 4].tolist()
    return (
        GridMap(cells), [(row, column) for row, column in robots],
        None if known is None else GridMap(known.astype(np.float32)),
    )  # fmt: skip


def assert_equal(ours: Exploration, theirs: Exploration) -> None:
    for column in fields(ours.steps):
        np.testing.assert_array_equal(
            getattr(ours.steps, column.name), getattr(theirs.steps, column.name), column.name
        )
    np.testing.assert_array_equal(ours.after.cells, theirs.after.cells)
    np.testing.assert_array_equal(ours.explorable, theirs.explorable)
    assert ours.frontier == theirs.frontier
    assert ours.summary == theirs.summary


@pytest.mark.slow
@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_compiled_and_plain_take_the_same_steps(options: dict[str, Any]) -> None:
    done = 0
    for seed in range(12):
        world, robots, known = random_case(seed)
        both = []
        for compiled in (False, True):
            try:
                parameters = ExplorationParameters(**options)
                both.append(explore(world, robots, parameters, known, compiled=compiled))
            except DataError as error:
                both.append(str(error))
        if isinstance(both[0], str):
            assert both[0] == both[1]
        else:
            assert_equal(*both)
            done += 1
    assert done >= 4


def test_only_large_maps_are_compiled() -> None:
    large = GridMap(np.zeros((1, LARGE + 1), dtype=np.float32))
    assert not is_large(BOOK["fig9_9"], ExplorationParameters("gain"))
    assert is_large(large, ExplorationParameters())


def test_small_maps_load_nothing_heavy() -> None:
    heavy = {"numba", "scipy", "PIL", "yaml", "rich", "rosbags", "mcap", "gtsam", "shapely"}
    maps = str(FIXTURES / "fig9_9.txt"), "--known", str(FIXTURES / "fig9_4.txt")
    assert not modules_loaded_by("frontier", *maps, "--robot", "5,9") & heavy
    outputs = "--json", "-", "--strategy", "gain"
    assert not modules_loaded_by("frontier", *maps, "--robot", "5,9", "-q", *outputs) & heavy
