"""What `mapcli similarity-table` writes: the table in its forms, pictures, the map after it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.candidate_poses import CandidateWindow
from mapcli.algorithms.similarity.expected_perception import obstacle_position
from mapcli.algorithms.similarity.grid_table import pose_in_cells, ternary_cells
from mapcli.algorithms.similarity.local_maxima import find_local_maxima
from mapcli.algorithms.similarity.map_update import crop_to_perception
from mapcli.algorithms.similarity.measures import higher_is_better
from mapcli.commands._frontier_outputs import map_files, write_all
from mapcli.commands._similarity_inputs import (
    GridsOnMap,
    LandmarksOnMap,
    Loaded,
    ReadingsInDatabase,
    ScanOnMap,
    Settings,
    map_after,
)
from mapcli.errors import DataError
from mapcli.formats.documents.similarity_table import (
    csv_text,
    markdown_lines,
    pose_content,
    table_bytes,
    window_bytes,
)
from mapcli.model.local_maxima import LocalMaxima
from mapcli.model.pose import Pose2D
from mapcli.model.similarity import ScoredCandidate, SimilarityTable
from mapcli.model.world import World

Floats = NDArray[np.float64]

Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Answer:
    """Scores, and how they came about.

    Attributes:
        sightings: distances and bearings (degrees) to be located.
        window, along, surface, peaks: of a window: its half-widths, steps along one axis in the
            map's unit, best score of all headings as (up, right) from above, and peaks.
    """

    loaded: Loaded
    settings: Settings
    table: SimilarityTable
    sightings: tuple[Point, ...] = ()
    window: CandidateWindow | None = None
    along: Floats | None = None
    surface: Floats | None = None
    peaks: LocalMaxima | None = None

    @property
    def best(self) -> ScoredCandidate | None:
        return self.peaks.peak if self.peaks else self.table.best()

    @property
    def unit(self) -> str:
        """What steps are counted in."""
        if isinstance(self.loaded.comparison, ReadingsInDatabase):
            return "step"
        return "unit" if isinstance(self.loaded.comparison, LandmarksOnMap) else "cell"

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
        parameters: dict[str, Any] = asdict(self.settings)
        if self.peaks is not None:
            assert self.window is not None
            assert self.along is not None
            assert self.surface is not None
            parameters["window"] = asdict(self.window)
            return window_bytes(
                self.table, self.surface, self.along, self.peaks, digests, parameters
            )
        intended = self.loaded.comparison.intended()
        extra: dict[str, Any] = {"intended": intended and pose_content(intended)}
        if self.sightings:
            extra["located"] = self.located()
        return table_bytes(self.table, digests, parameters, extra)

    def text(self, form: str) -> str:
        """The table as json, csv or markdown."""
        if form == "json":
            return self.json().decode()
        if self.along is not None and self.surface is not None:
            rows, columns = self.along[::-1].round(6).tolist(), self.along.round(6).tolist()
            if form == "csv":
                return csv_text(rows, columns, self.surface, "up\\right")
            return "\n".join(_markdown_surface(rows, columns, self.surface)) + "\n"
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
    """The answer for a window: its peaks and the best score of all headings at each position.

    Raises:
        DataError: all poses score the same, so that there is no peak.
    """
    comparison, table = answer.loaded.comparison, answer.table
    cell = comparison.grid.resolution if isinstance(comparison, ScanOnMap) else None
    along, turns = window.axes(cell)
    peaks = find_local_maxima(table, answer.settings.similarity, (along, turns), cell or 1.0)
    scores = higher_is_better(
        answer.settings.similarity, np.where(table.comparable(), table.values, np.nan)
    )
    highest = scores.max(axis=1).reshape(len(along), len(along))[::-1]
    surface = np.where(np.isfinite(highest), -highest if table.lower else highest, np.nan)
    along_m = along * (cell or 1.0)
    return replace(answer, window=window, along=along_m, surface=surface + 0.0, peaks=peaks)


def write_png(answer: Answer) -> bytes:
    """The picture: panels of matrices, a plan of landmarks, or the scores of a window."""
    from mapcli.pictures import similarity as picture

    comparison = answer.loaded.comparison
    if answer.peaks is not None and answer.surface is not None and answer.along is not None:
        return picture.heat_map(
            answer.surface, answer.along, answer.peaks, lower=answer.table.lower
        )
    best = _best_of(answer)
    if isinstance(comparison, LandmarksOnMap):
        assert best.pose is not None  # landmarks always have one
        poses = {"intended": comparison.intended(), "best": best.pose}
        return picture.landmark_plan(
            comparison.world.points, poses, comparison.landmarks.measured, best.pose
        )
    assert isinstance(comparison, ScanOnMap | GridsOnMap)
    low = answer.settings.low
    signs, perceived, corner = crop_to_perception(
        ternary_cells(comparison.grid, low), comparison.perceived(best, near=True)
    )
    robot = None
    if best.pose is not None:
        u, v, theta = pose_in_cells(comparison.grid, best.pose)
        robot = (corner[1] + len(signs) - v - 0.5, u - corner[0] - 0.5, theta)
    return picture.panels(signs, perceived, robot, best, answer.settings.similarity)


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


def write_update(name: str, answer: Answer, *, no_clobber: bool) -> None:
    """Write the map after the update.

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
        data = write_world(World(comparison.world.polygons, points))
        write_all(name, {name: data}, no_clobber=no_clobber)
        return
    assert not isinstance(comparison, ReadingsInDatabase)
    grid = map_after(comparison, answer.best, answer.settings.low)
    write_all(name, map_files(name, grid), no_clobber=no_clobber)
