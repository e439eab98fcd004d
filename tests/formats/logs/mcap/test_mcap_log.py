"""MCAP logs: what is written is read, and what others write is understood."""

from __future__ import annotations

import gzip
import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap.writer import CompressionType
from support.mcap_making import S, Sent, mcap_bytes, mcap_file, odom, scan, tf_static, transform

from mapcli.errors import DataError, FormatError
from mapcli.formats.logs.log import Source
from mapcli.formats.logs.mcap import container as mcap_file_module
from mapcli.formats.logs.mcap.writer import McapLogWriter
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.formats.logs.ros import messages as ros
from mapcli.formats.logs.topics import LogNames
from mapcli.model.log import Damage, LogOptions
from mapcli.model.pose import Pose2D, rounded_angle
from mapcli.model.scan import Mount, Odometry, RangeScan, Record, TruePose

BASE_LASER = transform(0, "base_link", "laser", (0.2, 0.1, 0.3))


def read(path: str, **options: Any) -> tuple[list[Record], Log]:
    log = open_log([path], LogOptions(**options))
    return list(log.records()), log


def read_messages(folder: Path, *messages: Sent, **options: Any) -> tuple[list[Record], Log]:
    return read(mcap_file(folder, *messages), **options)


def scans_of(records: list[Record]) -> list[RangeScan]:
    return [record for record in records if isinstance(record, RangeScan)]


def poses_of(records: list[Record]) -> list[tuple[float, Pose2D]]:
    return [(r.stamp_ns / S, r.pose) for r in records if isinstance(r, Odometry)]


def identity(record: Record) -> tuple[Any, ...]:
    """Everything about a record, to the bit."""
    if isinstance(record, RangeScan):
        return (
            "scan", record.stamp_ns, record.angle_min, record.angle_increment,
            record.ranges.tobytes(), record.range_min, record.range_max, record.mount,
        )  # fmt: skip
    return type(record).__name__, record.stamp_ns, record.pose


def written(records: list[Record], **settings: Any) -> bytes:
    stream = io.BytesIO()
    with McapLogWriter(stream, LogNames(**settings)) as writer:
        for record in records:
            writer.write(record)
    return stream.getvalue()


# What is written is read


singles = st.floats(-1e3, 1e3, width=32)
stamps = st.integers(0, 2**31 * S - 1)
angles = st.floats(-10, 10).map(rounded_angle)
poses = st.builds(Pose2D, st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), angles)
mounts = st.builds(
    Mount,
    st.builds(
        Pose2D,
        st.floats(-2, 2).map(lambda x: round(x, 6) + 0.0),
        st.floats(-2, 2).map(lambda y: round(y, 6) + 0.0),
        angles,
    ),
    st.booleans(),
)
REP117 = [math.inf, -math.inf, math.nan]
scans = st.builds(
    RangeScan,
    stamps,
    singles,
    st.floats(0.0009765625, 1, width=32),
    arrays(
        np.float32,
        st.integers(1, 12),
        elements=st.floats(1, 19, width=32) | st.sampled_from(REP117),
    ),
    st.sampled_from([0.0, 0.5]),
    st.sampled_from([20.0, math.inf]),
    mounts,
)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.lists(scans | st.builds(Odometry, stamps, poses), min_size=1, max_size=12), scans)
def test_round_trip_to_the_bit(
    tmp_path_factory: pytest.TempPathFactory, records: list[Record], last: RangeScan
) -> None:
    records = sorted([*records, last], key=lambda record: record.stamp_ns)
    path = tmp_path_factory.mktemp("log") / "a.mcap"
    path.write_bytes(written(records))
    again, log = read(str(path))
    assert [identity(record) for record in again] == [identity(record) for record in records]
    assert log.damage.counts == {}


