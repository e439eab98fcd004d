"""Two poses compared on the cells that both share (Sect. 9.7)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mapcli.algorithms.similarity.measures import SIMILARITIES, Similarity
from mapcli.algorithms.similarity.shared_cells import (
    BELIEVED_SIGMAS,
    Comparison,
    Votes,
    compare,
)


def signs(text: str) -> np.ndarray:
    return np.array([{"#": 1, ".": -1, "?": 0}[letter] for letter in text], np.int8)


def compared(p: str, e: str, by_odometry: str, similarity: Similarity) -> Comparison:
    """Each cell was seen by a beam of its own."""
    return compare(signs(p), signs(e), signs(by_odometry), np.arange(len(p)), similarity)


@pytest.mark.parametrize("similarity", SIMILARITIES)
def test_a_pose_that_explains_more_of_the_same_cells_is_better(similarity: Similarity) -> None:
    one = compared("#####...", "#####...", "#....#..", similarity)
    assert (one.cells, one.votes) == (8, (5, 0))
    assert one.is_better


@pytest.mark.parametrize("similarity", SIMILARITIES)
def test_knowing_more_is_no_merit(similarity: Similarity) -> None:
    """Where the map knows twice as much and all of it agrees, S of the book is twice as high."""
    one = compared("##..##..", "##..##..", "##..????", similarity)
    assert (one.cells, one.votes) == (4, (0, 0))
    assert one.lead == 0
    assert not one.is_better


def test_by_hand() -> None:
    """S: of six shared cells 5 - 1 against 2 - 4."""
    one = compared("###...?#", "###..##?", "#..#..##", "product")
    assert (one.cells, one.votes, one.lead) == (6, (3, 1), 4.0)


def test_a_witness_is_counted_once_however_much_it_says() -> None:
    """Of beam 0 four cells are for the test position and one against it; of beam 1 one is for it
    and two against; beam 2 does not tell."""
    p, e, by_odometry = "####.##..#.", "##########.", "......#..#."
    witnesses = np.array([0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2])
    one = compare(signs(p), signs(e), signs(by_odometry), witnesses, "agreement")
    assert one.votes == (1, 1)
    assert not one.is_better


@pytest.mark.parametrize(
    ("wins", "losses", "expected"),
    [(3, 0, False), (4, 0, True), (4, 1, False), (9, 4, True), (10, 6, False), (20, 14, True)],
)
def test_a_majority_that_chance_would_give_is_none(wins: int, losses: int, expected: bool) -> None:
    assert Comparison(100, Votes(wins, losses), 0.1).is_better is expected


@pytest.mark.parametrize(
    ("wins", "losses", "expected"),
    [(4, 0, False), (5, 0, True), (8, 2, False), (9, 2, True), (20, 10, False), (22, 10, True)],
)
def test_beyond_two_standard_deviations_it_is_believed(
    wins: int, losses: int, expected: bool
) -> None:
    assert Votes(wins, losses).is_majority(BELIEVED_SIGMAS) is expected


def test_votes_add_up() -> None:
    assert Votes(4, 0).plus(Votes(5, 1)) == (9, 1)


def test_a_similarity_that_is_not_defined_is_not_better() -> None:
    one = compared("####", "####", "....", "correlation")
    assert math.isnan(one.lead)
    assert not one.is_better
