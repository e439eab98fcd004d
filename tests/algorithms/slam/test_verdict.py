"""What speaks against a map, in cases made by hand: a scan a second, a metre apart."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mapcli.algorithms.slam.contradictions import Agreement
from mapcli.algorithms.slam.verdict import UNSEEN_M, map_reasons, verdict_of
from mapcli.model.pose import Pose2D
from mapcli.model.reason import Reason, Verdict
from mapcli.model.trace import Status, TracedPose


def driven(count: int, alone: range = range(0)) -> list[TracedPose]:
    def status(k: int) -> Status:
        return "odometry" if k in alone else "matched"

    return [
        TracedPose(5_000_000_000 + k * 1_000_000_000, Pose2D(float(k)), None, 0.9, status(k))
        for k in range(count)
    ]


def agreements(count: int, against: range = range(0)) -> list[Agreement]:
    return [Agreement(k, 0.5 if k in against else 0.02, 0.0) for k in range(count)]


def reasons(
    poses: list[TracedPose], found: list[Agreement], remedy: str = ""
) -> tuple[Reason, ...]:
    return map_reasons(poses, found, remedy)


def test_a_map_that_agrees_with_itself_is_good() -> None:
    assert reasons(driven(100), agreements(100)) == ()
    assert verdict_of(()) == "good"


@pytest.mark.parametrize(
    ("against", "verdict"),
    [(range(2), "good"), (range(20, 24), "doubtful"), (range(20, 30), "bad")],
)
def test_contradictions_count_by_their_share(against: range, verdict: Verdict) -> None:
    found = reasons(driven(100), agreements(100, against))
    assert verdict_of(found) == verdict
    if found:
        assert found[0].kind == "walls_twice"
        assert (found[0].from_s, found[0].to_s) == (against[0], against[-1])
        assert found[0].remedy == "--same-place T,20.0"


def test_spans_are_parted_where_nothing_contradicts_for_a_while() -> None:
    found = agreements(100)
    for k in (10, 11, 18, 40, 41):
        found[k] = Agreement(k, 0.9, 0.0)
    spans = [(one.from_s, one.to_s) for one in reasons(driven(100), found)]
    assert spans == [(10, 18), (40, 41)]
    assert reasons(driven(100), found, "--loop-closing")[0].remedy == "--loop-closing"


def test_what_a_person_may_tell() -> None:
    """There and back: the scan at 149 s is 1 m from where the robot was at 50 s."""
    there = driven(100)
    back = [
        replace(one, stamp_ns=(105 + k) * 10**9, pose=Pose2D(one.pose.x, 1.0))
        for k, one in enumerate(reversed(there))
    ]
    found = [Agreement(k, 0.5 if 149 <= k < 170 else 0.0, 0.0) for k in range(200)]
    (twice,) = reasons([*there, *back], found)
    assert twice.remedy == "--same-place 50.0,149.0"
    assert map_reasons([*there, *back], found, may_be_told=False)[0].remedy == ""


def test_scans_nearby_tell_that_tracking_was_lost() -> None:
    found = [Agreement(k, None, 0.5 if 50 <= k < 70 else 0.0) for k in range(100)]
    (torn,) = reasons(driven(100), found)
    assert (torn.kind, torn.verdict, torn.from_s, torn.to_s) == ("torn", "bad", 50, 69)


@pytest.mark.parametrize(("share", "verdict"), [(0.25, "good"), (0.4, "doubtful"), (0.7, "bad")])
def test_a_robot_that_was_carried_contradicts_what_was_seen_just_before(
    share: float, verdict: Verdict
) -> None:
    """Once is enough: few scans are near the place."""
    found = [Agreement(k, None, 0.0, onward=share if k in (50, 51) else 0.1) for k in range(100)]
    torn = reasons(driven(100), found)
    assert verdict_of(torn) == verdict
    assert [(one.kind, one.from_s, one.to_s) for one in torn] == [("torn", 50, 51)] * len(torn)


def test_a_stretch_by_odometry_alone_is_doubtful() -> None:
    (alone,) = reasons(driven(100, range(30, 34)), agreements(100))
    assert (alone.kind, alone.from_s, alone.to_s) == ("odometry_alone", 29, 33)
    assert alone.text == "4 m by odometry alone: no scan fitted the map"
    assert verdict_of([alone]) == "doubtful"


def test_odometry_that_scans_nearby_confirm_is_good_where_none_was_searched_for() -> None:
    poses = driven(100, range(100))
    assert map_reasons(poses, agreements(100), is_searched=False) == ()
    blind = [replace(one, fixed_near=one.scan not in range(30, 34)) for one in agreements(100)]
    alone = map_reasons(poses, blind, is_searched=False)[0]
    assert (alone.kind, alone.from_s, alone.to_s) == ("odometry_alone", 29, 34)
    assert alone.text == "5 m by odometry alone: no scan nearby fixes it"


def test_a_scan_by_odometry_alone_is_not() -> None:
    assert reasons(driven(100, range(30, 32)), agreements(100)) == ()


def test_where_scans_do_not_tell_odometry_decides() -> None:
    # Odometry that errs by half a metre in 5 m now and then; 30 m on which scans tell nothing.
    odom, x = [], 0.0
    for k in range(100):
        odom.append(Pose2D(x))
        x += 0.7 if k % 20 < 10 else 1.0
    poses = [replace(pose, odom=odom[k]) for k, pose in enumerate(driven(100))]
    found = agreements(100)
    for k in range(40, 71):
        found[k] = replace(found[k], fixed_apart=False, fixed_near=False)
    (sliding,) = reasons(poses, found)
    assert (sliding.kind, sliding.verdict) == ("sliding", "bad")
    assert (sliding.from_s, sliding.to_s) == (40, 70)
    assert sliding.text == (
        "30 m on which scans fit half a metre away as well: the map may be off by 1.6 m"
    )
    # Where another visit fixes scans in between, the parts stand alone.
    for k in (50, 51, 60, 61):
        found[k] = replace(found[k], fixed_apart=True, fixed_near=True)
    assert {one.verdict for one in reasons(poses, found)} == {"doubtful"}
    # With odometry as good as the map nothing is wrong.
    assert reasons([replace(pose, odom=pose.pose) for pose in poses], found) == ()


def test_a_long_way_of_which_nothing_is_seen_again_is_doubtful() -> None:
    length = int(UNSEEN_M) + 50
    found = [Agreement(k, 0.0 if k < 20 else None, 0.0) for k in range(length)]
    (unseen,) = reasons(driven(length), found)
    assert (unseen.kind, unseen.verdict) == ("unconfirmed", "doubtful")
    assert (unseen.from_s, unseen.to_s) == (19, length - 1)
    assert reasons(driven(100), [Agreement(k, None, 0.0) for k in range(100)]) == ()


def test_the_worst_reason_decides() -> None:
    doubtful = Reason("unconfirmed", 0, 1, "", "", "doubtful")
    assert verdict_of([doubtful, Reason("range_unit", 0, 1, "")]) == "bad"


def test_no_scans_no_reasons() -> None:
    assert map_reasons([], []) == ()
