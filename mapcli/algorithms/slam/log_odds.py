"""Obstacle probabilities as log-odds, in whole counts to which observations are added.

0 is unknown. A count is small enough that the default `p_hit` and `p_miss` of `MapParameters` are
met to three digits, and large enough that a cell's limits fit into 16 bits with flags beside them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

LOG_ODDS_PER_COUNT = 1 / 17
"""Natural logarithm of the odds that one count stands for."""

MAX_COUNTS, MIN_COUNTS = 1000, -500
"""The limits of a cell. They keep it from being so sure that it can never change: an obstacle that
was always seen is gone after 40 beams through its cell (`p_miss`), and open space becomes an
obstacle after six hits (`p_hit`)."""


def log_odds_counts(probability: float) -> int:
    """The log-odds of an unknown cell after one observation, in counts; never 0.

    Args:
        probability: of an obstacle, after the observation; within (0, 1).
    """
    counts = round(math.log(probability / (1 - probability)) / LOG_ODDS_PER_COUNT)
    return counts or (1 if probability > 0.5 else -1)


def log_odds_from_probabilities(probabilities: NDArray[np.float32]) -> NDArray[np.int16]:
    """Probabilities of cells, NaN where unknown, as counts within the limits; 0 only there."""
    known = np.clip(np.nan_to_num(probabilities.astype(np.float64), nan=0.5), 1e-9, 1 - 1e-9)
    counts = np.round(np.log(known / (1 - known)) / LOG_ODDS_PER_COUNT)
    counts = np.clip(counts, MIN_COUNTS, MAX_COUNTS)
    counts[(counts == 0) & ~np.isnan(probabilities)] = -1
    return counts.astype(np.int16)


def probabilities_from_log_odds(counts: NDArray[np.int16]) -> NDArray[np.float32]:
    """The obstacle probability of each cell; NaN where the count is 0, which is unknown."""
    every = np.arange(MIN_COUNTS, MAX_COUNTS + 1)
    table: NDArray[np.float32] = (1 / (1 + np.exp(-every * LOG_ODDS_PER_COUNT))).astype(np.float32)
    table[-MIN_COUNTS] = np.nan
    return table[counts - MIN_COUNTS]
