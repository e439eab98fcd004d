"""Two poses compared on the same cells: on those of a perception that both expect something of.

Sums over whatever a perception and the map have in common grow with how much that is, so that a
pose deep in the known part of the map would win over the right one at its edge. "The function
compare(p, e) will only compare the areas that overlap" (Sect. 9.7): of two poses, where the
expected maps of both overlap p. There each cell speaks for one of them, for the other, or for
neither.

The cells of a beam move together when a heading is tried, and so do those of all beams that one
sensor took along a short way. So they have one vote together: a witness is counted once, however
much it says.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.measures import (
    Similarity,
    higher_is_better,
    similarity_of_counts,
)

Signs = NDArray[np.int8]
Numbers = NDArray[np.int64]

CHANCE_SIGMAS, BELIEVED_SIGMAS = 1.0, 2.0
"""Standard deviations of a tossed coin: up to the first, a majority of the votes is chance; beyond
the second it is believed. Between them it is a suspicion, and the next comparison is asked too: one
that is right comes up again, also when a wheel slips on, while of those that are not one in ten
does (walls that lie on the border of two cells are seen once in the one, once in the other)."""

FEW = 3
"""Votes up to which a majority says nothing: so many differ by where in its cell a wall lies."""


class Votes(NamedTuple):
    """Of the witnesses, for a test position and for the odometry's pose."""

    wins: int
    losses: int

    def plus(self, others: Votes) -> Votes:
        return Votes(self.wins + others.wins, self.losses + others.losses)

    def is_majority(self, sigmas: float = CHANCE_SIGMAS) -> bool:
        """Whether more speak for the test position, by more than chance: a sign test."""
        chance = max(sigmas * math.sqrt(self.wins + self.losses), FEW)
        return self.wins - self.losses > chance


class Comparison(NamedTuple):
    """A test position compared with the odometry's pose on the cells that both share.

    Attributes:
        cells: of the perception that both expect something of.
        votes: of the witnesses that saw them; one is for the test position if that agrees with
            more of its cells than the odometry's pose does.
        lead: the similarity of the test position less that of the odometry's, so that more is
            better; NaN where it is not defined.
    """

    cells: int
    votes: Votes
    lead: float

    @property
    def is_better(self) -> bool:
        """Whether the test position is better, and not just by chance."""
        return self.lead > 0 and self.votes.is_majority()


def compare(
    p: Signs, expected: Signs, by_odometry: Signs, witnesses: Numbers, similarity: Similarity
) -> Comparison:
    """Compare a perception with what is expected at a test position and at the odometry's pose.

    Args:
        p, expected, by_odometry: the same cells, shape (n,): -1 empty, +1 obstacle, 0 unknown.
        witnesses: shape (n,), from 0: which beam, or which of a few sensors, saw the cell.
    """
    shared = (p != 0) & (expected != 0) & (by_odometry != 0)
    codes = 4 * (p[shared] > 0) + 2 * (expected[shared] > 0) + (by_odometry[shared] > 0)
    counts = np.bincount(codes, minlength=8).reshape(2, 2, 2)
    pairs = np.stack([counts.sum(axis=2), counts.sum(axis=1)])
    score, odometry = higher_is_better(similarity, similarity_of_counts(similarity, pairs))
    lead = float(score - odometry) if np.isfinite([score, odometry]).all() else math.nan
    agrees = (p[shared] == expected[shared]).astype(np.int8) - (p[shared] == by_odometry[shared])
    gains = np.bincount(witnesses[shared], agrees)
    votes = Votes(int((gains > 0).sum()), int((gains < 0).sum()))
    return Comparison(int(counts.sum()), votes, lead)
