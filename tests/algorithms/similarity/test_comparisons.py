"""Scoring perceptions on records: each kind on what it goes with, and nothing else."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import FIXTURES

from mapcli.algorithms.similarity.candidate_poses import CandidateWindow
from mapcli.algorithms.similarity.comparisons import score
from mapcli.algorithms.similarity.expected_perception import (
    RangeSensor,
    expect_perceptions,
    perception_at_intended,
)
from mapcli.algorithms.similarity.local_maxima import window_scores
from mapcli.errors import DataError
from mapcli.formats.documents.perception_reader import load_perception
from mapcli.formats.documents.world import load_world
from mapcli.formats.maps.load import load_map
from mapcli.model.perception import IntendedPose

CORNER = load_map(FIXTURES / "corner.txt").grid
SCAN = load_perception(FIXTURES / "corner-scan.yaml")
GRIDS = load_perception(FIXTURES / "corner-grids.yaml")
LANDMARKS = load_perception(FIXTURES / "landmarks.yaml")
POINTS = load_world(FIXTURES / "landmarks-map.yaml").world
HERE = IntendedPose(math.radians(90), cell=(4, 6))


@pytest.mark.parametrize("perception", [SCAN, GRIDS])
def test_scans_and_their_perception_maps_find_the_corner(perception: object) -> None:
    best = score(CORNER, perception).best()  # type: ignore[arg-type]
    assert best is not None
    assert (best.position, best.turn_deg) == ("intended", -15)


def test_readings_are_compared_with_l1_unless_told() -> None:
    assert score(CORNER, SCAN).similarity == "product"
    assert score(POINTS, LANDMARKS).similarity == "l1"
    assert score(POINTS, LANDMARKS, "l2").similarity == "l2"


def test_what_is_expected_at_a_pose_is_the_most_similar_to_itself() -> None:
    database = expect_perceptions(CORNER, HERE, sensor=RangeSensor(24, 360.0, 5.0))
    assert len(database.expectations) == 15
    best = score(database, perception_at_intended(database, HERE)).best()
    assert best is not None
    assert (best.position, best.turn_deg, best.score) == ("intended", 0, 0)


def test_the_intended_heading_is_always_expected() -> None:
    database = expect_perceptions(CORNER, HERE, steps=(0.0,), turns_deg=(30.0,))
    assert [e.turn_deg for e in database.expectations] == [0.0, 30.0]


def test_a_window_has_the_peak_of_its_table() -> None:
    window = CandidateWindow(2.0, 30.0, None, 5.0)
    table = score(CORNER, SCAN, window=window)
    scores = window_scores(table, window, CORNER.resolution)
    assert scores.along.tolist() == [-2, -1, 0, 1, 2]
    assert scores.maxima.peak.score == table.values.max() == np.nanmax(scores.surface)


def test_what_does_not_go_together() -> None:
    with pytest.raises(DataError, match="cannot be scored on"):
        score(POINTS, SCAN)
    with pytest.raises(DataError, match="cannot be scored on"):
        score(CORNER, LANDMARKS)
    with pytest.raises(DataError, match="kind: grids"):
        score(expect_perceptions(CORNER, HERE), GRIDS)
    with pytest.raises(DataError, match="a window of poses"):
        score(CORNER, GRIDS, window=CandidateWindow(1.0, 15.0))
