"""One drive in every dress in which logs come: encodings, types of messages, schemas, containers.

Where a dress carries all that LaserScan does, the records are the same to the last bit, and so are
map and trace; where it does not, the trace stays within a centimetre of the truth.
"""

from __future__ import annotations

import gzip
import math
import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from conftest import FIXTURES
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry as FoxgloveOdometry
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from rosbags.rosbag2 import CompressionMode
from support.dresses import (
    HUMBLE,
    Said,
    said_in,
    same,
    write_foxglove,
    write_mcap,
    write_ros1,
    write_ros2,
)
from support.mcap_making import Sent, mcap_file

import mapcli
from mapcli.algorithms.evaluation.trajectory_error import evaluate_trajectory
from mapcli.errors import MapcliError
from mapcli.formats.documents.load_trajectory import load_trajectory
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.model.log import LogOptions
from mapcli.model.pose import Pose2D, planar_pose
from mapcli.model.scan import NANOSECONDS, Odometry, RangeScan, Record

APARTMENT = FIXTURES / "apartment.mcap"
NAMED = "/scan", "/odom", "/tf", "/tf_static"
S = NANOSECONDS


def built(name: str, *values: Any) -> Any:
    return HUMBLE.types[name](*values)


@cache
def drive(seconds: float = 10.0) -> list[Said]:
    return said_in(APARTMENT, seconds, *NAMED)


def read(path: Path, **options: Any) -> tuple[list[Record], Log]:
    log = open_log(path, LogOptions(**options))
    return list(log.records()), log


@cache
def wanted() -> list[Record]:
    last = drive()[-1].time
    records = open_log(APARTMENT).records()
    return [record for record in records if record.stamp_ns <= last]


# --- Messages of ROS


def as_echoes(said: Said) -> Said:
    """A scan as MultiEchoLaserScan: each beam has its echo and a farther one, or none."""
    if said.topic != "/scan":
        return said
    scan = said.message
    echoes = [
        built("sensor_msgs/msg/LaserEcho", np.array([r, r + 1][: 2 * math.isfinite(r)], np.float32))
        for r in scan.ranges.tolist()
    ]
    return said.dressed(
        built(
            "sensor_msgs/msg/MultiEchoLaserScan", scan.header, scan.angle_min, scan.angle_max,
            scan.angle_increment, scan.time_increment, scan.scan_time, scan.range_min,
            scan.range_max, echoes, [],
        )
    )  # fmt: skip


def as_pose(said: Said) -> Said:
    return said.dressed(
        built("geometry_msgs/msg/PoseStamped", said.message.header, said.message.pose.pose)
    )


def as_pose_with_covariance(said: Said) -> Said:
    message = said.message
    return said.dressed(
        built("geometry_msgs/msg/PoseWithCovarianceStamped", message.header, message.pose)
    )


def as_transform(said: Said) -> Said:
    message = said.message
    pose = message.pose.pose
    place = built("geometry_msgs/msg/Vector3", pose.position.x, pose.position.y, 0.0)
    motion = built("geometry_msgs/msg/Transform", place, pose.orientation)
    return said.dressed(
        built("geometry_msgs/msg/TransformStamped", message.header, message.child_frame_id, motion)
    )


def idl(name: str) -> str:
    return name.replace("/", "::")


def dds(name: str) -> str:
    package, kind, short = name.split("/")
    return f"{package}::{kind}::dds_::{short}_"


SCHEMAS: dict[str, tuple[str, str, Callable[[str], str]]] = {
    "cdr": ("cdr", "ros2msg", str),
    "ros2idl": ("cdr", "ros2idl", str),
    "omgidl": ("cdr", "omgidl", idl),
    "dds": ("cdr", "omgidl", dds),
    "cdr without schemas": ("cdr", "", str),
    "ros1": ("ros1", "ros1msg", lambda name: name.replace("/msg/", "/")),
    "ros1 without schemas": ("ros1", "", str),
    "json": ("json", "jsonschema", str),
    "json without schemas": ("json", "", str),
}


@pytest.mark.parametrize("dress", SCHEMAS)
@pytest.mark.parametrize("echoes", [False, True])
def test_messages_of_ros_in_mcap(tmp_path: Path, dress: str, echoes: bool) -> None:
    said = [as_echoes(one) for one in drive()] if echoes else drive()
    found, log = read(write_mcap(tmp_path / "a.mcap", said, *SCHEMAS[dress]))
    same(found, wanted())
    assert not log.damage.counts
    roles = {topic.name: topic.role for topic in log.topics()}
    assert roles == {"/scan": "scan", "/odom": "odometry", "/tf": "tf", "/tf_static": "tf_static"}
    told = "/scan: read as sensor_msgs/msg/" in " ".join(log.notes)
    assert told == ("without" in dress)


