"""What a window of scores looks like: its peak, a second one, how far the fit can be trusted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.model.similarity import ScoredCandidate


@dataclass(frozen=True, eq=False)
class LocalMaxima:
    """The answer to "is this place ambiguous?".

    Attributes:
        peak: the best pose; second: the best one on another hill, None if there is no other.
        second_share: how high the second is, 0 at the window's median and 1 at the peak.
        covariance: of x, y (map's unit) and theta (radians) of the peak's hill, shape (3, 3).
        plateau: poses that score as much as the peak, itself included.
        at_border: the peak lies at the border of the window, so the true one may be outside.
    """

    peak: ScoredCandidate
    second: ScoredCandidate | None
    second_share: float | None
    covariance: NDArray[np.float64]
    plateau: int
    at_border: bool
