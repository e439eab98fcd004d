"""Stamp order, selection, damage counts, REP 117: what all log readers share."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapcli.errors import DataError, FormatError
from mapcli.formats.logs import log as _log
from mapcli.formats.logs.log import Log, Source, StrictDamage
from mapcli.formats.logs.one_recording import Spans
from mapcli.formats.logs.open_log import open_log
from mapcli.formats.logs.rep117 import rep117, sensible_limits
from mapcli.model.clock import Delay
from mapcli.model.log import BeamCounts, Damage, LogOptions, MissedScans, Topic
from mapcli.model.pose import Pose2D, rounded_angle, wrap_angle
from mapcli.model.scan import Odometry, RangeScan, Record
from mapcli.model.selection import select

S = 10**9


def scan(t: float) -> RangeScan:
    return RangeScan(round(t * S), 0.0, 0.1, np.ones(3, dtype=np.float32))


def odom(t: float) -> Odometry:
    return Odometry(round(t * S), Pose2D(t))


class ListLog(Log):
    """A log out of a list."""

    def __init__(self, records: Sequence[Record], options: LogOptions = LogOptions()) -> None:  # noqa: B008
        super().__init__([Source("list.log", Path("list.log"))], options)
        self._list = records

    def topics(self) -> list[Topic]:
        return [Topic("/scan", "scan", "LaserScan", "cdr", len(self._list))]

    def _part_spans(self) -> list[Spans]:
        return [{}]

    def _records(self) -> Iterator[Record]:
        yield from self._list


# Stamp order


def test_equal_stamps_keep_their_order() -> None:
    records: list[Record] = [odom(1), scan(1), odom(1), scan(1), odom(0)]
    ordered = list(ListLog(records).records())
    assert ordered == [records[4], *records[:4]]


def test_a_record_beyond_the_window_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_log, "REORDER_RECORDS", 3)
    log = ListLog([scan(t) for t in (1, 2, 3, 4, 5, 6, 1.5, 7, 5.5)])
    assert [record.stamp_ns / S for record in log.records()] == [1, 2, 3, 4, 5, 5.5, 6, 7]
    assert log.damage.lines() == ["1 scan with a stamp that jumps back, dropped (at 1.500 s)"]
    told = "a clock was set back; --time-source log uses times of recording"
    assert told in log.notes
    strict = ListLog([scan(t) for t in (1, 2, 3, 4, 5, 6, 1.5)], LogOptions(strict=True))
    with pytest.raises(FormatError, match=r"list.log: at 1.500 s: 1 scan with a stamp"):
        list(strict.records())


def test_a_stray_stamp_in_the_future_harms_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_log, "REORDER_RECORDS", 3)
    log = ListLog([scan(t) for t in (1, 2, 999, 3, 4, 5, 6)])
    assert [record.stamp_ns / S for record in log.records()] == [1, 2, 3, 4, 5, 6, 999]
    assert log.damage.counts == {}


@given(st.lists(st.integers(0, 50), min_size=1, max_size=60))
def test_order_within_the_window_is_sorting(stamps: list[int]) -> None:
    records: list[Record] = [scan(stamp) for stamp in stamps]
    log = ListLog(records)
    assert list(log.records()) == sorted(records, key=lambda record: record.stamp_ns)


def test_nothing_to_read() -> None:
    with pytest.raises(FormatError, match=r"list.log: not one scan can be read"):
        list(ListLog([odom(1)]).records())


# Selection


ALL: list[Record] = [r for t in range(10) for r in (odom(t), scan(t + 0.5))]


def shown(records: Iterator[Record]) -> str:
    return " ".join(
        f"{'s' if isinstance(r, RangeScan) else 'o'}{r.stamp_ns / S:g}" for r in records
    )


@pytest.mark.parametrize(
    ("start", "end", "every", "expected"),
    [
        (None, 1.6, 1, "o0 s0.5 o1 s1.5 o2"),
        (7.2, None, 1, "o7 s7.5 o8 s8.5 o9 s9.5"),
        (7, 8, 1, "o6 o7 s7.5 o8 o9"),
        (2.5, 2.5, 1, "o2 s2.5 o3"),
        (None, None, 4, "o0 s0.5 o1 o2 o3 o4 s4.5 o5 o6 o7 o8 s8.5 o9"),
        (100, None, 1, ""),
    ],
)
def test_select(start: float | None, end: float | None, every: int, expected: str) -> None:
    assert shown(select(ALL, start, end, every)) == expected


def test_select_all_is_all() -> None:
    assert list(select(ALL)) == ALL


def test_seconds_count_from_the_first_record() -> None:
    later: list[Record] = [Odometry(r.stamp_ns + 10**18, Pose2D()) for r in ALL[:6]]
    assert [r.stamp_ns - 10**18 for r in select(later, 0.4, 0.6)] == [0, S // 2, S]


def test_select_stops_without_odometry() -> None:
    def endless() -> Iterator[Record]:
        t = 0
        while True:
            yield scan(t)
            t += 1

    assert shown(select(endless(), None, 2)) == "s0 s1 s2"


# Damage


def test_damage_speaks_in_the_right_number() -> None:
    damage = Damage()
    damage.add("scans without beams", where="line 3")
    damage.add("scans without beams", where="line 5")
    damage.add("chunks with a wrong checksum", where="byte 9")
    damage.add("messages lost", 1234)
    damage.add("bytes lost", 0)
    assert damage.lines() == [
        "2 scans without beams (first: line 3)",
        "1 chunk with a wrong checksum (byte 9)",
        "1,234 messages lost",
    ]
    damage.clear()
    assert damage.lines() == []


def test_damage_accounts_for_missed_scans() -> None:
    damage = Damage(scans_read=3)
    assert damage.lost_share == 0
    damage.miss(MissedScans("scans without beams", lost=False, count=2))
    damage.miss(MissedScans("scans lost", lost=True))
    damage.miss(MissedScans("scans lost", lost=True, count=4))
    assert damage.missed == {"scans without beams": 2, "scans lost": 5}
    assert damage.lost_share == 0.5
    damage.clear()
    assert (damage.missed, damage.lost_share) == ({}, 0)


def test_strict_damage_refuses_the_first() -> None:
    with pytest.raises(FormatError) as caught:
        StrictDamage().add("scans without beams", file="a.log", where="line 3")
    assert str(caught.value) == (
        "a.log: line 3: 1 scan without beams; expected an undamaged log (--strict)"
    )
    StrictDamage().add("scans without beams", 0)


def test_delay() -> None:
    delay = Delay()
    for value in (3 * S, -S, 4 * S):
        delay.add(value)
    assert (delay.least_ns, delay.most_ns, delay.mean_s) == (-S, 4 * S, 2.0)


# Ranges and angles


def rep117_by_hand(value: float, low: float, high: float) -> float:
    if math.isnan(value) or (value <= 0 and value != -math.inf):
        return math.nan
    if value >= high:
        return math.inf
    return -math.inf if value < low else value


READINGS = st.floats(-1, 12, width=32) | st.sampled_from([0, math.inf, -math.inf, math.nan])


@given(st.lists(READINGS, max_size=30), st.sampled_from([0, 0.5]), st.sampled_from([10, math.inf]))
def test_rep117(values: list[float], low: float, high: float) -> None:
    ranges = np.array(values, dtype=np.float32)
    before, beams = ranges.copy(), BeamCounts()
    found = rep117(ranges, low, high, beams)
    expected = np.array([rep117_by_hand(v, low, high) for v in values], dtype=np.float32)
    assert np.array_equal(found, expected, equal_nan=True)
    assert np.array_equal(ranges, before, equal_nan=True)
    assert beams == BeamCounts(
        len(values), *(int(kind(expected).sum()) for kind in (np.isposinf, np.isneginf, np.isnan))
    )
    again = BeamCounts()
    assert np.array_equal(rep117(found, low, high, again), found, equal_nan=True)
    assert again == beams


def test_sensible_limits() -> None:
    assert sensible_limits(0.1, 30) == (0.1, 30)
    assert sensible_limits(0.1, math.inf) == (0.1, math.inf)
    assert sensible_limits(math.nan, 0) == (0.0, math.inf)
    assert sensible_limits(-1, -2) == (0.0, math.inf)


@given(st.floats(-1e4, 1e4))
def test_settled_angles_survive_a_quaternion(angle: float) -> None:
    settled = rounded_angle(angle)
    assert abs(wrap_angle(settled - angle)) < 1.1e-9
    assert -math.pi < settled < math.pi
    z, w = math.sin(settled / 2), math.cos(settled / 2)
    assert rounded_angle(math.atan2(2 * z * w, 1 - 2 * z * z)) == settled
    assert rounded_angle(settled) == settled


# Opening


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty; expected an MCAP file, a ROS bag, a CARMEN log or a robot's CSV"),
        (b"hello\n", "is no log that mapcli knows"),
        (b"P5\n1 1\n255\n0", "is a PGM map; .*mapcli render.*; expected an MCAP file"),
        (b"#ROSBAG V2.0\n", "no range scans"),
        (b"#ROSBAG V1.2\n", "is 'ROSBAG V1.2'; expected a bag of version 2.0, as `rosbag migrate`"),
        (b"SQLite format 3\0", "is an SQLite file without the tables of a bag"),
        (b"BZh91AY", "is empty"),
        (b"PK\x03\x04", "is a zip archive"),
        (b"\x28\xb5\x2f\xfd", "is empty"),
        (b"\xfd7zXZ\0", "is empty"),
        (b"\x1f\x8b", "is empty"),
        (b"\x1f\x8bnonsense", "is empty"),
    ],
)
def test_files_that_are_no_log(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "a.log"
    path.write_bytes(content)
    with pytest.raises((FormatError, DataError), match=f"a.log: {message}"):
        list(open_log([str(path)]).records())


def test_missing_and_folders(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"none.mcap: no such file"):
        open_log([str(tmp_path / "none.mcap")])
    with pytest.raises(FormatError, match="is a folder without a bag's files; expected an MCAP"):
        open_log([str(tmp_path)])


def test_one_file_need_not_be_a_list(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("FLASER 2 1.0 2.0 0 0 0 0 0 0 1.0 host 1.0\n")
    for paths in (path, str(path), [path]):
        assert open_log(paths).topics()[0].name == "FLASER"