@pytest.mark.parametrize("dress", [name for name in SCHEMAS if "idl" not in name])
@pytest.mark.parametrize("pose", [as_pose, as_pose_with_covariance, as_transform])
def test_poses_named_as_odometry(tmp_path: Path, dress: str, pose: Callable[[Said], Said]) -> None:
    said = [pose(one) if one.topic == "/odom" else one for one in drive() if one.topic != "/tf"]
    path = write_mcap(tmp_path / "a.mcap", said, *SCHEMAS[dress])
    same(read(path, odom_topic="/odom")[0], wanted())
    assert open_log(path).odom_topic is None


@pytest.mark.parametrize("pose", [as_pose, as_transform])
def test_poses_named_as_odometry_in_bags(tmp_path: Path, pose: Callable[[Said], Said]) -> None:
    said = [pose(one) if one.topic == "/odom" else one for one in drive() if one.topic != "/tf"]
    same(read(write_ros1(tmp_path / "a.bag", said), odom_topic="/odom")[0], wanted())
    same(read(write_ros2(tmp_path / "bag", said), odom_topic="/odom")[0], wanted())
    found = load_trajectory(str(tmp_path / "a.bag"), "/odom").trajectory
    assert len(found) == sum(isinstance(record, Odometry) for record in wanted())


def test_a_topic_of_a_foreign_type_is_read_when_it_is_named(tmp_path: Path) -> None:
    """A company's own copy of LaserScan: its bytes are those of the original."""
    said = [one._replace(type="acme_msgs/msg/Beams") if one.topic == "/scan" else one
            for one in drive()]  # fmt: skip
    path = write_mcap(tmp_path / "a.mcap", said)
    assert open_log(path).scan_topics == []
    same(read(path, scan_topics=("/scan",))[0], wanted())


