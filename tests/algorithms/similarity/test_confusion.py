"""How precisely poses are found from readings (Activity 9.5)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import FIXTURES

from mapcli import expect_perceptions, load_world, score
from mapcli.algorithms.similarity.confusion import ReadingNoise, confusion, noisy_trials
from mapcli.errors import DataError
from mapcli.model.perception import (
    UNTOLD,
    ExpectedReadings,
    IntendedPose,
    MeasuredTrials,
    PerceptionDatabase,
    ReadingsPerception,
    Trial,
)

BUMPS = [("intended", 0.0, [100, 0, 300]), ("up", 0.0, [400, 0, 300]), ("up", 15.0, [400, 0, 300])]
DATABASE = PerceptionDatabase(
    "readings",
    tuple(ExpectedReadings(p, t, None, np.array(r, float)[:, None]) for p, t, r in BUMPS),
)


def readings(*values: float) -> ReadingsPerception:
    return ReadingsPerception(UNTOLD, np.array(values))


def test_readings_of_any_sensors_find_their_pose() -> None:
    table = score(DATABASE, readings(120, 10, 290))
    best = table.best()
    assert best is not None
    assert (best.position, best.score) == ("intended", 20 + 10 + 10)
    assert table[1, 0].score == 280 + 10 + 10


def test_readings_that_are_missing_are_left_out() -> None:
    assert score(DATABASE, readings(math.nan, 10, 290))[1, 0].score == 20


def test_readings_of_another_length_are_refused() -> None:
    with pytest.raises(DataError, match="readings: 2 readings; expected 3, one for each sensor"):
        score(DATABASE, readings(1, 2))


def test_the_table_counts_what_was_found_for_what() -> None:
    trials = MeasuredTrials("readings", (
        Trial("intended", 0.0, readings(120, 0, 300)),
        Trial("intended", 0.0, readings(90, 0, 310)),
        Trial("intended", 0.0, readings(390, 0, 300)),  # equally near to both others
        Trial("up", 15.0, readings(110, 0, 300)),
    ))  # fmt: skip
    found = confusion(DATABASE, trials, "l1")
    assert found.counts.tolist() == [[2, 0, 0, 1], [0, 0, 0, 0], [1, 0, 0, 0]]
    assert (found.right, found.right_position) == (2, 2)


def test_a_trial_at_a_pose_that_is_not_in_the_database() -> None:
    trials = MeasuredTrials("readings", (Trial("left", 0.0, readings(1, 2, 3)),))
    with pytest.raises(DataError, match="left at 0 degrees"):
        confusion(DATABASE, trials, "l1")


@pytest.mark.parametrize("name", ["landmarks-map.yaml", "corner.txt"])
def test_without_noise_every_pose_is_found_and_noise_has_its_size(name: str) -> None:
    place = IntendedPose(0.0) if name == "landmarks-map.yaml" else IntendedPose(0.0, cell=(4, 6))
    database = expect_perceptions(load_world(FIXTURES / name).world, place)
    exact = noisy_trials(database, ReadingNoise(0.0), 2)
    found = confusion(database, exact, "l1")
    assert found.right == len(exact.trials) == 2 * len(database.expectations)

    alone = replace(database, expectations=database.expectations[:1])
    noisy = [t.measured for t in noisy_trials(alone, ReadingNoise(0.1, 0.02, 7), 2000).trials]
    many = np.array([m.measured if hasattr(m, "measured") else m.beams for m in noisy])  # type: ignore[union-attr]
    known = np.isfinite(database.expectations[0].readings).all(axis=1)
    spread = many[:, known].std(axis=0).mean(axis=0)
    expected = [0.1, 0.02] if hasattr(noisy[0], "measured") else [0.0, 0.1]
    assert spread == pytest.approx(expected, rel=0.05)
