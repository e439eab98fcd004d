"""What became of a log's scans, and limits on it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mapcli.errors import DataError, QualityError
from mapcli.model.reason import Reason
from mapcli.model.summary import LIMIT_FIELDS, Limit, ReplaySummary

SUMMARY = ReplaySummary(
    scans=8,
    used=6,
    matched=4,
    odometry=1,
    skipped={"scans without beams, skipped": 2},
    distance_m=12.34567,
    duration_s=60.0,
    loops=0,
    mean_score=0.87654321,
    odometry_jumps=3,
    odometry_faults=12,
    odometry_catch_ups=4,
    damage={"scans without beams, skipped": 2, "files cut short": 1},
    interrupted=False,
    verdict="bad",
    reasons=(Reason("range_unit", 0.0, 59.9, "far", "--less"),),
    lost_share=0.125,
    seconds=1.5,
)


def test_the_document_literally() -> None:
    assert SUMMARY.document() == {
        "scans": 8,
        "used": 6,
        "used_share": 0.75,
        "lost_share": 0.125,
        "matched": 4,
        "odometry": 1,
        "skipped": {"scans without beams, skipped": 2},
        "distance_m": 12.346,
        "duration_s": 60.0,
        "loops": 0,
        "mean_score": 0.8765,
        "odometry_jumps": 3,
        "odometry_faults": 12,
        "odometry_catch_ups": 4,
        "damage": {"scans without beams, skipped": 2, "files cut short": 1},
        "interrupted": False,
        "verdict": "bad",
        "reasons": [
            {"kind": "range_unit", "from_s": 0.0, "to_s": 59.9, "text": "far", "try": "--less"}
        ],
    }


def test_what_depends_on_the_machine_stays_out_of_documents() -> None:
    assert SUMMARY.document() == replace(SUMMARY, seconds=99.0).document()


def test_values_for_limits() -> None:
    numbers = SUMMARY.values()
    assert set(numbers) == set(LIMIT_FIELDS)
    assert numbers["skipped"] == 2
    assert numbers["damage"] == 3
    assert numbers["seconds"] == 1.5
    assert numbers["times_real_time"] == 40
    assert numbers["interrupted"] == 0
    assert numbers["verdict"] == "bad"


def test_nothing_at_all() -> None:
    nothing = ReplaySummary(0, 0, 0, 0, {}, 0.0, 0.0, 0, None, 0, 0, 0, {}, interrupted=True)
    assert nothing.used_share == 0
    assert nothing.times_real_time == 0
    assert nothing.document()["mean_score"] is None
    assert nothing.values()["mean_score"] == 0  # no match at all is no good match
    assert nothing.values()["interrupted"] == 1


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        ("used_share<0.95", Limit("used_share", "<", 0.95)),
        (" skipped >= 1e2 ", Limit("skipped", ">=", 100)),
        ("mean_score<=+.5", Limit("mean_score", "<=", 0.5)),
        ("loops==0", Limit("loops", "==", 0)),
        ("odometry_jumps!=-3", Limit("odometry_jumps", "!=", -3)),
        ("seconds>60", Limit("seconds", ">", 60)),
        ("verdict!=good", Limit("verdict", "!=", "good")),
        ("verdict == bad", Limit("verdict", "==", "bad")),
    ],
)
def test_limits_are_read(text: str, limit: Limit) -> None:
    assert Limit.parse(text) == limit


@pytest.mark.parametrize(
    "text",
    ["", "used_share", "used_share<", "<0.5", "used_share=1", "used_share<>1", "used_share<one",
     "used_share<1.2.3", "used_share<nan", "0.5<used_share", "used share<1", "used_share<0.5 or 1"],
)  # fmt: skip
def test_what_is_no_limit(text: str) -> None:
    with pytest.raises(DataError, match=r"expected a limit such as 'used_share<0\.95'"):
        Limit.parse(text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("verdict<good", "expected verdict== or verdict!=, since its values are words"),
        ("verdict==1", "expected one of good, doubtful, bad"),
        ("verdict!=fine", "expected one of good, doubtful, bad"),
        ("used_share==good", "expected a limit such as"),
    ],
)
def test_words_are_compared_with_words(text: str, expected: str) -> None:
    with pytest.raises(DataError, match=expected):
        Limit.parse(text)


def test_a_limit_on_the_verdict() -> None:
    limit = Limit.parse("verdict!=good")
    limit.check({"verdict": "good"}, "a.mcap")
    with pytest.raises(QualityError) as failure:
        limit.check(SUMMARY.values(), "a.mcap")
    assert str(failure.value) == "a.mcap: verdict is bad; expected not verdict!=good (--fail-if)"


def test_a_limit_on_nothing() -> None:
    with pytest.raises(
        DataError, match="'score<1': no 'score' in the summary; expected one of scans, used, "
    ):
        Limit.parse("score<1")


@pytest.mark.parametrize(
    ("comparison", "holds_at"),
    [("<", {1}), ("<=", {1, 2}), ("==", {2}), ("!=", {1, 3}), (">=", {2, 3}), (">", {3})],
)
def test_every_comparison(comparison: str, holds_at: set[int]) -> None:
    limit = Limit("used", comparison, 2)
    for value in (1, 2, 3):
        if value in holds_at:
            with pytest.raises(QualityError) as failure:
                limit.check({"used": value}, "a.mcap")
            assert str(failure.value) == (
                f"a.mcap: used is {value}; expected not used{comparison}2 (--fail-if)"
            )
        else:
            limit.check({"used": value}, "a.mcap")