def test_what_a_topic_is_does_not_hang_on_messages_that_are_damaged(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", drive(), "cdr", "")
    content = bytearray(path.read_bytes())
    content[4726] ^= 0xFF  # in the first chunk
    path.write_bytes(content)
    found, log = read(path)
    assert log.damage.counts
    assert sum(isinstance(record, RangeScan) for record in found) > 20


def test_what_is_like_no_message_is_not_recognised(tmp_path: Path) -> None:
    stamp = built("builtin_interfaces/msg/Time", 1, 0)
    header = built("std_msgs/msg/Header", stamp, "base")
    others = [
        built("sensor_msgs/msg/Temperature", header, 21.5, 0.01),
        built("sensor_msgs/msg/FluidPressure", header, 101325.0, 0.0),
        built("geometry_msgs/msg/PointStamped", header, built("geometry_msgs/msg/Point", 1, 2, 3)),
        built("std_msgs/msg/String", "hello"),
        built("std_msgs/msg/Float64", 3.5),
    ]
    said = [Said(f"/other{k}", "", S, one) for k, one in enumerate(others)]
    for encoding in ("cdr", "ros1", "json"):
        log = open_log(write_mcap(tmp_path / "a.mcap", said, encoding, ""))
        assert {topic.role for topic in log.topics()} == {"other"}
    odd = Sent("/odd", "", None, S, b"\x00\x01\x00\x00\xff")
    path = mcap_file(tmp_path, odd, schema=False, encoding="")
    assert {topic.role for topic in open_log(path).topics()} == {"other"}


# --- Foxglove's


def fox_stamp(header: Any) -> dict[str, int]:
    return {"seconds": header.stamp.sec, "nanos": header.stamp.nanosec}


def fox_turn(turn: Any) -> dict[str, float]:
    return {name: getattr(turn, name) for name in "xyzw"}


def fox_place(place: Any) -> dict[str, float]:
    return {name: getattr(place, name) for name in "xyz"}


def fox_scan(said: Said) -> Said:
    scan = said.message
    message = LaserScan(
        timestamp=fox_stamp(scan.header), frame_id=scan.header.frame_id,
        start_angle=scan.angle_min, end_angle=scan.angle_max, ranges=scan.ranges.tolist(),
    )  # fmt: skip
    return Said(said.topic, "foxglove.LaserScan", said.time, message)


def fox_cloud(said: Said) -> Said:
    """The points of a scan, with a byte before each, as a cloud."""
    header, points = said.message.header, hits(said.message)
    kind = np.dtype({"names": ["ring", "x", "y", "z"], "formats": ["u1", "<f4", "<f4", "<f8"],
                     "offsets": [0, 1, 5, 9], "itemsize": 17})  # fmt: skip
    data = np.zeros(len(points), kind)
    data["x"], data["y"] = points.T
    types = PackedElementField.NumericType
    fields = [
        PackedElementField(name=name, offset=offset, type=number)
        for name, offset, number in (
            ("ring", 0, types.UINT8), ("x", 1, types.FLOAT32), ("y", 5, types.FLOAT32),
            ("z", 9, types.FLOAT64),
        )
    ]  # fmt: skip
    message = PointCloud(timestamp=fox_stamp(header), frame_id=header.frame_id, point_stride=17,
                         fields=fields, data=data.tobytes())  # fmt: skip
    return Said(said.topic, "foxglove.PointCloud", said.time, message)


def fox_transforms(said: Said) -> Said:
    """The static transforms one by one, the moving ones as a list."""
    made = [
        FrameTransform(
            timestamp=fox_stamp(one.header), parent_frame_id=one.header.frame_id,
            child_frame_id=one.child_frame_id, translation=fox_place(one.transform.translation),
            rotation=fox_turn(one.transform.rotation),
        )
        for one in said.message.transforms
    ]  # fmt: skip
    if said.topic == "/tf_static":
        return Said(said.topic, "foxglove.FrameTransform", said.time, made[0])
    return Said(said.topic, "foxglove.FrameTransforms", said.time, FrameTransforms(transforms=made))


def fox_odometry(said: Said) -> Said:
    pose = said.message.pose.pose
    message = FoxgloveOdometry(
        timestamp=fox_stamp(said.message.header), frame_id="odom", body_frame_id="base_link",
        pose={"position": fox_place(pose.position), "orientation": fox_turn(pose.orientation)},
        linear_velocity={},
    )  # fmt: skip
    return Said(said.topic, "foxglove.Odometry", said.time, message)


def fox_pose(said: Said) -> Said:
    one = fox_odometry(said).message
    message = PoseInFrame(timestamp=one.timestamp, frame_id=one.frame_id, pose=one.pose)
    return Said(said.topic, "foxglove.PoseInFrame", said.time, message)


FOX = {
    "/scan": fox_scan,
    "/odom": fox_odometry,
    "/tf": fox_transforms,
    "/tf_static": fox_transforms,
}


@cache
def fox_drive(seconds: float = 10.0) -> list[Said]:
    return [FOX[said.topic](said) for said in drive(seconds)]


def without_limits(records: list[Record]) -> Iterator[Record]:
    """Scans as a message gives them that has no limits of the range and wider angles."""
    for record in records:
        if isinstance(record, RangeScan):
            first, step = float(record.angle_min), float(record.angle_increment)
            record = replace(record, range_min=0.0, range_max=math.inf, angle_min=first,
                             angle_increment=step)  # fmt: skip
        yield record


@pytest.mark.parametrize("dress", ["protobuf", "json", "json without schemas"])
def test_messages_of_foxglove(tmp_path: Path, dress: str) -> None:
    encoding, _, without = dress.partition(" ")
    path = write_foxglove(tmp_path / "a.mcap", fox_drive(), encoding, not without)
    found, log = read(path)
    same(found, list(without_limits(wanted())))
    for one, other in zip(found, wanted(), strict=True):
        if isinstance(one, RangeScan) and isinstance(other, RangeScan):
            assert one.range_max == math.inf
            assert one.angle_increment == pytest.approx(other.angle_increment, rel=1e-6)
    assert {topic.role for topic in log.topics()} == {"scan", "odometry", "tf", "tf_static"}
    assert not log.damage.counts


@pytest.mark.parametrize("encoding", ["protobuf", "json"])
def test_odometry_of_foxglove_from_transforms_and_from_poses(tmp_path: Path, encoding: str) -> None:
    said = [one for one in fox_drive() if one.topic != "/odom"]
    by_transforms = read(write_foxglove(tmp_path / "a.mcap", said, encoding))[0]
    said = [one for one in said if one.topic != "/tf"]
    said += [fox_pose(one) for one in drive() if one.topic == "/odom"]
    said.sort(key=lambda one: one.time)
    path = write_foxglove(tmp_path / "a.mcap", said, encoding)
    by_poses = read(path, odom_topic="/odom")[0]
    moved = [record.pose for record in wanted() if isinstance(record, Odometry)]
    for found in (by_transforms, by_poses):
        poses = [record.pose for record in found if isinstance(record, Odometry)]
        assert max(a.distance(b) for a, b in zip(poses, moved, strict=True)) < 1e-9
    assert len(load_trajectory(str(path), "/odom").trajectory) == len(moved)


def test_protobuf_cut_anywhere_is_refused_or_shorter(tmp_path: Path) -> None:
    from mapcli.formats.logs.protobuf import decoder_of_fields
    from mapcli.formats.logs.ros.foxglove import scan_of

    message = fox_scan(next(one for one in drive() if one.topic == "/scan")).message
    file = tmp_path / "a.mcap"
    write_foxglove(file, [Said("/scan", "", S, message)], "protobuf")
    (stream,) = open_log(file)._files[0].streams.values()  # type: ignore[attr-defined]
    decode = decoder_of_fields(stream.type, stream.schema, scan_of)
    data = message.SerializeToString()
    assert len(decode(data).ranges) == len(message.ranges)
    for size in range(0, len(data), 7):
        try:
            assert len(decode(data[:size]).ranges) <= len(message.ranges)
        except ValueError:
            continue
    for broken in (b"", b"\n", stream.schema[:-9], stream.schema[9:]):
        with pytest.raises(ValueError, match=r".*"):
            decoder_of_fields(stream.type, broken, scan_of)(data)


# --- Dresses that do not carry all, as maps


def hits(scan: Any) -> Any:
    """The points that the beams of a scan hit, in the frame of the laser, shape (n, 2)."""
    ranges = scan.ranges.astype(np.float64)
    bearing = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    seen = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges <= scan.range_max)
    return np.column_stack([ranges * np.cos(bearing), ranges * np.sin(bearing)])[seen]


