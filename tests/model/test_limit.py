"""Limits on what a command found."""

from __future__ import annotations

import pytest

from mapcli.errors import DataError, QualityError
from mapcli.model.limit import Limit, limit_fields

FIELDS = limit_fields(
    ("used_share", "skipped", "mean_score", "loops", "odometry_jumps", "seconds", "verdict"),
    verdict=("good", "doubtful", "bad"),
)


def parsed(text: str) -> Limit:
    return Limit.parse(text, FIELDS, "used_share<0.95")


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
    assert parsed(text) == limit


@pytest.mark.parametrize(
    "text",
    ["", "used_share", "used_share<", "<0.5", "used_share=1", "used_share<>1", "used_share<one",
     "used_share<1.2.3", "used_share<nan", "0.5<used_share", "used share<1", "used_share<0.5 or 1"],
)  # fmt: skip
def test_what_is_no_limit(text: str) -> None:
    with pytest.raises(DataError, match=r"expected a limit such as 'used_share<0\.95'"):
        parsed(text)


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
        parsed(text)


def test_a_limit_on_the_verdict() -> None:
    limit = parsed("verdict!=good")
    limit.check({"verdict": "good"}, "a.mcap")
    with pytest.raises(QualityError) as failure:
        limit.check({"verdict": "bad"}, "a.mcap")
    assert str(failure.value) == "a.mcap: verdict is bad; expected not verdict!=good (--fail-if)"


def test_a_limit_on_nothing() -> None:
    with pytest.raises(
        DataError,
        match="'score<1': no 'score' in the summary; expected one of used_share, skipped, ",
    ):
        parsed("score<1")


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
