"""Messages other than LaserScan and Odometry, one by one, and logs of them that others wrote."""

from __future__ import annotations

import json
import math
import struct
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from conftest import SHARED
from rosbags.typesys import Stores, get_typestore
from support.mcap_making import Sent, mcap_file, odom, scan

from mapcli.errors import DataError
from mapcli.formats.logs.open_log import open_log
from mapcli.formats.logs.ros import foxglove
from mapcli.formats.logs.ros.decode import LaserScan
from mapcli.formats.logs.ros.other_scans import cloud_from_cdr, multi_echo_from_cdr
from mapcli.formats.logs.ros.point_cloud import Band, scan_of_cloud
from mapcli.formats.logs.ros.segments import TurnAssembler
from mapcli.model.log import LogOptions
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount, Odometry, RangeScan

CASES = SHARED / "cases" / "logs"
HUMBLE = get_typestore(Stores.ROS2_HUMBLE)
S = 10**9


def built(name: str, *values: object) -> object:
    return HUMBLE.types[name](*values)


def header(t: float, frame: str = "laser") -> object:
    stamp = built("builtin_interfaces/msg/Time", *divmod(round(t * S), S))
    return built("std_msgs/msg/Header", stamp, frame)


def cdr(message: object) -> bytes:
    return bytes(HUMBLE.serialize_cdr(message, message.__msgtype__))  # type: ignore[attr-defined]


# --- MultiEchoLaserScan


def multi_echo(*beams: list[float]) -> bytes:
    echoes = [built("sensor_msgs/msg/LaserEcho", np.array(beam, np.float32)) for beam in beams]
    message = built("sensor_msgs/msg/MultiEchoLaserScan", header(1.5), -0.5, 0.5, 0.5, 0.01, 0.1,
                    0.2, 30.0, echoes, [])  # fmt: skip
    return cdr(message)


def test_the_first_echo_of_each_beam() -> None:
    found = multi_echo_from_cdr(multi_echo([1.0, 2.0], [], [3.0]))
    assert found.ranges.tolist() == [1.0, math.inf, 3.0]
    assert (found.stamp_ns, found.frame) == (1.5 * S, "laser")
    assert (found.angle_min, found.angle_increment, found.range_max) == (-0.5, 0.5, 30.0)
    assert found.time_increment == np.float32(0.01)


def test_echoes_cut_anywhere_are_refused() -> None:
    good = multi_echo([1.0, 2.0], [], [3.0])
    for size in range(len(good) - 8):  # the last list, of intensities, is not needed
        with pytest.raises(ValueError, match=r".*"):
            multi_echo_from_cdr(good[:size])


# --- PointCloud2


def cloud(points: list[tuple[float, float, float]], extra: int = 0) -> bytes:
    """A cloud whose points have `extra` bytes of other fields before x, y and z."""
    fields = [
        built("sensor_msgs/msg/PointField", name, extra + 4 * k, 7, 1) for k, name in
        enumerate("xyz")
    ]  # fmt: skip
    if extra:
        fields.insert(0, built("sensor_msgs/msg/PointField", "rgb", 0, 1, extra))
    step = extra + 12
    data = b"".join(bytes(extra) + struct.pack("<3f", *point) for point in points)
    return cdr(
        built("sensor_msgs/msg/PointCloud2", header(2.0), 1, len(points), fields, False, step,
              step * len(points), np.frombuffer(data, np.uint8), True)
    )  # fmt: skip


@pytest.mark.parametrize("extra", [0, 3])
def test_the_nearest_point_of_each_bearing_in_the_band(extra: int) -> None:
    points = [(2, 0, 0), (1, 0, 0.05), (0.5, 0, 0.3), (0, 3, -0.09), (-4, 0, 0), (math.nan, 1, 0)]
    found = scan_of_cloud(cloud_from_cdr(cloud(points, extra)), Band(-0.1, 0.1))
    seen = {
        round(math.degrees(found.angle_min + k * found.angle_increment)): value
        for k, value in enumerate(found.ranges.tolist())
        if not math.isnan(value)
    }
    assert seen == {0: 1.0, 90: 3.0, -180: 4.0}
    assert found.stamp_ns == 2 * S


def test_clouds_cut_anywhere_are_refused() -> None:
    good = cloud([(1, 2, 0), (3, 4, 0)])
    for size in range(len(good) - 4):
        with pytest.raises(ValueError, match=r".*"):
            cloud_from_cdr(good[:size])


