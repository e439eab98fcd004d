"""What the scores of a window of poses look like: the best pose, other local maxima, covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.model.similarity import ScoredCandidate


@dataclass(frozen=True, eq=False)
class LocalMaxima:
    """The answer to "is this place ambiguous?".

    Attributes:
        peak: the best pose.
        second: the best local maximum outside the peak's mode, None if there is no other.
        second_share: how high the second is, 0 at the window's median and 1 at the peak.
        covariance: of x, y (map's unit) and theta (radians) over the peak's mode, shape (3, 3).
        plateau: poses that score as much as the peak, itself included.
        at_border: the peak lies at the border of the window, so the true one may be outside.
    """

    peak: ScoredCandidate
    second: ScoredCandidate | None
    second_share: float | None
    covariance: NDArray[np.float64]
    plateau: int
    at_border: bool


@dataclass(frozen=True, eq=False)
class WindowScores:
    """The scores of a whole window of poses, summed up.

    Attributes:
        along: steps from the intended position along one axis, in the map's unit, ascending.
        surface: shape (up, right), the best score of all headings at each position, the highest
            position first; NaN where nothing overlaps.
        maxima: its local maxima.
    """

    along: NDArray[np.float64]
    surface: NDArray[np.float64]
    maxima: LocalMaxima
