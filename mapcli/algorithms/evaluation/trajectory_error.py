"""ATE and RPE of a trajectory against a reference trajectory.

ATE (absolute trajectory error) and RPE (relative pose error) are those of Sturm et al. 2012, "A
benchmark for the evaluation of RGB-D SLAM systems", with the same definitions as the tool evo, so
that numbers can be compared.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import DataError
from mapcli.model.counting import counted
from mapcli.model.evaluation import Errors, Evaluation
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.trajectory import (
    Poses,
    Stamps,
    Trajectory,
    between,
    interpolated,
    moved,
)

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class EvaluateParameters:
    """How a trace is held against a reference.

    Attributes:
        max_diff_s: poses whose stamps differ by no more are taken at the same moment.
        interpolate_s: if set, the reference is interpolated at the stamps of the trace instead,
            between poses that are no more seconds apart than this.
        delta: RPE compares motions over so many poses or metres.
        delta_unit: `f` for poses (frames), or `m` for metres along the trace's path.
    """

    max_diff_s: float = 0.01
    interpolate_s: float | None = None
    delta: float = 1.0
    delta_unit: str = "f"


class Association(NamedTuple):
    """Which poses of a trace and of its reference are of the same moment.

    Attributes:
        truth: the reference's poses, shape (n, 3).
        mine: indices of the trace's poses, shape (n,).
        total: how many there could be at most.
        method: how they were associated; for people.
    """

    truth: Poses
    mine: Indices
    total: int
    method: str


def evaluate_trajectory(
    trace: Trajectory,
    reference: Trajectory,
    parameters: EvaluateParameters | None = None,
    alignment: Pose2D | None = None,
) -> Evaluation:
    """ATE after the best rigid alignment in the plane, without scaling; and RPE.

    Args:
        alignment: the motion to align the trace by, where it is not to be its own best one
            (`common_alignment`).

    Raises:
        DataError: fewer than two poses can be compared, or no two that are `delta` apart.
    """
    parameters = parameters or EvaluateParameters()
    truth, mine, total, method = associate(trace, reference, parameters)
    found = trace.poses[mine]
    motion = alignment or rigid_alignment(found[:, :2], truth[:, :2])
    aligned, seconds = moved(found, motion), trace.seconds()[mine]
    first, second = rpe_pairs(found, parameters)
    rpe = Errors.of(
        between(truth[first], truth[second]), between(found[first], found[second]), seconds[second]
    )
    stamps = None if trace.stamps_ns is None else trace.stamps_ns[mine]
    return Evaluation(
        kind="trajectory",
        errors={"ate": Errors.of(truth, aligned, seconds), "rpe": rpe},
        matched=len(mine),
        total=total,
        association=method,
        trace=Trajectory(moved(trace.poses, motion), trace.stamps_ns),
        reference=Trajectory(truth, stamps),
        aligned=motion,
        overlap_s=_overlap_s(trace, reference),
    )


def common_alignment(traces: Sequence[Trajectory], associations: Sequence[Association]) -> Pose2D:
    """The best rigid motion of all traces at once: of those that share a frame.

    Args:
        associations: of each trace with the reference, at least one.
    """
    pairs = zip(traces, associations, strict=True)
    found = np.concatenate([trace.poses[associated.mine, :2] for trace, associated in pairs])
    truth = np.concatenate([associated.truth[:, :2] for associated in associations])
    return rigid_alignment(found, truth)


def associate(
    trace: Trajectory, reference: Trajectory, parameters: EvaluateParameters
) -> Association:
    """Associate poses by nearest stamps, by interpolation of the reference, or by index where
    either has no times.

    Raises:
        DataError: fewer than two poses.
    """
    if trace.stamps_ns is None or reference.stamps_ns is None:
        if len(trace) != len(reference):
            raise DataError(
                f"without times in both, poses are compared by index, but there are {len(trace):,} "
                f"in the trace and {len(reference):,} in the reference",
                expected="equally many",
            )
        every = np.arange(len(trace))
        found = Association(reference.poses, every, len(trace), "by index")
    elif parameters.interpolate_s is not None:
        gap = parameters.interpolate_s
        mine = within_gaps(trace.stamps_ns, reference.stamps_ns, gap)
        truth = interpolated(trace.stamps_ns[mine], reference)
        method = f"reference interpolated over at most {gap:g} s"
        found = Association(truth, mine, len(trace), method)
    else:
        mine, other = nearest_stamps(trace.stamps_ns, reference.stamps_ns, parameters.max_diff_s)
        method = f"by stamps at most {parameters.max_diff_s:g} s apart"
        total = min(len(trace), len(reference))
        found = Association(reference.poses[other], mine, total, method)
    if len(found.mine) < 2:
        raise _no_match(trace, reference, found)
    return found


def _overlap_s(trace: Trajectory, reference: Trajectory) -> float | None:
    """The time that both cover; negative where one begins after the other has ended."""
    if trace.stamps_ns is None or reference.stamps_ns is None:
        return None
    start = max(int(trace.stamps_ns[0]), int(reference.stamps_ns[0]))
    return (min(int(trace.stamps_ns[-1]), int(reference.stamps_ns[-1])) - start) * 1e-9


def _no_match(trace: Trajectory, reference: Trajectory, found: Association) -> DataError:
    matched = len(found.mine)
    if trace.stamps_ns is None or reference.stamps_ns is None:
        return DataError(f"only {counted(matched, 'poses')} to compare", expected="at least two")
    return DataError(
        f"{counted(matched, 'poses')} matched {found.method}: the trace has {trace.span()}, "
        f"the reference {reference.span()}",
        expected="at least two, of one recording and clock, or stamps that may differ by more",
    )


def nearest_stamps(mine: Stamps, other: Stamps, max_diff_s: float) -> tuple[Indices, Indices]:
    """For each stamp of the shorter list the nearest of the longer, if it is near enough.

    Returns indices into `mine` and into `other`; one of the longer may be named more than once.
    """
    if len(other) <= len(mine):
        long, short = _nearest_in(other, mine, max_diff_s)
        return long, short
    other_at, mine_at = _nearest_in(mine, other, max_diff_s)
    return mine_at, other_at


def _nearest_in(short: Stamps, long: Stamps, max_diff_s: float) -> tuple[Indices, Indices]:
    """Indices into `long`, and into `short`."""
    after = np.clip(np.searchsorted(long, short, side="right"), 1, max(len(long) - 1, 1))
    after = np.minimum(after, len(long) - 1)
    before = np.maximum(after - 1, 0)
    best = np.where(np.abs(long[after] - short) < np.abs(short - long[before]), after, before)
    near = np.flatnonzero(np.abs(long[best] - short) <= round(max_diff_s * 1e9))
    return best[near], near


def within_gaps(stamps: Stamps, known: Stamps, gap_s: float) -> Indices:
    """Indices of the stamps between two known ones that are at most `gap_s` apart."""
    after = np.searchsorted(known, stamps, side="left")
    inside = (stamps >= known[0]) & (stamps <= known[-1])
    after = np.clip(after, 0, len(known) - 1)
    gaps = known[after] - known[np.maximum(after - 1, 0)]
    exact = known[after] == stamps
    return np.flatnonzero(inside & (exact | (gaps <= round(gap_s * 1e9))))


def rigid_alignment(found: NDArray[np.float64], truth: NDArray[np.float64]) -> Pose2D:
    """The rigid motion of the plane that takes points nearest to others (Umeyama 1991, scale 1).

    Both shape (n, 2). In the plane the turn is known in closed form; unlike in space, there is no
    mirror image to be taken for it, however straight the path is.
    """
    centre, goal = found.mean(axis=0), truth.mean(axis=0)
    a, b = found - centre, truth - goal
    sine = float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
    turn = Pose2D(0.0, 0.0, wrap_angle(math.atan2(sine, float((a * b).sum()))))
    x, y = turn.apply(centre[None, :])[0]
    return Pose2D(float(goal[0] - x), float(goal[1] - y), turn.theta)


def rpe_pairs(poses: Poses, parameters: EvaluateParameters) -> tuple[Indices, Indices]:
    """Pairs of poses that are `delta` apart, each beginning where the one before ended.

    Raises:
        DataError: there are none.
    """
    if parameters.delta_unit == "f":
        chosen = np.arange(0, len(poses), max(int(parameters.delta), 1))
    else:
        chosen = np.array(_every_metres(poses, parameters.delta), dtype=np.intp)
    if len(chosen) < 2:
        raise DataError(
            f"no two poses are {parameters.delta:g} "
            f"{'poses' if parameters.delta_unit == 'f' else 'm'} apart",
            expected="a smaller distance for the RPE",
        )
    return chosen[:-1], chosen[1:]


def _every_metres(poses: Poses, metres: float) -> list[int]:
    """The first pose, and each one that is so far along the path from the last chosen."""
    chosen, driven = [0], 0.0
    for k, step in enumerate(np.hypot(*np.diff(poses[:, :2], axis=0).T), start=1):
        driven += float(step)
        if driven >= metres:
            chosen.append(k)
            driven = 0.0
    return chosen
