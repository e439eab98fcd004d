"""The self-check: aligned scans, pairs at places visited twice, and torn traces."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import FIXTURES

from mapcli.algorithms.evaluation.revisited_places import revisited_pairs
from mapcli.algorithms.evaluation.scan_alignment import align_scans, densified
from mapcli.algorithms.evaluation.self_check import (
    MeasuredPairs,
    RecordedTrace,
    self_check,
    self_checks,
)
from mapcli.algorithms.evaluation.self_check_parameters import SelfCheckParameters
from mapcli.algorithms.scans.perception import PerceptionParameters, perceive
from mapcli.errors import DataError
from mapcli.formats.documents.load_trajectory import load_trajectory
from mapcli.formats.logs.open_log import open_log
from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan, Record
from mapcli.model.trajectory import Trajectory, interpolated, moved

APARTMENT = str(FIXTURES / "apartment.mcap")
DEFAULTS = SelfCheckParameters()


@pytest.fixture(scope="module")
def records() -> list[Record]:
    return list(open_log([APARTMENT]).records())


@pytest.fixture(scope="module")
def truth(records: list[Record]) -> Trajectory:
    """The true poses at the scans."""
    stamps = np.array([r.stamp_ns for r in records if isinstance(r, RangeScan)], np.int64)
    return Trajectory(interpolated(stamps, load_trajectory(APARTMENT).trajectory), stamps)


def test_pairs_are_near_in_space_and_far_apart_along_the_path() -> None:
    """Ten metres there and back, a pose a metre: only the later part has been far away."""
    x = [*range(11), *range(10, -1, -1)]
    heading = [0.0] * 11 + [math.pi] * 11
    poses = np.column_stack([x, np.zeros(22), heading])
    trace = Trajectory(poses, np.arange(22) * 10**9)
    pairs = revisited_pairs([trace], replace(DEFAULTS, near_m=0.5, apart_m=12.0))
    assert pairs == [((0, k), (0, 21 - k)) for k in (4, 3, 2, 1, 0)]
    assert len(revisited_pairs([trace], replace(DEFAULTS, near_m=0.5, apart_m=12.0, most=2))) == 2
    with pytest.raises(DataError, match="the trace has no times"):
        self_check(Trajectory(poses), [])


def test_scans_of_one_stamp_cannot_be_told_apart() -> None:
    poses = np.zeros((4, 3))
    poses[:, 0] = (0, 20, 0, 0)
    times = np.array([0, 1, 2, 3]) * 10**9
    assert revisited_pairs([Trajectory(poses, times)], DEFAULTS) == [
        ((0, 0), (0, 2)),
        ((0, 0), (0, 3)),
    ]
    assert revisited_pairs([Trajectory(poses, np.array([0, 1, 2, 2]) * 10**9)], DEFAULTS) == []


def test_scans_are_aligned_wherever_the_search_begins(
    records: list[Record], truth: Trajectory
) -> None:
    scans = [perceive(r, PerceptionParameters()) for r in records if isinstance(r, RangeScan)]
    a, b = (Pose2D(*truth.poses[k]) for k in (100, 106))
    expected = a.between(b)
    for off in (Pose2D(), Pose2D(0.8, -0.7, 0.3)):
        found = align_scans(scans[100], scans[106], expected.compose(off), DEFAULTS)
        assert found is not None
        assert found.distance(expected) < 0.02
        assert abs(found.theta - expected.theta) < 0.005
    assert align_scans(scans[100], scans[106], expected.compose(Pose2D(6, 0, 0)), DEFAULTS) is None


def walls(*lines: tuple[float, float, float, float]) -> RangeScan:
    """What 360 beams from the origin see of walls, each x0 y0 x1 y1."""
    bearings = np.radians(np.arange(-180, 180))
    ranges = np.full(360, np.inf)
    for x0, y0, x1, y1 in lines:
        dx, dy = x1 - x0, y1 - y0
        with np.errstate(divide="ignore", invalid="ignore"):
            across = np.cos(bearings) * dy - np.sin(bearings) * dx
            along = (x0 * dy - y0 * dx) / across
            share = (x0 * np.sin(bearings) - y0 * np.cos(bearings)) / across
        hit = (along > 0) & (share >= 0) & (share <= 1)
        ranges = np.where(hit, np.minimum(ranges, along), ranges)
    return RangeScan(0, -math.pi, math.radians(1), ranges.astype(np.float32), 0.0, 12.0)


def test_a_corridor_is_no_proof() -> None:
    sides = [(-20, 1, 20, 1), (-20, -1, 20, -1)]
    corridor = perceive(walls(*sides), PerceptionParameters())  # 12 m of it, then no return
    room = perceive(walls(*sides, (3, -1, 3, 1), (-3, -1, -3, 1)), PerceptionParameters())
    assert align_scans(corridor, corridor, Pose2D(0.5, 0, 0), DEFAULTS) is None
    found = align_scans(room, room, Pose2D(0.5, 0.1, 0), DEFAULTS)
    assert found is not None
    assert found.distance(Pose2D()) < 0.01


def test_points_between_neighbours() -> None:
    points = np.array([(0.0, 0), (0.2, 0), (0.22, 0), (5, 0)])
    filled = densified(points, 0.05)
    assert sorted(filled[:, 0].round(3)) == [
        0, 0.025, 0.05, 0.075, 0.1, 0.125, 0.15, 0.175, 0.2, 0.22, 5,
    ]  # fmt: skip


@pytest.mark.slow
def test_the_truth_passes_and_a_torn_trace_does_not(
    records: list[Record], truth: Trajectory
) -> None:
    good = self_check(truth, records)
    assert good.total >= good.matched >= 20
    numbers = good.numbers()
    assert numbers["self_check_median"] < 0.01
    assert numbers["self_check_max"] < 0.06
    torn = truth.poses.copy()
    half = len(torn) // 2
    torn[half:] = moved(torn[half:], Pose2D(0.4, 0.3, 0))  # the second half is half a metre off
    bad = self_check(Trajectory(torn, truth.stamps_ns), records)
    assert bad.matched >= 20
    assert bad.numbers()["self_check_max"] == pytest.approx(0.5, abs=0.06)


def test_what_cannot_be_checked(records: list[Record], truth: Trajectory) -> None:
    assert truth.stamps_ns is not None
    with pytest.raises(DataError, match=r"no place is visited twice: no two poses are within 2 m"):
        self_check(Trajectory(truth.poses[:50], truth.stamps_ns[:50]), records)
    with pytest.raises(DataError, match="no scan of the log has the stamp of a pose"):
        self_check(Trajectory(truth.poses, truth.stamps_ns + 20_000_000), records)
    blind = [
        replace(r, ranges=np.full_like(r.ranges, np.inf))
        for r in records
        if isinstance(r, RangeScan)
    ]
    with pytest.raises(DataError, match=r"none of the \d+ pairs of scans .* can be aligned"):
        self_check(truth, blind)


def test_pairs_of_two_traces_in_the_order_of_their_stamps() -> None:
    """The same four metres twice: each pose of the later drive is a pair with that of the earlier,
    though neither drove far."""
    poses = np.column_stack([np.arange(5), np.zeros(5), np.zeros(5)]).astype(float)
    monday, tuesday = (Trajectory(poses, (np.arange(5) + t) * 10**9) for t in (0, 100))
    near = replace(DEFAULTS, near_m=0.5)
    assert revisited_pairs([monday, tuesday], near) == [((0, k), (1, k)) for k in range(5)]
    assert revisited_pairs([tuesday, monday], near) == [((1, k), (0, k)) for k in range(5)]


def test_a_pair_counts_for_both_of_its_traces() -> None:
    poses = np.column_stack([np.arange(3), np.zeros(3), np.zeros(3)]).astype(float)
    monday, tuesday = (Trajectory(poses, (np.arange(3) + t) * 10**9) for t in (0, 100))
    alone = Trajectory(poses + 50, np.arange(3) * 10**9)
    pairs = [((0, 0), (1, 2)), ((0, 1), (1, 2))]
    measured = {pairs[1]: Pose2D(0.75, 0, 0.1)}
    found = MeasuredPairs([monday, tuesday, alone], pairs, measured, DEFAULTS)
    for number, seconds in ((0, 1.0), (1, 2.0)):
        one = found.evaluation(number)
        errors = one.errors["self_check"]
        assert (one.matched, one.total) == (1, 2)
        assert errors.metres == pytest.approx([0.25])
        assert errors.degrees == pytest.approx([math.degrees(0.1)])
        assert errors.seconds == pytest.approx([seconds])
        assert one.relations is not None
        assert one.relations.from_ns.tolist() == [10**9]
        assert one.relations.to_ns.tolist() == [102 * 10**9]
    with pytest.raises(DataError, match="no place is visited twice"):
        found.evaluation(2)


@pytest.mark.slow
def test_two_drives_in_one_frame_are_held_against_each_other(
    records: list[Record], truth: Trajectory
) -> None:
    """Both halves of a drive as drives of their own; then the second is half a metre off."""
    assert truth.stamps_ns is not None
    half = len(truth) // 2
    border = int(truth.stamps_ns[half])
    logs = [[r for r in records if (r.stamp_ns >= border) == later] for later in (False, True)]
    first = Trajectory(truth.poses[:half], truth.stamps_ns[:half])
    for off, low, high in ((0.0, 0.0, 0.06), (1.0, 0.44, 0.56)):
        shifted = moved(truth.poses[half:], Pose2D(0.4 * off, 0.3 * off, 0))
        traces = [first, Trajectory(shifted, truth.stamps_ns[half:])]
        recorded = list(map(RecordedTrace, traces, logs))
        found = self_checks(recorded, replace(DEFAULTS, most=30))
        crossing = [pair for pair in found.measured if pair[0][0] != pair[1][0]]
        assert len(crossing) >= 10
        for number in (0, 1):
            assert low <= found.evaluation(number).numbers()["self_check_max"] <= high
    with pytest.raises(DataError, match="no scan of the log") as caught:
        self_checks([RecordedTrace(traces[0], logs[0]), RecordedTrace(traces[1], [], "b.tum")])
    assert caught.value.file == "b.tum"
