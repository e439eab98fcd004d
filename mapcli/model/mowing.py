"""The plan of mowing a lawn, its runs, and their statistics (Activity 9.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MowingPlan:
    """Where a mower is told to drive, and the landmarks beside its path.

    Attributes:
        outline: corners of the lawn, shape (n, 2), metres.
        waypoints: shape (m, 2), from the charging station over both ends of every lane back to
            the station.
        lanes: how many there are; width: metres that a lane is cut wide.
        marks: centres of the tape marks, shape (k, 2).
    """

    outline: Floats
    waypoints: Floats
    lanes: int
    width: float
    marks: Floats

    @property
    def station(self) -> Floats:
        """The charging station, shape (2,)."""
        return np.asarray(self.waypoints[0], dtype=np.float64)

    @property
    def largest_mark(self) -> float:
        """Side of the largest marks that do not touch, metres; inf when there are not two."""
        apart = np.abs(self.marks[:, None] - self.marks).max(axis=2)
        return float(apart[~np.eye(len(apart), dtype=bool)].min(initial=np.inf))

    @property
    def distance(self) -> float:
        """Metres of the whole path."""
        return float(np.hypot(*np.diff(self.waypoints, axis=0).T).sum())


@dataclass(frozen=True, eq=False)
class MowingRun:
    """One run.

    Attributes:
        path: true positions, shape (n, 2).
        measured: metres and radians that the wheels measured between them, shape (n - 1, 2).
        seen: how often each mark was noticed, shape (marks,).
    """

    path: Floats
    measured: Floats
    seen: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Mowing:
    """Many runs of one plan under the same conditions.

    Attributes:
        landmark_size: side of the tape marks, metres; None for odometry alone.
        end_errors: true position at the end of each run less the station, shape (runs, 2), metres.
        detected: share of the marks that were noticed at least once in a run; None without marks.
        mown: share of the lawn that each run cut, shape (runs,); empty where nobody asked.
        runs: the runs themselves.
    """

    landmark_size: float | None
    end_errors: Floats
    detected: float | None
    mown: Floats
    runs: tuple[MowingRun, ...]

    @property
    def distances(self) -> Floats:
        """Metres from the station at the end of each run."""
        return np.asarray(np.hypot(*self.end_errors.T), dtype=np.float64)

    @property
    def mean_error(self) -> Floats:
        """Mean error of the ends, shape (2,), metres: the systematic error."""
        return np.asarray(self.end_errors.mean(axis=0), dtype=np.float64)

    @property
    def scatter(self) -> float:
        """Root mean square distance of the ends from their mean, metres: the random error."""
        return float(np.sqrt(((self.end_errors - self.mean_error) ** 2).sum(axis=1).mean()))

    @property
    def systematic_share(self) -> float:
        """The share of the mean squared error that is systematic, 0 to 1."""
        whole = float((self.end_errors**2).sum(axis=1).mean())
        return float((self.mean_error**2).sum()) / whole if whole else 0.0

    def document(self) -> dict[str, Any]:
        """Ready for JSON."""
        x, y = self.mean_error
        return {
            "landmark_size_m": self.landmark_size,
            "station_distance_m": {
                "mean": _figure(self.distances.mean()),
                "median": _figure(np.median(self.distances)),
                "p95": _figure(np.percentile(self.distances, 95)),
                "worst": _figure(self.distances.max()),
            },
            "mean_miss": {"x": _figure(x), "y": _figure(y)},
            "spread_m": _figure(self.scatter),
            "common_share": _figure(self.systematic_share),
            "detected_share": None if self.detected is None else _figure(self.detected),
            "mown_share": _figure(self.mown.mean()) if len(self.mown) else None,
            "runs": [{"x": _figure(x), "y": _figure(y)} for x, y in self.end_errors],
        }


def _figure(value: Any) -> float:
    """Six decimals, micrometres: the same on every machine."""
    return round(float(value), 6) + 0.0