def as_cloud(said: Said) -> Said:
    """The points of a scan, with those of a floor 20 cm below them and a ceiling."""
    if said.topic != "/scan":
        return said
    seen = hits(said.message)
    points = np.zeros((3 * len(seen), 3), np.float32)
    points[:, :2] = np.concatenate([seen, 0.5 * seen, 0.7 * seen])
    points[len(seen) :, 2] = -0.2
    points[2 * len(seen) :, 2] = 1.5
    fields = [
        built("sensor_msgs/msg/PointField", name, 4 * k, 7, 1) for k, name in enumerate("xyz")
    ]
    data = np.frombuffer(points.tobytes(), np.uint8)
    return said.dressed(
        built("sensor_msgs/msg/PointCloud2", said.message.header, 1, len(points), fields, False, 12,
              len(data), data, True)
    )  # fmt: skip


def as_segments(said: Said) -> Iterator[Said]:
    """A turn as six messages, one after another in the time before the next turn."""
    if said.topic != "/scan":
        yield said
        return
    scan, parts = said.message, 6
    beams = len(scan.ranges) // parts
    for k in range(parts):
        first = scan.angle_min + k * beams * scan.angle_increment
        part = replace(
            scan, angle_min=first, angle_max=first + (beams - 1) * scan.angle_increment,
            ranges=scan.ranges[k * beams : (k + 1) * beams], intensities=scan.intensities[:0],
        )  # fmt: skip
        yield said.dressed(part)


def rounded(path: Path, said: list[Said]) -> Path:
    """A CARMEN log: centimetres, and times of a hundredth of a second."""
    lines, where = [], ""
    for one in said:
        when = "{0:.2f} host {0:.2f}".format(one.time * 1e-9)
        if one.topic == "/odom":
            pose = planar(one.message.pose.pose)
            where = f"{pose.x:.3f} {pose.y:.3f} {pose.theta:.4f}"
            lines.append(f"ODOM {where} 0 0 0 {when}")
        elif one.topic == "/scan" and where:
            scan, n = one.message, len(one.message.ranges)
            ranges = " ".join(f"{r:.2f}" for r in np.minimum(scan.ranges, 81.83))
            step = f"{scan.angle_increment:.6f}"
            head = f"ROBOTLASER1 0 {scan.angle_min:.6f} {math.tau:.6f} {step} 81.83 0.01 0"
            lines.append(f"{head} {n} {ranges} 0 {where} {where} 0 0 0 0 0 {when}")
    path.write_text("\n".join(lines) + "\n")
    return path


def planar(pose: Any) -> Pose2D:
    turn = pose.orientation
    return planar_pose((pose.position.x, pose.position.y), (turn.x, turn.y, turn.z, turn.w))


