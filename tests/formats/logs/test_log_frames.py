"""Odometry and mounts out of /tf and /tf_static: chains, missing links, lasers in odd places."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.mcap_making import Sent, mcap_file, odom, quaternion, scan, tf, tf_static, transform

from mapcli.errors import DataError
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.formats.logs.ros.transforms import FrameTree, rigid
from mapcli.model.log import LogOptions
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount, Odometry, RangeScan, Record


def read(folder: Path, *messages: Sent, **options: Any) -> tuple[list[Record], Log]:
    log = open_log([mcap_file(folder, *messages)], LogOptions(**options))
    return list(log.records()), log


def mount_of(records: list[Record]) -> Mount:
    mounts = {record.mount for record in records if isinstance(record, RangeScan)}
    assert len(mounts) == 1
    return mounts.pop()


def poses_of(records: list[Record]) -> list[tuple[float, Pose2D]]:
    return [(r.stamp_ns / 1e9, r.pose) for r in records if isinstance(r, Odometry)]


def near(pose: Pose2D, x: float, y: float, theta: float) -> bool:
    return (pose.x, pose.y, pose.theta) == pytest.approx((x, y, theta), abs=1e-8)


# The laser's mount


def test_a_chain_of_static_transforms(tmp_path: Path) -> None:
    records, log = read(
        tmp_path,
        tf_static(1, transform(0, "mast", "laser", (0.1, 0, 0))),
        tf_static(1, transform(0, "base_link", "mast", (0.2, 0, 1), (0, 0, 90))),
        tf_static(1, transform(0, "base_footprint", "base_link", (0, 0, 0.1))),
        odom(2, child="base_footprint"),
        scan(3),
    )
    assert near(mount_of(records).pose, 0.2, 0.1, math.pi / 2)
    assert log.notes == ["laser /scan: mounted at x 0.200 m, y 0.100 m, yaw 90.0 deg"]


def test_odometry_of_the_frame_below_the_static_root(tmp_path: Path) -> None:
    # The odometry tells base_link, which hangs from base_footprint.
    records, _ = read(
        tmp_path,
        tf_static(1, transform(0, "base_footprint", "base_link", (0, 0, 0.1))),
        tf_static(1, transform(0, "base_footprint", "laser", (0.3, 0, 0))),
        odom(2),
        scan(3),
    )
    assert near(mount_of(records).pose, 0.3, 0, 0)


def test_upside_down(tmp_path: Path) -> None:
    """A beam to the laser's left (+90 degrees) points to the robot's right."""
    records, log = read(
        tmp_path,
        tf_static(1, transform(0, "base_link", "laser", (0.2, 0, 0.3), (180, 0, 0))),
        odom(2),
        scan(3, [2.0], angle_min=math.pi / 2),
    )
    assert mount_of(records) == Mount(Pose2D(0.2, 0.0, 0.0), flipped=True)
    assert isinstance(records[1], RangeScan)
    assert records[1].points() == pytest.approx(np.array([[0.2, -2.0]]), abs=1e-6)
    assert log.notes[0].startswith("laser /scan: mounted upside down, at x 0.200 m")


@pytest.mark.parametrize("rpy_deg", [(180, 0, 180), (0, 180, 0), (175, -3, 30), (10, -170, 80)])
def test_points_agree_with_the_transform_in_space(
    tmp_path: Path, rpy_deg: tuple[float, float, float]
) -> None:
    """However a laser is turned, its beams go where the full rotation puts them, from above."""
    bearing = 0.7
    records, _ = read(
        tmp_path,
        tf_static(1, transform(0, "base_link", "laser", (0.2, 0.1, 0.3), rpy_deg)),
        odom(2),
        scan(3, [2.0], angle_min=bearing),
    )
    motion = rigid((0.2, 0.1, 0.3), quaternion(*map(math.radians, rpy_deg)))
    beam = np.array([math.cos(bearing), math.sin(bearing), 0]) * 2
    end = (motion.rotation @ beam + motion.translation)[:2]
    assert isinstance(records[1], RangeScan)
    tilted = any(angle % 180 for angle in rpy_deg[:2])
    assert records[1].points()[0] == pytest.approx(end, abs=0.1 if tilted else 1e-6)


@pytest.mark.parametrize("rpy_deg", [(25, 0, 0), (0, 90, 0), (90, 0, 0), (155, 0, 0)])
def test_a_tilted_laser_is_refused(tmp_path: Path, rpy_deg: tuple[float, float, float]) -> None:
    sent = [tf_static(1, transform(0, "base_link", "laser", (0, 0, 0), rpy_deg)), odom(2), scan(3)]
    with pytest.raises(DataError, match=r"/scan: the laser 'laser' is tilted .*--laser-pose"):
        read(tmp_path, *sent)
    records, _ = read(tmp_path, *sent, laser_pose=Mount(Pose2D(0.5, 0, 0)))
    assert mount_of(records) == Mount(Pose2D(0.5, 0, 0))


def test_no_static_transforms(tmp_path: Path) -> None:
    records, log = read(tmp_path, odom(1), scan(2))
    assert mount_of(records) == Mount()
    assert log.notes == [
        "laser /scan: no transform from 'base_link' to 'laser': mount unknown, assumed at the "
        "robot's centre"
    ]


def test_scans_in_the_robots_own_frame(tmp_path: Path) -> None:
    records, log = read(tmp_path, odom(1), scan(2, frame="base_link"))
    assert mount_of(records) == Mount()
    assert "assumed at the robot's centre" in log.notes[0]
    sent = tf_static(1, transform(0, "base_link", "arm"))
    assert read(tmp_path, sent, odom(1), scan(2, frame="base_link"))[1].notes == []


def test_a_missing_link_to_the_footprint(tmp_path: Path) -> None:
    records, log = read(
        tmp_path,
        tf_static(1, transform(0, "base_link", "laser", (0.3, 0, 0))),
        odom(2, child="base_footprint"),
        scan(3),
    )
    assert near(mount_of(records).pose, 0.3, 0, 0)
    assert "mount taken from base_link" in log.notes[0]


def test_a_mount_told_by_moving_transforms(tmp_path: Path) -> None:
    """robot_state_publisher of old sent fixed joints on /tf again and again."""
    records, _ = read(
        tmp_path,
        odom(1),
        *(tf(t, transform(t, "base_link", "laser", (0.25, 0, 0))) for t in (1, 2, 3)),
        scan(4),
    )
    assert near(mount_of(records).pose, 0.25, 0, 0)


def test_static_transforms_after_the_scans(tmp_path: Path) -> None:
    late = tf_static(9, transform(0, "base_link", "laser", (0.25, 0, 0)))
    records, _ = read(tmp_path, odom(1), scan(2), scan(3), late)
    assert near(mount_of(records).pose, 0.25, 0, 0)


def test_frames_with_a_leading_slash(tmp_path: Path) -> None:
    sent = tf_static(1, transform(0, "/base_link", "/laser", (0.25, 0, 0)))
    records, _ = read(tmp_path, sent, odom(2), scan(3))
    assert near(mount_of(records).pose, 0.25, 0, 0)


def test_two_lasers_on_one_topic_keep_their_mounts(tmp_path: Path) -> None:
    records, log = read(
        tmp_path,
        tf_static(1, transform(0, "base_link", "left", (0, 0.2, 0))),
        tf_static(1, transform(0, "base_link", "right", (0, -0.2, 0))),
        odom(2),
        scan(3, frame="left"),
        scan(4, frame="right"),
        scan(5, frame="left"),
    )
    mounts = [record.mount.pose.y for record in records if isinstance(record, RangeScan)]
    assert mounts == [0.2, -0.2, 0.2]
    assert len(log.notes) == 2


def test_a_transform_without_a_rotation_is_passed_over(tmp_path: Path) -> None:
    broken = transform(0, "base_link", "laser", (0.2, 0, 0))
    broken.transform.rotation.w = 0.0
    records, _ = read(tmp_path, tf_static(1, broken), odom(2), scan(3))
    assert mount_of(records) == Mount()


# Odometry from /tf


def test_odometry_from_tf(tmp_path: Path) -> None:
    records, log = read(
        tmp_path,
        tf_static(1, transform(0, "base_link", "laser", (0.1, 0, 0))),
        tf(1, transform(1, "odom", "base_link", (1, 2, 0), (0, 0, 90))),
        scan(2),
        tf(3, transform(3, "odom", "base_link", (2, 2, 0))),
    )
    assert log.odom_topic == "/tf"
    (first, pose), (second, _) = poses_of(records)
    assert (first, second) == (1.0, 3.0)
    assert near(pose, 1, 2, math.pi / 2)
    assert near(mount_of(records).pose, 0.1, 0, 0)


def test_odometry_messages_come_before_tf(tmp_path: Path) -> None:
    sent = [tf(1, transform(1, "odom", "base_link", (7, 0, 0))), odom(2, 1.0), scan(3)]
    records, log = read(tmp_path, *sent)
    assert log.odom_topic == "/odom"
    assert poses_of(records) == [(2.0, Pose2D(1, 0, 0))]
    records, log = read(tmp_path, *sent, odom_topic="/tf")
    assert poses_of(records) == [(1.0, Pose2D(7, 0, 0))]


def test_odometry_through_intermediate_frames(tmp_path: Path) -> None:
    """odom -> base_footprint moves, -> base_stabilized moves, -> base_link is fixed."""
    records, log = read(
        tmp_path,
        tf_static(1, transform(0, "base_stabilized", "base_link", (0, 0, 0.2))),
        tf_static(1, transform(0, "base_link", "laser", (0.1, 0, 0))),
        tf(1, transform(1, "map", "odom", (50, 50, 0))),
        tf(2, transform(2, "base_footprint", "base_stabilized", (0, 0, 0), (0, 0, 90))),
        tf(3, transform(3, "odom", "base_footprint", (1, 0, 0))),
        scan(4),
        tf(5, transform(5, "odom", "base_footprint", (2, 0, 0)), transform(5, "x", "y")),
        tf(6, transform(6, "base_footprint", "base_stabilized", (0, 0, 0), (0, 0, 0))),
        tf(7, transform(7, "elsewhere", "camera")),
    )
    assert log.odom_topic == "/tf"
    found = poses_of(records)
    assert [stamp for stamp, _ in found] == [2, 3, 5, 6]
    assert near(found[2][1], 2, 0, math.pi / 2)
    assert near(found[3][1], 2, 0, 0)
    assert near(mount_of(records).pose, 0.1, 0, 0)


def test_odometry_from_tf_without_a_chain_to_the_laser(tmp_path: Path) -> None:
    records, log = read(
        tmp_path, tf(1, transform(1, "robot/odom", "robot/base_footprint", (3, 0, 0))), scan(2)
    )
    assert poses_of(records) == [(1.0, Pose2D(3, 0, 0))]
    assert mount_of(records) == Mount()
    assert "assumed at the robot's centre" in log.notes[0]


def test_tf_without_odometry_is_none(tmp_path: Path) -> None:
    records, log = read(tmp_path, tf(1, transform(1, "map", "base_link", (3, 0, 0))), scan(2))
    assert poses_of(records) == []
    assert log.odom_topic is None
    assert "no odometry: poses come from matching scans alone" in log.notes


def test_time_source_log_for_tf(tmp_path: Path) -> None:
    sent = [tf(8, transform(1, "odom", "base_link")), scan(2, log=9)]
    records, _ = read(tmp_path, *sent, time_source="log")
    assert [record.stamp_ns / 1e9 for record in records] == [8, 9]


# The tree


def test_lookup_up_and_down() -> None:
    tree = FrameTree()
    tree.add("a", "b", rigid((1, 0, 0), quaternion(0, 0, math.pi / 2)))
    tree.add("b", "c", rigid((1, 0, 0), quaternion(0, 0, 0)))
    tree.add("a", "d", rigid((0, 5, 0), quaternion(0, 0, 0)))

    def found(target: str, source: str) -> Pose2D:
        motion = tree.lookup(target, source)
        assert motion is not None
        return motion.pose()

    assert near(found("a", "c"), 1, 1, math.pi / 2)
    assert near(found("c", "a"), -1, 1, -math.pi / 2)
    assert near(found("d", "c"), 1, -4, math.pi / 2)
    assert near(found("b", "b"), 0, 0, 0)
    assert tree.lookup("a", "z") is None
    assert "a" in tree
    assert "z" not in tree


def test_a_loop_of_frames_does_not_hang() -> None:
    tree = FrameTree()
    motion = rigid((1, 0, 0), (0, 0, 0, 1))
    tree.add("a", "b", motion)
    tree.add("b", "a", motion)
    assert tree.ancestry("a") == ["a", "b"]
    assert tree.lookup("c", "a") is None


@pytest.mark.parametrize(
    "quaternion", [(0, 0, 0, 0), (math.nan, 0, 0, 1), (math.inf, 0, 0, 1), (0, 0, 0, 1e-9)]
)
def test_no_rotation(quaternion: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="no rotation"):
        rigid((0, 0, 0), quaternion)


def test_quaternions_need_no_unit_length() -> None:
    motion = rigid((0, 0, 0), (0, 0, 3, 3))
    assert motion.pose().theta == pytest.approx(math.pi / 2)


def test_a_frame_that_is_its_own_parent(tmp_path: Path) -> None:
    loop = tf_static(
        0, transform(0, "odom", "odom"), transform(0, "base_link", "laser", (0.2, 0, 0))
    )
    moving = tf(1, transform(1, "map", "map"))
    records, _ = read(tmp_path, loop, moving, scan(1), scan(2))
    assert near(mount_of(records).pose, 0.2, 0, 0)
    assert poses_of(records) == []


def test_long_chains_of_frames() -> None:
    """A megabyte of transforms is looked up in much less than a second."""
    tree = FrameTree()
    for k in range(10_000):
        tree.add(f"f{k}", f"f{k + 1}", rigid((0.001, 0, 0), (0, 0, 0, 1)))
    tree.add("f9000", "side", rigid((0, 1, 0), (0, 0, 0, 1)))
    start = time.process_time()
    found = tree.lookup("side", "f10000")
    assert found is not None
    assert near(found.pose(), 1.0, -1.0, 0)
    assert len(tree.ancestry("f10000")) == 10_001
    assert time.process_time() - start < 1
