"""Lawnmowers (Activity 9.3): plans, the Kalman filter with landmarks, many runs, the report."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from conftest import run
from mcap.reader import make_reader

from mapcli.algorithms.simulation._kernels.mowing import (
    Lawn,
    RunRecord,
    Step,
    WheelErrors,
    correct,
    mark_under,
    mow_once,
    predict_covariance,
    steer,
    true_motion,
    truncate_axis,
    truncated_gaussian,
)
from mapcli.algorithms.simulation.mowing import MowerModel, landmark_sizes, mow, smallest_reliable
from mapcli.algorithms.simulation.mowing_plan import plan_mowing
from mapcli.algorithms.simulation.sensors import WheelModel
from mapcli.errors import DataError
from mapcli.model.mowing import Mowing
from mapcli.model.pose import Pose2D
from mapcli.model.world import World

LAWN = World.of([[[0, 0], [4, 0], [4, 2], [0, 2]]])
EXACT = WheelModel(noise=(0, 0, 0, 0))
NOISE = np.array([0.02, 0.02, 0.02, 0.005])


# --- the plan


def test_lanes_go_back_and_forth() -> None:
    plan = plan_mowing(LAWN, 1.0)
    assert plan.waypoints.tolist() == [[0.5, 0.5], [3.5, 0.5], [3.5, 1.5], [0.5, 1.5], [0.5, 0.5]]
    assert (plan.lanes, plan.distance) == (2, 8)


def test_upright_lawn_and_station() -> None:
    upright = World.of([[[0, 0], [2, 0], [2, 4], [0, 4]]], [[0, -1]])
    plan = plan_mowing(upright, 1.0)
    assert plan.station.tolist() == [0, -1]
    assert plan.waypoints[1:-1].tolist() == [[0.5, 0.5], [0.5, 3.5], [1.5, 3.5], [1.5, 0.5]]


def test_landmarks_lie_on_the_path() -> None:
    plan = plan_mowing(LAWN, 1.0, 4)
    assert plan.marks.tolist() == [[1.5, 0.5], [3.5, 0.5], [2.5, 1.5], [0.5, 1.5]]
    assert plan.largest_mark == 1


@pytest.mark.parametrize(
    ("world", "width", "message"),
    [
        (World(), 1, "0 polygons; expected one polygon, the lawn"),
        (LAWN, 2.5, "the lawn, 4 m x 2 m, is too narrow"),
        (LAWN, 1e-5, "lanes; expected at most 10,000"),
        (World.of([[(0, 0), (2, 2), (2, 0), (0, 2)]]), 0.1, "is no simple outline"),
        (World.of([[(0, 0), (9, 0), (9, 5), (5, 1), (0, 5)]]), 0.5, "leave the lawn and enter"),
    ],
)
def test_lawns_that_are_none(world: World, width: float, message: str) -> None:
    with pytest.raises(DataError) as error:
        plan_mowing(world, width)
    assert message in str(error.value)


def test_landmarks_of_several_sizes_are_tried() -> None:
    assert landmark_sizes(plan_mowing(LAWN, 1.0), 0.4) == [None]
    plan = plan_mowing(LAWN, 1.0, 4)
    assert landmark_sizes(plan, 0.3) == [None, 0.3, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8]
    with pytest.raises(DataError, match=r"4 landmarks of 1 m would touch; expected less than 1.00"):
        landmark_sizes(plan, 1.0)


# --- one step, against slow and obvious twins


def test_steering() -> None:
    step = Step(0.1, 0.05)
    pose = np.array([0.0, 0.0, 0.0])
    assert steer(pose, np.array([2.0, 0.0]), step) == (0.1, 0, False)
    assert steer(pose, np.array([0.0, -2.0]), step) == (0, -0.05, False)  # on the spot
    assert steer(pose, np.array([0.07, 0.0]), step) == (0.07, 0, True)
    assert steer(pose, pose[:2], step) == (0, 0, True)


def test_what_robots_do_is_what_wheels_measure_the_other_way_round() -> None:
    model = WheelModel(noise=(0, 0, 0, 0), scale=1.1, turn_scale=0.9, drift_deg=3)
    wheels = WheelErrors(np.zeros(4), 1.1, 0.9, math.radians(3))
    distance, turn = true_motion(0.4, 0.2, wheels, np.zeros(2))
    back = model.measured(Pose2D(distance, 0, turn), np.random.default_rng(0))
    assert (back.x, back.theta) == pytest.approx((0.4, 0.2))


@pytest.mark.slow
def test_the_covariance_is_that_of_many_runs() -> None:
    rng = np.random.default_rng(1)
    count, steps = 20_000, 40
    poses, covariance, heading = np.zeros((count, 3)), np.zeros((3, 3)), 0.0
    for _ in range(steps):
        way, turn = 0.1, 0.02
        predict_covariance(covariance, heading + turn / 2, way, turn, NOISE)
        heading += turn
        ways = way + math.sqrt(0.02**2 * way + 0.005**2 * turn) * rng.standard_normal(count)
        turns = turn + math.sqrt(0.02**2 * (way + turn)) * rng.standard_normal(count)
        middle = poses[:, 2] + turns / 2
        poses += np.column_stack([ways * np.cos(middle), ways * np.sin(middle), turns])
    np.testing.assert_allclose(np.cov(poses.T), covariance, rtol=0.05, atol=2e-4)


@pytest.mark.parametrize(
    ("mean", "sigma", "low", "high"),
    [(0.0, 1.0, -1.0, 2.0), (0.3, 0.5, 0.9, 1.1), (5.0, 2.0, 0.0, 1.0), (0.5, 10.0, 0.0, 1.0)],
)
def test_a_truncated_gaussian(mean: float, sigma: float, low: float, high: float) -> None:
    x = np.linspace(low, high, 200_001)
    density = np.exp(-(((x - mean) / sigma) ** 2) / 2)
    density /= density.sum()
    expected = float((x * density).sum())
    variance = float(((x - expected) ** 2 * density).sum())
    cut, share = truncated_gaussian(mean, sigma, low, high)
    assert cut == pytest.approx(expected, abs=1e-4)
    assert share * sigma**2 == pytest.approx(variance, rel=2e-2)


def test_far_out_and_narrow_bounds_give_their_nearest_point() -> None:
    assert truncated_gaussian(0.0, 0.1, 5.0, 6.0)[0] == 5
    assert truncated_gaussian(0.0, 1e6, 5.0, 6.0)[0] == 5
    estimate, covariance = np.zeros(3), np.zeros((3, 3))
    truncate_axis(estimate, covariance, 0, 5.0, 6.0)  # it knows for sure where it is
    assert estimate.tolist() == [0, 0, 0]


def test_a_mark_corrects_position_and_heading() -> None:
    covariance = np.zeros((3, 3))
    for _ in range(200):  # 5 m east
        predict_covariance(covariance, 0.0, 0.025, 0.0, NOISE)
    estimate = np.array([5.0, 0.0, 0.0])
    before = covariance.copy()
    correct(estimate, covariance, np.array([5.15, 0.3]), 0.2, 0.025)
    # It came over the western edge, 5.05, and is between 0.2 and 0.4 north.
    assert estimate[0] == pytest.approx(5.05, abs=0.025)
    assert 0.2 <= estimate[1] <= 0.4
    assert estimate[2] > 0.02  # so it had turned left
    assert (np.diag(covariance) < np.diag(before)).all()
    assert np.linalg.eigvalsh(covariance).min() > -1e-9


def test_marks_under_a_robot() -> None:
    marks = np.array([[0.0, 0.0], [1.0, 0.0]])
    assert mark_under(np.array([1.05, -0.1, 0.0]), marks, 0.2) == 1
    assert mark_under(np.array([1.1, -0.11, 0.0]), marks, 0.2) == -1
    assert mark_under(np.array([0.0, 0.0, 0.0]), marks, -1.0) == -1


@pytest.mark.slow
def test_compiled_and_plain_runs_are_the_same() -> None:
    plan = plan_mowing(LAWN, 1.0, 4)
    normals = np.random.default_rng(2).standard_normal((600, 2))
    wheels = WheelErrors(NOISE, 1.0, 1.0, 0.0)
    results = []
    for function in (mow_once, mow_once.py_func):
        record = RunRecord(np.zeros((600, 2)), np.zeros((600, 2)), np.zeros(4, dtype=np.int64))
        lawn = Lawn(plan.waypoints, plan.marks, 0.3)
        count = function(lawn, Step(0.05, 0.1), wheels, NOISE, normals, record)
        results.append((count, record.path[:count], record.seen.tolist()))
    assert results[0][0] == results[1][0] < 600
    assert results[0][2] == results[1][2]
    np.testing.assert_allclose(results[0][1], results[1][1], atol=1e-9)


# --- many runs


def sent(wheels: WheelModel, size: float | None = None, runs: int = 20, seed: int = 0) -> Mowing:
    plan = plan_mowing(LAWN, 0.5, 0 if size is None else 8)
    return mow(plan, MowerModel(wheels), size, runs, seed)


def test_exact_wheels_come_home_and_cut_all() -> None:
    mowing = sent(EXACT, runs=2)
    assert mowing.distances.max() < 1e-6
    assert mowing.mown.min() > 0.98
    assert mowing.systematic_share == 0
    assert mowing.detected is None


def test_runs_depend_on_the_seed_and_their_number_only() -> None:
    wheels = WheelModel()
    few, many = sent(wheels, runs=3), sent(wheels, runs=5)
    assert (few.end_errors == many.end_errors[:3]).all()
    assert (few.end_errors != sent(wheels, runs=3, seed=1).end_errors).all()


def test_noise_differs_from_run_to_run_and_drift_does_not() -> None:
    noise = sent(WheelModel(), runs=40)
    assert noise.systematic_share < 0.3
    assert noise.distances.mean() > 0.1
    drift = sent(WheelModel(noise=(0.001,) * 4, drift_deg=1))
    assert drift.systematic_share > 0.95
    assert drift.scatter < 0.2 * drift.distances.mean()


def test_landmarks_bring_mowers_home() -> None:
    wheels = WheelModel(noise=(0.04, 0.04, 0.04, 0.01))
    alone, marked = sent(wheels, runs=40), sent(wheels, 0.4, runs=40)
    assert marked.distances.mean() < 0.5 * alone.distances.mean()
    assert marked.mown.mean() > alone.mown.mean()
    tiny = sent(wheels, 0.02, runs=40)
    assert tiny.detected is not None
    assert marked.detected is not None
    assert tiny.detected < marked.detected
    assert smallest_reliable([tiny, marked], 0.01) == 0.02
    assert smallest_reliable([tiny, marked], (tiny.detected + marked.detected) / 2) == 0.4
    assert smallest_reliable([tiny, marked], 1.01) is None


def test_a_lawn_beyond_all_bounds() -> None:
    plan = plan_mowing(World.of([[(0, 0), (1e6, 0), (1e6, 3), (0, 3)]]), 1.0)
    with pytest.raises(DataError, match="steps; expected at most 2,000,000"):
        mow(plan, MowerModel(EXACT), None, 1, 0)


# --- the command


@pytest.fixture
def lawn(tmp_path: Path) -> str:
    path = tmp_path / "lawn.yaml"
    path.write_text("polygons: [[[0, 0], [4, 0], [4, 2], [0, 2]]]\n")
    return str(path)


def test_the_command(tmp_path: Path, lawn: str, capsys: pytest.CaptureFixture[str]) -> None:
    out, png, report = (str(tmp_path / name) for name in ("o.mcap", "o.png", "o.json"))
    options = ["--mow", "--mow-width", "0.5", "--runs", "5", "--landmarks", "6"]
    arguments = ["simulate", lawn, out, *options, "--png", png, "--json", report]
    assert run(*arguments) == 0
    printed = capsys.readouterr().out
    assert "lawn  4 m x 2 m, 4 lanes of 0.5 m" in printed
    assert "of 5 runs, to within a lane's width" in printed
    assert "with 6 of 0.4 m" in printed
    assert "reliable  " in printed
    document = json.loads(Path(report).read_text())
    assert document["format"] == "mapcli.mowing"
    assert [each["landmark_size_m"] for each in document["mowings"][:2]] == [None, 0.4]
    assert len(document["mowings"][0]["runs"]) == 5
    assert Path(png).read_bytes().startswith(b"\x89PNG")
    with Path(out).open("rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert {"/odom", "/ground_truth"} <= topics
    first = [Path(name).read_bytes() for name in (out, png, report)]
    assert run(*arguments) == 0
    assert [Path(name).read_bytes() for name in (out, png, report)] == first


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["--mow", "--landmarks", "90"], 1, "90 landmarks of 0.4 m would touch"),
        (["--mow", "--mow-width", "3"], 1, "is too narrow"),
        (["--mow", "--path", "p.txt"], 2, "--mow drives its own way"),
        (["--mow", "--odom-fault", "slip@1-2"], 2, "--mow drives its own way"),
        (["--mow", "--runs", "0"], 2, "--runs"),
        (["--mow", "--landmark-size", "0"], 2, "--landmark-size"),
        (["--mow", "--speed", "0"], 2, "speed is 0"),
        ([], 2, "Missing option '--path' (or add --mow"),
        (["o.mcap", "--path", "p.txt", "--landmarks", "3"], 2, "are for --mow"),
    ],
)
def test_bad_input(
    lawn: str, capsys: pytest.CaptureFixture[str], options: list[str], code: int, message: str
) -> None:
    assert run("simulate", lawn, *options) == code
    assert message in capsys.readouterr().err


def test_a_grid_map_is_no_lawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "m.txt").write_text("0 0\n0 0\n")
    assert run("simulate", str(tmp_path / "m.txt"), "--mow") == 1
    assert "is a grid map; expected a lawn" in capsys.readouterr().err