def test_the_same_records_give_the_same_bytes() -> None:
    records: list[Record] = [
        Odometry(1, Pose2D(1, 2, 0.5)),
        RangeScan(2, 0.0, 0.1, np.ones(5, dtype=np.float32)),
    ]
    assert written(records) == written(records)
    assert b"mapcli 0." in written(records)[:60]


def test_truth_is_not_taken_for_odometry(tmp_path: Path) -> None:
    records: list[Record] = [
        TruePose(1, Pose2D(9, 9, 1)),
        RangeScan(2, 0.0, 0.1, np.ones(5, dtype=np.float32)),
    ]
    path = tmp_path / "a.mcap"
    path.write_bytes(written(records))
    again, log = read(str(path))
    assert [type(record) for record in again] == [RangeScan]
    assert log.odom_topic is None
    assert "no odometry: poses come from matching scans alone" in log.notes
    assert {t.name: t.role for t in log.topics()}["/ground_truth"] == "pose"


def test_written_with_other_names(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    record = RangeScan(2, 0.0, 0.1, np.ones(5, dtype=np.float32))
    path.write_bytes(written([Odometry(1, Pose2D()), record], scan_topic="/s", odom_topic="/o"))
    log = open_log([str(path)])
    assert (log.scan_topics, log.odom_topic) == (["/s"], "/o")


def test_stamps_beyond_ros_2_are_refused() -> None:
    for stamp in (-1, 2**31 * S):
        with pytest.raises(DataError, match="between 1970 and 2038"):
            McapLogWriter(io.BytesIO()).write(Odometry(stamp, Pose2D()))


def test_others_read_what_is_written(tmp_path: Path) -> None:
    """rosbags' own reader stands for them."""
    from rosbags.highlevel import AnyReader

    mount = Mount(Pose2D(0.1, 0.0, 0.5), flipped=True)
    first = RangeScan(2 * S, -1.0, 0.5, np.arange(1, 4, dtype=np.float32), 0.1, 8.0, mount)
    path = tmp_path / "a.mcap"
    path.write_bytes(written([Odometry(S, Pose2D(1, 2, 1)), first, TruePose(3 * S, Pose2D(4, 5))]))
    with AnyReader([path]) as reader:
        found = [
            (connection.topic, time, reader.deserialize(raw, connection.msgtype))
            for connection, time, raw in reader.messages()
        ]
    assert [(topic, time / S) for topic, time, _ in found] == [
        ("/odom", 1), ("/tf", 1), ("/tf_static", 2), ("/scan", 2), ("/ground_truth", 3),
    ]  # fmt: skip
    messages: dict[str, Any] = {topic: message for topic, _, message in found}
    assert messages["/scan"].header.frame_id == "laser"
    assert messages["/scan"].angle_max == 0.0
    assert messages["/scan"].ranges.tolist() == [1, 2, 3]
    assert messages["/odom"].pose.pose.orientation.z == math.sin(0.5)
    placed = messages["/tf_static"].transforms[0]
    assert (placed.header.frame_id, placed.child_frame_id) == ("base_link", "laser")
    assert messages["/ground_truth"].pose.position.y == 5


# Containers


BODY = [tf_static(1, BASE_LASER)] + [
    message for t in range(1, 40) for message in (odom(t, x=t / 10), scan(t + 0.5, [1, 2, t / 9]))
]


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"compression": CompressionType.LZ4},
        {"compression": CompressionType.NONE},
        {"use_chunking": False},
        {"enable_crcs": False},
        {"chunk_size": 1},
        {"repeat_channels": False},
        {"use_statistics": False, "use_summary_offsets": False},
        {"repeat_schemas": False},
    ],
    ids=str,
)
def test_every_kind_of_container_reads_the_same(tmp_path: Path, settings: dict[str, Any]) -> None:
    records, log = read(mcap_file(tmp_path, *BODY, **settings))
    assert len(records) == 78
    assert [r.stamp_ns for r in records] == sorted(r.stamp_ns for r in records)
    assert log.damage.counts == {}
    assert log.scan_count == 39
    assert records[-1].stamp_ns == 39.5 * S
    expected, _ = read(mcap_file(tmp_path, *BODY, name="b.mcap"))
    assert list(map(identity, records)) == list(map(identity, expected))
    topic = next(topic for topic in log.topics() if topic.name == "/scan")
    assert (topic.count, topic.first_ns, topic.last_ns) == (39, 1.5 * S, 39.5 * S)


