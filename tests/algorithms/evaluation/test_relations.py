"""Errors by measured relations: hand-worked values, odometry between scans, a real log."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import SHARED

from mapcli.algorithms.evaluation.relations import evaluate_relations, poses_at
from mapcli.errors import DataError
from mapcli.formats.logs.open_log import open_log
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Odometry
from mapcli.model.trajectory import Relations, Trajectory

DATASETS = SHARED / "datasets"
S = 1_000_000_000


def trajectory(*rows: tuple[float, float, float, float]) -> Trajectory:
    """From `t x y theta`."""
    table = np.array(rows, dtype=np.float64)
    return Trajectory(table[:, 1:], np.rint(table[:, 0] * S).astype(np.int64))


def relations(*found: tuple[float, float, float, float, float]) -> Relations:
    """From `t1 t2 x y yaw`."""
    table = np.array(found)
    starts, ends = (np.rint(table[:, k] * S).astype(np.int64) for k in (0, 1))
    return Relations(starts, ends, table[:, 2:])


PATH = trajectory((0, 0, 0, 0), (1, 1, 0, math.pi / 2), (3, 1, 2, math.pi / 2))


def test_relations_by_hand() -> None:
    measured = relations((0, 1, 1, 0.5, math.pi / 2), (3, 1, -2, 0, 0.1), (1, 4, 0, 0, 0))
    evaluation = evaluate_relations(PATH, measured)
    errors = evaluation.errors["relations"]
    assert (evaluation.matched, evaluation.total) == (2, 3)  # the third ends after the trace
    assert errors.metres == pytest.approx([0.5, 0])
    assert errors.degrees == pytest.approx([0, math.degrees(0.1)])


def test_between_scans_the_odometry_carries_on() -> None:
    """The wheels' frame is turned by a quarter; they drove 1.5 m of 2 m, then stood."""
    wheels = trajectory((0, 0, 0, -math.pi / 2), (1, 0, 7, 0), (2, 1.5, 7, 0), (3, 1.5, 7, 0))
    moments = np.array([0, 1.5, 2.5, 3]) * S
    found = poses_at(moments.astype(np.int64), PATH, wheels)
    assert found == pytest.approx(
        np.array([(0, 0, 0), (1, 0.75, math.pi / 2), (1, 1.5, math.pi / 2), (1, 2, math.pi / 2)])
    )
    straight = poses_at(moments.astype(np.int64), PATH, None)
    assert straight[1] == pytest.approx((1, 0.5, math.pi / 2))


def test_relations_of_another_log() -> None:
    with pytest.raises(DataError, match="covers none of 1 relation: it has 3 poses from"):
        evaluate_relations(PATH, relations((7, 9, 0, 0, 0)))
    with pytest.raises(DataError, match="the trace has no times"):
        evaluate_relations(Trajectory(PATH.poses), relations((0, 1, 0, 0, 0)))


@pytest.mark.skipif(not DATASETS.exists(), reason="needs the real logs")
def test_the_relations_of_a_real_log() -> None:
    """Raw odometry against the relations, held against a plain loop over them."""
    from mapcli.formats.documents.relations import load_relations

    measured = load_relations(str(DATASETS / "intel-dense.relations.gz"))
    log = open_log([str(DATASETS / "intel-dense.log.gz")])
    wheels = [r for r in log.records() if isinstance(r, Odometry)]
    trace = Trajectory(
        np.array([(r.pose.x, r.pose.y, r.pose.theta) for r in wheels]),
        np.array([r.stamp_ns for r in wheels], np.int64),
    )
    by_stamp = {r.stamp_ns: r.pose for r in wheels}
    expected = []
    for start, end, row in zip(measured.from_ns, measured.to_ns, measured.poses, strict=True):
        left = Pose2D(*row).between(by_stamp[int(start)].between(by_stamp[int(end)]))
        expected.append(math.hypot(left.x, left.y))
    for odometry in (None, trace):
        errors = evaluate_relations(trace, measured, odometry).errors["relations"]
        assert errors.metres == pytest.approx(expected, abs=1e-9)
