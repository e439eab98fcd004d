"""The self-check: aligned scans, pairs at places visited twice, and torn traces."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import FIXTURES

from mapcli.algorithms.evaluation.self_check import (
    SelfCheckParameters,
    align_scans,
    densified,
    revisited_pairs,
    self_check,
)
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
    pairs = revisited_pairs(trace, replace(DEFAULTS, near_m=0.5, apart_m=12.0))
    assert pairs == [(k, 21 - k) for k in (4, 3, 2, 1, 0)]
    assert len(revisited_pairs(trace, replace(DEFAULTS, near_m=0.5, apart_m=12.0, most=2))) == 2
    with pytest.raises(DataError, match="the trace has no times"):
        revisited_pairs(Trajectory(poses), DEFAULTS)


def test_scans_of_one_stamp_cannot_be_told_apart() -> None:
    poses = np.zeros((4, 3))
    poses[:, 0] = (0, 20, 0, 0)
    times = np.array([0, 1, 2, 3]) * 10**9
    assert revisited_pairs(Trajectory(poses, times), DEFAULTS) == [
        (0, 2),
        (0, 3),
    ]
    assert revisited_pairs(Trajectory(poses, np.array([0, 1, 2, 2]) * 10**9), DEFAULTS) == []


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
