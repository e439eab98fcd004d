"""One verb for all kinds of reference."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import FIXTURES

from mapcli.algorithms.evaluation.evaluate import evaluate
from mapcli.algorithms.evaluation.relations import odometry_of
from mapcli.algorithms.evaluation.trajectory_error import EvaluateParameters
from mapcli.errors import DataError
from mapcli.formats.documents.load_trajectory import load_trajectory
from mapcli.formats.logs.open_log import open_log
from mapcli.model.pose import Pose2D
from mapcli.model.scan import TruePose
from mapcli.model.trajectory import Relations, Trajectory

SECOND = 10**9
PATH = Trajectory(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], float), np.arange(3) * SECOND)


def test_a_trajectory_gives_ate_and_rpe() -> None:
    found = evaluate(PATH, PATH, EvaluateParameters(delta=2))
    assert found.kind == "trajectory"
    assert {name: len(errors) for name, errors in found.errors.items()} == {"ate": 3, "rpe": 1}


def test_relations_give_what_is_left_of_each() -> None:
    measured = Relations(np.array([0]), np.array([2 * SECOND]), np.array([[2.5, 0.0, 0.0]]))
    found = evaluate(PATH, measured)
    assert found.kind == "relations"
    assert found.errors["relations"].metres == pytest.approx([0.5])


@pytest.mark.slow
def test_the_records_of_its_own_log_give_a_self_check() -> None:
    log = str(FIXTURES / "apartment.mcap")
    found = evaluate(load_trajectory(log).trajectory, open_log([log]).records())
    assert (found.kind, list(found.errors)) == ("self-check", ["self_check"])
    assert 0 < found.matched <= found.total
    assert np.median(found.errors["self_check"].metres) < 0.02


def test_the_odometry_of_a_log() -> None:
    log = open_log([str(FIXTURES / "corridor.mcap")])
    odometry = odometry_of(log.records())
    assert odometry.poses[0].tolist() == [0, 0, 0]
    assert odometry.stamps_ns is not None
    assert (np.diff(odometry.stamps_ns) > 0).all()
    with pytest.raises(DataError, match="has no odometry"):
        odometry_of([TruePose(0, Pose2D())])
