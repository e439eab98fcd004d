"""Do drives agree with each other in the map that they share, and each with itself?

Things move from one day to the next, so that a drive may see walls where another saw through, and
both are right. What a drive's own visits say of it counts as for a single drive; what others say
confirms it, and counts against it only where much of what it saw is not there for them.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace

from mapcli.algorithms.slam.contradictions import Agreement, compare_scans
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.scan_sample import sample_of_keyframes
from mapcli.algorithms.slam.verdict import CONTRADICTED
from mapcli.model.pose import Pose2D
from mapcli.model.reason import Reason
from mapcli.model.scan import NANOSECONDS
from mapcli.model.trace import TracedPose

MANY = 0.25
"""Share of a drive's scans that others contradict, from which on it lies wrongly on them, or next
to nothing is as it was."""


def compare_drives(
    parts: Sequence[TrackedTrajectory], poses: Sequence[Pose2D], begins: Sequence[int]
) -> list[list[Agreement]]:
    """How scans of each drive agree with those of all, by the numbers of its own scans.

    Args:
        parts: each drive in the map; poses: of all scans; begins: the first ones of each drive.
    """
    sampled = [
        replace(one, scan=begin + one.scan)
        for part, begin in zip(parts, begins, strict=True)
        for one in sample_of_keyframes(part.keyframes)
    ]
    own: list[list[Agreement]] = [[] for _ in parts]
    for one in compare_scans(sampled, poses, begins):
        k = bisect_right(begins, one.scan) - 1
        own[k].append(replace(one, scan=one.scan - begins[k]))
    return own


def confirmed_by(own: Sequence[Agreement], others: Sequence[Agreement]) -> list[Agreement]:
    """What a drive says of itself, where other drives may confirm a scan."""
    return [
        replace(
            one,
            apart=_least(one.apart, other.apart),
            fixed_apart=one.fixed_apart or other.fixed_apart,
        )
        for one, other in zip(own, others, strict=True)
    ]


def _least(own: float | None, others: float | None) -> float | None:
    """The lesser contradicted share; what others contradict alone is none."""
    if own is None:
        return others if others is not None and others <= CONTRADICTED else None
    return own if others is None else min(own, others)


def with_names(reason: Reason, drive: str) -> Reason:
    """A reason whose line to try names the drive at its times, as is needed where there are
    several."""
    times = r"(--same-place |--trust-odometry |,)(?=[\dT])"
    return replace(reason, remedy=re.sub(times, rf"\g<1>{drive}:", reason.remedy))


def drive_reasons(
    poses: Sequence[TracedPose], own: Sequence[Agreement], others: Sequence[Agreement]
) -> Iterator[Reason]:
    """Whether a drive lies wrongly on the others.

    Args:
        poses: of its scans; own, others: how some of them agree with its own visits, and with all.
    """
    compared = [(one, other) for one, other in zip(own, others, strict=True)
                if other.apart is not None]  # fmt: skip
    against = [
        other.scan for one, other in compared
        if (other.apart or 0.0) > CONTRADICTED >= (one.apart or 0.0)
    ]  # fmt: skip
    if not against or len(against) < MANY * len(compared):
        return
    begin = poses[0].stamp_ns
    first, last = ((poses[scan].stamp_ns - begin) / NANOSECONDS for scan in
                   (against[0], against[-1]))  # fmt: skip
    share = f"{100 * len(against) / len(compared):.0f} % of the scans"
    text = f"{share} see walls that other drives saw through: joined wrongly, or much has changed"
    yield Reason("walls_twice", first, last, text)
