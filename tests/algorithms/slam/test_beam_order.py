"""The order of the beams, found from the log."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.sweeping import SweepingRobot

from mapcli import Pose2D
from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.algorithms.slam.beam_order import BEFORE, MOST, BeamOrderSearch
from mapcli.model.scan import RangeScan
from mapcli.model.sweep import BeamTiming


def unknown(robot: SweepingRobot) -> list[tuple[RangeScan, Pose2D | None]]:
    return list(odometry_at_scans(robot.records(BeamTiming(robot.increment, order=None))))


@pytest.mark.parametrize("flipped", [False, True])
def test_it_is_found_as_soon_as_the_robot_turns(flipped: bool) -> None:
    scans = unknown(SweepingRobot(flipped=flipped, seconds=8))
    search = BeamOrderSearch()
    settled = list(search.settled(scans))
    assert search.found == ("backward" if flipped else "forward")
    assert {scan.timing.order for scan, _ in settled} == {search.found}
    assert [scan.stamp_ns for scan, _ in settled] == [scan.stamp_ns for scan, _ in scans]
    assert [odom for _, odom in settled] == [odom for _, odom in scans]


def test_a_robot_that_stands_shows_none_and_few_scans_are_held_back() -> None:
    scans = unknown(SweepingRobot(pose_at=lambda t: Pose2D(), seconds=12, noise=0.0))
    taken = 0

    def watched():  # type: ignore[no-untyped-def]
        nonlocal taken
        for one in scans:
            taken += 1
            yield one

    search, passed = BeamOrderSearch(), 0
    for scan, _ in search.settled(watched()):
        passed += 1
        assert scan.timing.order == "forward"
        assert taken - passed <= BEFORE
    assert passed == len(scans)
    assert search.found is None
    assert BEFORE < MOST


def test_what_is_known_is_not_searched_for() -> None:
    scans = [
        (replace(scan, timing=BeamTiming(1e-3, order="backward")), odom)
        for scan, odom in unknown(SweepingRobot(seconds=3))
    ]
    search = BeamOrderSearch()
    assert list(search.settled(scans)) == scans
    assert not search.was_needed
