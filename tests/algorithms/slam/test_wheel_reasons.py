"""When the wheels failed, told as spans."""

from __future__ import annotations

from mapcli import Pose2D
from mapcli.algorithms.slam.odometry_faults import Hypothesis
from mapcli.algorithms.slam.wheel_reasons import wheel_reasons
from mapcli.model.scan import NANOSECONDS
from mapcli.model.trace import TracedPose


def spans(failures: dict[int, Hypothesis]) -> list[tuple[float, float, str]]:
    """Of a log of 40 s with a scan a quarter of a second."""
    poses = [
        TracedPose(5 + k * NANOSECONDS // 4, Pose2D(), None, 1.0, "matched") for k in range(160)
    ]
    reasons = list(wheel_reasons(poses, failures))
    assert {(one.kind, one.verdict) for one in reasons} <= {("wheels_failed", "good")}
    return [(one.from_s, one.to_s, one.text) for one in reasons]


BACKWARDS = "the wheels counted backwards, and were not believed"
NOTHING = "the wheels counted nothing while the robot drove on, and were not believed"


def test_each_failure_is_a_span_from_where_it_began() -> None:
    failures = dict.fromkeys([*range(40, 61), *range(100, 109)], "reversed")
    assert spans(failures) == [(9.75, 15.0, BACKWARDS), (24.75, 27.0, BACKWARDS)]


def test_short_breaks_part_no_failure_but_another_kind_does() -> None:
    failures = dict.fromkeys([*range(40, 45), *range(50, 61)], "reversed")
    failures |= dict.fromkeys(range(61, 71), "keeps going")
    assert spans(failures) == [(9.75, 15.0, BACKWARDS), (15.0, 17.5, NOTHING)]


def test_a_reading_that_was_missed_is_no_failure_of_the_wheels() -> None:
    assert spans({40: "keeps going"}) == []
    assert spans({}) == []