def test_clouds_are_scans_only_where_there_are_no_others(tmp_path: Path) -> None:
    sent = [Sent("/cloud", "sensor_msgs/msg/PointCloud2", None, k * S, cloud([(1, 0, 0)]))
            for k in range(1, 4)]  # fmt: skip
    records = list(open_log(mcap_file(tmp_path, *sent)).records())
    assert sum(isinstance(record, RangeScan) for record in records) == 3
    log = open_log(mcap_file(tmp_path, *sent, scan(1), scan(2)))
    assert log.scan_topics == ["/scan"]
    named = open_log(mcap_file(tmp_path, *sent, scan(1)), LogOptions(scan_topics=("/cloud",)))
    assert named.scan_topics == ["/cloud"]


# --- Segments


def segment(k: int, *, count: int = 4, start: float = -math.pi, t: float = 0.0) -> LaserScan:
    step = math.tau / 360
    beams = 360 // count
    first = start + k * beams * step
    return LaserScan(round(t * S), "laser", first, first + (beams - 1) * step, step, 0.0, 0.1, 9.0,
                     np.full(beams, k + 1, np.float32))  # fmt: skip


def assembled(*scans: LaserScan) -> tuple[list[LaserScan], int]:
    assembler = TurnAssembler()
    turns = [turn for one in scans for turn in assembler.add(one)]
    return [*turns, *assembler.rest()], assembler.segments


def test_segments_make_turns() -> None:
    sent = [segment(k % 4, t=k * 0.025) for k in range(10)]
    turns, count = assembled(*sent)
    assert count == 4
    assert [len(turn.ranges) for turn in turns] == [360, 360, 180]
    assert turns[0].ranges[::90].tolist() == [1, 2, 3, 4]
    assert [turn.stamp_ns for turn in turns] == [0, 0.1 * S, 0.2 * S]
    assert turns[0].angle_max == pytest.approx(math.pi - math.tau / 360)
    assert turns[0].time_increment == pytest.approx(0.075 / 270)


def test_whole_scans_stay_as_they_are() -> None:
    for first, beams in ((-math.pi, 360), (-math.pi / 2, 180)):
        step = math.tau / 360
        sent = [
            LaserScan(k * S, "laser", first, first + (beams - 1) * step, step, 0.0, 0.1, 9.0,
                      np.full(beams, k, np.float32))
            for k in range(5)
        ]  # fmt: skip
        turns, count = assembled(*sent)
        assert count == 1
        assert all(a is b for a, b in zip(turns, sent, strict=True))


def test_a_lost_segment_costs_a_part_of_its_turn() -> None:
    sent = [segment(k % 4, t=k * 0.025) for k in range(12) if k != 5]
    turns, _ = assembled(*sent)
    assert [len(turn.ranges) for turn in turns] == [360, 90, 360, 180]  # a turn begins anywhere


def test_segments_of_two_frames_are_not_joined() -> None:
    turns, count = assembled(segment(0), segment(1)._replace(frame="other"))
    assert (len(turns), count) == (2, 1)


# --- Poses as odometry, and transforms of any name


def pose_stamped(t: float, x: float) -> Sent:
    point = built("geometry_msgs/msg/Point", x, 0.0, 0.0)
    turn = built("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
    message = built("geometry_msgs/msg/PoseStamped", header(t, "map"),
                    built("geometry_msgs/msg/Pose", point, turn))  # fmt: skip
    return Sent("/pose", "geometry_msgs/msg/PoseStamped", None, round(t * S), cdr(message))


def test_poses_are_odometry_only_when_they_are_named(tmp_path: Path) -> None:
    path = mcap_file(tmp_path, *(pose_stamped(t, t / 2) for t in (1, 2, 3)), scan(1), scan(2))
    assert open_log(path).odom_topic is None
    records = list(open_log(path, LogOptions(odom_topic="/pose")).records())
    moved = [record.pose.x for record in records if isinstance(record, Odometry)]
    assert moved == [0.5, 1.0, 1.5]
    with pytest.raises(DataError, match="no odometry topic /none among /pose"):
        list(open_log(path, LogOptions(odom_topic="/none")).records())


def test_odometry_goes_before_poses(tmp_path: Path) -> None:
    path = mcap_file(tmp_path, pose_stamped(1, 1), odom(1), scan(1))
    assert open_log(path).odom_topic == "/odom"


# --- Foxglove


def test_a_foxglove_scan_literally() -> None:
    turn = {"x": 0, "y": 0, "z": math.sin(0.25), "w": math.cos(0.25)}
    message = {
        "timestamp": {"sec": 3, "nsec": 5}, "frame_id": "/laser", "start_angle": -1.0,
        "end_angle": 1.0, "ranges": [1, None, 3],
        "pose": {"position": {"x": 2}, "orientation": turn},
    }  # fmt: skip
    decode = foxglove.of_json(foxglove.scan_of)
    found = decode(json.dumps(message).encode())
    assert (found.stamp_ns, found.frame) == (3 * S + 5, "laser")
    assert (found.angle_min, found.angle_increment) == (-1.0, 1.0)
    assert found.origin == (2, 0, 0, 0, 0, math.sin(0.25), math.cos(0.25))
    assert found.ranges.tolist()[::2] == [1.0, 3.0]
    assert math.isnan(found.ranges[1])
    for pose in ({}, {"position": {}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 0}}):
        assert decode(json.dumps({**message, "pose": pose}).encode()).origin == ()
    for bad in ({**message, "ranges": 1}, {**message, "timestamp": {"sec": 1, "nsec": -1}}, [],
                {**message, "pose": {"position": {"x": "?"}}}):  # fmt: skip
        with pytest.raises(ValueError, match=r".*"):
            decode(json.dumps(bad).encode())


