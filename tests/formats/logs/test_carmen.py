"""CARMEN logs: every message's literal reading, and every way of being malformed."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.errors import DataError, FormatError, MapcliError
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.model.log import LogOptions
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount, Odometry, RangeScan, Record

ODOM = "ODOM 1.5 -2 0.25 0.1 0 0 10.000001 robot 10.5"
FLASER = "FLASER 4 1 2.5 81.83 0.5 1.5 -2 0.25 1.5 -2 0.25 10.25 robot 10.75"
ROBOTLASER = (
    "ROBOTLASER1 0 -1.5 3 0.5 5 0.01 0 7 1 2 3 4 5 6 0.5 2 9 9 "
    "1 2 3 1 2 3 0 0 0.1 0.1 1e10 20.5 robot 20.5"
)


def flaser(*ranges: float, t: float = 1, laser: str = "0 0 0", robot: str = "0 0 0") -> str:
    return f"FLASER {len(ranges)} {' '.join(map(str, ranges))} {laser} {robot} {t} host {t}"


def write(folder: Path, *lines: str, name: str = "a.log") -> str:
    path = folder / name
    path.write_text("\n".join([*lines, ""]))
    return str(path)


def read(path: str, **options: object) -> tuple[list[Record], Log]:
    log = open_log([path], LogOptions(**options))  # type: ignore[arg-type]
    return list(log.records()), log


def scans_of(records: list[Record]) -> list[RangeScan]:
    return [record for record in records if isinstance(record, RangeScan)]


def test_odom_and_flaser_literally(tmp_path: Path) -> None:
    (first, own, scan), log = read(write(tmp_path, ODOM, FLASER))
    assert first == Odometry(10_000_001_000, Pose2D(1.5, -2.0, 0.25))
    assert own == Odometry(10_250_000_000, Pose2D(1.5, -2.0, 0.25))
    assert isinstance(scan, RangeScan)
    assert scan.stamp_ns == 10_250_000_000
    assert scan.ranges.dtype == np.float32
    assert scan.ranges.tolist() == [1.0, 2.5, math.inf, 0.5]  # 81.83 is SICK for no return
    assert (scan.range_min, scan.range_max, scan.mount) == (0.0, 80.0, Mount())
    assert (log.scan_topics, log.odom_topic, log.scan_count) == (["FLASER"], "ODOM", 1)
    assert log.damage.counts == {}


@pytest.mark.parametrize(
    ("n", "step_deg"), [(180, 1.0), (181, 1.0), (360, 0.5), (361, 0.5), (4, 45.0), (1, 180.0)]
)
def test_flaser_angles_depend_on_the_parity_of_the_beams(
    tmp_path: Path, n: int, step_deg: float
) -> None:
    records, _ = read(write(tmp_path, flaser(*[1.0] * n)))
    scan = scans_of(records)[0]
    assert scan.angle_min == float(np.float32(-math.pi / 2))
    assert scan.angle_increment == float(np.float32(math.radians(step_deg)))


def test_robotlaser_literally(tmp_path: Path) -> None:
    (own, scan), log = read(write(tmp_path, ROBOTLASER))
    assert own == Odometry(20_500_000_000, Pose2D(1.0, 2.0, 3.0))
    assert isinstance(scan, RangeScan)
    assert (scan.angle_min, scan.angle_increment) == (-1.5, 0.5)
    assert scan.range_max == 5.0
    assert scan.ranges.tolist() == [1, 2, 3, 4, math.inf, math.inf, 0.5]  # 5 is its maximum
    assert log.scan_topics == ["ROBOTLASER1"]
    assert log.odom_topic == "ROBOTLASER1"  # there is no ODOM line


@pytest.mark.parametrize(
    ("angles", "expected"),
    [
        ("-1.5 3 0", (-1.5, 0.5)),  # no resolution: field of view over the beams
        ("-1.5 3 0.1", (-1.5, 0.5)),  # contradicts the beams
        ("0 0 0", (-math.pi / 2, math.pi / 6)),  # tells nothing: as FLASER
        ("-1.5 3.5 0.5", (-1.5, 0.5)),  # field of view counted one beam too wide
    ],
)
def test_robotlaser_angles_that_make_no_sense(
    tmp_path: Path, angles: str, expected: tuple[float, float]
) -> None:
    records, _ = read(write(tmp_path, ROBOTLASER.replace("-1.5 3 0.5", angles)))
    scan = scans_of(records)[0]
    assert (scan.angle_min, scan.angle_increment) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("maximum", ["0", "81.92", "nan"])
def test_robotlaser_with_sicks_maximum_or_none(tmp_path: Path, maximum: str) -> None:
    line = ROBOTLASER.replace("0.5 5 0.01", f"0.5 {maximum} 0.01").replace("6 0.5", "81.91 0.5")
    records, _ = read(write(tmp_path, line))
    assert scans_of(records)[0].ranges.tolist() == [1, 2, 3, 4, 5, math.inf, 0.5]


def test_ranges_follow_rep117(tmp_path: Path) -> None:
    records, log = read(write(tmp_path, flaser(1, 0, -1, "nan", "inf", 1e300)))  # type: ignore[arg-type]
    ranges = scans_of(records)[0].ranges
    assert np.array_equal(
        ranges, [1, math.nan, math.nan, math.nan, math.inf, math.inf], equal_nan=True
    )
    assert (log.beams.total, log.beams.invalid, log.beams.no_return) == (6, 3, 2)


def test_the_mount_is_the_constant_difference_of_the_poses(tmp_path: Path) -> None:
    # Laser 0.2 m ahead of a robot at (1, 0) that looks up, then left.
    lines = [
        flaser(1, 2, t=1, laser="1 0.2 1.570796", robot="1 0 1.570796"),
        flaser(1, 2, t=2, laser="0.8 0 3.141593", robot="1 0 3.141593"),
    ]
    records, log = read(write(tmp_path, *lines))
    assert [scan.mount for scan in scans_of(records)] == [Mount(Pose2D(0.2, 0.0, 0.0))] * 2
    assert "x 0.200 m" in log.notes[0]


def test_a_backward_laser_keeps_one_mount_across_the_half_turn(tmp_path: Path) -> None:
    lines = [
        flaser(1, 2, t=1, laser="0 0 3.14155", robot="0 0 0"),
        flaser(1, 2, t=2, laser="0 0 -3.14155", robot="0 0 0"),
    ]
    records, log = read(write(tmp_path, *lines))
    assert scans_of(records)[0].mount == scans_of(records)[1].mount
    assert abs(scans_of(records)[0].mount.pose.theta) > 3.14
    assert "yaw" in log.notes[0]


def test_a_corrected_log_has_no_mount(tmp_path: Path) -> None:
    lines = [flaser(1, 2, t=i, laser=f"{i} 0 0", robot="0 0 0") for i in range(1, 4)]
    records, log = read(write(tmp_path, *lines))
    assert scans_of(records)[0].mount == Mount()
    assert "assumed at the robot's centre" in log.notes[0]


def test_laser_pose_overrides_the_mount(tmp_path: Path) -> None:
    mount = Mount(Pose2D(0.1, 0.0, math.pi / 2), flipped=True)
    records, _ = read(write(tmp_path, FLASER), laser_pose=mount)
    assert scans_of(records)[0].mount == Mount(Pose2D(0.1, 0.0, 1.570796327), flipped=True)


def test_headings_are_settled(tmp_path: Path) -> None:
    line = "ODOM 0 0 9.42477796077 0 0 0 1 robot 1"
    records, _ = read(write(tmp_path, line, flaser(1, 2, t=2)))
    assert isinstance(records[0], Odometry)
    assert abs(records[0].pose.theta) == pytest.approx(math.pi, abs=1e-8)
    assert -math.pi < records[0].pose.theta < math.pi


@pytest.mark.parametrize(
    ("message_time", "log_time", "source", "expected"),
    [
        ("1.5", "2.5", "header", 1_500_000_000),
        ("0.000000", "2.5", "header", 2_500_000_000),  # not set: when it was logged
        ("1.5", "2.5", "log", 2_500_000_000),
        ("976052857.311607", "0", "header", 976_052_857_311_607_000),  # exact to the digit
        ("1e3", "0", "header", 1_000_000_000_000),
        ("1.123456789", "0", "header", 1_123_456_789),
    ],
)
def test_stamps(
    tmp_path: Path, message_time: str, log_time: str, source: str, expected: int
) -> None:
    line = f"FLASER 1 1 0 0 0 0 0 0 {message_time} host {log_time}"
    records, _ = read(write(tmp_path, line), time_source=source)
    assert [record.stamp_ns for record in records] == [expected, expected]


@pytest.mark.parametrize(
    "line",
    [
        "FLASER 4 1 2 3 0 0 0 0 0 0 1 host 1",  # one beam less than said
        "FLASER 2 1 2 3 0 0 0 0 0 0 1 host 1",  # one more
        "FLASER -1 0 0 0 0 0 0 1 host 1",
        "FLASER x 1 2 0 0 0 0 0 0 1 host 1",
        "FLASER 2 1 two 0 0 0 0 0 0 1 host 1",
        "FLASER 2 1 2 0 0 0 0 0 nan 1 host 1",
        "FLASER 2 1 2 0 0 0 inf 0 0 1 host 1",
        "FLASER 2 1 2 0 0 0 0 0 0 -1 host 1",
        "FLASER 2 1 2 0 0 0 0 0 0 nan host 1",
        "FLASER 2 1 2 0 0 0 0 0 0 1e99999 host 1",
        "FLASER 2 1 2 0 0 0 0 0 0 9999999999 host 1",
        "FLASER",
        "FLASER ",
        "ODOM 1 2 3",
        "ODOM a b c 0 0 0 1 host 1",
        ODOM[:-2] + " x y z",
    ],
)
def test_a_malformed_line_is_counted_and_refused_if_strict(tmp_path: Path, line: str) -> None:
    name = line.split()[0]
    path = write(tmp_path, ODOM, FLASER, line, flaser(1, 2, t=11))
    records, log = read(path)
    assert len(records) == 5  # everything else
    assert log.damage.lines() == [f"1 line without a valid {name} message (line 3)"]
    with pytest.raises(FormatError, match="line 3: 1 line without a valid"):
        read(path, strict=True)


def test_robotlaser_malformed(tmp_path: Path) -> None:
    words = ROBOTLASER.split()
    for i in (8, 16):  # counts of readings and of remissions
        broken = " ".join([*words[:i], "999999999", *words[i + 1 :]])
        _, log = read(write(tmp_path, ROBOTLASER, broken))
        assert log.damage.counts == {"lines without a valid ROBOTLASER1 message": 1}


def test_a_scan_without_beams_is_skipped_and_counted(tmp_path: Path) -> None:
    records, log = read(write(tmp_path, flaser(t=1), flaser(1, t=2)))
    assert len(scans_of(records)) == 1
    assert log.damage.lines() == ["1 scan without beams, skipped (line 1)"]


def test_other_lines_do_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    lines = ["# CARMEN Logfile", "", "PARAM robot_width 0.4 x 0", "  ", "RLASER 1 2", "OLDLASER 3"]
    path.write_bytes("\r\n".join([*lines, "NMEAGGA \xff", FLASER, ""]).encode("latin-1"))
    records, log = read(str(path))
    assert len(records) == 2
    assert log.damage.counts == {}
    assert {topic.name: topic.count for topic in log.topics()} == {
        "FLASER": 1, "NMEAGGA": 1, "OLDLASER": 1, "PARAM": 1, "RLASER": 1,
    }  # fmt: skip


def test_nonsense_between_the_lines_is_counted(tmp_path: Path) -> None:
    _, log = read(write(tmp_path, FLASER, "flaSER 1 2", "\x00\x01"))
    assert log.damage.counts == {"lines of nonsense, skipped": 2}


def test_a_line_of_megabytes_is_not_collected(tmp_path: Path) -> None:
    _, log = read(write(tmp_path, FLASER, "FLASER 1" + " 1" * 2_000_000, flaser(1, t=12)))
    assert "lines of more than 1 MB" in log.damage.counts


def test_scans_tell_odometry_alone(tmp_path: Path) -> None:
    path = write(tmp_path, ODOM, FLASER)
    records, log = read(path, odom_topic="FLASER")
    assert [type(record) for record in records] == [Odometry, RangeScan]
    assert log.odom_topic == "FLASER"
    records, _ = read(path, odom_topic="ODOM")
    assert [record.stamp_ns for record in records] == [10_000_001_000, 10_250_000_000]


def test_two_lasers_need_a_choice(tmp_path: Path) -> None:
    path = write(tmp_path, FLASER, ROBOTLASER)
    with pytest.raises(DataError, match=r"several scan topics: FLASER .* ROBOTLASER1 .*scan-topic"):
        read(path)
    records, _ = read(path, scan_topics=("FLASER",))
    assert len(scans_of(records)) == 1
    with pytest.raises(DataError, match="no scan topic FOO among FLASER"):
        read(path, scan_topics=("FOO",))
    with pytest.raises(DataError, match="no odometry topic FOO"):
        read(path, scan_topics=("FLASER",), odom_topic="FOO")


def test_no_scans(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"no range scans among ODOM \(CARMEN, 1 message\)"):
        read(write(tmp_path, ODOM))


def test_no_valid_message_at_all(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="holds no valid message"):
        read(write(tmp_path, "FLASER 3 1"))


def test_stamps_that_jump_back_within_the_window_are_put_in_order(tmp_path: Path) -> None:
    records, log = read(write(tmp_path, *[flaser(1, t=t) for t in (3, 1, 2)]))
    assert [r.stamp_ns for r in records] == [s * 10**9 for s in (1, 1, 2, 2, 3, 3)]
    assert log.disordered == 4
    assert log.damage.counts == {}


def test_gzip_plain_and_chained_are_the_same(tmp_path: Path) -> None:
    plain = f"{ODOM}\n{FLASER}\n".encode()
    (tmp_path / "a.log.gz").write_bytes(gzip.compress(plain))
    (tmp_path / "b").write_bytes(
        gzip.compress(plain[:40]) + gzip.compress(plain[40:]) + b"\0" * 600
    )
    for name in ("a.log.gz", "b"):
        records, log = read(str(tmp_path / name))
        assert len(records) == 3
        assert log.damage.counts == {}


def test_gzip_cut_short_and_broken(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    lines = [flaser(*rng.uniform(1, 9, 50).round(3), t=t) for t in range(1, 200)]
    packed = gzip.compress("\n".join(lines).encode(), mtime=0)
    path = tmp_path / "a.log.gz"
    path.write_bytes(packed[: len(packed) // 2])
    records, log = read(str(path))
    assert 80 < len(scans_of(records)) < 120
    assert "gzip streams without an end" in log.damage.counts
    path.write_bytes(packed[: len(packed) // 2] + rng.bytes(len(packed) // 2))
    records, log = read(str(path))
    assert 80 < len(scans_of(records)) < 120
    assert log.damage.counts
    path.write_bytes(packed[:-8] + b"12345678")  # a wrong checksum shows at the end
    records, log = read(str(path))
    assert len(scans_of(records)) == 199
    assert "gzip streams broken off, the rest is lost" in log.damage.counts
    with pytest.raises(FormatError, match="gzip stream"):
        read(str(path), strict=True)


def test_parts_are_one_recording_in_stamp_order(tmp_path: Path) -> None:
    second = write(tmp_path, flaser(1, t=3), name="b.log")
    first = write(tmp_path, flaser(1, t=1), flaser(1, t=5), name="a.log")
    log = open_log([second, first])
    assert [scan.stamp_ns // 10**9 for scan in scans_of(list(log.records()))] == [1, 3, 5]
    assert log.scan_count == 3
    assert list(log.digests()) == ["b.log", "a.log"]


def test_reading_twice_gives_the_same(tmp_path: Path) -> None:
    log = open_log([write(tmp_path, FLASER, "FLASER 1", flaser(t=11))])
    first, lines = list(log.records()), log.damage.lines()
    assert [r.stamp_ns for r in log.records()] == [r.stamp_ns for r in first]
    assert log.damage.lines() == lines
    assert log.beams.total == 4


TEXT = "\n".join([ODOM, FLASER, ROBOTLASER.replace("ROBOTLASER1", "RLASER"), FLASER]).encode()


@settings(max_examples=150, deadline=None)
@given(
    cut=st.integers(0, len(TEXT)),
    flips=st.lists(st.tuples(st.integers(0, len(TEXT) - 1), st.integers(0, 7)), max_size=4),
    strict=st.booleans(),
    packed=st.booleans(),
)
def test_damaged_anywhere_nothing_but_our_errors(
    tmp_path_factory: pytest.TempPathFactory,
    cut: int,
    flips: list[tuple[int, int]],
    strict: bool,
    packed: bool,
) -> None:
    data = bytearray(gzip.compress(TEXT, mtime=0) if packed else TEXT)
    for at, bit in flips:
        data[at % len(data)] ^= 1 << bit
    path = tmp_path_factory.mktemp("fuzz") / "a.log"
    path.write_bytes(data[:cut])
    try:
        records, _ = read(str(path), strict=strict)
    except MapcliError:
        return
    stamps = [record.stamp_ns for record in records]
    assert stamps == sorted(stamps)
