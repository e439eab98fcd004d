"""The errors of a trajectory against a reference, their statistics, and limits on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mapcli.model.limit import limit_fields
from mapcli.model.pose import IDENTITY, Pose2D
from mapcli.model.trajectory import Poses, Relations, Trajectory, between

Kind = Literal["trajectory", "relations", "self-check"]

MEASURES: dict[Kind, tuple[str, ...]] = {
    "trajectory": ("ate", "rpe"),
    "relations": ("relations",),
    "self-check": ("self_check",),
}
"""What is measured against each kind of reference; the start of the fields' names."""

COUNTS = "matched", "total", "matched_share"
ALL_MEASURES = tuple(measure for measures in MEASURES.values() for measure in measures)
STATISTICS = "rmse", "mean", "median", "std", "min", "max"


@dataclass(frozen=True, eq=False)
class Errors:
    """Residuals between poses, or relative poses, that should be the same, one by one.

    Attributes:
        metres: shape (n,), lengths of the residual translations.
        degrees: shape (n,), absolute values of the residual rotations.
        seconds: shape (n,), when, after the trace's first pose (its index where there are no
            times).
    """

    metres: NDArray[np.float64]
    degrees: NDArray[np.float64]
    seconds: NDArray[np.float64]

    @classmethod
    def of(cls, expected: Poses, found: Poses, seconds: NDArray[np.float64]) -> Errors:
        """Row by row the motion from the expected pose, or motion, to the one that was found."""
        left = between(expected, found)
        return cls(np.hypot(left[:, 0], left[:, 1]), np.degrees(np.abs(left[:, 2])), seconds)

    def __len__(self) -> int:
        return len(self.metres)

    def document(self) -> dict[str, Any]:
        """The statistics for a file."""
        return {
            "count": len(self),
            "translation_m": {name: round(x, 6) for name, x in statistics(self.metres).items()},
            "rotation_deg": {name: round(x, 6) for name, x in statistics(self.degrees).items()},
        }

    def numbers(self, measure: str) -> dict[str, float]:
        """What limits may be set on: `ate_rmse`, `ate_rot_rmse`..."""
        lengths = {f"{measure}_{name}": x for name, x in statistics(self.metres).items()}
        turns = {f"{measure}_rot_{name}": x for name, x in statistics(self.degrees).items()}
        return lengths | turns


def statistics(values: NDArray[np.float64]) -> dict[str, float]:
    """Root mean square, mean, median, standard deviation (of the population), least and most."""
    found = (
        np.sqrt(np.mean(values**2)),
        np.mean(values),
        np.median(values),
        np.std(values),
        np.min(values),
        np.max(values),
    )
    return {name: float(value) for name, value in zip(STATISTICS, found, strict=True)}


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A trace held against a reference.

    Attributes:
        kind: what the reference was.
        errors: measure -> errors: `ate` and `rpe`; or `relations`; or `self_check`.
        matched, total: poses (or relations, or pairs of scans) that could be compared, of those
            there are.
        association: how poses were associated, or gaps between stamps bridged; for people.
        trace: the trace, aligned to the reference where that is a trajectory.
        reference: the reference's poses at those of the trace that have one; None where it is not
            a trajectory.
        relations: those compared, in the order of their errors; None against a trajectory.
        aligned: the motion that aligned the trace (`reference_from_trace`).
        overlap_s: the time that both cover, seconds; None where there are no times.
    """

    kind: Kind
    errors: Mapping[str, Errors]
    matched: int
    total: int
    association: str
    trace: Trajectory
    reference: Trajectory | None = None
    relations: Relations | None = None
    aligned: Pose2D = IDENTITY
    overlap_s: float | None = None

    def numbers(self) -> dict[str, float]:
        """What limits may be set on, in this evaluation."""
        counts = {
            "matched": float(self.matched),
            "total": float(self.total),
            "matched_share": self.matched / max(self.total, 1),
        }
        for measure, errors in self.errors.items():
            counts |= errors.numbers(measure)
        return counts


def names_of_limits(kind: Kind) -> tuple[str, ...]:
    """The numbers that limits may be set on, against a reference of this kind."""
    of_statistics = (
        f"{measure}_{turn}{name}"
        for measure in MEASURES[kind]
        for turn in ("", "rot_")
        for name in STATISTICS
    )
    return (*COUNTS, *of_statistics)


LIMIT_FIELDS = limit_fields(field for kind in MEASURES for field in names_of_limits(kind))
"""The same for all kinds together."""
