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
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.evaluation.relations import evaluate_relations
from mapcli.algorithms.evaluation.trajectory_error import nearest_stamps
from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.algorithms.scans.perception import Perception, PerceptionParameters, perceive
from mapcli.algorithms.slam.agreement import agreement
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.match import MIN_POINTS, MatchParameters
from mapcli.algorithms.slam.motion_model import OdometryUncertainty
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.scan_matcher import match_scan
from mapcli.algorithms.slam.scan_points import voxel_filtered
from mapcli.algorithms.slam.sweep_search import SweepSearch
from mapcli.errors import DataError
from mapcli.model.evaluation import Evaluation
from mapcli.model.pose import Pose2D, interpolate
from mapcli.model.scan import Record
from mapcli.model.se2_uncertainty import StandardDeviations
from mapcli.model.trajectory import Relations, Stamps, Trajectory, wrap_angles

Pair = tuple[int, int]
"""Indices of two poses of a trace, the earlier first."""

SAME_STAMP_S = 0.001
"""Trajectories of other tools may have rounded the stamps of the scans."""


@dataclass(frozen=True)
class SelfCheckParameters:
    """Which pairs of scans are matched, and when a match is accepted.

    Attributes:
        near_m: positions of a pair are at most so far from each other in the trace, metres.
        apart_m: between them the robot drove at least so far.
        most: pairs, at even intervals over the log.
        window_m, window_deg: half-widths of the search around the trace's relative pose.
        agreement: least agreement of the one scan with the map of the other, 0 to 1.
        shared: least share of the points of a scan that lie in known cells of the other's map.
        reverse_m, reverse_deg: largest difference of the two directions of matching.
        slide_m: the agreement must fall by `slide_loss` when a scan is shifted so far in any
            direction; in a corridor, an unconstrained direction, it does not.
    """

    near_m: float = 2.0
    apart_m: float = 10.0
    most: int = 200
    window_m: float = 2.0
    window_deg: float = 30.0
    agreement: float = 0.75
    shared: float = 0.5
    reverse_m: float = 0.03
    reverse_deg: float = 0.5
    slide_m: float = 0.25
    slide_loss: float = 0.15


MAP = MapParameters(blur=0.1)
"""The map of one scan is thin; a wider likelihood field lets the refinement find its walls."""


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
    p = parameters or SelfCheckParameters()
    pairs = revisited_pairs(trace, p)
    if not pairs:
        raise DataError(
            f"no place is visited twice: no two poses are within {p.near_m:g} m of each other "
            f"and {p.apart_m:g} m of driving apart",
            expected="a trace with closed loops",
        )
    scans = _scans_of(trace, records, sorted({k for pair in pairs for k in pair}))
    measured = {pair: found for pair in pairs if (found := _relation(trace, scans, pair, p))}
    if not measured:
        raise DataError(
            f"none of the {len(pairs)} pairs of scans at places visited twice can be aligned",
            expected="scans that see the same walls, and a trace that is right by 2 m there",
        )
    evaluation = evaluate_relations(trace, _relations(trace, measured))
    return replace(
        evaluation,
        kind="self-check",
        errors={"self_check": evaluation.errors["relations"]},
        total=len(pairs),
        association="those that can be aligned for certain",
    )


