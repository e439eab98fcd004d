"""Relations from pairs of scans at places visited twice: the consistency of a trace without ground
truth.

Where the robot came back to a place, two scans see the same walls. Scan-to-scan matching, with
nothing of the map between, measures the motion from one visit to the other; the trace only says
which scans to match and the centre of the search window. Uncertain matches are left out: too
little overlap, an unconstrained direction (a corridor), or another result when the two scans change
roles. A trace that is inconsistent by more than the window has no such pairs, which shows in their
number.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mapcli.algorithms.evaluation.revisited_places import (
    SAME_STAMP_S,
    Pair,
    Visit,
    revisited_pairs,
    stamps_of,
)
from mapcli.algorithms.evaluation.scan_alignment import align_scans
from mapcli.algorithms.evaluation.self_check_parameters import SelfCheckParameters
from mapcli.algorithms.evaluation.trajectory_error import nearest_stamps
from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.algorithms.scans.perception import Perception, PerceptionParameters, perceive
from mapcli.algorithms.slam.sweep_search import SweepSearch
from mapcli.errors import DataError
from mapcli.model.evaluation import Errors, Evaluation
from mapcli.model.pose import Pose2D, interpolate
from mapcli.model.scan import Record
from mapcli.model.trajectory import Poses, Relations, Stamps, Trajectory, between


class RecordedTrace(NamedTuple):
    """A trace, the records that it was made from, and its name for errors."""

    trace: Trajectory
    records: Iterable[Record]
    name: str | None = None


@dataclass(frozen=True, eq=False)
class MeasuredPairs:
    """What pairs of scans, of one trace or of several in one frame, measured.

    Attributes:
        traces: that the pairs number.
        pairs: all that were tried.
        measured: of those that could be aligned, the pose of the later scan as seen from the
            earlier.
    """

    traces: Sequence[Trajectory]
    pairs: Sequence[Pair]
    measured: Mapping[Pair, Pose2D]
    parameters: SelfCheckParameters

    def evaluation(self, number: int) -> Evaluation:
        """Of one trace: the pairs that it takes part in, with itself and with others.

        Raises:
            DataError: there are none, or none that could be aligned.
        """
        p = self.parameters
        total = sum(number in _traces_of(pair) for pair in self.pairs)
        if not total:
            raise DataError(
                f"no place is visited twice: no two poses are within {p.near_m:g} m of each other "
                f"and {p.apart_m:g} m of driving apart",
                expected="a trace with closed loops",
            )
        pairs = [pair for pair in self.measured if number in _traces_of(pair)]
        if not pairs:
            raise DataError(
                f"none of the {total} pairs of scans at places visited twice can be aligned",
                expected="scans that see the same walls, and a trace that is right by 2 m there",
            )
        (first, first_ns), (second, second_ns) = (self._visits(pairs, side) for side in (0, 1))
        motions = np.array([(m.x, m.y, m.theta) for m in map(self.measured.__getitem__, pairs)])
        trace = self.traces[number]
        mine = [max(pose for of, pose in pair if of == number) for pair in pairs]
        errors = Errors.of(motions, between(first, second), trace.seconds()[mine])
        return Evaluation(
            kind="self-check",
            errors={"self_check": errors},
            matched=len(pairs),
            total=total,
            association="those that can be aligned for certain",
            trace=trace,
            relations=Relations(first_ns, second_ns, motions),
        )

    def _visits(self, pairs: Sequence[Pair], side: int) -> tuple[Poses, Stamps]:
        """The poses and stamps of the earlier (0) or later (1) scans."""
        visits = [pair[side] for pair in pairs]
        poses = [self.traces[trace].poses[pose] for trace, pose in visits]
        stamps = [stamps_of(self.traces[trace])[pose] for trace, pose in visits]
        return np.array(poses), np.array(stamps, dtype=np.int64)


def self_check(
    trace: Trajectory,
    records: Iterable[Record],
    parameters: SelfCheckParameters | None = None,
) -> Evaluation:
    """How well the relative poses of a trace agree with those that pairs of its scans measure.

    Raises:
        DataError: a trace without times or without a place visited twice, scans of another log,
            or not one pair that can be aligned.
    """
    return self_checks([RecordedTrace(trace, records)], parameters).evaluation(0)


def self_checks(
    recorded: Sequence[RecordedTrace], parameters: SelfCheckParameters | None = None
) -> MeasuredPairs:
    """The same of several traces in one frame, each held against itself and the others.

    Raises:
        DataError: a trace without times, or whose log has none of its scans; with its name.
    """
    p = parameters or SelfCheckParameters()
    for trace, _, name in recorded:
        if trace.stamps_ns is None:
            expected = "times, to find its scans by"
            raise DataError("the trace has no times", file=name, expected=expected)
    traces = [trace for trace, _, _ in recorded]
    pairs = revisited_pairs(traces, p)
    scans: dict[Visit, Perception] = {}
    for number, (trace, records, name) in enumerate(recorded):
        wanted = sorted({pose for pair in pairs for of, pose in pair if of == number})
        if wanted:
            own = _scans_of(trace, records, wanted, name)
            scans |= {(number, pose): scan for pose, scan in own.items()}
    measured = {pair: found for pair in pairs if (found := _relation(traces, scans, pair, p))}
    return MeasuredPairs(traces, pairs, measured, p)


def _traces_of(pair: Pair) -> tuple[int, int]:
    return pair[0][0], pair[1][0]


def _scans_of(
    trace: Trajectory, records: Iterable[Record], wanted: list[int], name: str | None
) -> dict[int, Perception]:
    """Index of a pose -> its scan, of those wanted.

    Raises:
        DataError: the log has none of them.
    """
    stamps, scans = stamps_of(trace)[wanted], dict[int, Perception]()
    for scan, _ in odometry_at_scans(SweepSearch().settled(records)):
        at, _ = nearest_stamps(stamps, np.array([scan.stamp_ns]), SAME_STAMP_S)
        if len(at):
            scans[wanted[int(at[0])]] = perceive(scan, PerceptionParameters())
    if not scans:
        raise DataError(
            "no scan of the log has the stamp of a pose",
            file=name,
            expected="the log that the trace was made from",
        )
    return scans


def _relation(
    traces: Sequence[Trajectory],
    scans: Mapping[Visit, Perception],
    pair: Pair,
    p: SelfCheckParameters,
) -> Pose2D | None:
    """The pose of the later scan in the frame of the earlier; None if the match is uncertain or the
    two directions of matching differ."""
    earlier, later = pair
    if earlier not in scans or later not in scans:
        return None
    a, b = (Pose2D(*map(float, traces[of].poses[pose])) for of, pose in pair)
    forth = align_scans(scans[earlier], scans[later], a.between(b), p)
    back = align_scans(scans[later], scans[earlier], b.between(a), p)
    if forth is None or back is None:
        return None
    back = back.inverse()
    left = forth.between(back)
    if math.hypot(left.x, left.y) > p.reverse_m or abs(left.theta) > math.radians(p.reverse_deg):
        return None
    return interpolate(forth, back, 0.5)
