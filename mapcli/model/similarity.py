"""The similarity table (Table 9.1): candidate poses with their scores, and the best of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields

import numpy as np
from numpy.typing import NDArray

from mapcli.model.limit import limit_fields
from mapcli.model.pose import Pose2D

INTENDED = "intended"
"""The name of the position where the robot should be."""

EQUAL = 1e-9
"""Scores that differ by less are equal."""


@dataclass(frozen=True, slots=True)
class ScoredCandidate:
    """One candidate and its score.

    Attributes:
        position: its name; turn_deg: degrees counter-clockwise of the intended heading.
        pose: in the frame of the map, when it is known.
        score, overlap: as in the table.
        place: row and column of the table.
    """

    position: str
    turn_deg: float
    pose: Pose2D | None
    score: float
    overlap: int
    place: tuple[int, int]


@dataclass(frozen=True, eq=False)
class SimilarityTable:
    """Scores of candidate poses.

    Attributes:
        similarity: the function's name; lower: whether lower scores are better.
        rows: names of the positions, the intended one first if it is there.
        columns: turns in degrees, counter-clockwise of the intended heading.
        values: shape (rows, columns); NaN where there is no score.
        overlap: shape (rows, columns), what was compared there: cells or readings.
        missing: places of the table for which no candidate was given.
        pose_at: the pose of a row and column, None where it is not known. (A window has many.)
    """

    similarity: str
    lower: bool
    rows: tuple[str, ...]
    columns: tuple[float, ...]
    values: NDArray[np.float64]
    overlap: NDArray[np.int64]
    pose_at: Callable[[int, int], Pose2D | None]
    missing: int = 0

    def __getitem__(self, place: tuple[int, int]) -> ScoredCandidate:
        row, column = place
        return ScoredCandidate(
            self.rows[row], self.columns[column], self.pose_at(row, column),
            float(self.values[row, column]), int(self.overlap[row, column]), place,
        )  # fmt: skip

    def comparable(self) -> NDArray[np.bool_]:
        """Where the candidate overlaps the map, so that its score says something."""
        return (self.overlap > 0) & ~np.isnan(self.values)

    def ascending_scores(self) -> NDArray[np.float64]:
        """The scores, turned so that the highest is the best; -inf where nothing is comparable."""
        return np.where(self.comparable(), -self.values if self.lower else self.values, -np.inf)

    def winners(self) -> list[ScoredCandidate]:
        """The best candidate, and all others that score the same, row by row."""
        scores = self.ascending_scores()
        if not self.comparable().any():
            return []
        return [self[int(r), int(c)] for r, c in np.argwhere(scores >= scores.max() - EQUAL)]

    def best(self) -> ScoredCandidate | None:
        """The first of the winners; None when nothing can be concluded, because no candidate
        overlaps the map or, of several, all score the same."""
        winners = self.winners()
        if not winners or 1 < len(winners) == np.count_nonzero(self.comparable()):
            return None
        return winners[0]

    def runner_up(self) -> ScoredCandidate | None:
        """The best of those that did not win."""
        able = self.comparable()
        for winner in self.winners():
            able[winner.place] = False
        if not able.any():
            return None
        scores = np.where(able, self.ascending_scores(), -np.inf)
        row, column = np.unravel_index(int(np.argmax(scores)), scores.shape)
        return self[int(row), int(column)]


@dataclass(frozen=True)
class TableSummary:
    """What a table, or the scores of a window, say in numbers.

    Attributes:
        candidates: poses that could be compared.
        score: of the best one; None when nothing can be concluded.
        overlap: cells or readings that it compares.
        ties: others that score the same.
        margin: by which the best beats the next one, or the next peak of a window; None if there
            is no other.
        distance: of the best from the intended pose, in the map's unit; None where poses are not
            known.
        turn_deg: its heading from the intended one, degrees counter-clockwise.
        at_border: it lies at the border of a window, so that the true one may be outside.
    """

    candidates: int
    score: float | None = None
    overlap: int = 0
    ties: int = 0
    margin: float | None = None
    distance: float | None = None
    turn_deg: float | None = None
    at_border: bool = False

    def values(self, *, lower: bool) -> dict[str, float]:
        """What limits may be set on; what there is no number for is infinitely bad.

        Args:
            lower: lower scores are better.
        """
        missing = {"score": math.inf if lower else -math.inf, "margin": 0.0}
        return {
            name: missing.get(name, math.inf) if value is None else float(value)
            for name, value in asdict(self).items()
        }


@dataclass(frozen=True)
class ConfusionSummary:
    """How precisely the poses of many sets of readings were found.

    Attributes:
        trials: sets of readings.
        ties: of these, where several poses were equally similar, so that nothing can be concluded.
        right, right_share: whose pose was found, and the share of all.
        right_position, right_position_share: whose position was found, whatever the heading.
    """

    trials: int
    ties: int
    right: int
    right_share: float
    right_position: int
    right_position_share: float

    def values(self) -> dict[str, float]:
        """What limits may be set on."""
        return {name: float(value) for name, value in asdict(self).items()}


LIMIT_FIELDS = limit_fields(
    dict.fromkeys(one.name for kind in (TableSummary, ConfusionSummary) for one in fields(kind))
)
"""What limits may be set on, of one set of readings and of many."""
