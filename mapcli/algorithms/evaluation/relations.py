"""How good a trajectory is, by relations between its poses that were measured otherwise.

These are the relations of Kuemmerle et al. 2009, "On measuring the accuracy of SLAM algorithms":
they need no alignment and do not care where an error happened. Their numbers are mean and
standard deviation of the translation and of the rotation that are left.
"""

from __future__ import annotations

import numpy as np

from mapcli.errors import DataError
from mapcli.model.counting import counted
from mapcli.model.evaluation import Errors, Evaluation, Kind
from mapcli.model.trajectory import (
    Poses,
    Relations,
    Stamps,
    Trajectory,
    between,
    compose,
    interpolated,
)

SLACK_NS = 200
"""Relations name stamps of the log with microseconds; less than half of one is rounding."""


def evaluate_relations(
    trace: Trajectory,
    relations: Relations,
    odometry: Trajectory | None = None,
    kind: Kind = "relations",
) -> Evaluation:
    """What is left between measured relations and those between the trace's poses.

    Args:
        odometry: with it, the pose between two of the trace's is the one before, composed with
            the odometry since; without, it is interpolated between the two.

    Raises:
        DataError: a trace without times, or that covers none of the relations.
    """
    stamps = trace.stamps_ns
    if stamps is None:
        raise DataError("the trace has no times", expected="times, to find the relations' poses by")
    inside = [
        (t >= stamps[0] - SLACK_NS) & (t <= stamps[-1] + SLACK_NS)
        for t in (relations.from_ns, relations.to_ns)
    ]
    used = np.flatnonzero(inside[0] & inside[1])
    if not len(used):
        raise DataError(
            f"covers none of {counted(len(relations), 'relations')}: it has {trace.span()}",
            expected="a trace of the log that the relations belong to",
        )
    kept = Relations(relations.from_ns[used], relations.to_ns[used], relations.poses[used])
    found = between(poses_at(kept.from_ns, trace, odometry), poses_at(kept.to_ns, trace, odometry))
    seconds = (np.maximum(kept.from_ns, kept.to_ns) - stamps[0]) * 1e-9
    measure = "relations" if kind == "relations" else "self_check"
    bridged = "interpolated" if odometry is None else "the last one carried on by odometry"
    return Evaluation(
        kind=kind,
        errors={measure: Errors.of(kept.poses, found, seconds)},
        matched=len(used),
        total=len(relations),
        how=f"between the trace's poses: {bridged}",
        trace=trace,
        relations=kept,
    )


def poses_at(moments: Stamps, trace: Trajectory, odometry: Trajectory | None) -> Poses:
    """The poses at any moments within the trace, shape (k, 3); see `evaluate_relations`."""
    if odometry is None:
        return interpolated(moments, trace)
    stamps = trace.stamps_ns
    assert stamps is not None, "a trace with times"
    last = np.maximum(np.searchsorted(stamps, moments + SLACK_NS, side="right") - 1, 0)
    since = between(interpolated(stamps[last], odometry), interpolated(moments, odometry))
    return compose(trace.poses[last], since)
