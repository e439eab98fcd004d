"""One scan out of a log."""

from __future__ import annotations

import numpy as np
import pytest

from mapcli.algorithms.scans.scan_extraction import extract_scan, scan_perception
from mapcli.errors import DataError
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Odometry, RangeScan, Record

MS = 10**6


def log() -> list[Record]:
    """Odometry from 5 s on, scans every second from 6 s on, a metre from each other."""
    records: list[Record] = [Odometry(5000 * MS, Pose2D(1.0))]
    for k in range(6):
        stamp = (6000 + 1000 * k) * MS
        ranges = np.array([1.0, np.nan], np.float32)
        records += [Odometry(stamp, Pose2D(2.0 + k)), RangeScan(stamp, 0.0, 0.1, ranges)]
    return records


@pytest.mark.parametrize(
    ("seconds", "number"), [(0.0, 0), (1.4, 0), (1.5, 0), (1.6, 1), (6.0, 5), (7.0, 5)]
)
def test_the_scan_nearest_to_a_time_after_the_first_record(seconds: float, number: int) -> None:
    found = extract_scan(log(), seconds)
    assert (found.number, found.seconds) == (number, number + 1.0)  # of two, the earlier one
    assert found.odom == Pose2D(2.0 + number)
    assert found.pose() == Pose2D(number)  # maps start at the first scan


def test_only_the_part_asked_for_is_considered() -> None:
    found = extract_scan(log(), 3.0, start_s=2.0, every=2)
    assert (found.number, found.seconds) == (0, 2.0)
    assert found.pose() == Pose2D()
    found = extract_scan(log(), 2.9, end_s=2.0)
    assert found.seconds == 2.0


def test_times_without_a_scan() -> None:
    with pytest.raises(DataError, match=r"no scan at 7\.1 s") as error:
        extract_scan(log(), 7.1)
    assert error.value.expected == "a time up to 6.0 s, where the last scan is"
    for records in ([], log()[:1]):
        with pytest.raises(DataError, match="no scan in the part asked for"):
            extract_scan(records, 0.0)


def test_beams_without_a_valid_reading_are_left_out() -> None:
    found = extract_scan(log(), 1.0)
    assert scan_perception(found.scan, found.pose()).beams.tolist() == [[0.0, 1.0]]
