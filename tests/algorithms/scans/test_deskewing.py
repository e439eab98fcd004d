"""Beams taken one after another, put where they were taken."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.sweeping import MOUNT, SweepingRobot

from mapcli import Pose2D, extract_scan
from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.algorithms.scans.perception import PerceptionParameters, perceive
from mapcli.algorithms.scans.scan_extraction import scan_perception
from mapcli.model.scan import Odometry, RangeScan, Record
from mapcli.model.sweep import BeamTiming, SweepMotion

MS = 1_000_000
QUARTER = math.pi / 2


def scan(ms: int, ranges: list[float], timing: BeamTiming) -> RangeScan:
    return RangeScan(ms * MS, 0.0, QUARTER, np.array(ranges, np.float32), timing=timing)


def driving(until_ms: int, metres_per_s: float = 1.0) -> list[Record]:
    return [
        Odometry(ms * MS, Pose2D(metres_per_s * ms * 1e-3)) for ms in range(0, until_ms + 1, 40)
    ]


def test_the_motion_is_that_of_odometry_from_the_first_beam_to_the_last() -> None:
    timing = BeamTiming(0.05, "middle")
    late = scan(1010, [1, 1, 1], timing)
    records = sorted([*driving(2000), late], key=lambda record: record.stamp_ns)
    [(found, _)] = odometry_at_scans(records)
    assert found.motion is not None
    # The ends, the stamp, and every record of odometry between them.
    assert found.motion.seconds == pytest.approx([-0.05, -0.01, 0, 0.03, 0.05])
    assert found.motion.at(np.array([-0.05, 0.0, 0.02, 0.05]))[:, 0] == pytest.approx(
        [-0.05, 0, 0.02, 0.05]
    )


def test_a_scan_waits_for_the_odometry_of_its_last_beam() -> None:
    records: list[Record] = [Odometry(0, Pose2D()), scan(0, [1, 1, 1], BeamTiming(0.05))]
    records += [Odometry(40 * MS, Pose2D(0.04)), Odometry(80 * MS, Pose2D(0.4))]
    records += [Odometry(120 * MS, Pose2D(9.0))]
    [(found, _)] = odometry_at_scans(records)
    assert found.motion is not None
    assert found.motion.at(np.array([0.1]))[0, 0] == pytest.approx(0.4 + 8.6 / 2)


def test_beams_taken_at_once_have_no_motion() -> None:
    records: list[Record] = [*driving(80)]
    records.insert(1, scan(20, [1, 1], BeamTiming()))
    [(found, _)] = odometry_at_scans(records)
    assert found.motion is None
    assert perceive(found, PerceptionParameters()).sweep is None


def test_each_hit_is_where_the_robot_was_when_it_was_seen() -> None:
    # Ahead, left, behind, right; the robot drives ahead 1 m and turns left a right angle meanwhile.
    motion = SweepMotion(np.array([0.0, 3.0]), np.array([[0, 0, 0], [1.0, 0, QUARTER]]))
    one = RangeScan(0, 0.0, QUARTER, np.full(4, 2, np.float32), timing=BeamTiming(1.0))
    seen = perceive(replace(one, motion=motion), PerceptionParameters())
    third = QUARTER / 3
    expected = [
        (2, 0),
        (1 / 3 - 2 * math.sin(third), 2 * math.cos(third)),
        (2 / 3 - 2 * math.cos(2 * third), -2 * math.sin(2 * third)),
        (1 + 2, 0),
    ]
    assert seen.hits == pytest.approx(np.array(expected))
    assert seen.laser == pytest.approx([0.5, 0])
    # Deskewed by no motion at all, and back.
    still = SweepMotion(np.zeros(1), np.zeros((1, 3)))
    assert seen.deskewed(still).hits == pytest.approx(np.array([(2, 0), (0, 2), (-2, 0), (0, -2)]))
    assert seen.deskewed(still).deskewed(motion).hits == pytest.approx(seen.hits)


def test_the_last_beam_of_a_flipped_array_was_taken_first() -> None:
    motion = SweepMotion(np.array([0.0, 1.0]), np.array([[0, 0, 0], [1.0, 0, 0]]))
    timing = BeamTiming(1.0, order="backward")
    one = RangeScan(0, 0.0, QUARTER, np.full(2, 2, np.float32), timing=timing)
    seen = perceive(replace(one, motion=motion), PerceptionParameters())
    assert seen.hits == pytest.approx(np.array([(3, 0), (0, 2)]))


def test_beams_without_return_pass_where_they_were_taken() -> None:
    motion = SweepMotion(np.array([0.0, 1.0]), np.array([[0, 0, 0], [1.0, 0, 0]]))
    ranges = np.array([2, np.inf], np.float32)
    one = RangeScan(0, 0.0, QUARTER, ranges, 0.0, 5.0, timing=BeamTiming(1.0))
    seen = perceive(replace(one, motion=motion), PerceptionParameters(no_return="clear"))
    assert seen.open_ends == pytest.approx(np.array([(1, 5)]))


def test_an_extracted_scan_is_seen_from_the_pose_at_its_stamp() -> None:
    robot = SweepingRobot(noise=0.0)
    found = extract_scan(robot.records(BeamTiming(robot.increment)), 4.0)
    perception = scan_perception(found.scan, found.pose())
    expected = perceive(found.scan, PerceptionParameters()).hits
    bearings, ranges = perception.beams.T
    ends = np.column_stack([np.cos(bearings), np.sin(bearings)]) * ranges[:, None]
    ends += MOUNT.pose.x, MOUNT.pose.y
    assert ends == pytest.approx(expected)
