"""ATE and RPE: hand-worked values, evo's values, and what cannot be compared."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from conftest import FIXTURES, SHARED
from hypothesis import given
from hypothesis import strategies as st

from mapcli.algorithms.evaluation.trajectory_error import (
    EvaluateParameters,
    associate,
    common_alignment,
    evaluate_trajectory,
    nearest_stamps,
    rigid_alignment,
    rpe_pairs,
    within_gaps,
)
from mapcli.errors import DataError
from mapcli.formats.documents.load_trajectory import load_trajectory
from mapcli.formats.documents.trajectory_text import dump_trajectory
from mapcli.formats.logs.open_log import open_log
from mapcli.model.evaluation import Errors, names_of_limits, statistics
from mapcli.model.pose import Pose2D, interpolate
from mapcli.model.scan import Odometry
from mapcli.model.trace import PoseTrace, TracedPose
from mapcli.model.trajectory import Trajectory, between, compose, interpolated, moved

APARTMENT = FIXTURES / "apartment.mcap"
DATASETS = SHARED / "datasets"
S = 1_000_000_000


def trajectory(*rows: tuple[float, float, float, float]) -> Trajectory:
    """From `t x y theta`."""
    table = np.array(rows, dtype=np.float64)
    return Trajectory(table[:, 1:], np.rint(table[:, 0] * S).astype(np.int64))


# evo

EVO = {
    ("1f", "ate"): ((0.307390, 0.245454, 0.169137, 0.185043, 0.041491, 0.731825),
                    (4.657009, 3.950320, 3.869291, 2.466314, 0.078394, 8.670953)),
    ("1f", "rpe"): ((0.006554, 0.005203, 0.004059, 0.003985, 0.000104, 0.021171),
                    (0.489393, 0.391288, 0.339488, 0.293937, 0.002896, 1.621323)),
    ("10f", "rpe"): ((0.025540, 0.021565, 0.019304, 0.013683, 0.000235, 0.055256),
                     (1.521122, 1.208577, 0.860440, 0.923663, 0.011693, 3.669342)),
    ("2m", "rpe"): ((0.045515, 0.040439, 0.035290, 0.020888, 0.017139, 0.102936),
                    (2.355682, 1.874632, 1.457672, 1.426532, 0.402052, 5.889208)),
}  # fmt: skip
"""What evo 1.38.1 prints (rmse, mean, median, std, min, max) for the file that `estimate` writes
and the fixture's true poses as TUM: `evo_ape tum truth.tum odom.tum -a -r trans_part` (second
line: `-r angle_deg`) and `evo_rpe tum truth.tum odom.tum -r trans_part --delta 1 --delta_unit f`
(then 10 f, 2 m)."""


@pytest.fixture(scope="module")
def estimate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Every third odometry reading of the apartment, its clock 4 ms late, as TUM."""
    readings = [r for r in open_log([str(APARTMENT)]).records() if isinstance(r, Odometry)][::3]
    path = tmp_path_factory.mktemp("evo") / "odom.tum"
    rows = [TracedPose(r.stamp_ns + 4_000_000, r.pose, None, None, "odometry") for r in readings]
    path.write_bytes(dump_trajectory(PoseTrace(tuple(rows)), path))
    return path


@pytest.mark.parametrize(("delta", "measure"), EVO)
def test_the_same_numbers_as_evo(delta: str, measure: str, estimate: Path) -> None:
    found, truth = (load_trajectory(str(path)).trajectory for path in (estimate, APARTMENT))
    parameters = EvaluateParameters(delta=float(delta[:-1]), delta_unit=delta[-1])
    evaluation = evaluate_trajectory(found, truth, parameters)
    assert (evaluation.matched, evaluation.total) == (340, 340)
    errors, (metres, degrees) = evaluation.errors[measure], EVO[delta, measure]
    assert tuple(statistics(errors.metres).values()) == pytest.approx(metres, abs=1e-6)
    assert tuple(statistics(errors.degrees).values()) == pytest.approx(degrees, abs=1e-6)


# Arithmetic

numbers = st.floats(-100, 100)
poses = st.builds(Pose2D, numbers, numbers, st.floats(-3.1, 3.1))


def rows(*found: Pose2D) -> np.ndarray:
    return np.array([(p.x, p.y, p.theta) for p in found])


@given(poses, poses, st.floats(0, 1))
def test_arrays_of_poses_are_as_poses(a: Pose2D, b: Pose2D, fraction: float) -> None:
    assert np.allclose(compose(rows(a), rows(b)), rows(a.compose(b)), atol=1e-9)
    assert np.allclose(between(rows(a), rows(b)), rows(a.between(b)), atol=1e-9)
    assert np.allclose(moved(rows(b), a), rows(a.compose(b)), atol=1e-9)
    path = Trajectory(rows(a, b), np.array([5, 5 + 10**6]))
    at = 5 + round(fraction * 10**6)
    expected = rows(interpolate(a, b, (at - 5) / 10**6))
    left = between(interpolated(np.array([at]), path), expected)
    assert np.allclose(left, 0, atol=1e-6)


@given(poses, st.lists(st.tuples(numbers, numbers), min_size=2, max_size=8, unique=True))
def test_alignment_undoes_any_motion(motion: Pose2D, points: list[tuple[float, float]]) -> None:
    truth = np.array(points)
    found = motion.inverse().apply(truth)
    assert np.allclose(rigid_alignment(found, truth).apply(found), truth, atol=1e-6)


