"""When the wheels failed, for people who have to look after them.

The map was made without them, and whether it may be trusted there is told by scans (`verdict`). So
wheels that failed do not make a map doubtful by themselves.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from mapcli.algorithms.slam.odometry_faults import Hypothesis
from mapcli.model.reason import Reason
from mapcli.model.scan import NANOSECONDS
from mapcli.model.trace import TracedPose

TEXTS: dict[Hypothesis, str] = {
    "reversed": "the wheels counted backwards",
    "keeps going": "the wheels counted nothing while the robot drove on",
}

SHORTEST_S = 0.5
"""Seconds that a failure takes at least: less is a reading that was missed."""

APART_S = 2.0
"""Seconds within which two failures of the same kind are one."""


def wheel_reasons(
    poses: Sequence[TracedPose], failures: Mapping[int, Hypothesis]
) -> Iterator[Reason]:
    """A reason for each time that the wheels failed.

    Args:
        poses: of every scan.
        failures: what was true of each scan's motion where odometry was not, by its number.
    """
    seconds = [(pose.stamp_ns - poses[0].stamp_ns) / NANOSECONDS for pose in poses]
    for scans in _spans(seconds, failures):
        # The first of the motions began at the scan before.
        begin, end = seconds[max(scans[0] - 1, 0)], seconds[scans[-1]]
        if end - begin >= SHORTEST_S:
            text = f"{TEXTS[failures[scans[0]]]}, and were not believed"
            yield Reason("wheels_failed", begin, end, text, "", "good")


def _spans(seconds: Sequence[float], failures: Mapping[int, Hypothesis]) -> Iterator[list[int]]:
    """Scans at which the same failed, without long breaks."""
    span: list[int] = []
    for scan in sorted(failures):
        if span and (
            failures[scan] != failures[span[0]] or seconds[scan] - seconds[span[-1]] > APART_S
        ):
            yield span
            span = []
        span.append(scan)
    if span:
        yield span
