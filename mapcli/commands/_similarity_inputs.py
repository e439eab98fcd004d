"""What `mapcli similarity-table` reads: a perception, and the map or database it is scored on."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

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
from mapcli.errors import FormatError
from mapcli.formats.documents.perception_reader import read_perception
from mapcli.formats.input import read_file
from mapcli.formats.maps.load import load_map, sniff
from mapcli.formats.maps.save import SUFFIXES
from mapcli.model.grid import GridMap
from mapcli.model.perception import (
    GridPerceptions,
    LandmarkPerception,
    PerceptionDatabase,
    ScanPerception,
)
from mapcli.model.pose import Pose2D
from mapcli.model.similarity import ScoredCandidate, SimilarityTable
from mapcli.model.world import World


@dataclass(frozen=True)
class Settings:
    """How perceptions are compared; see the options of the command."""

    similarity: Similarity
    low: float
    bearing_weight: float


@dataclass(frozen=True, eq=False)
class ScanOnMap:
    """A scan and a grid map."""

    grid: GridMap
    scan: ScanPerception

    def candidates(self, window: CandidateWindow | None) -> Candidates:
        if window is not None:
            return window.candidates(self.grid.resolution)
        return neighbour_candidates(self.scan.steps, self.scan.turns_deg)

    def table(self, settings: Settings, window: CandidateWindow | None) -> SimilarityTable:
        candidates = self.candidates(window)
        return scan_table(self.grid, self.scan, candidates, settings.similarity, settings.low)

    def intended(self) -> Pose2D | None:
        return self.scan.intended_pose.pose(self.grid)

    def perceived(self, candidate: ScoredCandidate, *, near: bool = False) -> PerceptionMap:
        """The perception map at a candidate; `near`, no farther off the map than it is large."""
        assert candidate.pose is not None  # scans always have one
        rows, columns = self.grid.rows, self.grid.columns
        within = (-columns, -rows, 2 * columns, 2 * rows) if near else None
        return scan_perception_map(self.grid, self.scan, candidate.pose, within)


@dataclass(frozen=True, eq=False)
class GridsOnMap:
    """Perception maps that are written out, and a grid map."""

    grid: GridMap
    perceptions: GridPerceptions

    def table(self, settings: Settings, window: CandidateWindow | None) -> SimilarityTable:
        return grid_table(self.grid, self.perceptions, settings.similarity, settings.low)

    def intended(self) -> Pose2D | None:
        place = self.perceptions.intended_pose
        return None if place is None else place.pose(self.grid)

    def perceived(self, candidate: ScoredCandidate, *, near: bool = False) -> PerceptionMap:
        """The perception map of a candidate."""
        names = [(c.position, c.turn_deg) for c in self.perceptions.candidates]
        index = names.index((candidate.position, candidate.turn_deg))
        return candidate_perception_map(self.grid, self.perceptions, index)


@dataclass(frozen=True, eq=False)
class LandmarksOnMap:
    """Distances and bearings, and a points map."""

    world: World
    landmarks: LandmarkPerception

    def table(self, settings: Settings, window: CandidateWindow | None) -> SimilarityTable:
        marks = self.landmarks
        candidates = (
            neighbour_candidates(marks.steps, marks.turns_deg)
            if window is None
            else window.candidates(None)
        )
        similarity, weight = settings.similarity, settings.bearing_weight
        return landmark_table(self.world, marks, candidates, similarity, weight)

    def intended(self) -> Pose2D | None:
        return self.landmarks.intended_pose.pose(None)


@dataclass(frozen=True, eq=False)
class ReadingsInDatabase:
    """A set of readings, and a database of such sets."""

    database: PerceptionDatabase
    readings: ScanPerception | LandmarkPerception

    def table(self, settings: Settings, window: CandidateWindow | None) -> SimilarityTable:
        similarity, weight = settings.similarity, settings.bearing_weight
        return database_table(self.database, self.readings, similarity, weight)

    def intended(self) -> Pose2D | None:
        place = self.readings.intended_pose
        return place.pose(None) if place.cell is None else None


Comparison = ScanOnMap | GridsOnMap | LandmarksOnMap | ReadingsInDatabase


@dataclass(frozen=True, eq=False)
class Loaded:
    """A comparison, and what its reader should know.

    Attributes:
        perception: the file's name, for errors; digests: file name -> SHA-256;
        warnings: sentences about the map, with its name.
    """

    comparison: Comparison
    perception: str
    digests: dict[str, str]
    warnings: tuple[str, ...] = ()


def load_comparison(
    files: tuple[str, ...], database: str | None, dialect: Any, low: float
) -> Loaded:
    """Read the perception, and the map or the database.

    Raises:
        click.UsageError: not the files that are needed.
        FormatError: a file that does not hold what it should.
    """
    wanted = 1 if database else 2
    if len(files) != wanted:
        expected = "PERCEPTION alone, with --database" if database else "MAP and PERCEPTION"
        raise click.UsageError(f"Expected {expected}; got {len(files)} of them.")
    if [*files, database].count("-") > 1:
        raise click.UsageError("Only one of the files can be standard input.")
    digests: dict[str, str] = {}

    def read(path: Path) -> bytes:
        data = read_file(path)
        digests[path.name] = hashlib.sha256(data).hexdigest()
        return data

    name = files[-1]
    perception = read_perception(read(Path(name)), name, low)
    if isinstance(perception, PerceptionDatabase):
        raise FormatError("is a database", file=name, expected="a scan, landmarks or grids; "
                          "databases go to --database")  # fmt: skip
    if database:
        found = read_perception(read(Path(database)), database)
        if not isinstance(found, PerceptionDatabase):
            raise FormatError("is one perception", file=database, expected="kind: database")
        if isinstance(perception, GridPerceptions):
            raise FormatError("kind: grids", file=name, expected="readings: scan or landmarks")
        return Loaded(ReadingsInDatabase(found, perception), name, digests)
    if isinstance(perception, LandmarkPerception):
        world = _points(read(Path(files[0])), files[0])
        return Loaded(LandmarksOnMap(world, perception), name, digests)
    loaded = load_map(files[0], dialect=dialect, read=read)
    comparison = (
        ScanOnMap(loaded.grid, perception)
        if isinstance(perception, ScanPerception)
        else GridsOnMap(loaded.grid, perception)
    )
    return Loaded(comparison, name, digests, tuple(f"{files[0]}: {w}" for w in loaded.warnings))


def _points(data: bytes, file: str) -> World:
    """The points map that landmarks are compared with.

    Raises:
        FormatError: the file holds something else.
    """
    from mapcli.formats.documents.world import read_world

    expected = "a points map for landmarks, YAML with points: [[x, y], ...]"
    if (SUFFIXES.get(Path(file).suffix.lower()) or sniff(data)) != "yaml":
        raise FormatError("is no YAML", file=file, expected=expected)
    if b"points" not in data:
        raise FormatError("holds no points", file=file, expected=expected)
    world = read_world(data, file)
    if not len(world.points):
        raise FormatError("holds no points", file=file, expected=expected)
    return world


def map_after(comparison: ScanOnMap | GridsOnMap, best: ScoredCandidate, low: float) -> GridMap:
    """The map with the best perception written into it (Fig. 9.22)."""
    return update_map(comparison.grid, comparison.perceived(best), low)
