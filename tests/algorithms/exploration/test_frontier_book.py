"""The twelve lines of Algorithm 9.1 as the book prints them, and the exploration that users run."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import book_frontier
from support.exploring import BOOK, open_cells, worlds

from mapcli import GridMap, explore

LOW = np.float32(0.5)


def test_the_twelve_lines_give_figures_9_5_to_9_8() -> None:
    goals, _ = book_frontier.explore(BOOK["fig9_9"].cells, BOOK["fig9_4"].cells, (5, 9), LOW)
    assert goals[:3] == [(3, 9), (2, 9), (2, 7)]


@pytest.mark.parametrize(
    ("world", "known", "robot"), [("fig9_9", "fig9_4", (5, 9)), ("fig9_10", "fig9_10", (3, 3))]
)
def test_the_books_maps(world: str, known: str, robot: tuple[int, int]) -> None:
    goals, grid = book_frontier.explore(BOOK[world].cells, BOOK[known].cells, robot, LOW)
    ours = explore(BOOK[world], [robot], known=BOOK[known])
    assert [step.goal for step in ours.steps] == goals
    np.testing.assert_array_equal(ours.after.cells, grid)


@settings(max_examples=150, deadline=None)
@given(world=worlds().filter(lambda w: len(open_cells(w)) > 0), data=st.data())
def test_any_map(world: np.ndarray, data: st.DataObject) -> None:
    robot = data.draw(st.sampled_from(open_cells(world)))
    hidden = data.draw(st.lists(st.booleans(), min_size=world.size, max_size=world.size))
    known = np.where(np.reshape(hidden, world.shape), np.float32(np.nan), world)
    known[robot] = world[robot]
    goals, grid = book_frontier.explore(world, known, robot, LOW)
    ours = explore(GridMap(world), [robot], known=GridMap(known))
    assert [step.goal for step in ours.steps] == goals
    np.testing.assert_array_equal(ours.after.cells, grid)