def test_a_straight_path_is_not_mirrored() -> None:
    truth = np.array([(0, 0), (1, 0.1), (2, 0.0), (3, 0.1), (4, 0)])
    mirrored = truth * (1, -1)
    left = rigid_alignment(mirrored, truth).apply(mirrored) - truth
    assert np.hypot(*left.T).max() > 0.1


def test_statistics_by_hand() -> None:
    found = statistics(np.array([1.0, 2.0, 6.0, 3.0]))
    assert found["rmse"] == pytest.approx(math.sqrt(50 / 4))
    assert (found["mean"], found["median"], found["min"], found["max"]) == (3, 2.5, 1, 6)
    assert found["std"] == pytest.approx(math.sqrt(14 / 4))


def test_errors_by_hand() -> None:
    """Two metres along y and a quarter turn too much, whatever the expected pose."""
    expected = np.array([(5.0, 5.0, 3.0)])
    found = compose(expected, np.array([(0.0, 2.0, math.pi / 2)]))
    errors = Errors.of(expected, found, np.zeros(1))
    assert (errors.metres[0], errors.degrees[0]) == pytest.approx((2, 90))


# Association


def test_nearest_stamps() -> None:
    long, short = np.array([0, 10, 20, 30]) * S, np.array([9, 16, 35, 5]) * S
    assert [x.tolist() for x in nearest_stamps(long, short[:1], 1.0)] == [[1], [0]]
    assert [x.tolist() for x in nearest_stamps(short[:3], long, 4.0)] == [[0, 1], [1, 2]]
    assert [x.tolist() for x in nearest_stamps(long, short[3:], 5.0)] == [
        [0],
        [0],
    ]  # the earlier of two
    assert [x.tolist() for x in nearest_stamps(long[:1], short[:1], 1.0)] == [[], []]


def test_interpolation_bridges_small_gaps_only() -> None:
    known = np.array([0, 1, 5, 6]) * S
    stamps = np.array([-0.5, 0, 0.5, 1, 3, 5, 5.5, 6, 6.5]) * S
    assert within_gaps(stamps.astype(np.int64), known, 1.0).tolist() == [1, 2, 3, 5, 6, 7]


def test_the_reference_is_interpolated() -> None:
    truth = trajectory((0, 0, 0, 0), (2, 2, 0, 0), (4, 2, 2, math.pi / 2))
    found = trajectory((1, 1, 0, 0), (2, 2, 0, 0), (3, 2, 1, math.pi / 4), (9, 0, 0, 0))
    with pytest.raises(DataError, match="1 pose matched by stamps"):
        evaluate_trajectory(found, truth)
    evaluation = evaluate_trajectory(found, truth, EvaluateParameters(interpolate_s=2.0))
    assert (evaluation.matched, evaluation.total, evaluation.overlap_s) == (3, 4, 3)
    assert evaluation.numbers()["ate_max"] == pytest.approx(0, abs=1e-12)
    assert evaluation.numbers()["rpe_rot_max"] == pytest.approx(0, abs=1e-12)


def test_without_times_poses_are_compared_by_index() -> None:
    path = rows(Pose2D(), Pose2D(1, 0, 0.5), Pose2D(1, 1, 1))
    evaluation = evaluate_trajectory(Trajectory(moved(path, Pose2D(3, 4, 2))), Trajectory(path))
    assert evaluation.association == "by index"
    assert evaluation.overlap_s is None
    assert evaluation.numbers()["ate_max"] == pytest.approx(0, abs=1e-12)
    with pytest.raises(DataError, match=r"3 in the trace and 2 in the reference; expected equally"):
        evaluate_trajectory(Trajectory(path), Trajectory(path[:2]))


def test_pairs_along_the_path() -> None:
    path = rows(*(Pose2D(x) for x in (0, 0.6, 1.2, 1.3, 2.5, 2.6, 9)))
    for delta, unit, ends in ((2, "f", [0, 2, 4, 6]), (1, "m", [0, 2, 4, 6]), (5, "m", [0, 6])):
        first, second = rpe_pairs(path, EvaluateParameters(delta=delta, delta_unit=unit))
        assert [*first, second[-1]] == ends
    with pytest.raises(DataError, match="no two poses are 10 m apart; expected a smaller distance"):
        rpe_pairs(path, EvaluateParameters(delta=10, delta_unit="m"))


def test_limits_know_every_number() -> None:
    truth = trajectory((0, 0, 0, 0), (2, 2, 0, 0))
    assert tuple(evaluate_trajectory(truth, truth).numbers()) == names_of_limits("trajectory")


def test_one_alignment_of_two_traces() -> None:
    """One trace a metre to the left of the truth, the other a metre to the right, both in a frame
    that is turned by 90 degrees: no one motion is better than that turn."""
    truth = trajectory((0, 0, 0, 0), (1, 2, 0, 0))
    traces = [trajectory((0, -y, 0, math.pi / 2), (1, -y, 2, math.pi / 2)) for y in (1, -1)]
    parameters = EvaluateParameters()
    motion = common_alignment(traces, [associate(t, truth, parameters) for t in traces])
    assert (motion.x, motion.y) == pytest.approx((0, 0), abs=1e-12)
    assert motion.theta == pytest.approx(-math.pi / 2)
    for trace in traces:
        assert evaluate_trajectory(trace, truth).errors["ate"].metres == pytest.approx([0, 0])
        found = evaluate_trajectory(trace, truth, parameters, motion)
        assert found.errors["ate"].metres == pytest.approx([1, 1])
        assert found.aligned == motion
