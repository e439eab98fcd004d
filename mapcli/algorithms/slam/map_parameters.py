"""How the map is made: its resolution, and how much one beam says about a cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels.ray_tracing import LogOddsRules
from mapcli.algorithms.slam.likelihood_field import gaussian_kernel
from mapcli.algorithms.slam.log_odds import MAX_COUNTS, MIN_COUNTS, log_odds_counts
from mapcli.errors import DataError


@dataclass(frozen=True)
class MapParameters:
    """How the map is made.

    Attributes:
        resolution: metres per cell.
        p_hit: obstacle probability of an unknown cell after one beam ended in it: 85 counts. Worth
            more than three misses, since a laser seldom reports an obstacle that is not there,
            while beams that graze a wall pass through its cells again and again.
        p_miss: the same after one beam passed through it: -25 counts.
        blur: standard deviation of the likelihood field around an obstacle, metres; at least a
            cell is taken.

    Raises:
        DataError: a resolution finer than a millimetre or coarser than 100 m.
    """

    resolution: float = 0.05
    p_hit: float = 0.9933
    p_miss: float = 0.19
    blur: float = 0.05

    def __post_init__(self) -> None:
        if not 0.001 <= self.resolution <= 100:
            raise DataError(
                f"resolution {self.resolution:g}", expected="0.001 to 100 metres per cell"
            )

    def log_odds_rules(self) -> LogOddsRules:
        """What a hit adds to a cell and a miss takes away, and its limits, in counts."""
        hit, miss = log_odds_counts(self.p_hit), -log_odds_counts(self.p_miss)
        return LogOddsRules(hit, miss, MAX_COUNTS, MIN_COUNTS)

    def gaussian_kernel(self) -> NDArray[np.uint8]:
        """The likelihood field around one occupied cell, shape (2 r + 1, 2 r + 1)."""
        return gaussian_kernel(max(self.blur / self.resolution, 1.0))
