"""Pose algebra, by hand and by its laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.model.pose import Pose2D, interpolate, wrap_angle

FEW = settings(max_examples=40)
METRES = st.floats(-1000, 1000)
ANGLES = st.floats(-10, 10)
POSES = st.builds(Pose2D, METRES, METRES, ANGLES)
QUARTER = math.pi / 2


def assert_same(a: Pose2D, b: Pose2D) -> None:
    assert (a.x, a.y) == pytest.approx((b.x, b.y), abs=1e-9)
    assert abs(wrap_angle(a.theta - b.theta)) < 1e-12


# --- angles


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [
        (0.0, 0.0),
        (3.0, 3.0),
        (math.pi, -math.pi),
        (-math.pi, -math.pi),
        (4.0, 4.0 - math.tau),
        (-4.0, math.tau - 4.0),
        (100 * math.pi + 1, 1.0),
    ],
)
def test_wrapped_angles(angle: float, wrapped: float) -> None:
    assert wrap_angle(angle) == pytest.approx(wrapped, abs=1e-12)


@FEW
@given(st.floats(-1e6, 1e6))
def test_wrapping_keeps_the_direction(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped <= math.pi
    turns = (angle - wrapped) / math.tau
    assert turns == pytest.approx(round(turns), abs=1e-8)


# --- motions


def test_compose_by_hand() -> None:
    # Facing up at (1, 2): 3 ahead is up, 4 to the left is towards -x.
    there = Pose2D(1, 2, QUARTER).compose(Pose2D(3, 4, math.pi))
    assert_same(there, Pose2D(1 - 4, 2 + 3, -QUARTER))


def test_inverse_by_hand() -> None:
    # Seen from a robot at (1, 2) facing up, the origin is 2 behind and 1 to the left.
    assert_same(Pose2D(1, 2, QUARTER).inverse(), Pose2D(-2, 1, -QUARTER))


def test_between_by_hand() -> None:
    # From (1, 1) facing -x, the point (0, 3) is 1 ahead and 2 to the right.
    seen = Pose2D(1, 1, math.pi).between(Pose2D(0, 3, -QUARTER))
    assert_same(seen, Pose2D(1, -2, QUARTER))


@FEW
@given(POSES)
def test_an_inverse_undoes(pose: Pose2D) -> None:
    assert_same(pose.compose(pose.inverse()), Pose2D())
    assert_same(pose.inverse().compose(pose), Pose2D())


@FEW
@given(POSES)
def test_the_origin_changes_nothing(pose: Pose2D) -> None:
    assert_same(pose.compose(Pose2D()), pose)
    assert_same(Pose2D().compose(pose), pose)


@FEW
@given(POSES, POSES, POSES)
def test_compose_is_associative(a: Pose2D, b: Pose2D, c: Pose2D) -> None:
    assert_same(a.compose(b).compose(c), a.compose(b.compose(c)))


@FEW
@given(POSES, POSES)
def test_between_is_what_is_missing(a: Pose2D, b: Pose2D) -> None:
    assert_same(a.compose(a.between(b)), b)


@FEW
@given(POSES, POSES)
def test_headings_come_out_wrapped(a: Pose2D, b: Pose2D) -> None:
    for pose in (a.compose(b), a.inverse(), a.between(b), interpolate(a, b, 0.3)):
        assert -math.pi <= pose.theta <= math.pi


def test_apply_by_hand() -> None:
    points = np.array([[1.0, 0.0], [0.0, 1.0]])
    assert Pose2D(10, 20, QUARTER).apply(points) == pytest.approx(np.array([[10, 21], [9, 20]]))
    assert points.tolist() == [[1, 0], [0, 1]]
    assert Pose2D(10, 20, 1).apply(np.empty((0, 2))).shape == (0, 2)


@FEW
@given(POSES, POSES)
def test_apply_moves_a_point_as_compose_moves_a_pose(a: Pose2D, b: Pose2D) -> None:
    moved = a.compose(b)
    assert a.apply(np.array([[b.x, b.y]]))[0] == pytest.approx((moved.x, moved.y), abs=1e-9)


def test_distance() -> None:
    assert Pose2D(1, 2, 3).distance(Pose2D(4, 6, -1)) == 5


# --- between two poses


def test_half_way() -> None:
    middle = interpolate(Pose2D(0, 0, 0), Pose2D(2, -4, 1), 0.5)
    assert_same(middle, Pose2D(1, -2, 0.5))


def test_turning_the_shorter_way_across_the_seam() -> None:
    # 170 degrees to -170 degrees is 20 to the left, not 340 to the right.
    a, b = Pose2D(theta=math.radians(170)), Pose2D(theta=math.radians(-170))
    assert_same(interpolate(a, b, 0.25), Pose2D(theta=math.radians(175)))
    assert_same(interpolate(a, b, 0.75), Pose2D(theta=math.radians(-175)))


def test_going_on_beyond() -> None:
    assert_same(interpolate(Pose2D(0, 0, 0), Pose2D(1, 2, 0.1), 3.0), Pose2D(3, 6, 0.3))
    assert_same(interpolate(Pose2D(0, 0, 0), Pose2D(1, 2, 0.1), -1.0), Pose2D(-1, -2, -0.1))


@FEW
@given(POSES, POSES)
def test_the_ends_are_exact(a: Pose2D, b: Pose2D) -> None:
    assert interpolate(a, b, 0.0) == a
    assert interpolate(a, b, 1.0) == b
