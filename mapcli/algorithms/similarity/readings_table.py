"""The similarity table of readings: landmarks against a points map (Activity 9.4), or a set of
readings against a database of such sets (Activity 9.5)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.candidate_poses import CandidateFrame, Candidates
from mapcli.algorithms.similarity.expected_perception import expected_landmarks
from mapcli.algorithms.similarity.grid_table import table_of
from mapcli.algorithms.similarity.measures import (
    LOWER_IS_BETTER,
    Similarity,
    similarity_of_readings,
)
from mapcli.errors import DataError
from mapcli.model.perception import (
    LandmarkPerception,
    Measured,
    PerceptionDatabase,
    ReadingsKind,
    ReadingsPerception,
    ScanPerception,
)
from mapcli.model.pose import Pose2D
from mapcli.model.similarity import SimilarityTable
from mapcli.model.world import World

Floats = NDArray[np.float64]

SAME_BEARING = math.radians(0.1)


def landmark_table(
    world: World,
    perception: LandmarkPerception,
    candidates: Candidates,
    similarity: Similarity,
    bearing_weight: float = 1.0,
) -> SimilarityTable:
    """Score measured distances and bearings at every candidate.

    Bearings count in radians times `bearing_weight`. Equal, for `agreement` and `jaccard`, are
    readings within the first step and the smallest turn of the perception.

    Raises:
        DataError: another number of landmarks than the map has points.
    """
    _same_count(len(perception.measured), len(world.points), "point of the map")
    frame = CandidateFrame(perception.intended_pose.pose(None))
    shape = len(candidates.names), len(candidates.turns_deg)
    poses = [candidates.pose(frame, r, c) for r, c in np.ndindex(shape)]
    array = np.array([(pose.x, pose.y, pose.theta) for pose in poses])
    expected = expected_landmarks(world.points, array)
    scores = _landmark_scores(similarity, expected, perception, bearing_weight)
    overlap = np.full(shape, count_readings(perception.measured), np.int64)
    return table_of(similarity, candidates, scores.reshape(shape), overlap, frame)


def _landmark_scores(
    similarity: Similarity, expected: Floats, perception: LandmarkPerception, weight: float
) -> Floats:
    """Bearings are wrapped around the expected ones, so that 179 and -179 degrees are near."""
    turn = (perception.measured[:, 1] - expected[..., 1] + math.pi) % math.tau - math.pi
    distance = np.broadcast_to(perception.measured[:, 0], turn.shape)
    measured = np.stack([distance, expected[..., 1] + turn], axis=2)
    step = next((step for step in perception.steps if step), 1.0)
    turns = [abs(turn) for turn in perception.turns_deg if turn] or [15.0]
    scale = np.array([1.0, weight])
    tolerance = np.array([step, math.radians(min(turns))])
    return similarity_of_readings(similarity, expected * scale, measured * scale, tolerance * scale)


def count_readings(measured: Floats) -> int:
    """How many readings are not NaN."""
    return int((~np.isnan(measured).any(axis=1)).sum())


def database_table(
    database: PerceptionDatabase,
    perception: Measured,
    similarity: Similarity,
    bearing_weight: float = 1.0,
) -> SimilarityTable:
    """Score a set of readings against those that are expected at each pose of a database.

    Beams without return count as the scan's `range_max`.

    Raises:
        DataError: other readings than the database holds.
    """
    kind = _kind_of(perception)
    if kind != database.of:
        raise DataError(f"kind: {kind}", expected=f"{database.of}, as in the database")
    known = database.expectations
    if isinstance(perception, ScanPerception):
        scores = _scan_scores(similarity, database, perception)
        overlap = len(perception.beams)
    elif isinstance(perception, ReadingsPerception):
        measured = perception.readings[:, None]
        for expectation in known:
            _same_count(
                len(measured), len(expectation.readings), "sensor of the database", "readings"
            )
        expected = np.stack([expectation.readings for expectation in known])
        step = np.array([database.step])
        scores = similarity_of_readings(similarity, expected, measured, step)
        overlap = count_readings(measured)
    else:
        for expectation in known:
            _same_count(len(perception.measured), len(expectation.readings), "in the database")
        expected = np.stack([expectation.readings for expectation in known])
        scores = _landmark_scores(similarity, expected, perception, bearing_weight)
        overlap = count_readings(perception.measured)
    return _by_name(database, similarity, scores, overlap)


def _kind_of(perception: Measured) -> ReadingsKind:
    if isinstance(perception, ScanPerception):
        return "scan"
    return "landmarks" if isinstance(perception, LandmarkPerception) else "readings"


def _scan_scores(
    similarity: Similarity, database: PerceptionDatabase, scan: ScanPerception
) -> Floats:
    order = np.argsort(scan.beams[:, 0], kind="stable")
    bearing, reach = scan.beams[order].T
    expected = []
    for expectation in database.expectations:
        theirs = expectation.readings[np.argsort(expectation.readings[:, 0], kind="stable")]
        _same_count(len(bearing), len(theirs), "beam in the database")
        if (np.abs(theirs[:, 0] - bearing) > SAME_BEARING).any():
            raise DataError(
                "beams: at other bearings than those in the database",
                expected="the same sensor for both",
            )
        expected.append(np.minimum(theirs[:, 1], scan.range_max))
    measured = np.minimum(reach, scan.range_max)[:, None]
    return similarity_of_readings(similarity, np.stack(expected)[..., None], measured,
                       np.array([database.step]))  # fmt: skip


def _same_count(ours: int, theirs: int, what: str, where: str = "") -> None:
    if ours != theirs:
        expected = f"{theirs}, one for each {what}, in its order"
        raise DataError(f"{ours} readings", where=where, expected=expected)


def _by_name(
    database: PerceptionDatabase, similarity: Similarity, scores: Floats, overlap: int
) -> SimilarityTable:
    known = database.expectations
    rows = tuple(dict.fromkeys(e.position for e in known))
    columns = tuple(dict.fromkeys(e.turn_deg for e in known))
    values = np.full((len(rows), len(columns)), np.nan)
    compared = np.zeros(values.shape, np.int64)
    poses: dict[tuple[int, int], Pose2D | None] = {}
    for expectation, score in zip(known, scores, strict=True):
        place = rows.index(expectation.position), columns.index(expectation.turn_deg)
        values[place], compared[place] = score, overlap
        poses[place] = expectation.pose
    lower = similarity in LOWER_IS_BETTER
    return SimilarityTable(
        similarity, lower, rows, columns, values, compared, lambda r, c: poses.get((r, c)),
        values.size - len(known),
    )  # fmt: skip
