"""When beams are taken, found from the log."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from support.sweeping import SweepingRobot, ate

from mapcli import Pose2D
from mapcli.algorithms.slam.replay import replay
from mapcli.algorithms.slam.sweep_search import BEFORE, SweepSearch
from mapcli.model.scan import Odometry, RangeScan, Record
from mapcli.model.sweep import AT_ONCE, BeamTiming

UNTOLD = BeamTiming(order=None)
"""Of a log whose time_increment is 0."""


def order_unknown(robot: SweepingRobot) -> list[Record]:
    return robot.records(BeamTiming(robot.increment, order=None))


def without_odometry(records: list[Record]) -> list[Record]:
    return [record for record in records if not isinstance(record, Odometry)]


def timings(records: list[Record]) -> set[BeamTiming]:
    return {record.timing for record in records if isinstance(record, RangeScan)}


@pytest.mark.parametrize("flipped", [False, True])
@pytest.mark.parametrize("odometry", [True, False])
def test_the_order_is_found_as_soon_as_the_robot_turns(flipped: bool, odometry: bool) -> None:
    records = order_unknown(SweepingRobot(flipped=flipped, seconds=8))
    records = records if odometry else without_odometry(records)
    search = SweepSearch()
    settled = list(search.settled(records))
    assert search.order == ("backward" if flipped else "forward")
    assert search.turn_s == 0  # which the log tells
    assert {timing.order for timing in timings(settled)} == {search.order}
    assert [record.stamp_ns for record in settled] == [record.stamp_ns for record in records]


@pytest.mark.parametrize("timing", [BeamTiming(1e-3, order=None), UNTOLD])
def test_a_robot_that_stands_shows_nothing_and_few_scans_are_held_back(timing: BeamTiming) -> None:
    records = SweepingRobot(pose_at=lambda t: Pose2D(), seconds=12, noise=0.0).records(timing)
    taken = 0

    def watched() -> Iterator[Record]:
        nonlocal taken
        for one in records:
            taken += isinstance(one, RangeScan)
            yield one

    search, passed = SweepSearch(), 0
    for record in search.settled(watched()):
        if isinstance(record, RangeScan):
            passed += 1
            assert record.timing == replace(timing, order="forward")
            assert taken - passed <= BEFORE + 1
    assert passed == sum(isinstance(record, RangeScan) for record in records)
    assert search.order is None


@pytest.mark.parametrize("timing", [BeamTiming(1e-3, order="backward"), AT_ONCE])
def test_what_is_known_is_not_searched_for(timing: BeamTiming) -> None:
    records = SweepingRobot(seconds=3).records(timing)
    search = SweepSearch()
    assert list(search.settled(records)) == records
    assert not search.was_needed


@pytest.mark.parametrize("flipped", [False, True])
@pytest.mark.parametrize("share", [0.9, 0.5])
def test_a_turn_of_which_the_log_tells_nothing_is_found(share: float, flipped: bool) -> None:
    robot, search = SweepingRobot(share=share, flipped=flipped), SweepSearch()
    (timing,) = timings(list(search.settled(robot.records(UNTOLD))))
    assert search.turn_s == pytest.approx(robot.increment * robot.beams, rel=0.05)
    assert timing.increment == pytest.approx(robot.increment, rel=0.05)
    assert timing.order == search.order == ("backward" if flipped else "forward")


def test_without_odometry_too() -> None:
    robot, search = SweepingRobot(), SweepSearch()
    list(search.settled(without_odometry(robot.records(UNTOLD))))
    assert search.turn_s == pytest.approx(robot.increment * robot.beams, rel=0.05)


@pytest.mark.parametrize("seconds", [8, 30])
def test_beams_that_are_taken_at_once_stay_so(seconds: float) -> None:
    records = SweepingRobot(share=1e-6, seconds=seconds).records(UNTOLD)
    search = SweepSearch()
    assert timings(list(search.settled(records))) == {AT_ONCE}
    assert search.order is None


def test_what_is_found_is_used_and_said() -> None:
    robot = SweepingRobot()
    found = replay(robot.records(UNTOLD))
    told = replay(robot.records(BeamTiming(robot.increment)))
    at_once = replay(robot.records(AT_ONCE))
    errors = [
        ate([traced.pose for traced in replayed.trace.poses], robot.truth())
        for replayed in (found, told, at_once)
    ]
    assert errors[0] < errors[1] + 0.005 < errors[2]
    sweep = found.summary.sweep
    assert sweep is not None
    assert sweep.is_found
    assert sweep.document()["turn_time_found"]
    assert "looks as if a turn took 0.18" in sweep.text()
    assert told.summary.sweep is not None
    assert not told.summary.sweep.is_found
    assert at_once.summary.sweep is None


def test_what_was_read_before_an_interruption_is_not_lost() -> None:
    records, passed = SweepingRobot(seconds=8).records(UNTOLD), list[Record]()

    def interrupted() -> Iterator[Record]:
        yield from records
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        passed.extend(SweepSearch().settled(interrupted()))
    assert [record.stamp_ns for record in passed] == [record.stamp_ns for record in records]
