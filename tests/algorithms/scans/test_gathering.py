"""Readings of several sensors over a short way become one scan."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mapcli import Pose2D
from mapcli.algorithms.scans.gathering import gathered
from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.algorithms.scans.perception import PerceptionParameters, perceive
from mapcli.algorithms.scans.scan_extraction import scan_perception
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.model.range_reading import GatheredScan, RangeReading
from mapcli.model.scan import Mount, Odometry, RangeScan

S = 10**9
AHEAD, LEFT = Mount(Pose2D(0.1)), Mount(Pose2D(0, 0.05, math.pi / 2))


def reading(t: float, metres: float, mount: Mount = AHEAD, reach: float = 2.0) -> RangeReading:
    ranges = np.array([metres], dtype=np.float32)
    return RangeReading(round(t * S), 0.0, 0.0, ranges, 0.0, reach, mount, sensor=str(mount))


def drive(way: float, *, steps: int = 10) -> list[tuple[RangeScan, Pose2D | None]]:
    """Straight on; ahead and to the left at every step."""
    scans: list[tuple[RangeScan, Pose2D | None]] = []
    for k in range(steps + 1):
        pose = Pose2D(way * k / steps)
        scans += [(reading(k, 1.5 - pose.x), pose), (reading(k, 0.45, LEFT), pose)]
    return scans


def test_by_hand() -> None:
    # Two metres of a wall to the left at y = 0.5, another one ahead at x = 1.6.
    first, *others = gathered(drive(1.0), 0.25)
    assert isinstance(first[0], RangeReading)  # the map begins where it was taken
    assert [len(scan.ranges) for scan, _ in others] == [5, 6, 6, 4]
    scan, odom = others[1]
    assert isinstance(scan, GatheredScan)
    assert (scan.stamp_ns, odom) == (5 * S, Pose2D(0.5))
    p = perceive(scan, PerceptionParameters())
    ahead, left = p.hits[::2], p.hits[1::2]
    assert ahead.tolist() == [pytest.approx([1.1, 0])] * 3  # as seen from x = 0.5
    assert left == pytest.approx(np.array([(-0.2, 0.5), (-0.1, 0.5), (0, 0.5)]))
    assert [one.laser.tolist() for one in p.readings[:2]] == [
        pytest.approx([-0.1, 0]), pytest.approx([-0.2, 0.05]),
    ]  # fmt: skip
    assert p.independent == 2 / 6  # what two sensors see, three times


def test_a_turn_and_a_long_time_end_a_scan() -> None:
    turning = [(reading(k, 1, m), Pose2D(0, 0, k * 0.1)) for k in range(9) for m in (AHEAD, LEFT)]
    assert [len(scan.ranges) for scan, _ in gathered(turning)] == [1, 5, 6, 6]  # 17 deg are 0.297
    standing = [(reading(3 * k, 1, m), Pose2D()) for k in range(9) for m in (AHEAD, LEFT)]
    assert [len(scan.ranges) for scan, _ in gathered(standing)] == [1, 7, 8, 2]  # 10 s


def test_what_stays_alone() -> None:
    alone = [(scan, odom) for scan, odom in drive(1.0) if scan.mount == LEFT]
    assert list(gathered(alone)) == alone  # a lone sensor
    without: list[tuple[RangeScan, Pose2D | None]] = [(scan, None) for scan, _ in drive(1.0)]
    assert list(gathered(without)) == without
    laser = RangeScan(0, 0.0, 0.1, np.ones(3, dtype=np.float32))
    mixed = [*drive(0.1, steps=1), (laser, Pose2D()), *drive(0.1, steps=1)]
    assert [len(scan.ranges) for scan, _ in gathered(mixed)] == [1, 3, 3, 4]


def test_readings_between_two_of_odometry() -> None:
    records = [Odometry(0, Pose2D()), *(reading(t, 1, m) for t in (0.5, 1) for m in (AHEAD, LEFT)),
               Odometry(2 * S, Pose2D(0.2))]  # fmt: skip
    first, (scan, odom) = odometry_at_scans(records)
    assert first[1] == Pose2D(0.05)
    assert isinstance(scan, GatheredScan)
    assert odom == Pose2D(0.1)
    assert [placed.pose.x for placed in scan.readings] == pytest.approx([-0.05, 0, 0])


def test_the_map_is_that_of_the_readings_one_by_one() -> None:
    together, alone = OccupancyGrid(), OccupancyGrid()
    parameters = PerceptionParameters(no_return="clear")
    scans = [*drive(1.0), (reading(11, math.inf, reach=0.5), Pose2D(1.0))]
    for scan, odom in gathered(scans, 0.25):
        assert odom is not None
        together.integrate(odom, perceive(scan, parameters))
    for scan, odom in scans:
        assert odom is not None
        alone.integrate(odom, perceive(scan, parameters))
    one, other = together.to_grid_map(), alone.to_grid_map()
    assert one.origin == other.origin
    assert np.array_equal(one.cells, other.cells, equal_nan=True)


def test_as_a_perception_from_the_middle_of_the_robot() -> None:
    *_, (scan, _) = gathered([*drive(0.1, steps=1), (reading(2, math.inf, LEFT), Pose2D(0.1))])
    found = scan_perception(scan, Pose2D(3, 4, 0))
    assert found.beams[:, 0] == pytest.approx([math.atan2(0.5, -0.1), 0, math.pi / 2, math.pi / 2])
    assert found.beams[:, 1] == pytest.approx([math.hypot(0.5, 0.1), 1.5, 0.5, math.inf])
