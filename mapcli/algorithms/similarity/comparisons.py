"""Score a perception at its candidate poses: against a map or a database (Sect. 9.5).

`score` is `mapcli similarity-table` on records. There is one comparison for each kind of
perception and of what it is compared with.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from mapcli.algorithms.similarity.candidate_poses import (
    Candidates,
    CandidateWindow,
    neighbour_candidates,
)
from mapcli.algorithms.similarity.grid_table import (
    candidate_perception_map,
    grid_table,
    scan_perception_map,
    scan_table,
)
from mapcli.algorithms.similarity.map_update import update_map
from mapcli.algorithms.similarity.measures import Similarity
from mapcli.algorithms.similarity.perception_map import PerceptionMap
from mapcli.algorithms.similarity.readings_table import database_table, landmark_table
from mapcli.errors import DataError
from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap
from mapcli.model.perception import (
    UNTOLD,
    GridPerceptions,
    LandmarkPerception,
    Measured,
    Perceived,
    PerceptionDatabase,
    ReadingsPerception,
    ScanPerception,
)
from mapcli.model.pose import Pose2D
from mapcli.model.similarity import ScoredCandidate, SimilarityTable
from mapcli.model.world import World

BEARING_WEIGHT = 1.0
"""What a radian of bearing counts against a unit of distance."""


@dataclass(frozen=True)
class Scoring:
    """How a perception is compared.

    Attributes:
        similarity: the measure, see `measures`.
        low: a known cell below this probability counts as empty.
        bearing_weight: what a radian of bearing counts against a unit of distance.
    """

    similarity: Similarity
    low: float = OCCUPIED_THRESHOLD
    bearing_weight: float = BEARING_WEIGHT


@dataclass(frozen=True, eq=False)
class ScanOnMap:
    """A scan and a grid map."""

    grid: GridMap
    scan: ScanPerception
    default_similarity: ClassVar[Similarity] = "product"

    @property
    def cell(self) -> float | None:
        """The size of a cell."""
        return self.grid.resolution

    def table(self, scoring: Scoring, window: CandidateWindow | None = None) -> SimilarityTable:
        """The scores of the candidates, or of all poses of a window."""
        candidates = self._candidates(window)
        return scan_table(self.grid, self.scan, candidates, scoring.similarity, scoring.low)

    def _candidates(self, window: CandidateWindow | None) -> Candidates:
        if window is not None:
            return window.candidates(self.grid.resolution)
        return neighbour_candidates(self.scan.steps, self.scan.turns_deg)

    def intended(self) -> Pose2D | None:
        """The intended pose in the map."""
        return self.scan.intended_pose.pose(self.grid)

    def perceived(self, candidate: ScoredCandidate, *, near: bool = False) -> PerceptionMap:
        """The perception map at a candidate; `near`, no farther off the map than it is large."""
        assert candidate.pose is not None  # scans always have one
        rows, columns = self.grid.rows, self.grid.columns
        within = (-columns, -rows, 2 * columns, 2 * rows) if near else None
        return scan_perception_map(self.grid, self.scan, candidate.pose, within)


@dataclass(frozen=True, eq=False)
class GridsOnMap:
    """Perception maps that are written out (Fig. 9.20), and a grid map."""

    grid: GridMap
    perceptions: GridPerceptions
    default_similarity: ClassVar[Similarity] = "product"

    def table(self, scoring: Scoring, window: CandidateWindow | None = None) -> SimilarityTable:
        """The scores of the candidates; there is no window."""
        _refuse(window)
        return grid_table(self.grid, self.perceptions, scoring.similarity, scoring.low)

    def intended(self) -> Pose2D | None:
        """The intended pose in the map, if it is told."""
        place = self.perceptions.intended_pose
        return None if place is None else place.pose(self.grid)

    def perceived(self, candidate: ScoredCandidate, *, near: bool = False) -> PerceptionMap:
        """The perception map of a candidate."""
        names = [(c.position, c.turn_deg) for c in self.perceptions.candidates]
        index = names.index((candidate.position, candidate.turn_deg))
        return candidate_perception_map(self.grid, self.perceptions, index)


@dataclass(frozen=True, eq=False)
class LandmarksOnMap:
    """Distances and bearings, and a points map (Activity 9.4)."""

    world: World
    landmarks: LandmarkPerception
    default_similarity: ClassVar[Similarity] = "l1"
    cell: ClassVar[float | None] = None

    def table(self, scoring: Scoring, window: CandidateWindow | None = None) -> SimilarityTable:
        """The scores of the candidates, or of all poses of a window."""
        marks = self.landmarks
        candidates = (
            neighbour_candidates(marks.steps, marks.turns_deg)
            if window is None
            else window.candidates(None)
        )
        similarity, weight = scoring.similarity, scoring.bearing_weight
        return landmark_table(self.world, marks, candidates, similarity, weight)

    def intended(self) -> Pose2D | None:
        """The intended pose in the map."""
        return self.landmarks.intended_pose.pose(None)


@dataclass(frozen=True, eq=False)
class ReadingsInDatabase:
    """A set of readings, and a database of such sets (Activity 9.5)."""

    database: PerceptionDatabase
    readings: Measured
    default_similarity: ClassVar[Similarity] = "l1"

    def table(self, scoring: Scoring, window: CandidateWindow | None = None) -> SimilarityTable:
        """The scores of the poses of the database; there is no window."""
        _refuse(window)
        similarity, weight = scoring.similarity, scoring.bearing_weight
        return database_table(self.database, self.readings, similarity, weight)

    def intended(self) -> Pose2D | None:
        """The intended pose, if it is told in metres: a database has no cells."""
        place = self.readings.intended_pose
        return None if place is UNTOLD or place.cell is not None else place.pose(None)


Comparison = ScanOnMap | GridsOnMap | LandmarksOnMap | ReadingsInDatabase


def _refuse(window: CandidateWindow | None) -> None:
    if window is not None:
        raise DataError("a window of poses", expected="a scan or landmarks, and a map to move "
                        "them on")  # fmt: skip


def comparison_of(known: GridMap | World | PerceptionDatabase, perception: Perceived) -> Comparison:
    """The comparison of a perception with a map or a database.

    Raises:
        DataError: they do not go together.
    """
    match known, perception:
        case PerceptionDatabase(), ScanPerception() | LandmarkPerception() | ReadingsPerception():
            return ReadingsInDatabase(known, perception)
        case PerceptionDatabase(), GridPerceptions():
            raise DataError("kind: grids", expected="readings, a scan or landmarks")
        case _, ReadingsPerception():
            raise DataError("kind: readings", expected="--database, with readings at each pose")
        case GridMap(), ScanPerception():
            return ScanOnMap(known, perception)
        case GridMap(), GridPerceptions():
            return GridsOnMap(known, perception)
        case World(), LandmarkPerception():
            return LandmarksOnMap(known, perception)
    raise DataError(
        f"a {type(perception).__name__} cannot be scored on a {type(known).__name__}",
        expected="scans and grids with a grid map, landmarks with a points map, or readings with "
        "a database",
    )


def score(
    known: GridMap | World | PerceptionDatabase,
    perception: Perceived,
    similarity: Similarity | None = None,
    window: CandidateWindow | None = None,
    *,
    low: float = OCCUPIED_THRESHOLD,
    bearing_weight: float = BEARING_WEIGHT,
) -> SimilarityTable:
    """Score every candidate pose of a perception (Table 9.1); `best()` of the table is line 9 of
    Algorithm 9.2.

    Args:
        known: a grid map for scans and perception maps, a points map for landmarks, a database for
            either kind of readings.
        similarity: the measure, see `measures`; `product` by default, `l1` of readings.
        window: all poses of it, instead of the perception's candidates.
        low, bearing_weight: see `Scoring`.

    Raises:
        DataError: they do not go together, or do not overlap at any candidate.
    """
    comparison = comparison_of(known, perception)
    measure = similarity or comparison.default_similarity
    return score_comparison(comparison, Scoring(measure, low, bearing_weight), window)


def score_comparison(
    comparison: Comparison, scoring: Scoring, window: CandidateWindow | None = None
) -> SimilarityTable:
    """The table of a comparison.

    Raises:
        DataError: no candidate overlaps what the map knows.
    """
    table = comparison.table(scoring, window)
    if not (table.overlap > 0).any():
        raise DataError(
            "does not overlap what the map knows at any candidate pose, so nothing can be "
            "concluded",
            expected="a pose from which the sensor sees known cells, or landmarks that were seen",
        )
    return table


def map_after(comparison: ScanOnMap | GridsOnMap, best: ScoredCandidate, low: float) -> GridMap:
    """The map with the best perception written into it (Fig. 9.22)."""
    return update_map(comparison.grid, comparison.perceived(best), low)
