"""Obstacle probabilities as log-odds: whole numbers that observations are added to."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

LOG_ODDS_PER_COUNT = 1 / 17
"""One count of log-odds: a pass gives p = 0.19 of an obstacle, a hit p = 0.993."""


def log_odds_counts(probability: float) -> int:
    """Log-odds of an obstacle, in counts, after one observation of a cell; never 0."""
    counts = round(math.log(probability / (1 - probability)) / LOG_ODDS_PER_COUNT)
    return counts or (1 if probability > 0.5 else -1)


def log_odds_from_probabilities(
    probabilities: NDArray[np.float32], lowest: int, highest: int
) -> NDArray[np.int16]:
    """Probabilities, nan where unknown, as counts within limits: 0 only where unknown."""
    known = np.clip(np.nan_to_num(probabilities.astype(np.float64), nan=0.5), 1e-9, 1 - 1e-9)
    counts = np.round(np.log(known / (1 - known)) / LOG_ODDS_PER_COUNT)
    counts = np.clip(counts, lowest, highest)
    counts[(counts == 0) & ~np.isnan(probabilities)] = -1
    return counts.astype(np.int16)


def probability_by_count(lowest: int, highest: int) -> NDArray[np.float32]:
    """The probability of each count, from the lowest on; nan for 0, which is unknown."""
    counts = np.arange(lowest, highest + 1)
    table: NDArray[np.float32] = (1 / (1 + np.exp(-counts * LOG_ODDS_PER_COUNT))).astype(np.float32)
    table[-lowest] = np.nan
    return table
