"""Drives through an apartment that are joined, begun anywhere and at any heading."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from support.apartment import BEDROOM, HALL, KITCHEN, LIVING, STUDY, apartment, way
from support.looping import (
    Edges,
    drifted,
    rooms,
    see,
    there_and_back,
    trajectory_of,
    worst,
)

from mapcli import Pose2D, SlamParameters
from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.sessions.drive import Drive, by_age, do_overlap, without_repeats
from mapcli.algorithms.sessions.drive_agreement import with_names
from mapcli.algorithms.sessions.join_drives import JointMap, join_drives
from mapcli.algorithms.sessions.saving import restored, saved
from mapcli.model.knowledge import Knowledge, Moment, SamePlace
from mapcli.model.reason import Reason
from mapcli.model.summary import NOTHING
from mapcli.model.trace import TracedPose

PARAMETERS = SlamParameters()
S = 10**9
AFTER_NOON = 0.1
"""Degrees per metre by which the second drive drifts."""


def drive(name: str, tracked: list[Pose2D], seen: list[Perception], begin_s: int) -> Drive:
    """A drive of five scans a second, whose first pose is its origin."""
    home = tracked[0].inverse()
    own = [home.compose(pose) for pose in tracked]
    poses = tuple(
        TracedPose(begin_s * S + k * S // 5, pose, pose, 0.9, "matched")
        for k, pose in enumerate(own)
    )
    summary = replace(NOTHING, scans=len(own), used=len(own), matched=len(own))
    return Drive(name, {f"{name}.mcap": "0" * 64}, {}, trajectory_of(own, seen), poses, summary)


def through(edges: Edges, true: list[Pose2D], name: str, begin_s: int, drift: float = 0.0) -> Drive:
    return drive(name, drifted(true, 1.0, drift), [see(edges, pose) for pose in true], begin_s)


MORNING = way(HALL, (3.05, 5.0), BEDROOM, (3.05, 5.0), (9.2, 5.0), STUDY)
NOON = way(STUDY, (9.2, 5.0), (9.9, 5.0), KITCHEN, (9.9, 5.0), (3.0, 5.0))
EVENING = way(LIVING, (1.65, 5.0), (6.0, 5.0), (9.9, 5.0), KITCHEN)


@cache
def day() -> tuple[Drive, Drive, Drive]:
    """Three drives, of which the second one drifts."""
    world = apartment()
    noon = through(world, NOON, "noon", 2000, AFTER_NOON)
    return through(world, MORNING, "morning", 1000), noon, through(world, EVENING, "evening", 3000)


@cache
def joined() -> list[JointMap]:
    return join_drives(day(), PARAMETERS)


def aligned_errors(found: list[Pose2D], true: list[Pose2D]) -> NDArray[np.float64]:
    """Metres by which each pose is off, after one rigid alignment of all."""
    a, b = (np.array([complex(pose.x, pose.y) for pose in poses]) for poses in (found, true))
    a, b = a - a.mean(), b - b.mean()
    turn = np.vdot(a, b)
    errors: NDArray[np.float64] = np.abs(a * turn / abs(turn) - b)
    return errors


def test_all_are_in_the_frame_of_the_oldest() -> None:
    (joint,) = joined()
    assert [one.drive.name for one in joint.drives] == ["morning", "noon", "evening"]
    assert joint.drives[0].trace.poses[0].pose == Pose2D()
    found = [traced.pose for one in joint.drives for traced in one.trace.poses]
    errors = aligned_errors(found, [*MORNING, *NOON, *EVENING])
    ends = np.cumsum([len(MORNING), len(NOON)])
    for part in np.split(errors, ends):
        assert math.sqrt(np.mean(part**2)) < 0.02


def test_drift_of_one_drive_is_mended_by_the_others() -> None:
    alone = [traced.pose for traced in day()[1].poses]
    (joint,) = joined()
    noon = [traced.pose for traced in joint.drives[1].trace.poses]
    assert worst(noon, NOON) < 0.02 < 0.1 < worst(alone, NOON)


def test_what_is_said_of_each() -> None:
    (joint,) = joined()
    for one in joint.drives:
        assert one.summary.verdict == "good"
        assert one.loops_to
        assert set(one.loops_to) <= {"morning", "noon", "evening"} - {one.drive.name}
        assert one.summary.used == len(one.trace.poses)


def test_drives_that_share_nothing_are_kept_apart() -> None:
    elsewhere = through(rooms(6), there_and_back(14.0), "elsewhere", 4000)
    first, second = join_drives([day()[0], elsewhere], PARAMETERS)
    assert [one.drive.name for one in first.drives] == ["morning"]
    assert [one.drive.name for one in second.drives] == ["elsewhere"]
    assert second.drives[0].trace.poses[0].pose == Pose2D()
    assert not second.drives[0].loops_to


def test_rooms_that_are_alike_are_not_joined_wrongly() -> None:
    """Two drives past rooms that look the same: nobody knows which they are."""
    world = rooms(24)
    first = [Pose2D(x) for x in np.arange(10.0, 30.0, 0.4).tolist()]
    second = [Pose2D(x) for x in np.arange(40.0, 60.0, 0.4).tolist()]
    maps = join_drives(
        [through(world, first, "one", 1000), through(world, second, "two", 2000)], PARAMETERS
    )
    assert len(maps) == 2


def test_a_saved_drive_is_the_same_drive() -> None:
    """To the bit: the map of drives that were read back is the map of those that were not."""
    again = [restored(saved(one)) for one in day()]
    (first,), (second,) = joined(), join_drives(again, PARAMETERS)
    np.testing.assert_array_equal(first.map.cells, second.map.cells)
    assert [one.trace for one in first.drives] == [one.trace for one in second.drives]


def test_age() -> None:
    morning, noon, evening = day()
    assert by_age([evening, morning, noon]) == [morning, noon, evening]
    assert not do_overlap([evening, morning, noon])
    span_s = (morning.span_ns[1] - morning.span_ns[0]) / S
    late = through(apartment(), NOON[:5], "late", 1000 + math.floor(span_s))
    assert do_overlap([late, morning])


def test_a_drive_twice() -> None:
    morning, noon, _ = day()
    twin = replace(morning, name="twin", inputs={})
    later = drive("later", list(MORNING), [see(apartment(), pose) for pose in MORNING], 5000)
    kept, repeats = without_repeats([morning, noon, twin, later])
    assert kept == [morning, noon, later]  # the same way, at another time
    assert repeats == [(twin, morning)]


@pytest.mark.parametrize("static", [False, True])
def test_one_drive(static: bool) -> None:
    (joint,) = join_drives(day()[:1], PARAMETERS, static=static)
    assert [one.drive.name for one in joint.drives] == ["morning"]
    assert joint.drives[0].summary.verdict == "good"


def alike() -> list[Drive]:
    """Two drives past rooms that look the same; the second one begins where the first one ends."""
    ways = ((10.0, 22.0), (20.0, 32.0))
    return [
        through(rooms(24), [Pose2D(x) for x in np.arange(*way, 0.4).tolist()], name, begin_s)
        for way, name, begin_s in zip(ways, ("one", "two"), (1000, 2000), strict=True)
    ]


def told(one_s: float, two_s: float) -> Knowledge:
    return Knowledge((SamePlace(Moment(one_s, "one"), Moment(two_s, "two"), Pose2D()),))


def test_a_person_tells_rooms_apart() -> None:
    """A fifth of a second and 0.4 m from scan to scan: at 5.4 s the first is at x 20.8 m, where
    the second one is at 0.4 s. Which of the rooms, 3 m apart, is what is asked."""
    (joint,) = join_drives(alike(), PARAMETERS, told(5.4, 0.4))
    begin = joint.drives[1].trace.poses[0].pose
    assert (begin.x, begin.y) == pytest.approx((10.0, 0.0), abs=0.2)
    assert all(one.summary.verdict == "good" for one in joint.drives)


def test_the_line_to_try_names_the_drive() -> None:
    reason = Reason("walls_twice", 0, 1, "text", "--same-place 50.0,149.0")
    assert with_names(reason, "monday").remedy == "--same-place monday:50.0,monday:149.0"
    trust = replace(reason, remedy="--trust-odometry 10-20")
    assert with_names(trust, "day-2").remedy == "--trust-odometry day-2:10-20"
