"""Where scans do not tell, and how far odometry errs, in cases made by hand."""

from __future__ import annotations

import math

import pytest

from mapcli.algorithms.slam.contradictions import Agreement
from mapcli.algorithms.slam.sliding import (
    STRETCH_M,
    USUAL_SHARE,
    error_over,
    headings_are_fixed,
    odometry_error,
    sliding_stretches,
)
from mapcli.model.pose import Pose2D
from mapcli.model.trace import TracedPose


def test_headings_are_fixed_if_each_scan_of_the_stretches_fixes_its_own() -> None:
    scans = [Agreement(10 * k, 0.0, 0.0, fixed_heading=k != 4) for k in range(10)]
    assert headings_are_fixed(scans, [(0, 30), (50, 90)])
    assert not headings_are_fixed(scans, [(0, 30), (40, 60)])


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


def test_where_walls_tell_the_heading_only_the_way_is_asked() -> None:
    # One wheel slips for 5 m: a metre counts as 1.2, and turns by 0.3 rad. Then 10 m are silent.
    odoms: list[Pose2D | None] = [Pose2D()]
    for k in range(60):
        last = odoms[-1]
        assert last is not None
        odoms.append(last.compose(Pose2D(1.2, 0.0, 0.3) if 20 <= k < 25 else Pose2D(1.0)))
    way = driven(odoms)
    squares = 2 * (0.2**2 + 0.4**2 + 0.6**2 + 0.8**2) + 1.0
    told = odometry_error(*way, with_headings=False)
    assert told == pytest.approx(math.sqrt(squares / 56))
    assert odometry_error(*way) > 2 * told
    odoms[40:50] = [None] * 10
    kept = odometry_error(*driven(odoms), with_headings=False)
    assert kept == pytest.approx(math.sqrt((squares + 25 * 15) / 56))


def test_without_odometry_nothing_is_known() -> None:
    assert odometry_error(*driven([None] * 20)) == pytest.approx(STRETCH_M)
    assert odometry_error(*driven([None] * 3)) == USUAL_SHARE * STRETCH_M


def test_errors_add_up_as_their_squares() -> None:
    assert error_over(0.0, 1.0) == 0
    assert error_over(1.0, 1.0) == pytest.approx(0.2)
    assert error_over(20.0, 1.0) == pytest.approx(2.0)
    assert error_over(4.0, 7000.0) == 4.0  # millimetres
