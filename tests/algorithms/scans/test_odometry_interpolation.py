"""Odometry at the time of each scan: in between, exactly, before, after, and in silence."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.algorithms.scans.odometry_interpolation import (
    EXTRAPOLATION_NS,
    PATIENCE_NS,
    odometry_at_scans,
)
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Odometry, RangeScan, Record, TruePose

FEW = settings(max_examples=50)
MS = 10**6


def scan(ms: int) -> RangeScan:
    return RangeScan(ms * MS, 0.0, 0.1, np.ones(1, np.float32))


def odom(ms: int, x: float, y: float = 0.0, theta: float = 0.0) -> Odometry:
    return Odometry(ms * MS, Pose2D(x, y, theta))


def xs(records: list[Record]) -> dict[int, float | None]:
    """x of the odometry at each scan, by the scan's milliseconds."""
    found = {s.stamp_ns // MS: p for s, p in odometry_at_scans(records)}
    return {ms: None if pose is None else round(pose.x, 9) for ms, pose in found.items()}


def test_half_way() -> None:
    records = [odom(1000, 1, 2, 0.5), scan(1100), odom(1200, 3, -2, 0.7)]
    [(_, pose)] = odometry_at_scans(records)
    assert pose is not None
    assert (pose.x, pose.y, pose.theta) == pytest.approx((2, 0, 0.6))


def test_in_proportion_to_time() -> None:
    records = [odom(0, 0), scan(10), scan(25), odom(100, 1), scan(101), odom(200, 3)]
    assert xs(records) == {10: 0.1, 25: 0.25, 101: 1.02}


@pytest.mark.parametrize(("before", "after", "middle"), [(175, -175, 180), (-170, 160, 175)])
def test_turning_across_the_seam(before: float, after: float, middle: float) -> None:
    turned = [math.radians(before), math.radians(after)]
    records = [odom(0, 0, 0, turned[0]), scan(50), odom(100, 0, 0, turned[1])]
    [(_, pose)] = odometry_at_scans(records)
    assert pose is not None
    assert math.cos(pose.theta - math.radians(middle)) == pytest.approx(1, abs=1e-12)


def test_exact_at_equal_stamps() -> None:
    # Whichever comes first, and without arithmetic: bit for bit the record's own pose.
    record = odom(100, 0.1, 0.2, 0.3)
    for pair in ([scan(100), record], [record, scan(100)]):
        for before in ([odom(0, 7)], []):
            [(_, pose)] = odometry_at_scans([*before, *pair, odom(200, 9)])
            assert pose == record.pose


def test_exact_odometry_is_not_waited_for() -> None:
    def records() -> Iterator[Record]:
        yield odom(0, 0)
        yield odom(100, 1)
        yield scan(100)
        raise AssertionError("another record was asked for")

    _, pose = next(odometry_at_scans(records()))
    assert pose == Pose2D(1)


def test_before_the_first_odometry() -> None:
    records = [scan(0), scan(50), odom(100, 1), scan(150), odom(200, 2)]
    assert xs(records) == {0: None, 50: None, 150: 1.5}


def test_after_the_last_odometry_it_goes_on_for_a_while() -> None:
    limit = 100 + EXTRAPOLATION_NS // MS
    records = [odom(0, 0), odom(100, 1), scan(150), scan(limit), scan(limit + 1)]
    assert xs(records) == {150: 1.5, limit: limit / 100, limit + 1: None}


def test_a_single_odometry_record_stands_still() -> None:
    limit = EXTRAPOLATION_NS // MS
    records = [odom(0, 3), scan(100), scan(limit), scan(limit + 1)]
    assert xs(records) == {100: 3, limit: 3, limit + 1: None}


def test_two_odometry_records_of_one_stamp() -> None:
    # The later one counts, and nothing is divided by their distance in time.
    assert xs([odom(0, 1), odom(0, 2), scan(100)]) == {100: 2}
    assert xs([odom(0, 1), odom(0, 2), scan(100), odom(200, 4)]) == {100: 3}


def test_a_long_silence() -> None:
    patience, limit = PATIENCE_NS // MS, EXTRAPOLATION_NS // MS
    back = 10 * patience
    scans = [scan(ms) for ms in range(0, back, 100)]
    found = xs([odom(0, 0), *scans, odom(back, 1), scan(back)])
    assert list(found) == [*range(0, back, 100), back]
    assert found[0] == 0
    assert found[limit] == 0
    silent = [pose for ms, pose in found.items() if limit < ms < back - patience - 100]
    assert len(silent) == (back - patience - limit) // 100 - 2
    assert set(silent) == {None}
    # What is still waiting when it speaks again lies between two records.
    assert found[back - 100] == pytest.approx(1 - 100 / back)
    assert found[back] == 1


def test_without_odometry_scans_come_through_and_few_wait() -> None:
    taken = 0

    def records() -> Iterator[Record]:
        nonlocal taken
        for taken in range(1, 1001):
            yield scan(100 * taken)

    passed = 0
    for found, pose in odometry_at_scans(records()):
        passed += 1
        assert pose is None
        assert found.stamp_ns == passed * 100 * MS
        assert taken - passed <= PATIENCE_NS // (100 * MS) + 1
    assert passed == 1000


def test_other_records_only_tell_the_time() -> None:
    late = PATIENCE_NS // MS + 1
    truth = [TruePose(ms * MS, Pose2D(99)) for ms in (10, 150, late)]
    records = [odom(0, 0), truth[0], scan(50), odom(100, 2), truth[1], truth[2]]
    assert xs(records) == {50: 1}
    # A scan that nothing but true poses follow is let go all the same.
    assert xs([odom(0, 0), scan(50), truth[2]]) == {50: 0}


def test_no_scans_no_poses() -> None:
    assert list(odometry_at_scans([])) == []
    assert list(odometry_at_scans([odom(0, 0), odom(100, 1)])) == []


@FEW
@given(st.lists(st.tuples(st.booleans(), st.integers(1, 400)), max_size=40))
def test_every_scan_comes_out_once_in_order(gaps: list[tuple[bool, int]]) -> None:
    # Odometry moves at 1 m/s, so wherever it is known it is known exactly.
    records: list[Record] = []
    ms = 0
    for is_scan, gap in gaps:
        ms += gap
        records.append(scan(ms) if is_scan else odom(ms, ms / 1000))
    scans = [record for record in records if isinstance(record, RangeScan)]
    found = list(odometry_at_scans(records))
    assert [s for s, _ in found] == scans
    stamps = [record.stamp_ns for record in records if isinstance(record, Odometry)]
    for s, pose in found:
        earlier = [stamp for stamp in stamps if stamp <= s.stamp_ns]
        if not earlier:
            assert pose is None
        elif pose is not None and len(earlier) > 1:
            assert pose.x == pytest.approx(s.stamp_ns * 1e-9, abs=1e-9)
        else:
            after = s.stamp_ns - earlier[-1]
            assert pose is not None or after > EXTRAPOLATION_NS
