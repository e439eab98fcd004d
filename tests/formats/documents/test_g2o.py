"""A trace as a pose graph: GTSAM reads the same poses and constraints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mapcli.formats.documents.trace_g2o import STEP_INFORMATION
from mapcli.formats.documents.trajectory_text import dump_trajectory
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import InformationTriangle
from mapcli.model.trace import Loop, PoseTrace, TracedPose

gtsam = pytest.importorskip("gtsam")

POSES = [Pose2D(), Pose2D(1, 0.25, 1.5), Pose2D(1, 2, 3), Pose2D(-0.125, 0.25, -1.5)]
CERTAIN: InformationTriangle = (400.0, 12.5, -3.0, 900.0, 8.0, 10_000.0)
STEPS = (Pose2D(1.01, 0.25, 1.5), Pose2D(1.75, 0, 1.5), Pose2D(1, 1.75, 1.75))
TRACE = PoseTrace(
    tuple(TracedPose(k, pose, None, None, "matched") for k, pose in enumerate(POSES)),
    (Loop(0, 3, Pose2D(-0.1, 0.2, -1.4), 0.9, CERTAIN), Loop(3, 1, Pose2D(0.5, 1, 3), 0.8)),
    STEPS,
)


def upper(matrix: np.ndarray) -> np.ndarray:
    return matrix[np.triu_indices(3)]


def test_gtsam_reads_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "graph.g2o"
    path.write_bytes(dump_trajectory(TRACE, path))
    graph, values = gtsam.readG2o(str(path), False)
    assert values.size() == len(POSES)
    for k, pose in enumerate(POSES):
        found = values.atPose2(k)
        assert (found.x(), found.y(), found.theta()) == pytest.approx((pose.x, pose.y, pose.theta))
    expected = [(k, k + 1, step, STEP_INFORMATION) for k, step in enumerate(STEPS)]
    expected += [(x.from_, x.to, x.pose, x.information or STEP_INFORMATION) for x in TRACE.loops]
    assert graph.size() == len(expected)
    for k, (start, end, pose, information) in enumerate(expected):
        factor = graph.at(k)
        assert list(factor.keys()) == [start, end]
        found = factor.measured()
        assert (found.x(), found.y(), found.theta()) == pytest.approx((pose.x, pose.y, pose.theta))
        weights = upper(factor.noiseModel().information())
        assert weights == pytest.approx(np.array(information), rel=1e-6)


def test_without_measured_steps_the_edges_are_those_of_the_poses(tmp_path: Path) -> None:
    path = tmp_path / "graph.g2o"
    path.write_bytes(dump_trajectory(PoseTrace(TRACE.poses), path))
    graph, values = gtsam.readG2o(str(path), False)
    assert graph.size() == len(POSES) - 1
    assert graph.error(values) == pytest.approx(0, abs=1e-6)