def test_gzip_around_mcap(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap.gz"
    path.write_bytes(gzip.compress(mcap_bytes(*BODY)))
    assert len(read(str(path))[0]) == 78


def test_topics_written_one_after_another_are_merged(tmp_path: Path) -> None:
    messages = [*sorted(BODY, key=lambda sent: sent.topic)]
    records, log = read_messages(tmp_path, *messages)
    assert [r.stamp_ns for r in records] == sorted(r.stamp_ns for r in records)
    assert len(records) == 78
    assert log.disordered == 0


def test_chunks_are_unpacked_when_their_time_comes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Memory holds the chunks of one time, also where each topic has the file to itself."""
    loads: list[int] = []
    unpacked = mcap_file_module.unpacked

    def counting(file: Any, segment: Any) -> bytes:
        loads.append(segment.offset)
        return unpacked(file, segment)

    monkeypatch.setattr(mcap_file_module, "unpacked", counting)
    for messages in (BODY, sorted(BODY, key=lambda sent: sent.topic)):
        path = Path(mcap_file(tmp_path, *messages))
        file = mcap_file_module.McapFile(Source("a", path), Damage())
        loads.clear()
        stream = file.messages({1, 2, 3}, Damage())
        before = [(next(stream), len(loads))[1] for _ in range(79)]
        chunks = before[-1]
        assert chunks > 12
        assert before[0] <= 4
        assert before[40] < 0.75 * chunks
        assert len(set(loads)) == len(loads)


def test_parts_share_their_static_transforms(tmp_path: Path) -> None:
    one = mcap_file(tmp_path, *BODY[:41], name="one.mcap")
    two = mcap_file(tmp_path, *BODY[41:], name="two.mcap")  # has no /tf_static
    log = open_log([two, one])
    records = list(log.records())
    assert [r.stamp_ns for r in records] == sorted(r.stamp_ns for r in records)
    assert {scan.mount for scan in scans_of(records)} == {Mount(Pose2D(0.2, 0.1, 0.0))}
    assert (len(records), log.scan_count) == (78, 39)


def test_a_folder_is_a_ros_2_bag(tmp_path: Path) -> None:
    for i in range(11):
        mcap_file(tmp_path, *BODY[i * 8 : i * 8 + 8], name=f"bag_{i}.mcap")
    found = read(str(tmp_path))[0]  # a recorder that was killed leaves no metadata.yaml
    assert len(found) == 78
    for content in ("rosbag2_bagfile_information: {}\n", "{", "rosbag2_bagfile_information:\n"
                    "  relative_file_paths: [renamed_0.mcap]\n"):  # fmt: skip
        (tmp_path / "metadata.yaml").write_text(content)
        assert len(read(str(tmp_path))[0]) == 78


def test_parts_of_different_formats(tmp_path: Path) -> None:
    (tmp_path / "b.log").write_text("FLASER 1 1 0 0 0 0 0 0 1 host 1\n")
    with pytest.raises(FormatError, match=r"b.log: is a CARMEN log, but .*a.mcap is an MCAP log"):
        open_log([mcap_file(tmp_path, *BODY), str(tmp_path / "b.log")])


# Messages


def test_a_scan_literally(tmp_path: Path) -> None:
    sent = scan(1.25, [1.5, 2.5], angle_min=0.25, increment=-0.5, range_min=0.5, range_max=8)
    (record,), log = read_messages(tmp_path, sent)
    assert isinstance(record, RangeScan)
    assert (record.stamp_ns, record.angle_min, record.angle_increment) == (1.25 * S, 0.25, -0.5)
    assert record.ranges.tolist() == [1.5, 2.5]
    assert (record.range_min, record.range_max) == (0.5, 8.0)
    assert (log.beams.total, log.beams.no_return) == (2, 0)


def test_ranges_follow_rep117(tmp_path: Path) -> None:
    values = [math.nan, math.inf, -math.inf, 0, -1, 0.05, 0.1, 9.9, 10, 11, 5]
    records, log = read_messages(tmp_path, scan(1, values))
    nan, inf, single = math.nan, math.inf, np.float32
    expected = [nan, inf, -inf, nan, nan, -inf, single(0.1), single(9.9), inf, inf, 5]
    assert np.array_equal(scans_of(records)[0].ranges, expected, equal_nan=True)
    beams = log.beams
    assert (beams.total, beams.invalid, beams.too_close, beams.no_return) == (11, 3, 2, 3)


@pytest.mark.parametrize(("low", "high"), [(0, 0), (-1, -1), (math.nan, math.nan), (5, 4)])
def test_limits_that_make_no_sense_limit_nothing(tmp_path: Path, low: float, high: float) -> None:
    records, log = read_messages(tmp_path, scan(1, [0.01, 5, 500], range_min=low, range_max=high))
    found = scans_of(records)[0]
    assert found.range_max == math.inf
    assert found.ranges[2] == 500
    assert f"/scan: range_max is {high:g}: not used" in log.notes


@pytest.mark.parametrize(
    ("angle_min", "angle_max", "increment", "expected"),
    [
        (-1.0, 1.0, 0.5, 0.5),
        (-1.0, 1.5, 0.5, 0.5),  # angle_max is one beam too far: trust the increment
        (1.0, -1.0, -0.5, -0.5),
        (-1.0, 1.0, 0.0, 0.5),
        (-1.0, 1.0, math.nan, 0.5),
        (-1.0, 1.0, 0.1, 0.5),
        (1.0, -1.0, 0.5, -0.5),
        (-1.0, math.nan, 0.5, 0.5),
    ],
)
def test_angles_that_contradict_each_other(
    tmp_path: Path, angle_min: float, angle_max: float, increment: float, expected: float
) -> None:
    sent = scan(1, [1, 2, 3, 4, 5], angle_min=angle_min, angle_max=angle_max, increment=increment)
    records, log = read_messages(tmp_path, sent)
    assert scans_of(records)[0].angle_increment == expected
    noted = any(note.startswith("/scan: angle_increment contradicts") for note in log.notes)
    assert noted == (increment != expected)


def test_scans_without_beams_or_angles_are_skipped(tmp_path: Path) -> None:
    sent = [
        scan(1),
        scan(2, []),
        scan(3, [1, 2], angle_min=math.nan),
        scan(4, [1, 2], angle_max=math.inf, increment=0),
    ]
    records, log = read_messages(tmp_path, *sent)
    assert len(records) == 1
    assert log.damage.lines() == [
        "1 scan without beams, skipped (at 2.000 s)",
        "2 scans without angles, skipped (first: at 3.000 s)",
    ]


def test_beam_counts_may_change(tmp_path: Path) -> None:
    records, log = read_messages(tmp_path, *(scan(n, [1.0] * n) for n in range(1, 6)))
    assert [len(found.ranges) for found in scans_of(records)] == [1, 2, 3, 4, 5]
    assert log.damage.counts == {}


def test_odometry_in_the_plane(tmp_path: Path) -> None:
    records, _ = read_messages(tmp_path, odom(1, 1.5, -2, math.pi), odom(2, 1, 1, -0.1), scan(3))
    assert poses_of(records) == [
        (1.0, Pose2D(1.5, -2.0, rounded_angle(math.pi))),
        (2.0, Pose2D(1.0, 1.0, -0.1)),
    ]


@pytest.mark.parametrize("field", ["no quaternion", "not finite"])
def test_odometry_without_a_pose_is_counted(tmp_path: Path, field: str) -> None:
    bad = odom(2)
    if field == "no quaternion":
        bad.message.pose.pose.orientation.w = 0.0
    else:
        bad.message.pose.pose.position.x = math.nan
    records, log = read_messages(tmp_path, odom(1), bad, scan(3))
    assert len(records) == 2
    assert log.damage.lines() == ["1 message on /odom without readable content (at 2.000 s)"]


def test_big_endian_messages(tmp_path: Path) -> None:
    sent = [scan(1, little_endian=False), odom(2, 1, 2, 0.5, little_endian=False)]
    sent.append(tf_static(0, BASE_LASER))
    sent[-1].little_endian = False
    records, _ = read_messages(tmp_path, *sent)
    assert scans_of(records)[0].ranges.tolist() == [1, 2, 3]
    assert scans_of(records)[0].mount == Mount(Pose2D(0.2, 0.1, 0.0))
    assert poses_of(records) == [(2.0, Pose2D(1, 2, 0.5))]


@pytest.mark.parametrize("frame", ["", "a", "ab", "abc", "abcd", "robot_1/laser_front"])
def test_every_length_of_a_frames_name(tmp_path: Path, frame: str) -> None:
    child = frame or "x"
    records, _ = read_messages(
        tmp_path,
        tf_static(0, transform(0, child, "other"), transform(0, "base_link", child, (1, 0, 0))),
        odom(1, 3, child="base_link"),
        scan(2, frame=frame),
    )
    assert poses_of(records) == [(1.0, Pose2D(3, 0, 0))]
    assert scans_of(records)[0].mount.pose.x == (1.0 if frame else 0.0)


@pytest.mark.parametrize("schema_encoding", ["ros2msg", "ros2idl", ""])
def test_schemas_do_not_matter(tmp_path: Path, schema_encoding: str) -> None:
    path = mcap_file(tmp_path, *BODY, schema="", schema_encoding=schema_encoding)
    assert len(read(path)[0]) == 78


@pytest.mark.parametrize(
    "name",
    ["sensor_msgs/LaserScan", "sensor_msgs::msg::dds_::LaserScan_", "sensor_msgs::msg::LaserScan"],
)
def test_other_spellings_of_types(tmp_path: Path, name: str) -> None:
    sent = scan(1)
    data = bytes(ros.typestore().serialize_cdr(sent.message, sent.type))
    assert len(read_messages(tmp_path, Sent("/scan", name, None, S, data))[0]) == 1


def test_bytes_that_are_no_message_are_counted(tmp_path: Path) -> None:
    good = bytes(ros.typestore().serialize_cdr(scan(1).message, ros.LASER_SCAN))
    bad = [b"", b"\0", good[:30], good[:-13], b"\0\x06\0\0" + good[4:], good[:12] + b"\xff" * 40]
    sent = [Sent("/scan", ros.LASER_SCAN, None, t * S, data) for t, data in enumerate(bad, 2)]
    path = mcap_file(tmp_path, scan(1), *sent)
    records, log = read(path)
    assert len(records) == 1
    assert log.damage.counts == {"messages on /scan without readable content": 6}
    with pytest.raises(FormatError, match=r"at 2.000 s: 1 message on /scan"):
        read(path, strict=True)


# Time


def test_stamps_order_records_whatever_the_log_times(tmp_path: Path) -> None:
    sent = [odom(t, x=t, log=t) for t in (1.0, 2.0, 3.0)] + [scan(1.5, log=3.5)]
    records, _ = read_messages(tmp_path, *sent)
    assert [record.stamp_ns / S for record in records] == [1.0, 1.5, 2.0, 3.0]


def test_time_source_log(tmp_path: Path) -> None:
    records, _ = read_messages(tmp_path, scan(5, log=100), odom(6, log=99), time_source="log")
    assert [record.stamp_ns / S for record in records] == [99, 100]


def test_zero_stamps_fall_back_to_the_time_of_recording(tmp_path: Path) -> None:
    records, log = read_messages(tmp_path, scan(0, log=7), scan(0, log=8))
    assert [record.stamp_ns / S for record in records] == [7, 8]
    assert "/scan: stamps of 0, the time of recording is used" in log.notes


def test_impossible_stamps_are_dropped(tmp_path: Path) -> None:
    records, log = read_messages(tmp_path, scan(1), scan(-5, log=2), scan(3))
    assert [record.stamp_ns / S for record in records] == [1, 3]
    assert log.damage.counts == {"messages on /scan with an impossible stamp, dropped": 1}


# Topics


def test_several_scan_topics_need_a_choice(tmp_path: Path) -> None:
    path = mcap_file(tmp_path, scan(1, topic="/front"), scan(2, topic="/rear"), odom(3))
    with pytest.raises(
        DataError, match=r"several scan topics: /front \(.*\), /rear .*--scan-topic"
    ):
        read(path)
    assert len(scans_of(read(path, scan_topics=("/rear",))[0])) == 1
    with pytest.raises(DataError, match="no scan topic /top among /front"):
        read(path, scan_topics=("/top",))
    log = open_log([path])
    assert (log.scan_topics, log.scan_count) == ([], None)


def test_several_odometry_topics_need_a_choice(tmp_path: Path) -> None:
    path = mcap_file(tmp_path, scan(1), odom(2, 1), odom(3, 2, topic="/filtered"))
    with pytest.raises(DataError, match=r"several odometry topics: /filtered .*--odom-topic"):
        read(path)
    assert poses_of(read(path, odom_topic="/odom")[0]) == [(2.0, Pose2D(1, 0, 0))]
    with pytest.raises(DataError, match="no odometry topic /wheels among"):
        read(path, odom_topic="/wheels")


def test_no_scans_at_all(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"no range scans among /odom .*expected a topic of"):
        read_messages(tmp_path, odom(1))
    with pytest.raises(DataError, match="no range scans; expected"):
        read_messages(tmp_path)


@pytest.mark.parametrize("encoding", ["protobuf", "cbor", "flatbuffer"])
def test_scans_in_an_encoding_that_is_not_read(tmp_path: Path, encoding: str) -> None:
    path = mcap_file(tmp_path, scan(1), encoding=encoding)
    with pytest.raises(DataError, match=f"/scan holds sensor_msgs/msg/LaserScan in {encoding}"):
        read(path)


def test_foxglove_scans_that_are_not_read_are_named(tmp_path: Path) -> None:
    sent = Sent("/s", "foxglove.LaserScan", None, S, b"\n")
    path = mcap_file(tmp_path, sent, encoding="flatbuffer")
    with pytest.raises(DataError, match=r"/s holds foxglove\.LaserScan in flatbuffer"):
        read(path)


def test_protobuf_without_its_definition_is_unreadable_content(tmp_path: Path) -> None:
    sent = Sent("/s", "foxglove.LaserScan", None, S, b"\n")
    path = mcap_file(tmp_path, sent, encoding="protobuf", schema_encoding="protobuf")
    with pytest.raises(FormatError, match=r"1 message on /s without readable content"):
        read(path)


# JSON


def as_json(sent: Sent, **changes: Any) -> Sent:
    """The message as JSON in the shape of ROS messages."""

    def plain(value: Any) -> Any:
        if hasattr(value, "__dataclass_fields__"):
            names = [name for name in value.__dataclass_fields__ if not name.startswith("__")]
            return {name: plain(getattr(value, name)) for name in names}
        if isinstance(value, np.ndarray | list):
            return [plain(item) for item in value]
        return value.item() if isinstance(value, np.generic) else value

    content = plain(sent.message)
    content.update(changes)
    return Sent(sent.topic, sent.type, None, sent.log_ns, json.dumps(content).encode())


def json_body() -> list[Sent]:
    return [as_json(message) for message in BODY]


@pytest.mark.parametrize("schema", [True, False])
def test_json_is_read_like_cdr(tmp_path: Path, schema: bool) -> None:
    path = mcap_file(tmp_path, *json_body(), encoding="json", schema=schema)
    records, log = read(path)
    expected, _ = read(mcap_file(tmp_path, *BODY, name="b.mcap"))
    assert list(map(identity, records)) == list(map(identity, expected))
    assert log.damage.counts == {}


def test_json_has_no_nan(tmp_path: Path) -> None:
    sent = as_json(scan(1), ranges=[None, "NaN", "Infinity", "-Infinity", 2, math.nan, math.inf])
    records, _ = read(mcap_file(tmp_path, sent, encoding="json"))
    nan, inf = math.nan, math.inf
    expected = [nan, nan, inf, -inf, 2, nan, inf]
    assert np.array_equal(scans_of(records)[0].ranges, expected, equal_nan=True)


def test_json_of_more_than_a_float_holds(tmp_path: Path) -> None:
    """As the same number would be in CDR: infinite, and no warning about it."""
    sent = as_json(scan(1), range_max=1e300, ranges=[1, 2, 1e300])
    records, _ = read(mcap_file(tmp_path, sent, encoding="json"))
    assert scans_of(records)[0].ranges.tolist() == [1, 2, math.inf]
    assert scans_of(records)[0].range_max == math.inf


@pytest.mark.parametrize(
    "stamp", [{"sec": 5, "nanosec": 7}, {"sec": 5, "nsec": 7}, {"secs": 5, "nsecs": 7}]
)
def test_json_stamps(tmp_path: Path, stamp: dict[str, int]) -> None:
    sent = as_json(scan(1), header={"stamp": stamp, "frame_id": "laser"})
    records, _ = read(mcap_file(tmp_path, sent, encoding="json"))
    assert records[0].stamp_ns == 5 * S + 7


@pytest.mark.parametrize(
    "change",
    [
        {"ranges": "none"},
        {"ranges": [[1, 2]]},
        {"ranges": ["far"]},
        {"angle_min": "left"},
        {"header": None},
        {"header": {"frame_id": "laser"}},
        {"header": {"stamp": {"sec": "soon"}}},
        {"header": {"stamp": {}, "frame_id": 5}},
        {"header": {"stamp": {"sec": 10**310}, "frame_id": ""}},
    ],
    ids=lambda change: str(change)[:60],
)
def test_json_of_another_shape_is_counted(tmp_path: Path, change: dict[str, Any]) -> None:
    path = mcap_file(tmp_path, as_json(scan(1)), as_json(scan(2), **change), encoding="json")
    records, log = read(path)
    assert len(records) == 1
    assert log.damage.counts == {"messages on /scan without readable content": 1}


def test_json_that_is_none(tmp_path: Path) -> None:
    broken = [Sent("/scan", ros.LASER_SCAN, None, 2 * S, data) for data in (b"", b"[", b"[]", b"7")]
    broken.append(Sent("/scan", ros.LASER_SCAN, None, 2 * S, b"[" * 100_000))
    path = mcap_file(tmp_path, as_json(scan(1)), *broken, encoding="json")
    assert read(path)[1].damage.counts == {"messages on /scan without readable content": 5}


def test_a_description_is_no_message_however_its_bytes_read(tmp_path: Path) -> None:
    # With a clock that began lately, times are so small that a channel's name reads as one.
    records = [Odometry(138_570_784_768, Pose2D())]
    path = tmp_path / "early.mcap"
    path.write_bytes(written([*records, RangeScan(138_570_784_768, 0.0, 1.0, np.ones(3, "f4"))]))
    log = open_log([path])
    assert len(list(log.records())) == 2
    assert not log.damage.counts
