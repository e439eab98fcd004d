"""Clocks of scans and odometry that differ."""

from __future__ import annotations

import numpy as np
import pytest

from mapcli.algorithms.evaluation.log_reasons import clock_reasons
from mapcli.model.clock import ScansOutside
from mapcli.model.pose import Pose2D
from mapcli.model.scan import NANOSECONDS, Odometry, RangeScan


def outside(scans: range, odometry: range) -> ScansOutside:
    """One record a second."""
    found = ScansOutside()
    ranges = np.ones(3, dtype=np.float32)
    records = [RangeScan(t * NANOSECONDS, 0.0, 0.1, ranges) for t in scans]
    wheels = [Odometry(t * NANOSECONDS, Pose2D()) for t in odometry]
    for record in sorted([*records, *wheels], key=lambda one: one.stamp_ns):
        found.add(record)
    return found


@pytest.mark.parametrize(
    ("scans", "odometry", "share"),
    [
        (range(100), range(100), 0.0),
        (range(100), range(60), 0.4),
        (range(100), range(60, 100), 0.6),
        (range(100), range(250, 350), 1.0),
        (range(250, 350), range(100), 1.0),
        (range(100), range(0), 0.0),  # without odometry none is outside
        (range(0), range(100), 0.0),
    ],
)
def test_scans_outside_the_odometry(scans: range, odometry: range, share: float) -> None:
    found = outside(scans, odometry)
    assert found.share == pytest.approx(share, abs=0.011)
    reasons = list(clock_reasons(None, found, 99.0))
    assert [one.verdict for one in reasons] == ["doubtful"] * (share > 0.5)


@pytest.mark.parametrize(
    ("recorded_after", "text"),
    [
        ((0.05, 0.9), None),
        (
            (-250.0, 0.01),
            "scans were recorded 250.0 s before their stamps, odometry 0.0 s after its: "
            "their clocks differ",
        ),
    ],
)
def test_delays_that_differ(recorded_after: tuple[float, float], text: str | None) -> None:
    reasons = list(clock_reasons(recorded_after, ScansOutside(), 99.0))
    assert [one.text for one in reasons] == ([text] if text else [])
    assert {(one.kind, one.remedy, one.verdict) for one in reasons} <= {
        ("clocks_differ", "--time-source log", "doubtful")
    }
