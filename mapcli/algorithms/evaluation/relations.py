"""The error of a trajectory by relations between its poses that were measured otherwise.

These are the relations of Kuemmerle et al. 2009, "On measuring the accuracy of SLAM algorithms":
they need no alignment and do not care where an error happened. Their numbers are mean and
standard deviation of the translation and of the rotation that are left.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mapcli.errors import DataError
from mapcli.model.counting import counted
from mapcli.model.evaluation import Errors, Evaluation
from mapcli.model.scan import Odometry, Record
from mapcli.model.trajectory import (
    Poses,
    Relations,
    Stamps,
    Trajectory,
    between,
    compose,
    interpolated,
)

STAMP_ROUNDING_NS = 200
"""Relations name stamps of the log with microseconds; less than half of one is rounding."""


def evaluate_relations(
    trace: Trajectory,
    relations: Relations,
    odometry: Trajectory | None = None,
) -> Evaluation:
    """Residuals between measured relations and those between the trace's poses.

    Args:
        odometry: with it, the pose between two of the trace's is the one before, composed with
            the odometry since; without, it is interpolated between the two.

    Raises:
        DataError: a trace without times, or that covers none of the relations.
    """
    stamps = trace.stamps_ns
    if stamps is None:
        raise DataError("the trace has no times", expected="times, to find the relations' poses by")
    kept = _covered(relations, stamps)
    if not len(kept):
        raise DataError(
            f"covers none of {counted(len(relations), 'relations')}: it has {trace.span()}",
            expected="a trace of the log that the relations belong to",
        )
    found = between(poses_at(kept.from_ns, trace, odometry), poses_at(kept.to_ns, trace, odometry))
    seconds = (np.maximum(kept.from_ns, kept.to_ns) - stamps[0]) * 1e-9
    bridged = "interpolated" if odometry is None else "the last one carried on by odometry"
    return Evaluation(
        kind="relations",
        errors={"relations": Errors.of(kept.poses, found, seconds)},
        matched=len(kept),
        total=len(relations),
        association=f"between the trace's poses: {bridged}",
        trace=trace,
        relations=kept,
    )


def _covered(relations: Relations, stamps: Stamps) -> Relations:
    """The relations whose both moments lie within the stamps of a trace."""
    inside = [
        (t >= stamps[0] - STAMP_ROUNDING_NS) & (t <= stamps[-1] + STAMP_ROUNDING_NS)
        for t in (relations.from_ns, relations.to_ns)
    ]
    used = np.flatnonzero(inside[0] & inside[1])
    return Relations(relations.from_ns[used], relations.to_ns[used], relations.poses[used])


def odometry_of(records: Iterable[Record]) -> Trajectory:
    """All odometry of a log, in the odometry's frame.

    Raises:
        DataError: there is none.
    """
    readings = [record for record in records if isinstance(record, Odometry)]
    if not readings:
        raise DataError("has no odometry")
    poses = np.array([(r.pose.x, r.pose.y, r.pose.theta) for r in readings])
    return Trajectory(poses, np.array([r.stamp_ns for r in readings], dtype=np.int64))


def poses_at(moments: Stamps, trace: Trajectory, odometry: Trajectory | None) -> Poses:
    """The poses at any moments within the trace, shape (k, 3); see `evaluate_relations`."""
    if odometry is None:
        return interpolated(moments, trace)
    stamps = trace.stamps_ns
    assert stamps is not None, "a trace with times"
    last = np.maximum(np.searchsorted(stamps, moments + STAMP_ROUNDING_NS, side="right") - 1, 0)
    since = between(interpolated(stamps[last], odometry), interpolated(moments, odometry))
    return compose(trace.poses[last], since)
