"""Which scans of a trace, or of several in one frame, were taken at the same place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.evaluation.self_check_parameters import SelfCheckParameters
from mapcli.model.trajectory import Stamps, Trajectory, wrap_angles

Visit = tuple[int, int]
"""The number of a trace, and the index of one of its poses."""

Pair = tuple[Visit, Visit]
"""The earlier first."""

SAME_STAMP_S = 0.001
"""Trajectories of other tools may have rounded the stamps of the scans."""


def revisited_pairs(traces: Sequence[Trajectory], parameters: SelfCheckParameters) -> list[Pair]:
    """Pairs of poses near each other in space but far apart along the path, spread over the logs.

    Traces are taken in the order of their first stamps; all that one before has seen is far apart
    from what the next one sees.

    Args:
        traces: with times, in one frame.
    """
    p = parameters
    order = sorted(range(len(traces)), key=lambda k: int(stamps_of(traces[k])[0]))
    visits = [(k, pose) for k in order for pose in range(len(traces[k]))]
    poses = np.concatenate([traces[k].poses for k in order])
    single = np.concatenate([_has_own_stamp(stamps_of(traces[k])) for k in order])
    driven, pairs = _driven([traces[k] for k in order], 2 * p.apart_m), []
    for later in np.flatnonzero(single)[:: max(len(poses) // (2000 * len(traces)), 1)].tolist():
        earlier = int(np.searchsorted(driven, driven[later] - p.apart_m, side="right"))
        distance = np.hypot(*(poses[:earlier, :2] - poses[later, :2]).T)
        # A scanner that looks ahead sees the same walls only when it faces the same way.
        turn = np.abs(wrap_angles(poses[:earlier, 2] - poses[later, 2]))
        cost = np.where(single[:earlier] & (distance <= p.near_m), distance + turn, np.inf)
        if earlier and np.isfinite(cost).any():
            pairs.append((visits[int(np.argmin(cost))], visits[later]))
    most = min(p.most * len(traces), len(pairs))
    chosen = np.linspace(0, len(pairs) - 1, most).round().astype(int)
    return [pairs[k] for k in dict.fromkeys(chosen.tolist())]


def _driven(traces: Sequence[Trajectory], apart_m: float) -> NDArray[np.float64]:
    """Metres up to each pose of all traces, with `apart_m` from one trace to the next."""
    parts, start = [], 0.0
    for trace in traces:
        parts.append(trace.driven() + start)
        start = float(parts[-1][-1]) + apart_m
    return np.concatenate(parts)


def stamps_of(trace: Trajectory) -> Stamps:
    assert trace.stamps_ns is not None, "a trace with times"
    return trace.stamps_ns


def _has_own_stamp(stamps: Stamps) -> NDArray[np.bool_]:
    """Which poses share their stamp with no other: only of these the scan is known."""
    single = np.ones(len(stamps), dtype=np.bool_)
    near = np.diff(stamps) <= 2e9 * SAME_STAMP_S
    single[1:] &= ~near
    single[:-1] &= ~near
    return single
