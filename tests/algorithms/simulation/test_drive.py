"""A robot along waypoints: geometry and speeds."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mapcli.algorithms.simulation.drive import Drive, MotionLimits, Trapezoid, arc
from mapcli.algorithms.simulation.drive_plan import plan_drive
from mapcli.errors import DataError
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.waypoint import Waypoint

STRICT = MotionLimits(corner_cut=0.0)


def waypoints(*places: tuple[float, float]) -> list[Waypoint]:
    return [Waypoint(x, y) for x, y in places]


def sampled(drive: Drive, count: int = 2000) -> tuple[float, list[Pose2D]]:
    times = np.linspace(0, drive.duration, count)
    return times[1], [drive.pose_at(time) for time in times]


def test_one_metre_straight_by_hand() -> None:
    # 0.5 m/s at 0.5 m/s2: one second up, one steady, one down; 0.25 + 0.5 + 0.25 m.
    drive = plan_drive(waypoints((1, 1), (2, 1)))
    assert drive.duration == pytest.approx(3.0)
    assert drive.distance == pytest.approx(1.0)
    xs = [drive.pose_at(time).x for time in (0.0, 0.5, 1.0, 2.0, 2.5, 3.0)]
    assert xs == pytest.approx([1.0, 1.0625, 1.25, 1.75, 1.9375, 2.0])


def test_short_way_never_reaches_full_speed() -> None:
    assert plan_drive(waypoints((0, 0), (0.125, 0))).duration == pytest.approx(1.0)


def test_trapezoid_with_speeds_at_its_ends() -> None:
    profile = Trapezoid(length=1.5, start=1.0, end=0.5, peak=1.0, acceleration=0.5)
    # Steady for 0.75 m, then down for one second.
    assert profile.duration == pytest.approx(1.75)
    assert profile.travelled(0.75) == pytest.approx(0.75)
    assert profile.travelled(1.75) == pytest.approx(1.5)


def test_quarter_arc() -> None:
    pose = arc(math.pi, math.pi / 2)  # radius 2
    assert (pose.x, pose.y, pose.theta) == pytest.approx((2, 2, math.pi / 2))
    back = arc(-math.pi, math.pi / 2)
    assert (back.x, back.y) == pytest.approx((-2, -2))


def test_turning_on_the_spot_reaches_every_waypoint() -> None:
    path = waypoints((0, 0), (1, 0), (1, 1), (0, 0))
    drive = plan_drive(path, STRICT)
    times = drive.arrivals()
    assert len(times) == 4
    for time, waypoint in zip(times, path, strict=True):
        pose = drive.pose_at(time)
        assert (pose.x, pose.y) == pytest.approx((waypoint.x, waypoint.y))
    # 90 degrees: half a second up, one second at 60 degrees a second, half a second down.
    assert times[1] == pytest.approx(3.0 + 2.0)


def test_rounded_corner() -> None:
    drive = plan_drive(waypoints((0, 0), (1, 0), (1, 1)))
    _, poses = sampled(drive)
    nearest = min(math.hypot(pose.x - 1, pose.y) for pose in poses)
    assert nearest == pytest.approx(0.25 * (math.sqrt(2) - 1), abs=1e-4)
    assert drive.distance == pytest.approx(1.5 + 0.25 * math.pi / 2)
    assert drive.duration < plan_drive(waypoints((0, 0), (1, 0), (1, 1)), STRICT).duration


def test_waypoint_on_a_straight_line_changes_nothing() -> None:
    with_it = plan_drive(waypoints((0, 0), (1, 0), (2, 0)))
    assert with_it.duration == pytest.approx(plan_drive(waypoints((0, 0), (2, 0))).duration)


def test_reverse_keeps_the_heading() -> None:
    drive = plan_drive([Waypoint(0, 0), Waypoint(2, 0), Waypoint(1, 0, back=True)])
    _, poses = sampled(drive)
    assert {pose.theta for pose in poses} == {0.0}
    assert poses[-1].x == pytest.approx(1.0)
    assert max(pose.x for pose in poses) == pytest.approx(2.0, abs=1e-4)
    assert drive.distance == pytest.approx(3.0)


def test_start_in_reverse_faces_away() -> None:
    assert plan_drive([Waypoint(0, 0), Waypoint(0, -1, back=True)]).pose_at(0).theta == (
        pytest.approx(math.pi / 2)
    )


def test_arc_in_reverse_joins_its_legs() -> None:
    path = [Waypoint(0, 0), Waypoint(2, 0, back=True), Waypoint(2, 2, back=True)]
    step, poses = sampled(plan_drive(path))
    assert max(a.distance(b) for a, b in pairwise(poses)) <= 0.5 * step + 1e-9
    assert (poses[-1].x, poses[-1].y) == pytest.approx((2, 2))
    assert poses[-1].theta == pytest.approx(-math.pi / 2)


def test_pauses_and_speeds() -> None:
    path = [Waypoint(0, 0, pause=2), Waypoint(1, 0, pause=3), Waypoint(2, 0, speed=0.25, pause=1)]
    drive = plan_drive(path)
    # 2 + 3 + 3 + (0.5 up, 3.5 steady, 0.5 down) + 1
    assert drive.duration == pytest.approx(2 + 3 + 3 + 4.5 + 1)
    assert drive.pose_at(1.9).x == 0.0
    assert drive.pose_at(5.0).x == drive.pose_at(8.0).x == pytest.approx(1.0)
    assert drive.pose_at(99.0).x == pytest.approx(2.0)
    assert [drive.waypoint_at(time) for time in (0, 4, 7, 9, 99)] == [1, 1, 1, 2, 2]


coordinates = st.integers(-20, 20).map(lambda n: n / 4)
paths = st.lists(
    st.builds(Waypoint, coordinates, coordinates, st.booleans(), st.none(), st.just(0.0)),
    min_size=2,
    max_size=7,
)


@given(paths, st.sampled_from([0.0, 0.1, 0.4]))
def test_never_faster_than_the_limits(path: list[Waypoint], cut: float) -> None:
    assume(all((a.x, a.y) != (b.x, b.y) for a, b in pairwise(path)))
    drive = plan_drive(path, MotionLimits(corner_cut=cut))
    step, poses = sampled(drive, 400)
    for a, b in pairwise(poses):
        assert a.distance(b) <= 0.5 * step + 1e-9
        assert abs(wrap_angle(b.theta - a.theta)) <= math.radians(60) * step + 1e-9
    assert (poses[-1].x, poses[-1].y) == pytest.approx((path[-1].x, path[-1].y))
    assert len(drive.arrivals()) == len(path)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ([], "the path has 0 waypoint(s); expected the start and at least one more to drive to"),
        (waypoints((1, 2)), "the path has 1 waypoint(s)"),
        (waypoints((0, 0), (1e9, 0)), "the drive takes 2e+09 s; expected at most a week"),
        (waypoints((0, 0), (1e300, -1e308)), "the drive takes"),
        (waypoints((-1e308, 0), (1e308, 0)), "expected at most a week"),
        ([Waypoint(0, 0), Waypoint(1, 0, speed=5e-324)], "the drive takes inf s"),
        (waypoints((0, 0), (1, 2), (1, 2)), "waypoint 3 is at the same place as the one before"),
    ],
)
def test_paths_that_are_none(path: list[Waypoint], message: str) -> None:
    with pytest.raises(DataError) as error:
        plan_drive(path)
    assert message in str(error.value)


@pytest.mark.parametrize("name", ["speed", "acceleration", "turn_rate_deg", "corner_cut"])
@pytest.mark.parametrize("value", [-1.0, 5e-324, math.nan, math.inf])
def test_limits_are_checked(name: str, value: float) -> None:
    with pytest.raises(DataError, match=f"{name} is"):
        MotionLimits(**{name: value})
