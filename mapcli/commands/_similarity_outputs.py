"""What `mapcli similarity-table` writes: the table in its forms, pictures, the map after it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.candidate_poses import CandidateWindow
from mapcli.algorithms.similarity.comparisons import (
    GridsOnMap,
    LandmarksOnMap,
    ReadingsInDatabase,
    ScanOnMap,
    Scoring,
    map_after,
)
from mapcli.algorithms.similarity.expected_perception import obstacle_position
from mapcli.algorithms.similarity.grid_table import pose_in_cells
from mapcli.algorithms.similarity.local_maxima import window_scores
from mapcli.algorithms.similarity.map_excerpt import crop_to_all, crop_to_perception
from mapcli.algorithms.similarity.ternary_map import ternary_cells
from mapcli.commands._frontier_outputs import map_files
from mapcli.commands._similarity_inputs import Loaded
from mapcli.errors import DataError
from mapcli.formats.documents.similarity_table import (
    csv_text,
    markdown_lines,
    pose_content,
    rounded,
    table_bytes,
    window_bytes,
)
from mapcli.model.grid import GridMap
from mapcli.model.local_maxima import WindowScores
from mapcli.model.pose import Pose2D
from mapcli.model.similarity import ScoredCandidate, SimilarityTable, TableSummary
from mapcli.model.world import World

Floats = NDArray[np.float64]

Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Answer:
    """Scores, and how they came about.

    Attributes:
        sightings: distances and bearings (degrees) to be located.
        window, scores: of a window: its half-widths, and what its scores look like.
    """

    loaded: Loaded
    scoring: Scoring
    table: SimilarityTable
    sightings: tuple[Point, ...] = ()
    window: CandidateWindow | None = None
    scores: WindowScores | None = None

    @property
    def best(self) -> ScoredCandidate | None:
        return self.scores.maxima.peak if self.scores else self.table.best()

    @property
    def unit(self) -> str:
        """What steps are counted in."""
        if isinstance(self.loaded.comparison, ReadingsInDatabase):
            return "step"
        return "unit" if isinstance(self.loaded.comparison, LandmarksOnMap) else "cell"

    def summary(self) -> TableSummary:
        """What the scores say, in numbers."""
        table, best = self.table, self.best
        maxima = self.scores.maxima if self.scores else None
        found = TableSummary(
            candidates=int(table.comparable().sum()),
            ties=maxima.plateau - 1 if maxima else max(len(table.winners()) - 1, 0),
            at_border=maxima is not None and maxima.at_border,
        )
        if best is None:
            return found
        second = maxima.second if maxima else table.runner_up()
        intended, pose = self.loaded.comparison.intended(), best.pose
        return replace(
            found,
            score=rounded(best.score),
            overlap=best.overlap,
            margin=None if second is None else rounded(abs(best.score - second.score)),
            distance=rounded(intended.distance(pose)) if intended and pose else None,
            turn_deg=rounded(best.turn_deg),
        )

    def located(self) -> list[dict[str, Any]]:
        """Where sightings are, from the best pose and from the intended one (Activity 9.4)."""
        places = {
            "from_best": self.best.pose if self.best else None,
            "from_intended": self.loaded.comparison.intended(),
        }
        return [
            {
                "distance": distance,
                "bearing_deg": degrees,
                **{
                    name: None if pose is None else _point(pose, distance, degrees)
                    for name, pose in places.items()
                },
            }
            for distance, degrees in self.sightings
        ]

    def json(self) -> bytes:
        digests = self.loaded.digests
        parameters: dict[str, Any] = asdict(self.scoring)
        summary = self.summary()
        if self.scores is not None:
            assert self.window is not None
            parameters["window"] = asdict(self.window)
            return window_bytes(self.table, self.scores, summary, digests, parameters)
        intended = self.loaded.comparison.intended()
        extra: dict[str, Any] = {"intended": intended and pose_content(intended)}
        if self.sightings:
            extra["located"] = self.located()
        return table_bytes(self.table, summary, digests, parameters, extra)

    def text(self, form: str) -> str:
        """The table as json, csv or markdown."""
        if form == "json":
            return self.json().decode()
        if self.scores is not None:
            along, surface = self.scores.along, self.scores.surface
            rows, columns = along[::-1].round(6).tolist(), along.round(6).tolist()
            if form == "csv":
                return csv_text(rows, columns, surface, "up\\right")
            return "\n".join(_markdown_surface(rows, columns, surface)) + "\n"
        table = self.table
        if form == "csv":
            return csv_text(table.rows, table.columns, table.values, "position\\turn_deg")
        return "\n".join(markdown_lines(table, self.unit)) + "\n"


def _point(pose: Pose2D, distance: float, degrees: float) -> dict[str, float]:
    x, y = obstacle_position(pose, distance, math.radians(degrees))
    return {"x": round(x, 6) + 0.0, "y": round(y, 6) + 0.0}


def _markdown_surface(rows: list[float], columns: list[float], surface: Floats) -> list[str]:
    from mapcli.formats.documents.similarity_table import number_text

    lines = [["up / right", *(f"{c:g}" for c in columns)], ["---:"] * (len(columns) + 1)]
    lines += [
        [f"{row:g}", *map(number_text, values)]
        for row, values in zip(rows, surface.tolist(), strict=True)
    ]
    return [f"| {' | '.join(line)} |" for line in lines]


def window_answer(answer: Answer, window: CandidateWindow) -> Answer:
    """The answer for a window.

    Raises:
        DataError: all poses score the same, so that there is no peak.
    """
    comparison = answer.loaded.comparison
    assert isinstance(comparison, ScanOnMap | LandmarksOnMap)  # others have no windows
    scores = window_scores(answer.table, window, comparison.cell)
    return replace(answer, window=window, scores=scores)


def write_png(answer: Answer) -> bytes:
    """The picture: panels of matrices, a plan of landmarks, or the scores of a window."""
    from mapcli.pictures import similarity as picture

    comparison = answer.loaded.comparison
    if answer.scores is not None:
        from mapcli.pictures.score_map import heat_map

        return heat_map(answer.scores, lower=answer.table.lower)
    best = _best_of(answer)
    if isinstance(comparison, LandmarksOnMap):
        assert best.pose is not None  # landmarks always have one
        poses = {"intended": comparison.intended(), "best": best.pose}
        return picture.landmark_plan(
            comparison.world.points, poses, comparison.landmarks.measured, best.pose
        )
    assert isinstance(comparison, ScanOnMap | GridsOnMap)
    low = answer.scoring.low
    cells, perceived, corner = crop_to_perception(
        ternary_cells(comparison.grid, low), comparison.perceived(best, near=True)
    )
    robot = _robot_in(comparison.grid, best.pose, corner, len(cells))
    return picture.panels(cells, perceived, robot, best, answer.scoring.similarity)


def candidates_png(answer: Answer) -> bytes:
    """The picture of all candidates: what each perceives, in the cells of the map."""
    from mapcli.pictures import similarity as picture

    comparison, table = answer.loaded.comparison, answer.table
    assert isinstance(comparison, ScanOnMap | GridsOnMap)
    able = [table[r, c] for r, c in np.argwhere(table.comparable()).tolist()]
    _best_of(answer)  # there is one to show
    cells = ternary_cells(comparison.grid, answer.scoring.low)
    maps = [comparison.perceived(one, near=True) for one in able]
    parts, corner = crop_to_all(cells, maps)
    robots = [_robot_in(comparison.grid, one.pose, corner, len(parts[0])) for one in able]
    shown = list(zip(parts, robots, able, strict=True))
    return picture.candidates(shown, len(table.columns), _best_of(answer).place)


def _robot_in(
    grid: GridMap, pose: Pose2D | None, corner: tuple[int, int], rows: int
) -> tuple[float, float, float] | None:
    """Row, column and heading of a pose in so many rows of a map, from a column and a row (from
    below) on; None if it is not known."""
    if pose is None:
        return None
    u, v, theta = pose_in_cells(grid, pose)
    return corner[1] + rows - v - 0.5, u - corner[0] - 0.5, theta


def _best_of(answer: Answer) -> ScoredCandidate:
    """The best candidate, or else the first of equals.

    Raises:
        DataError: there is none.
    """
    winners = answer.table.winners()
    best = answer.best or (winners[0] if winners else None)
    if best is None:
        raise DataError("no candidate can be compared", file=answer.loaded.perception)
    return best


def updated_map(name: str, answer: Answer) -> dict[str, bytes]:
    """The files of the map after the update: name without its folder -> content.

    Raises:
        DataError: there is no best pose to write from.
    """
    comparison = answer.loaded.comparison
    if answer.best is None:
        raise DataError("no pose is the best, so the map cannot be updated",
                        file=answer.loaded.perception)  # fmt: skip
    if isinstance(comparison, LandmarksOnMap):
        from mapcli.formats.documents.world import write_world

        added = [(p["from_best"]["x"], p["from_best"]["y"]) for p in answer.located()]
        points = np.concatenate([comparison.world.points, np.array(added).reshape(-1, 2)])
        return {PurePath(name).name: write_world(World(comparison.world.polygons, points))}
    assert not isinstance(comparison, ReadingsInDatabase)
    grid = map_after(comparison, answer.best, answer.scoring.low)
    return map_files(name, grid)
