"""What a person knows: a line mends a map that is torn, and a wrong line does no harm."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import pytest
from support.apartment import BEDROOM, HALL, KITCHEN, apartment, way
from support.looping import laps, log_of, ring, scan_at, worst

from mapcli import Pose2D, replay
from mapcli.algorithms.slam.replay import Replayed
from mapcli.errors import DataError
from mapcli.model.knowledge import (
    Knowledge,
    Moment,
    NotSamePlace,
    SamePlace,
    TrustedOdometry,
)
from mapcli.model.knowledge import (
    scan_at as number_at,
)
from mapcli.model.scan import RangeScan

LAPS = laps(60, 0.2)
FIRST = way(HALL, (3.05, 5.0), BEDROOM, (3.05, 5.0), (9.9, 5.0), KITCHEN, step=0.2)
SECOND = way((3.05, 5.0), BEDROOM, step=0.15)
CARRIED_S = 0.2 * len(FIRST)
"""Scans are a fifth of a second apart."""

THERE_S = 0.2 * 12
"""When the robot was first where it is put down."""


@cache
def carried(*same: SamePlace) -> Replayed:
    """A robot drives through the apartment, is carried back to the bedroom's door, and drives two
    metres: too short a way for the map to tell where that is."""
    true = [*FIRST, *SECOND]
    scans = [scan_at(apartment(), pose, k) for k, pose in enumerate(true)]
    away = FIRST[-1].compose(SECOND[0].inverse())
    odom = [*FIRST, *(away.compose(pose) for pose in SECOND)]
    return replay(log_of(scans, odom), knowledge=Knowledge(same))


def kinds(replayed: Replayed) -> list[str]:
    return [one.kind for one in replayed.summary.reasons]


def off(replayed: Replayed) -> float:
    """Metres by which poses are off, at worst."""
    return worst([one.pose for one in replayed.trace.poses], [*FIRST, *SECOND])


def test_the_map_alone() -> None:
    assert "unjoined" in kinds(carried())
    assert carried().summary.verdict == "bad"
    assert off(carried()) > 1.0


@pytest.mark.parametrize(
    "line",
    [
        SamePlace(Moment(THERE_S), Moment(CARRIED_S + 0.2)),
        SamePlace(Moment(CARRIED_S + 0.2), Moment(THERE_S)),
        SamePlace(Moment(THERE_S), Moment(CARRIED_S), FIRST[12].between(SECOND[0])),
    ],
    ids=["about", "the other way round", "with a pose"],
)
def test_a_right_line_makes_it_good(line: SamePlace) -> None:
    found = carried(line)
    assert (found.summary.verdict, kinds(found)) == ("good", [])
    assert off(found) < 0.05
    assert found.summary.unjoined == 0


def test_a_wrong_line_is_called_wrong() -> None:
    """The robot was nowhere near: that is in the study."""
    line = SamePlace(Moment(0.0), Moment(CARRIED_S), Pose2D(8.0, 2.0, math.pi / 3))
    found = carried(line)
    (reason,) = [one for one in found.summary.reasons if one.kind == "not_so"]
    assert reason.text == (f"{line} is not so: scans contradict it, and the map is made without it")
    assert [one.pose for one in found.trace.poses] == [one.pose for one in carried().trace.poses]


@pytest.mark.parametrize("seconds", [-1.0, 1000.0])
def test_a_time_that_there_is_not(seconds: float) -> None:
    with pytest.raises(DataError, match="is not a time of the drive"):
        carried(SamePlace(Moment(1.0), Moment(seconds)))


def test_another_drive() -> None:
    with pytest.raises(DataError, match=r"monday:3 is a time of no drive; expected SECONDS"):
        carried(SamePlace(Moment(1.0), Moment(3.0, "monday")))


def blinded(scans: list[RangeScan], first: int, last: int) -> list[RangeScan]:
    """Between two numbers, the laser sees only what moves with the robot."""
    stuck = scans[first]
    return [
        replace(stuck, stamp_ns=one.stamp_ns) if first < k < last else one
        for k, one in enumerate(scans)
    ]


@cache
def misled(knowledge: Knowledge) -> Replayed:
    """For three seconds the laser shows the same picture, as where something stands on the robot:
    scans say that it stands, and the wheels that it drives."""
    true = LAPS[:160]
    scans = blinded([scan_at(ring(), pose, k) for k, pose in enumerate(true)], 60, 75)
    return replay(log_of(scans, true), knowledge=knowledge)


def test_odometry_that_is_trusted() -> None:
    alone = misled(Knowledge())
    told = misled(Knowledge(trusted=(TrustedOdometry(Moment(11.8), Moment(15.4)),)))
    true = LAPS[:160]
    errors = [worst([one.pose for one in r.trace.poses], true) for r in (alone, told)]
    assert errors[1] < 0.1 < errors[0]


def test_places_that_are_not_the_same_close_no_loop() -> None:
    true = LAPS[:185]
    log = log_of([scan_at(ring(), pose, k) for k, pose in enumerate(true)], true)
    assert replay(log).summary.loops
    apart = tuple(
        NotSamePlace(Moment(s), Moment(s + 35 / 0.2 * 0.2)) for s in range(0, 3)
    )  # a lap is 35 m
    assert not replay(log, knowledge=Knowledge(apart=apart)).summary.loops


def test_the_nearest_scan() -> None:
    assert number_at(Moment(1.4), [5 * 10**9, 6 * 10**9, 7 * 10**9]) == 1
