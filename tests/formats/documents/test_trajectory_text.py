"""Pose traces for other tools: TUM, KITTI, g2o, CSV."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapcli.errors import DataError
from mapcli.formats.documents.trajectory_text import WRITERS, dump_trajectory
from mapcli.model.pose import Pose2D
from mapcli.model.trace import Loop, PoseTrace, TracedPose

QUARTER = math.pi / 2
TRACE = PoseTrace(
    (
        TracedPose(1_600_000_000_000_000_001, Pose2D(), None, None, "first"),
        TracedPose(
            1_600_000_000_200_000_000, Pose2D(1, -2.5, QUARTER), Pose2D(1.1, -2, 1.5), 0.91236,
            "matched",
        ),
        TracedPose(
            1_600_000_001_000_000_000, Pose2D(1, -1.5, -math.pi), Pose2D(1, -1, 3), None, "odometry"
        ),
    ),
    (Loop(2, 0, Pose2D(1, -1.5, math.pi), 0.8),),
)  # fmt: skip

TUM = """\
1600000000.000000001 0.000000 0.000000 0 0 0 0.000000000 1.000000000
1600000000.200000000 1.000000 -2.500000 0 0 0 0.707106781 0.707106781
1600000001.000000000 1.000000 -1.500000 0 0 0 -1.000000000 0.000000000
"""

KITTI = """\
1.000000000 0.000000000 0 0.000000 0.000000000 1.000000000 0 0.000000 0 0 1 0
0.000000000 -1.000000000 0 1.000000 1.000000000 0.000000000 0 -2.500000 0 0 1 0
-1.000000000 0.000000000 0 1.000000 0.000000000 -1.000000000 0 -1.500000 0 0 1 0
"""

G2O = """\
VERTEX_SE2 0 0.000000 0.000000 0.000000
VERTEX_SE2 1 1.000000 -2.500000 1.570796
VERTEX_SE2 2 1.000000 -1.500000 -3.141593
EDGE_SE2 0 1 1.000000 -2.500000 1.570796 10000 0 0 10000 0 40000
EDGE_SE2 1 2 1.000000 0.000000 1.570796 10000 0 0 10000 0 40000
EDGE_SE2 2 0 1.000000 -1.500000 3.141593 10000 0 0 10000 0 40000
"""

CSV = """\
stamp_ns,x,y,theta,odom_x,odom_y,odom_theta,score,status
1600000000000000001,0.000000,0.000000,0.000000,,,,,first
1600000000200000000,1.000000,-2.500000,1.570796,1.100000,-2.000000,1.500000,0.9124,matched
1600000001000000000,1.000000,-1.500000,-3.141593,1.000000,-1.000000,3.000000,,odometry
"""


@pytest.mark.parametrize(
    ("name", "text"), [("a.tum", TUM), ("a.kitti", KITTI), ("a.g2o", G2O), ("A.CSV", CSV)]
)
def test_every_format_literally(name: str, text: str) -> None:
    assert dump_trajectory(TRACE, name).decode() == text


def test_standard_output_gets_csv() -> None:
    assert dump_trajectory(TRACE, "-").decode() == CSV


@pytest.mark.parametrize("name", ["a.txt", "tum", "a", "a.json"])
def test_unknown_suffixes(name: str) -> None:
    with pytest.raises(DataError, match=r"says no trace format; expected a name in \.tum \.kitti"):
        dump_trajectory(TRACE, name)


@pytest.mark.parametrize("suffix", WRITERS)
def test_one_pose_and_no_loop(suffix: str) -> None:
    lines = dump_trajectory(PoseTrace(TRACE.poses[:1]), f"a{suffix}").decode().splitlines()
    assert len(lines) == (2 if suffix == ".csv" else 1)


coordinates = st.floats(-1e6, 1e6)
poses = st.builds(Pose2D, coordinates, coordinates, st.floats(-math.pi, math.pi, exclude_max=True))
traces = st.lists(poses, min_size=1, max_size=4).map(
    lambda found: PoseTrace(
        tuple(
            TracedPose(1 + k * 10**8, pose, None, None, "matched") for k, pose in enumerate(found)
        )
    )
)


def same(found: tuple[float, ...], pose: Pose2D) -> None:
    x, y, theta = found
    assert (x, y) == pytest.approx((pose.x, pose.y), abs=6e-7)
    assert math.cos(theta - pose.theta) == pytest.approx(1, abs=1e-9)


@given(traces)
def test_every_format_reads_back(trace: PoseTrace) -> None:
    tum = np.loadtxt(dump_trajectory(trace, "a.tum").decode().splitlines(), ndmin=2)
    kitti = np.loadtxt(dump_trajectory(trace, "a.kitti").decode().splitlines(), ndmin=2)
    rows = list(csv.DictReader(dump_trajectory(trace, "a.csv").decode().splitlines()))
    g2o = [
        line.split()[2:]
        for line in dump_trajectory(trace, "a.g2o").decode().splitlines()
        if line.startswith("VERTEX")
    ]
    for k, traced in enumerate(trace.poses):
        same((tum[k, 1], tum[k, 2], 2 * math.atan2(tum[k, 6], tum[k, 7])), traced.pose)
        same((kitti[k, 3], kitti[k, 7], math.atan2(kitti[k, 4], kitti[k, 0])), traced.pose)
        same((float(rows[k]["x"]), float(rows[k]["y"]), float(rows[k]["theta"])), traced.pose)
        same(tuple(map(float, g2o[k])), traced.pose)
        assert int(rows[k]["stamp_ns"]) == traced.stamp_ns


@given(traces)
def test_the_edges_of_a_graph_lead_from_vertex_to_vertex(trace: PoseTrace) -> None:
    lines = [line.split() for line in dump_trajectory(trace, "a.g2o").decode().splitlines()]
    edges = [line for line in lines if line[0] == "EDGE_SE2"]
    assert len(edges) == len(trace.poses) - 1
    for k, edge in enumerate(edges):
        assert edge[1:3] == [str(k), str(k + 1)]
        step = Pose2D(*map(float, edge[3:6]))
        reached, expected = trace.poses[k].pose.compose(step), trace.poses[k + 1].pose
        assert reached.distance(expected) < 2e-6
