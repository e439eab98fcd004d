"""Two poses compared on the same cells: on those of a perception that both expect something of.

Sums over whatever a perception and the map have in common grow with how much that is, so that a
pose deep in the known part of the map would win over the right one at its edge. "The function
compare(p, e) will only compare the areas that overlap" (Sect. 9.7): of two poses, where the
expected maps of both overlap p. There each cell is a vote for one of them, for the other, or for
neither.
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

CHANCE_SIGMAS = 1.0
"""Standard deviations of a tossed coin up to which a majority of the votes is chance. A robot that
is a cell off is so again at the next comparison: what is missed once may be seen then, while a
wheel that slips for seconds is lost where every comparison is to be beyond doubt."""

FEW = 3
"""Cells up to which a majority says nothing: so many differ by where in its cell a wall lies."""


class Comparison(NamedTuple):
    """A test position compared with the odometry's pose on the cells that both share.

    Attributes:
        cells: of the perception that both expect something of.
        wins, losses: of these, where the test position agrees with the perception and the
            odometry's pose does not, and the other way round.
        lead: the similarity of the test position less that of the odometry's, so that more is
            better; NaN where it is not defined.
        independent: the share of the cells that is evidence of its own.
    """

    cells: int
    wins: int
    losses: int
    lead: float
    independent: float = 1.0

    @property
    def is_better(self) -> bool:
        """Whether the test position is better, and not just by chance: a sign test."""
        votes = (self.wins + self.losses) / self.independent
        chance = max(CHANCE_SIGMAS * math.sqrt(votes), FEW)
        return self.lead > 0 and self.wins - self.losses > chance


def compare(
    p: Signs,
    expected: Signs,
    by_odometry: Signs,
    similarity: Similarity,
    independent: float = 1.0,
) -> Comparison:
    """Compare a perception with what is expected at a test position and at the odometry's pose.

    Args:
        p, expected, by_odometry: the same cells, shape (n,): -1 empty, +1 obstacle, 0 unknown.
        independent: the share of p that is evidence of its own, see `Perception`.
    """
    shared = (p != 0) & (expected != 0) & (by_odometry != 0)
    codes = 4 * (p[shared] > 0) + 2 * (expected[shared] > 0) + (by_odometry[shared] > 0)
    counts = np.bincount(codes, minlength=8).reshape(2, 2, 2)
    pairs = np.stack([counts.sum(axis=2), counts.sum(axis=1)])
    score, odometry = higher_is_better(similarity, similarity_of_counts(similarity, pairs))
    lead = float(score - odometry) if np.isfinite([score, odometry]).all() else math.nan
    wins, losses = counts[0, 0, 1] + counts[1, 1, 0], counts[0, 1, 0] + counts[1, 0, 1]
    return Comparison(int(counts.sum()), int(wins), int(losses), lead, independent)
