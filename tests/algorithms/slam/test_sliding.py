"""Where scans do not tell, and how far odometry errs, in cases made by hand."""

from __future__ import annotations

import math

import pytest

from mapcli.algorithms.slam.contradictions import Agreement
from mapcli.algorithms.slam.sliding import (
    STRETCH_M,
    USUAL_SHARE,
    error_over,
    odometry_error,
    sliding_stretches,
)
from mapcli.model.pose import Pose2D
from mapcli.model.trace import TracedPose


def found(near: str, apart: str) -> list[Agreement]:
    """Scans 10, 20, 30...; x: its place is fixed."""
    marks = enumerate(zip(near, apart, strict=True), 1)
    return [Agreement(10 * k, 0.0, 0.0, b == "x", a == "x") for k, (a, b) in marks]


@pytest.mark.parametrize(
    ("near", "apart", "parts"),
    [
        ("xxxx", "....", []),
        ("x.x.x", ".....", []),  # fixed on both sides
        ("x...x..x", "........", [[(20, 40), (60, 70)]]),
        ("x...x..x", "....xx..", [[(20, 40)], [(60, 70)]]),
        ("x...x..x", "....x...", [[(20, 40), (60, 70)]]),  # by chance
        ("x...x..x", "xx....xx", [[(20, 40), (60, 70)]]),
        ("....", ".xx.", [[(10, 20)], [(20, 40)]]),
    ],
)
def test_stretches(near: str, apart: str, parts: list[list[tuple[int, int]]]) -> None:
    assert sliding_stretches(found(near, apart)) == parts


def driven(odoms: list[Pose2D | None]) -> tuple[list[TracedPose], list[float]]:
    """A scan every metre of a straight way."""
    poses = [TracedPose(k, Pose2D(float(k)), odom, 0.9, "matched") for k, odom in enumerate(odoms)]
    return poses, [float(k) for k in range(len(odoms))]


def test_what_odometry_always_errs_by_is_calibrated() -> None:
    scaled = [Pose2D(1.1 * k) for k in range(50)]
    assert odometry_error(*driven([*scaled])) == pytest.approx(0, abs=1e-9)


def test_wheels_that_stand_still_for_a_while_err() -> None:
    frozen = [Pose2D(float(k if k < 30 else 30 if k < 35 else k - 5)) for k in range(105)]
    # Over 5 m: short by 1, 2, 3, 4, 5, 4, 3, 2, 1 m where the nine stretches meet these five.
    squares = 2 * (1 + 4 + 9 + 16) + 25
    assert odometry_error(*driven([*frozen])) == pytest.approx(math.sqrt(squares / 100))


def test_without_odometry_nothing_is_known() -> None:
    assert odometry_error(*driven([None] * 20)) == pytest.approx(STRETCH_M)
    assert odometry_error(*driven([None] * 3)) == USUAL_SHARE * STRETCH_M


def test_errors_add_up_as_their_squares() -> None:
    assert error_over(0.0, 1.0) == 0
    assert error_over(1.0, 1.0) == pytest.approx(0.2)
    assert error_over(20.0, 1.0) == pytest.approx(2.0)
    assert error_over(4.0, 7000.0) == 4.0  # millimetres