def test_clouds_in_every_encoding_are_the_same_scans(tmp_path: Path) -> None:
    said = [as_cloud(one) for one in drive(3.0)]
    found = [
        read(write_mcap(tmp_path / f"{k}.mcap", said, *SCHEMAS[dress]))[0]
        for k, dress in enumerate(name for name in SCHEMAS if "idl" not in name)
    ]
    found.append(read(write_ros1(tmp_path / "a.bag", said))[0])
    for other in found[1:]:
        same(other, found[0])
    fox = [fox_cloud(one) if one.topic == "/scan" else FOX[one.topic](one) for one in drive(3.0)]
    for encoding in ("protobuf", "json"):
        same(read(write_foxglove(tmp_path / "a.mcap", fox, encoding))[0], found[0])


def written(dress: str, path: Path) -> Path:
    said = drive(math.inf)
    if dress == "foxglove":
        return write_foxglove(path, [FOX[one.topic](one) for one in said], "protobuf")
    if dress == "cloud":
        return write_mcap(path, [as_cloud(one) for one in said])
    if dress == "segments":
        return write_mcap(path, [part for one in said for part in as_segments(one)])
    return rounded(path, said)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dress", "metres"),
    [("foxglove", 0.01), ("cloud", 0.01), ("segments", 0.01), ("rounded", 0.02)],
)
def test_the_trace_is_right(tmp_path: Path, dress: str, metres: float) -> None:
    log = open_log(written(dress, tmp_path / "a"))
    trace = mapcli.replay(log.records()).trace
    assert len(trace.poses) == 509
    truth = load_trajectory(str(APARTMENT)).trajectory
    off = evaluate_trajectory(trace.trajectory(), truth).errors["ate"].metres
    assert math.sqrt(np.mean(off**2)) <= metres


# --- Damage


def zstd(data: bytes) -> bytes:
    return zstandard.ZstdCompressor().compress(data)


def bag(path: Path, compression: str | None = None) -> Path:
    return write_ros1(path, drive(4.0), compression, 1 << 13)


def db3(path: Path, mode: CompressionMode | None = None) -> Path:
    (file,) = (one for one in write_ros2(path, drive(4.0), mode).iterdir() if one.suffix != ".yaml")
    return file


CONTAINERS: dict[str, Callable[[Path], bytes]] = {
    "mcap": lambda path: write_mcap(path, drive(4.0)).read_bytes(),
    "mcap without schemas": lambda path: write_mcap(path, drive(4.0), "cdr", "").read_bytes(),
    "protobuf": lambda path: write_foxglove(path, fox_drive(4.0), "protobuf").read_bytes(),
    "mcap.zst": lambda path: zstd(write_mcap(path, drive(4.0)).read_bytes()),
    "bag": lambda path: bag(path).read_bytes(),
    "bag of lz4": lambda path: bag(path, "lz4").read_bytes(),
    "bag of bz2": lambda path: bag(path, "bz2").read_bytes(),
    "bag.gz": lambda path: gzip.compress(bag(path).read_bytes()),
    "db3": lambda path: db3(path).read_bytes(),
    "db3 of packed messages": lambda path: db3(path, CompressionMode.MESSAGE).read_bytes(),
    "db3.zstd": lambda path: db3(path, CompressionMode.FILE).read_bytes(),
}


@pytest.mark.parametrize("container", CONTAINERS)
def test_damage_costs_what_it_hits_and_is_said(tmp_path: Path, container: str) -> None:
    """A sample of what a hundred cuts and three hundred flipped bits of each were tried with: never
    less than a shorter prefix gives, and never less without a word."""
    good, hurt = CONTAINERS[container](tmp_path / "good"), tmp_path / "hurt"
    whole = scans_of(hurt, good)
    assert whole == sum(one.topic == "/scan" for one in drive(4.0))
    before = 0
    for k in range(1, 13):
        now = scans_of(hurt, good[: len(good) * k // 13], whole)
        assert now >= before
        before = now
    chance = random.Random(7)
    for _ in range(12):
        flipped = bytearray(good)
        flipped[chance.randrange(len(good))] ^= 1 << chance.randrange(8)
        scans_of(hurt, bytes(flipped), whole)


def scans_of(path: Path, data: bytes, wanted: int = 0) -> int:
    """Scans that a file gives, whose damage is told if there are less than wanted."""
    path.write_bytes(data)
    try:
        log = open_log(path)
        found = sum(isinstance(record, RangeScan) for record in log.records())
    except MapcliError:
        return 0
    assert found <= (wanted or found)
    assert log.damage.counts or found >= wanted
    return found
