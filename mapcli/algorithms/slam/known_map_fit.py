"""Whether a known map is of the place where the robot is."""

from __future__ import annotations

from dataclasses import dataclass

from mapcli.algorithms.slam.match import MIN_POINTS, Match
from mapcli.errors import DataError

LEAST_AGREEMENT = 0.5
"""Mean agreement of all points below which a map is of another place: it contradicts more of what
is seen than it explains. Drives in maps of their own building have 0.94 and more, in those of
others up to 0.37 (`benchmarks/RESULTS.md`)."""

EXPECTED = "a start pose in it (--initial-pose), or another map"


@dataclass
class KnownMapFit:
    """How well scans fit a known map, where both overlap (mutable).

    Attributes:
        scans: with enough points to be found.
        known_points: of these scans, points on cells that the map knows.
        agreement: of these points with the map, added up; nothing where a scan was not found.
    """

    scans: int = 0
    known_points: int = 0
    agreement: float = 0.0

    def add(self, match: Match, points: int) -> None:
        """Count a match of a scan with so many points."""
        self.scans += points >= MIN_POINTS
        self.known_points += match.known_points
        self.agreement += match.score * match.known_points if match.found else 0.0

    @property
    def mean(self) -> float:
        """Mean agreement, 0 to 1; 0 where nothing overlaps."""
        return self.agreement / max(self.known_points, 1)

    def check(self) -> None:
        """Refuse a map that does not explain what is seen in it.

        Raises:
            DataError: so little agrees that the robot is somewhere else.
        """
        if self.scans and self.mean < LEAST_AGREEMENT:
            raise DataError(
                f"is not of the place in the known map: only {self.mean:.0%} of what the scans see "
                "where both overlap agrees with it",
                expected=EXPECTED,
            )
