"""Line 4 of Algorithm 9.2: which readings of a scan are used, and where its beams end."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mapcli.algorithms.scans.perception import FARTHEST, PerceptionParameters, perceive
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount, RangeScan

INF, NAN = math.inf, math.nan
QUARTER = math.pi / 2


def scan_of(
    ranges: list[float],
    limits: tuple[float, float] = (0.5, 8.0),
    mount: Mount | None = None,
    increment: float = QUARTER,
) -> RangeScan:
    """Beams ahead, to the left, behind, to the right."""
    values = np.array(ranges, np.float32)
    return RangeScan(0, 0.0, increment, values, *limits, mount or Mount())


def hits(scan: RangeScan, **parameters) -> list[list[float]]:
    return np.round(perceive(scan, PerceptionParameters(**parameters)).hits, 6).tolist()


def open_ends(scan: RangeScan, **parameters) -> list[list[float]]:
    parameters = {"no_return": "clear"} | parameters
    return np.round(perceive(scan, PerceptionParameters(**parameters)).open_ends, 6).tolist()


def test_beams_end_where_they_hit() -> None:
    perception = perceive(scan_of([1, 2, 3, 4]), PerceptionParameters())
    assert perception.hits == pytest.approx(np.array([[1, 0], [0, 2], [-3, 0], [0, -4]]))
    assert perception.hits.dtype == np.float64
    assert perception.laser.tolist() == [0, 0]


def test_rep_117() -> None:
    scan = scan_of([NAN, INF, -INF, 2])
    assert hits(scan) == [[0, -2]]
    assert open_ends(scan) == [[0, 8]]  # only +inf tells that nothing is there


def test_no_return_is_ignored_or_clears() -> None:
    perception = perceive(scan_of([INF] * 4), PerceptionParameters(no_return="ignore"))
    assert perception.hits.shape == perception.open_ends.shape == (0, 2)
    assert len(open_ends(scan_of([INF] * 4))) == 4


def test_the_limits_of_the_sensor() -> None:
    scan = scan_of([0.5, 0.25, 8.0, 8.5])
    assert hits(scan) == [[0.5, 0], [-8, 0]]
    # Beyond the limit is no return; too close is not: something stands there.
    assert open_ends(scan) == [[0, -8]]


def test_limits_that_a_user_sets() -> None:
    scan = scan_of([1, 2, 3, INF])
    assert hits(scan, range_min=1.5, range_max=2.5) == [[0, 2]]
    assert open_ends(scan, range_min=1.5, range_max=2.5) == [[-2.5, 0], [0, -2.5]]
    # They may also be wider than the sensor's own.
    assert hits(scan_of([0.25, 9, 1, 1]), range_min=0.0, range_max=10.0)[:2] == [[0.25, 0], [0, 9]]


def test_limits_of_zero_are_limits() -> None:
    assert hits(scan_of([0.25, 1, 1, 1]), range_min=0.0)[0] == [0.25, 0]
    assert hits(scan_of([1, 1, 1, 1]), range_max=0.0) == []


def test_a_sensor_without_limits() -> None:
    scan = scan_of([FARTHEST + 1, FARTHEST - 1, 0.0, INF], limits=(0.0, INF))
    assert hits(scan) == [[0, FARTHEST - 1], [0, 0]]
    assert open_ends(scan) == [[FARTHEST, 0], [0, -FARTHEST]]


def test_a_laser_mounted_aside_and_turned() -> None:
    # 0.2 m ahead of and 0.1 m left of the robot's middle, looking to the left.
    scan = scan_of([1, 2, INF, NAN], mount=Mount(Pose2D(0.2, 0.1, QUARTER)))
    assert hits(scan) == [[0.2, 1.1], [-1.8, 0.1]]
    assert open_ends(scan) == [[0.2, -7.9]]
    assert perceive(scan, PerceptionParameters()).laser.tolist() == [0.2, 0.1]


def test_a_laser_hanging_upside_down() -> None:
    # Its beams run clockwise seen from above: ahead, right, behind, left.
    scan = scan_of([1, 2, INF, 4], mount=Mount(Pose2D(0, 0, 0), flipped=True))
    assert hits(scan) == [[1, 0], [0, -2], [0, 4]]
    assert open_ends(scan) == [[-8, 0]]
    # Turned as well: the turn is seen from above.
    scan = scan_of([1, 2, 3, 4], mount=Mount(Pose2D(0, 0, QUARTER), flipped=True))
    assert hits(scan) == [[0, 1], [2, 0], [0, -3], [-4, 0]]


def test_a_sensor_that_turns_clockwise() -> None:
    scan = scan_of([1, 2, 3, 4], increment=-QUARTER)
    assert hits(scan) == [[1, 0], [0, -2], [-3, 0], [0, 4]]


def test_a_scan_without_beams() -> None:
    perception = perceive(scan_of([]), PerceptionParameters(no_return="clear"))
    assert perception.hits.shape == perception.open_ends.shape == (0, 2)


def test_the_scan_stays_as_it_was() -> None:
    scan = scan_of([0.1, 9.0, 1.0, NAN])
    perceive(scan, PerceptionParameters(no_return="clear"))
    assert scan.ranges == pytest.approx([0.1, 9.0, 1.0, NAN], nan_ok=True)
