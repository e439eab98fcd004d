"""Whether a known map is of the place where the robot is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.correlative_search import SearchWindow
from mapcli.algorithms.slam.match import MIN_POINTS, Match, MatchParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.pose_refinement import ScanInMap
from mapcli.errors import DataError
from mapcli.model.reason import Reason

LEAST_AGREEMENT = 0.6
"""Mean agreement of all points below which a map is of another place. Drives in maps of their own
building have 0.8 and more, 0.61 where they drift; in those of others up to 0.39, and 0.50 in a
corridor, along which one wall is as good as another (`benchmarks/RESULTS.md`)."""

EXPECTED = "a start pose in it (--initial-pose), or another map"


@dataclass
class KnownMapFit:
    """How well scans fit a known map, where both overlap (mutable).

    Attributes:
        before: the map as it was, if the scans are written into it; else matches tell.
        scans: with enough points to be found.
        known_points: of these scans, points on cells that the map knows.
        agreement: of these points with the map, added up; nothing where a scan was not found.
    """

    before: OccupancyGrid | None = None
    scans: int = 0
    known_points: int = 0
    agreement: float = 0.0

    def add(self, match: Match, perception: Perception, parameters: MatchParameters) -> None:
        """Count a match of a scan."""
        points = len(perception.hits)
        self.scans += points >= MIN_POINTS
        if self.before is not None and points >= MIN_POINTS:
            scan = ScanInMap(self.before, perception, parameters)
            scan.cover(match.pose, SearchWindow(0.0, 0.0))
            match = scan.compare(match.pose)
        self.known_points += match.known_points
        self.agreement += match.score * match.known_points if match.found else 0.0

    @property
    def mean(self) -> float:
        """Mean agreement, 0 to 1; 0 where nothing overlaps."""
        return self.agreement / max(self.known_points, 1)

    def reasons(self, duration_s: float) -> Iterator[Reason]:
        """What the known map says of the map that it became.

        Args:
            duration_s: from the first scan to the last one.
        """
        if self.before is None or not self.scans or self.mean >= LEAST_AGREEMENT:
            return
        text = "the scans see nothing of the known map"
        if self.known_points:
            text = f"only {self.mean:.0%} of what the scans see of the known map agrees with it"
        text += ": it is of another place, or the start pose is wrong"
        yield Reason("known_map", 0.0, duration_s, text, "--initial-pose X,Y,THETA_DEG")

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
