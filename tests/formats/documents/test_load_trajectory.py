"""Reading trajectories and relations: every format, and every way of being malformed."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapcli.errors import DataError, FormatError
from mapcli.formats.documents.json_document import json_bytes
from mapcli.formats.documents.load_trajectory import load_trajectory
from mapcli.formats.documents.pose_trace import trace_document
from mapcli.formats.documents.relations import is_relations, load_relations
from mapcli.formats.documents.trajectory_text import WRITERS, dump_trajectory, read_trajectory
from mapcli.formats.logs.mcap.writer import McapLogWriter
from mapcli.formats.logs.topics import LogNames
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Odometry, TruePose
from mapcli.model.trace import Loop, PoseTrace, TracedPose
from mapcli.model.trajectory import wrap_angles

coordinates = st.floats(-1e6, 1e6)
poses = st.builds(Pose2D, coordinates, coordinates, st.floats(-math.pi, math.pi, exclude_max=True))
traces = st.lists(st.tuples(poses, st.integers(0, 2 * 10**18)), min_size=1, max_size=5).map(
    lambda found: PoseTrace(
        tuple(
            TracedPose(stamp, pose, pose, 0.5, "matched")
            for pose, stamp in sorted(found, key=lambda item: item[1])
        ),
        (Loop(0, len(found) - 1, Pose2D(), 0.9),),
    )
)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [*WRITERS, ".json"])
@given(trace=traces)
def test_every_format_is_read_as_written(
    suffix: str, trace: PoseTrace, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("traces") / f"no-suffix-{suffix[1:]}"
    if suffix == ".json":
        path.write_bytes(json_bytes(trace_document(trace, {}, {}, {})))
    else:
        path.write_bytes(gzip.compress(dump_trajectory(trace, f"a{suffix}")))
    found = load_trajectory(str(path)).trajectory
    expected = np.array([(p.pose.x, p.pose.y, p.pose.theta) for p in trace.poses])
    assert np.allclose(found.poses[:, :2], expected[:, :2], rtol=0, atol=6e-7)
    assert np.allclose(wrap_angles(found.poses[:, 2] - expected[:, 2]), 0, atol=1e-6)
    if suffix in (".kitti", ".g2o"):
        assert found.stamps_ns is None
    else:
        assert found.stamps_ns is not None
        assert found.stamps_ns.tolist() == [p.stamp_ns for p in trace.poses]


@pytest.mark.parametrize(
    ("text", "stamps", "rows"),
    [
        ("# t x y theta\n1.5 1 2 3\n\n2.5 4 5 -3 # end\n", [1.5e9, 2.5e9], [(1, 2, 3), (4, 5, -3)]),
        ("\ufeff1,1,2,3\r\n", [1e9], [(1, 2, 3)]),
        ("1.403636579763555520e+09 1 2 7 0 0 1 1\n", [1403636579763555520], [(1, 2, math.pi / 2)]),
        ("0 -1 0 4 1 0 0 5 0 0 1 6\n", None, [(4, 5, math.pi / 2)]),
        ("t,y,x,theta,note\n2,5,4,0.5,x\n", [2e9], [(4, 5, 0.5)]),
        ("x y theta\n4 5 0.5\n", None, [(4, 5, 0.5)]),
        ("FIX 7\nVERTEX_SE2 7 1 1 1\nEDGE_SE2 7 3 0 0 0 1 0 0 1 0 1\nVERTEX_SE2 3 2 2 2\n", None,
         [(2, 2, 2), (1, 1, 1)]),
        ("VERTEX_SE3:QUAT 0 1 2 3 0 0 1 1\n", None, [(1, 2, math.pi / 2)]),
    ],
)  # fmt: skip
def test_dialects(text: str, stamps: list[float] | None, rows: list[tuple[float, ...]]) -> None:
    found = read_trajectory(text.encode(), "a")
    assert found.poses == pytest.approx(np.array(rows))
    assert (None if found.stamps_ns is None else found.stamps_ns.tolist()) == stamps


KNOWN = r"expected trace\.json, MCAP, CSV, g2o, or lines of 4 \(t x y theta\), 8 \(TUM\)"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", f"a: has no poses; {KNOWN}"),
        ("# nothing\n", f"a: has no poses; {KNOWN}"),
        ("\n1 2 3 4 5\n", f"a: line 2: '1 2 3 4 5' is no pose; {KNOWN}"),
        ("hello world 1 2\n", f"a: line 1: 'hello world 1 2' is no pose; {KNOWN}"),
        ("\0\0\0\0", f"a: is no text; {KNOWN}"),
        ("1 1 1 1\n2 1 1\n", "a: line 2: has 3 columns; expected 4: t x y theta"),
        ("1 1 nan 1\n", "a: line 1: 'nan' is no finite number; expected t x y theta"),
        ("1 inf 1 1\n", "a: line 1: 'inf' is no finite number"),
        ("1 1 1 1\n2 1 1 one\n", "a: line 2: 'one' is no finite number"),
        ("1 1e17 1 1\n", "a: line 1: the pose 1e[+]17 1 1 is too far away"),
        ("2 1 1 1\n1 1 1 1\n", r"a: line 2: the time goes back from 2\.000000 to 1\.000000 s; "
         "expected poses in time order"),
        ("1 1 1 1 0 0 0 0\n", "a: line 1: 0 0 0 0 is no rotation; expected a quaternion"),
        ("t,x,y\n1,1,1\n", "a: has no column theta; expected stamp_ns,x,y,theta,"),
        ("x,y,theta\n1,1\n", "a: line 2: has 2 columns; expected 3, as the head"),
        ("stamp_ns,x,y,theta\n?,1,1,1\n", r"a: line 2: '\?e-9' is no time"),
        ("t,x,y,theta\n1e999999999,1,1,1\n", "a: line 2: '1e999999999' is no time"),
        ("stamp_ns,x,y,theta\n1e999999999,1,1,1\n", "a: line 2: '1e999999999e-9' is no time"),
        ("VERTEX_SE2 0 1 1 1\nVERTEX_SE2 0 1 1 1\n", "a: line 2: vertex 0 comes twice"),
        ("VERTEX_SE2 0 1 1\n", "a: line 1: has 3 columns; expected 4: id x y theta"),
    ],
)  # fmt: skip
def test_malformed_text(text: str, problem: str) -> None:
    with pytest.raises(FormatError, match=problem):
        read_trajectory(text.encode(), "a")


def write(path: Path, data: bytes | str) -> str:
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return str(path)


def test_other_malformed_files(tmp_path: Path) -> None:
    path = tmp_path / "a"
    with pytest.raises(FormatError, match="a: no such file"):
        load_trajectory(str(path))
    with pytest.raises(FormatError, match="is a folder without a bag's files"):
        load_trajectory(str(tmp_path))
    cut = gzip.compress(b"7 1 1 1\n" * 100)[:-12]
    with pytest.raises(FormatError, match=r"a: cannot be unpacked: .*; expected gzip"):
        load_trajectory(write(path, cut))
    head = '{"format": "mapcli.pose-trace", "version": 1, "poses": ['
    row = '{"stamp_ns": %d, "x": 1, "y": 1, "theta": 1}'
    with pytest.raises(FormatError, match=f"a: has no poses; {KNOWN}"):
        load_trajectory(write(path, head + "]}"))
    with pytest.raises(FormatError, match="a: pose 1: the stamp goes back from 7 to 6 ns"):
        load_trajectory(write(path, head + f"{row % 7}, {row % 6}]}}"))
    with pytest.raises(FormatError, match="a: has no topic /pose; expected a log"):
        load_trajectory(write(path, "7 1 1 1\n"), "/pose")


# MCAP


def write_mcap(path: Path, *topics: str, odometry: bool = True) -> str:
    """True poses x = 1, 2, 3 on every topic, the second written last; odometry at x = 9."""
    with path.open("wb") as file:
        writer = McapLogWriter(file)
        for number, topic in enumerate(topics or ("/ground_truth",)):
            writer.names = LogNames(truth_topic=topic)
            for k in (0, 2, 1):
                writer.write(TruePose(k * 10**9, Pose2D(k + 1, number, 0.5)))
        if odometry:
            writer.write(Odometry(5, Pose2D(9, 0, 0)))
        writer.close()
    return str(path)


def test_true_poses_in_the_order_of_their_stamps(tmp_path: Path) -> None:
    found = load_trajectory(write_mcap(tmp_path / "a.mcap")).trajectory
    assert found.poses == pytest.approx(np.array([(1, 0, 0.5), (2, 0, 0.5), (3, 0, 0.5)]))
    assert found.stamps_ns is not None
    assert found.stamps_ns.tolist() == [0, 10**9, 2 * 10**9]


def test_topics_of_poses(tmp_path: Path) -> None:
    both = write_mcap(tmp_path / "a", "/pose", "/ground_truth")
    assert load_trajectory(both).trajectory.poses[0, 1] == 1  # the truth is believed first
    assert load_trajectory(both, "/pose").trajectory.poses[0, 1] == 0
    assert load_trajectory(both, "/odom").trajectory.poses[0, 0] == 9
    two = write_mcap(tmp_path / "b", "/pose", "/other")
    with pytest.raises(DataError, match=r"several topics of poses: /other \(geometry.*--topic"):
        load_trajectory(two)
    with pytest.raises(DataError, match=r"has no topic /nope of poses among /odom \(nav_msgs"):
        load_trajectory(two, "/nope")


def test_damaged_mcap_gives_what_can_be_read(tmp_path: Path) -> None:
    whole = Path(write_mcap(tmp_path / "a")).read_bytes()
    loaded = load_trajectory(write(tmp_path / "a", whole[:-60]))
    assert len(loaded.trajectory) == 3
    assert loaded.warnings
    with pytest.raises(DataError, match=r"a: .*: has no topic of poses among nothing"):
        load_trajectory(write(tmp_path / "a", whole[:40]))


# Relations


def test_relations(tmp_path: Path) -> None:
    text = "# t1 t2 x y z roll pitch yaw\n1.000001 3 1 2 7 8 9 0.5\n3 2 0 0 0 0 0 -0.5\n"
    path = write(tmp_path / "a.relations.gz", gzip.compress(text.encode()))
    found = load_relations(path)
    assert found.from_ns.tolist() == [1_000_001_000, 3 * 10**9]
    assert found.to_ns.tolist() == [3 * 10**9, 2 * 10**9]
    assert found.poses.tolist() == [[1, 2, 0.5], [0, 0, -0.5]]


def test_what_is_a_file_of_relations() -> None:
    names = ["a.relations", "A.RELATIONS", "b/a.relations.gz", "a.tum", "relations", "a.gz"]
    assert [name for name in names if is_relations(name)] == names[:3]


@pytest.mark.parametrize(
    ("text", "problem"),
    [("", "has no relations; expected lines of t1 t2 x y z roll pitch yaw"),
     ("1 2 3\n", "line 1: has 3 columns; expected 8: t1 t2 x y z roll pitch yaw"),
     ("1 2 0 0 0 0 0 ?\n", r"line 1: '\?' is no finite number")],
)  # fmt: skip
def test_malformed_relations(text: str, problem: str, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=problem):
        load_relations(write(tmp_path / "a.relations", text))