def revisited_pairs(trace: Trajectory, parameters: SelfCheckParameters) -> list[Pair]:
    """Pairs of poses near each other in space but far apart along the path, spread over the log.

    Raises:
        DataError: a trace without times.
    """
    if trace.stamps_ns is None:
        raise DataError("the trace has no times", expected="times, to find its scans by")
    p, poses, driven = parameters, trace.poses, trace.driven()
    single, pairs = _has_own_stamp(trace.stamps_ns), []
    for later in np.flatnonzero(single)[:: max(len(trace) // 2000, 1)].tolist():
        earlier = int(np.searchsorted(driven, driven[later] - p.apart_m, side="right"))
        distance = np.hypot(*(poses[:earlier, :2] - poses[later, :2]).T)
        # A scanner that looks ahead sees the same walls only when it faces the same way.
        turn = np.abs(wrap_angles(poses[:earlier, 2] - poses[later, 2]))
        cost = np.where(single[:earlier] & (distance <= p.near_m), distance + turn, np.inf)
        if earlier and np.isfinite(cost).any():
            pairs.append((int(np.argmin(cost)), later))
    chosen = np.linspace(0, len(pairs) - 1, min(p.most, len(pairs))).round().astype(int)
    return [pairs[k] for k in dict.fromkeys(chosen.tolist())]


def _has_own_stamp(stamps: Stamps) -> NDArray[np.bool_]:
    """Which poses share their stamp with no other: only of these the scan is known."""
    single = np.ones(len(stamps), dtype=np.bool_)
    near = np.diff(stamps) <= 2e9 * SAME_STAMP_S
    single[1:] &= ~near
    single[:-1] &= ~near
    return single


def _scans_of(
    trace: Trajectory, records: Iterable[Record], wanted: list[int]
) -> dict[int, Perception]:
    """Index of a pose -> its scan, of those wanted.

    Raises:
        DataError: the log has none of them.
    """
    assert trace.stamps_ns is not None
    stamps, scans = trace.stamps_ns[wanted], dict[int, Perception]()
    for scan, _ in odometry_at_scans(SweepSearch().settled(records)):
        at, _ = nearest_stamps(stamps, np.array([scan.stamp_ns]), SAME_STAMP_S)
        if len(at):
            scans[wanted[int(at[0])]] = perceive(scan, PerceptionParameters())
    if not scans:
        raise DataError(
            "no scan of the log has the stamp of a pose",
            expected="the log that the trace was made from",
        )
    return scans


def _relations(trace: Trajectory, measured: Mapping[Pair, Pose2D]) -> Relations:
    assert trace.stamps_ns is not None
    pairs = np.array(list(measured))
    poses = np.array([(pose.x, pose.y, pose.theta) for pose in measured.values()])
    return Relations(trace.stamps_ns[pairs[:, 0]], trace.stamps_ns[pairs[:, 1]], poses)


def _relation(
    trace: Trajectory, scans: Mapping[int, Perception], pair: Pair, p: SelfCheckParameters
) -> Pose2D | None:
    """The pose of the later scan in the frame of the earlier; None if the match is uncertain or the
    two directions of matching differ."""
    earlier, later = pair
    if earlier not in scans or later not in scans:
        return None
    a, b = (Pose2D(*map(float, trace.poses[k])) for k in pair)
    forth = align_scans(scans[earlier], scans[later], a.between(b), p)
    back = align_scans(scans[later], scans[earlier], b.between(a), p)
    if forth is None or back is None:
        return None
    back = back.inverse()
    left = forth.between(back)
    if math.hypot(left.x, left.y) > p.reverse_m or abs(left.theta) > math.radians(p.reverse_deg):
        return None
    return interpolate(forth, back, 0.5)


def align_scans(
    base: Perception, scan: Perception, guess: Pose2D, p: SelfCheckParameters
) -> Pose2D | None:
    """Scan-to-scan matching: the pose of `scan` in the frame of `base`; None if uncertain."""
    points = voxel_filtered(scan.hits, MAP.resolution)
    if len(points) < MIN_POINTS or len(base.hits) < MIN_POINTS:
        return None
    grid = OccupancyGrid(MAP)
    grid.integrate(Pose2D(), replace(base, hits=densified(base.hits, MAP.resolution), readings=()))
    # No prior: the guess is only the centre of the search window.
    search = MatchParameters(
        window_xy=p.window_m, window_theta_deg=p.window_deg, odometry_prior=0.0, relocalise=False
    )
    match = match_scan(
        grid,
        scan,
        guess,
        OdometryUncertainty(StandardDeviations(1.0, 1.0), 0.0, window_sigmas=0.0),
        search,
    )
    enough = match.known_points >= p.shared * len(points) and match.score >= p.agreement
    inside = guess.distance(match.pose) < p.window_m
    if not (match.found and enough and inside and _is_constrained(grid, points, match.pose, p)):
        return None
    return match.pose


def _is_constrained(
    grid: OccupancyGrid, points: NDArray[np.float64], pose: Pose2D, p: SelfCheckParameters
) -> bool:
    """Whether the agreement falls in every direction in which the scan is shifted."""
    cell, start = grid.parameters.resolution, grid.pose_to_cells(pose)
    best = agreement(grid, points / cell, start).score
    for direction in np.arange(8) * (math.tau / 8):
        shift = np.array([math.cos(direction), math.sin(direction), 0.0]) * (p.slide_m / cell)
        if agreement(grid, points / cell, start + shift).score > best - p.slide_loss:
            return False
    return True


def densified(points: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Points with others put between neighbours that are on the same wall, `step` apart.

    Far walls are hit at intervals larger than a cell; the other scan hits them in between.
    """
    gaps = np.hypot(*np.diff(points, axis=0).T)
    filled = [points]
    for share in np.arange(1, 8) / 8:
        # Beyond eight steps it may be another wall.
        between = (gaps > step) & (gaps <= 8 * step)
        filled.append(points[:-1][between] * (1 - share) + points[1:][between] * share)
    return np.concatenate(filled)
