"""sensor_msgs/msg/Range in MCAP: both layouts, JSON, mounts, REP 117, switches, ground sensors."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path

import pytest
from support.mcap_making import Sent, mcap_bytes, odom, sonar, tf_static, transform

from mapcli import LogOptions, Pose2D, open_log, save_log
from mapcli.errors import DataError, FormatError
from mapcli.formats.logs.log import Log
from mapcli.formats.logs.ros import messages as ros
from mapcli.formats.logs.ros.decode import range_from_cdr
from mapcli.formats.logs.ros.decode_json import range_from_json
from mapcli.formats.logs.ros.decode_ros1 import range_from_ros1
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import Mount

ODOMETRY = [odom(0), odom(10)]
INF = math.inf


def ring(*messages: Sent, mounts: bool = True) -> bytes:
    """A log of three sonars: ahead, to the left, and one that looks at the floor."""
    places = [
        transform(0, "base_link", "front", (0.1, 0, 0)),
        transform(0, "base_link", "left", (0, 0.08, 0), (90, 0, 90)),  # rolled, which is the same
        transform(0, "base_link", "floor", (0.1, 0, 0), (0, 90, 0)),
    ]
    return mcap_bytes(*([tf_static(0, *places)] if mounts else []), *ODOMETRY, *messages)


def opened(folder: Path, data: bytes, **options: object) -> Log:
    path = folder / "ring.mcap"
    path.write_bytes(data)
    return open_log(path, LogOptions(**options))  # type: ignore[arg-type]


def readings(log: Log) -> list[RangeReading]:
    return [record for record in log.records() if isinstance(record, RangeReading)]


RING = ring(
    sonar(1, 0.5, topic="/us/front", frame="front"),
    sonar(2, 0.25, topic="/us/left", frame="left"),
    sonar(3, 0.05, topic="/us/floor", frame="floor"),
)


def test_each_topic_is_a_sensor_with_its_mount(tmp_path: Path) -> None:
    log = opened(tmp_path, RING)
    front, left = readings(log)
    assert front.ranges.tolist() == [0.5]
    assert (front.sensor, front.mount, front.stamp_ns) == ("/us/front", Mount(Pose2D(0.1)), 10**9)
    assert (front.range_min, front.range_max) == (pytest.approx(0.02), 2.0)
    assert front.field_of_view == 0.25
    assert left.mount == Mount(Pose2D(0, 0.08, round(math.pi / 2, 9)))
    assert {name: sensor.kind for name, sensor in log.sensors.items()} == {
        "/us/front": "distance", "/us/left": "distance", "/us/floor": "ground",
    }  # fmt: skip
    assert log.sensors["/us/floor"].readings == 1
    assert log.sensors["/us/floor"].most == pytest.approx(0.05)
    assert log.notes == [
        "2 range sensors, 2 readings: what they read over a short way is one scan (--gather)",
        "/us/floor: not used, as it looks at the floor or up",
    ]


def test_both_layouts_hold_the_same() -> None:
    old, new = sonar(1, 0.5), sonar(1, 0.5, variance=0.01)
    assert old.data
    assert new.data
    assert len(new.data) == len(old.data) + 4
    assert range_from_cdr(old.data) == range_from_cdr(new.data)
    assert range_from_cdr(old.data).reading == 0.5
    for bad in (b"", old.data[:-1], b"\0\2" + old.data[2:]):
        with pytest.raises(ValueError, match=r"."):
            range_from_cdr(bad)


def test_ros_1_has_no_padding() -> None:
    fields = struct.pack("<III", 7, 1, 5) + struct.pack("<I", 5) + b"front"
    data = fields + struct.pack("<B4f", 1, 0.25, 0.5, 2.0, 1.5)
    found = range_from_ros1(data)
    assert (found.stamp_ns, found.frame, found.reading) == (1_000_000_005, "front", 1.5)
    assert (found.field_of_view, found.range_min, found.range_max) == (0.25, 0.5, 2.0)
    with pytest.raises(ValueError, match=r"."):
        range_from_ros1(data[:-1])


def test_json_of_the_same_shape() -> None:
    message = {
        "header": {"stamp": {"sec": 1, "nanosec": 5}, "frame_id": "/front"}, "radiation_type": 1,
        "field_of_view": 0.25, "min_range": 0.02, "max_range": 2, "range": 0.5,
    }  # fmt: skip
    found = range_from_json(json.dumps(message).encode())
    assert (found.stamp_ns, found.frame, found.reading) == (1_000_000_005, "front", 0.5)
    assert (found.field_of_view, found.range_max) == (0.25, 2.0)
    for text, value in (("Infinity", INF), ('"inf"', INF), ("-Infinity", -INF)):
        data = json.dumps(message).replace('"range": 0.5', f'"range": {text}').encode()
        assert range_from_json(data).reading == value
    assert math.isnan(range_from_json(json.dumps({**message, "range": None}).encode()).reading)


@pytest.mark.parametrize(
    ("limits", "reading", "means"),
    [
        ((0.02, 2), 1.0, 1.0),
        ((0.02, 2), INF, INF),  # nothing seen
        ((0.02, 2), 2.0, INF),  # many drivers write the maximum for it
        ((0.02, 2), 7.0, INF),
        ((0.02, 2), -INF, -INF),  # too close
        ((0.02, 2), 0.01, -INF),
        ((0.02, 2), 0.0, math.nan),
        ((0.02, 2), -1.0, math.nan),
        ((0.02, 2), math.nan, math.nan),
        ((0.5, 0.5), -INF, 0.5),  # a switch: something within its distance
        ((0.5, 0.5), 0.5, 0.5),
        ((0.5, 0.5), 0.2, 0.5),
        ((0.5, 0.5), INF, INF),  # nothing until there
        ((0.5, 0.5), 0.6, INF),
        ((0.5, 0.5), math.nan, math.nan),
    ],
)
def test_rep_117(tmp_path: Path, limits: tuple[float, float], reading: float, means: float) -> None:
    data = ring(sonar(1, reading, frame="front", limits=limits))
    log = opened(tmp_path, data)
    [found] = readings(log)
    assert found.ranges.tolist() == pytest.approx([means], nan_ok=True)
    assert log.sensors["/sonar"].kind == ("switch" if limits == (0.5, 0.5) else "distance")
    assert (log.sensors["/sonar"].nothing == 1) == (means == INF)
    save_log(log.records(), tmp_path / "again.mcap")
    [again] = readings(open_log(tmp_path / "again.mcap"))
    assert again.ranges.tolist() == pytest.approx([means], nan_ok=True)
    assert (again.range_min, again.range_max) == (found.range_min, found.range_max)
    assert (again.mount, again.sensor) == (found.mount, "/sonar")


def test_a_sensor_without_a_mount(tmp_path: Path) -> None:
    data = ring(sonar(1, 0.5, frame="lost"))
    with pytest.raises(DataError) as refused:
        readings(opened(tmp_path, data))
    assert str(refused.value) == (
        f"{tmp_path}/ring.mcap: /sonar: nothing tells where the sensor 'lost' sits on 'base_link'; "
        "expected a transform to it, or --sensor /sonar=X,Y,YAW_DEG"
    )
    told = (("/sonar", Mount(Pose2D(0.2, 0, math.pi / 2))),)
    [found] = readings(opened(tmp_path, data, sensors=told))
    assert found.mount == Mount(Pose2D(0.2, 0, round(math.pi / 2, 9)))
    with pytest.raises(DataError, match="no sensor /other among /sonar"):
        readings(opened(tmp_path, data, sensors=(("/other", Mount()),)))


def test_sensors_that_share_a_topic(tmp_path: Path) -> None:
    log = opened(tmp_path, ring(sonar(1, 0.5, frame="front"), sonar(2, 0.4, frame="left")))
    assert [one.mount.pose.y for one in readings(log)] == [0, 0.08]
    assert list(log.sensors) == ["/sonar", "/sonar/left"]


def test_a_laser_is_chosen_before_range_sensors(tmp_path: Path) -> None:
    from support.mcap_making import scan

    log = opened(tmp_path, ring(sonar(1, 0.5, frame="front"), scan(1, [1, 2, 3], frame="front")))
    assert log.scan_topics == ["/scan"]
    named = opened(tmp_path, ring(sonar(1, 0.5, frame="front"), scan(1)), scan_topics=("/sonar",))
    assert named.scan_topics == ["/sonar"]


def test_units_and_damage(tmp_path: Path) -> None:
    broken = Sent("/sonar", ros.RANGE, None, 2 * 10**9, data=b"\0\1\0\0" + struct.pack("<i", 1))
    log = opened(tmp_path, ring(sonar(1, 50, frame="front", limits=(2, 200)), broken),
                 range_unit="cm")  # fmt: skip
    [found] = readings(log)
    assert found.ranges.tolist() == pytest.approx([0.5])
    assert found.range_max == 2.0
    assert log.damage.lines() == ["1 message on /sonar without readable content (at 2.000 s)"]
    with pytest.raises(FormatError, match="without readable content"):
        readings(opened(tmp_path, ring(sonar(1, 1, frame="front"), broken), strict=True))


def test_every_so_manieth_reading_of_each(tmp_path: Path) -> None:
    pairs = [
        sonar(t, 0.5, topic=f"/{frame}", frame=frame)
        for t in (1, 2, 3)
        for frame in ("front", "left")
    ]
    log = opened(tmp_path, ring(*pairs))
    kept = [r for r in log.records(every=2) if isinstance(r, RangeReading)]
    assert [(r.sensor, r.stamp_ns // 10**9) for r in kept] == [
        ("/front", 1), ("/left", 1), ("/front", 3), ("/left", 3),
    ]  # fmt: skip
