"""How precise is the determination of the pose? (Activity 9.5)

Sets of readings that were measured at known poses are each compared with the database; the
confusion table counts which pose was found for which.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.measures import Similarity
from mapcli.algorithms.similarity.readings_table import database_table
from mapcli.errors import DataError
from mapcli.model.perception import (
    MeasuredTrials,
    PerceptionDatabase,
    Trial,
    measured_of,
)
from mapcli.model.similarity import ConfusionSummary

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Confusion:
    """Which pose was found for which.

    Attributes:
        poses: position and turn in degrees of each pose of the database.
        counts: shape (poses, poses + 1): row the true pose, column the one that was found, the
            last one where several were equally similar, so that nothing can be concluded.
    """

    poses: tuple[tuple[str, float], ...]
    counts: NDArray[np.int64]

    @property
    def right(self) -> int:
        """Trials whose pose was found."""
        return int(np.trace(self.counts))

    @property
    def right_position(self) -> int:
        """Trials whose position was found, whatever the heading."""
        names = np.array([position for position, _ in self.poses])
        return int(self.counts[:, :-1][names[:, None] == names].sum())

    def summary(self) -> ConfusionSummary:
        """What the table says in numbers."""
        total, right, position = int(self.counts.sum()), self.right, self.right_position
        ties = int(self.counts[:, -1].sum())
        return ConfusionSummary(total, ties, right, right / total, position, position / total)


def confusion(
    database: PerceptionDatabase,
    measured: MeasuredTrials,
    similarity: Similarity,
    bearing_weight: float = 1.0,
) -> Confusion:
    """Find the pose of every trial.

    Raises:
        DataError: a trial at a pose that the database does not have, or of other readings.
    """
    poses = tuple((e.position, e.turn_deg) for e in database.expectations)
    counts = np.zeros((len(poses), len(poses) + 1), np.int64)
    for k, trial in enumerate(measured.trials):
        truth = (trial.position, trial.turn_deg)
        if truth not in poses:
            raise DataError(
                f"{trial.position} at {trial.turn_deg:g} degrees", where=f"trials[{k}]",
                expected="a pose of the database",
            )  # fmt: skip
        table = database_table(database, trial.measured, similarity, bearing_weight)
        found = table.winners()
        alone = len(found) == 1
        column = poses.index((found[0].position, found[0].turn_deg)) if alone else len(poses)
        counts[poses.index(truth), column] += 1
    return Confusion(poses, counts)


@dataclass(frozen=True)
class ReadingNoise:
    """Normal noise of readings.

    Attributes:
        distance: standard deviation of ranges and distances, in the map's unit.
        bearing: of the bearings of landmarks, radians.
        seed: the same seed, the same noise.
    """

    distance: float
    bearing: float = 0.0
    seed: int = 0


def noisy_trials(database: PerceptionDatabase, noise: ReadingNoise, times: int) -> MeasuredTrials:
    """What a noisy sensor returns at every pose of a database, so many times."""
    random = np.random.default_rng(noise.seed)
    return MeasuredTrials(
        database.of,
        tuple(
            Trial(
                expected.position, expected.turn_deg,
                measured_of(
                    database.of, _noisy(database, expected.readings, noise, random),
                    database.range_max,
                ),
            )
            for expected in database.expectations
            for _ in range(times)
        ),
    )  # fmt: skip


def _noisy(
    database: PerceptionDatabase, readings: Floats, noise: ReadingNoise, random: np.random.Generator
) -> Floats:
    """Distances stay positive, and what is not seen stays so."""
    spread = np.array([noise.distance, noise.bearing])
    if database.of == "scan":
        spread = np.array([0.0, noise.distance])
    found = readings + random.normal(size=readings.shape) * spread[: readings.shape[1]]
    distance = 1 if database.of == "scan" else 0
    found[:, distance] = np.maximum(found[:, distance], 0.0)
    return np.asarray(found)