def test_a_rotation_of_which_zeros_are_left_out() -> None:
    """JSON of protobuf has no fields that are 0: half a turn has no w, and none has no z."""
    for rotation, yaw in (({}, 0.0), ({"z": 1}, math.pi), ({"z": 0.6}, 2 * math.asin(0.6))):
        message = {"timestamp": {}, "frame_id": "odom", "pose": {"orientation": rotation}}
        found = foxglove.of_json(foxglove.pose_of)(json.dumps(message).encode())
        assert abs(found.pose.theta) == pytest.approx(yaw)


def test_the_pose_of_a_foxglove_scan_in_its_frame_is_a_part_of_the_mount(tmp_path: Path) -> None:
    def scans(*places: float) -> str:
        sent = [
            Sent("/scan", "foxglove.LaserScan", None, k * S, json.dumps({
                "timestamp": {"sec": k}, "frame_id": "base_link", "start_angle": -1.0,
                "end_angle": 1.0, "ranges": [1, 2, 3],
                "pose": {"position": {"x": x}, "orientation": {"x": 1}},
            }).encode())
            for k, x in enumerate(places, start=1)
        ]  # fmt: skip
        return mcap_file(tmp_path, *sent, encoding="json")

    (found, _) = open_log(scans(0.2, 0.2)).records()
    assert isinstance(found, RangeScan)
    assert found.mount == Mount(Pose2D(0.2, 0.0, 0.0), flipped=True)
    with pytest.raises(DataError, match="the scans' own pose in 'base_link' moves"):
        list(open_log(scans(0.2, 0.3)).records())


def test_iso_times_as_protobuf_writes_them() -> None:
    message = {"timestamp": "1970-01-01T00:00:02.5Z", "parent_frame_id": "odom",
               "child_frame_id": "base", "translation": {"x": 1}, "rotation": {}}  # fmt: skip
    for content in (message, {"transforms": [message]}):
        (found,) = foxglove.of_json(foxglove.transforms_of)(json.dumps(content).encode())
        assert found.stamp_ns == 2.5 * S
        assert found.motion.pose().x == 1


# --- What others wrote


@pytest.mark.skipif(not CASES.is_dir(), reason="no logs of others here")
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("foxglove_json/foxjson.mcap", LogOptions()),
        ("multi_echo/echo.mcap", LogOptions()),
        ("pointcloud/cloud.mcap", LogOptions()),
        ("segments/seg.mcap", LogOptions()),
        ("ros1_in_mcap/ros1.mcap", LogOptions()),
        ("odom_named_world/world.mcap", LogOptions(odom_topic="/tf")),
        ("db3_unknown_type/all_topics", LogOptions()),
        ("file_compression/fcomp", LogOptions()),
        ("folder_without_metadata/nometa", LogOptions()),
    ],
)
def test_logs_of_others(name: str, options: LogOptions) -> None:
    """Nine dresses of one drive of 509 scans, 40 m long."""
    records = list(open_log(CASES / name, options).records())
    scans = [record for record in records if isinstance(record, RangeScan)]
    poses = [record.pose for record in records if isinstance(record, Odometry)]
    assert len(scans) == 509
    assert sum(a.distance(b) for a, b in pairwise(poses)) == pytest.approx(40.1, abs=0.2)
