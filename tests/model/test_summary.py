"""What became of a log's scans."""

from __future__ import annotations

from dataclasses import replace

from mapcli.model.loop_check import LoopCheck
from mapcli.model.reason import Reason
from mapcli.model.summary import LIMIT_FIELDS, OF_THIS_RUN, ReplaySummary

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
        "unjoined": 0,
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


def test_what_loops_were_worth_is_in_the_document() -> None:
    check = LoopCheck(-0.75382, -0.26758, -0.2, 2)
    document = replace(SUMMARY, loop_check=check).document()
    assert document["loop_check"] == {
        "likelihood_without": -0.7538,
        "likelihood_found": -0.2676,
        "likelihood_kept": -0.2,
        "dropped": 2,
    }
    told = "a beam's log-likelihood is -0.20, without loops -0.75"
    assert check.text() == f"{told}; 2 more were dropped, with which it was -0.27"
    assert replace(check, dropped=0).text() == told


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


def test_only_what_depends_on_the_machine_is_in_no_document() -> None:
    assert set(LIMIT_FIELDS) - set(SUMMARY.document()) == set(OF_THIS_RUN)
