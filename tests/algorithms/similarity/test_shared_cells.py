"""Two poses compared on the cells that both share (Sect. 9.7)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mapcli.algorithms.similarity.measures import SIMILARITIES, Similarity
from mapcli.algorithms.similarity.shared_cells import Comparison, compare


def signs(text: str) -> np.ndarray:
    return np.array([{"#": 1, ".": -1, "?": 0}[letter] for letter in text], np.int8)


@pytest.mark.parametrize("similarity", SIMILARITIES)
def test_a_pose_that_explains_more_of_the_same_cells_is_better(similarity: Similarity) -> None:
    one = compare(signs("#####..."), signs("#####..."), signs("#....#.."), similarity)
    assert (one.cells, one.wins, one.losses) == (8, 5, 0)
    assert one.is_better


@pytest.mark.parametrize("similarity", SIMILARITIES)
def test_knowing_more_is_no_merit(similarity: Similarity) -> None:
    """Where the map knows twice as much and all of it agrees, S of the book is twice as high."""
    p = signs("##..##..")
    one = compare(p, signs("##..##.."), signs("##..????"), similarity)
    assert (one.cells, one.wins, one.losses) == (4, 0, 0)
    assert one.lead == 0
    assert not one.is_better


def test_by_hand() -> None:
    """S: of six shared cells 5 - 1 against 2 - 4."""
    one = compare(signs("###...?#"), signs("###..##?"), signs("#..#..##"), "product")
    assert (one.cells, one.wins, one.losses, one.lead) == (6, 3, 1, 4.0)


@pytest.mark.parametrize(
    ("wins", "losses", "expected"),
    [(3, 0, False), (4, 0, True), (4, 1, False), (9, 4, True), (10, 6, False), (20, 14, True)],
)
def test_a_majority_that_chance_would_give_is_none(wins: int, losses: int, expected: bool) -> None:
    assert Comparison(100, wins, losses, 0.1).is_better is expected


def test_cells_that_tell_the_same_count_as_one() -> None:
    """Of ten readings of a sensor along a way, nine tell nothing new: 9 to 4 is 0.9 to 0.4."""
    assert Comparison(100, 9, 4, 0.1, independent=1.0).is_better
    assert not Comparison(100, 9, 4, 0.1, independent=0.1).is_better
    assert Comparison(100, 40, 10, 0.1, independent=0.1).is_better


def test_a_similarity_that_is_not_defined_is_not_better() -> None:
    one = compare(signs("####"), signs("####"), signs("...."), "correlation")
    assert math.isnan(one.lead)
    assert not one.is_better
