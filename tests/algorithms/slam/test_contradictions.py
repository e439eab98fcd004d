"""Scans of a room that is seen twice, and what they say of a map that is torn."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.looping import Edges, box, laps, ring, see

from mapcli import World
from mapcli.algorithms.scans.perception import NOTHING_SEEN
from mapcli.algorithms.scans.ray_casting import edges_of
from mapcli.algorithms.slam.contradictions import Agreement, compare_scans
from mapcli.algorithms.slam.scan_sample import MOST_SCANS, SampledScan, ScanSample
from mapcli.algorithms.slam.verdict import CONTRADICTED
from mapcli.model.pose import Pose2D


def sampled(poses: list[Pose2D]) -> ScanSample:
    """Scans around the ring."""
    sample, edges = ScanSample(), ring()
    for pose in poses:
        sample.add(pose, see(edges, pose))
    return sample


TRUE = laps(150.0)
SAMPLE = sampled(TRUE)
HALF = len(TRUE) // 2


def test_a_right_map_has_no_contradictions() -> None:
    found = compare_scans(SAMPLE.scans, TRUE)
    apart = [one.apart for one in found if one.apart is not None]
    near = [one.near for one in found if one.near is not None]
    assert len(apart) > len(found) / 2
    assert max(apart) < 0.1
    assert max(near) < 0.2


@pytest.mark.parametrize("tear", [Pose2D(0.5, 0.5), Pose2D(0.0, 0.0, math.radians(6))])
def test_a_second_lap_beside_the_first_contradicts_it(tear: Pose2D) -> None:
    torn = [*TRUE[:HALF], *(tear.compose(pose) for pose in TRUE[HALF:])]
    apart = [one.apart for one in compare_scans(SAMPLE.scans, torn) if one.apart is not None]
    assert np.mean([share > CONTRADICTED for share in apart]) > 0.1


def test_tracking_that_is_lost_contradicts_its_neighbours() -> None:
    lost = [pose.compose(Pose2D(0.0, 0.6 * (k // 3 % 2))) for k, pose in enumerate(TRUE)]
    near = [one.near for one in compare_scans(SAMPLE.scans, lost) if one.near is not None]
    assert np.mean([share > CONTRADICTED for share in near]) > 0.1


def test_a_robot_that_is_taken_to_be_elsewhere_contradicts_what_was_seen_just_before() -> None:
    """It stands a metre to the side and turned by 70 degrees, and drives on from there."""
    cut = HALF // 2
    there = TRUE[cut]
    motion = there.compose(Pose2D(0.0, 1.0, math.radians(70))).compose(there.inverse())
    torn = [*TRUE[:cut], *(motion.compose(pose) for pose in TRUE[cut:HALF])]
    some = [one for one in SAMPLE.scans if one.scan < HALF]
    onward = {one.scan: one.onward or 0.0 for one in compare_scans(some, torn)}
    worst = max(onward, key=lambda scan: onward[scan])
    assert onward[worst] > CONTRADICTED
    assert abs(worst - cut) <= 3
    right = [one.onward or 0.0 for one in compare_scans(SAMPLE.scans, TRUE)]
    assert max(right) < 0.2


def test_a_sample_is_spread_over_the_way_and_bounded() -> None:
    sample = ScanSample()
    for k in range(5000):
        sample.add(Pose2D(0.3 * k), NOTHING_SEEN)
    numbers = [one.scan for one in sample.scans]
    assert MOST_SCANS / 2 <= len(numbers) <= MOST_SCANS
    assert numbers[0] == 0
    assert numbers[-1] > 4900
    steps = np.diff(numbers)
    assert steps.max() <= 3 * steps.min()  # a step that was just doubled, beside one that was not


def test_a_robot_that_stands_is_sampled_once() -> None:
    sample = ScanSample()
    for _ in range(100):
        sample.add(Pose2D(), NOTHING_SEEN)
    assert len(sample.scans) == 1


def test_nothing_to_compare() -> None:
    blind = SampledScan(0, np.empty((0, 2), np.float32), np.zeros(2))
    assert compare_scans([], [Pose2D()]) == []
    (nothing,) = compare_scans([blind], [Pose2D()])
    assert nothing == Agreement(0, None, None, False, False, None, False)


def corridor(length: float, door: float) -> Edges:
    """2 m wide, with a post of 80 cm somewhere."""
    walls = [box(-20, -1.2, length, -1.0), box(-20, 1.0, length, 1.2)]
    return edges_of(World.of([*walls, box(door, 0.2, door + 0.6, 1.0)]))


def test_what_sees_two_walls_only_does_not_fix_its_place() -> None:
    poses = [Pose2D(0.3 * k) for k in range(150)]
    sample, edges = ScanSample(), corridor(80.0, 30.0)
    for pose in poses:
        sample.add(pose, see(edges, pose))
    found = compare_scans(sample.scans, poses)
    near_post = [one for one in found if abs(poses[one.scan].x - 30) < 3]
    far = [one for one in found if abs(poses[one.scan].x - 30) > 12 and poses[one.scan].x > 2]
    assert np.mean([one.fixed_near for one in near_post]) > 0.6
    assert not any(one.fixed_near for one in far)
    assert not any(one.fixed_apart for one in far)
    assert all(one.fixed_heading for one in far)


def test_in_the_middle_of_a_round_room_a_scan_does_not_fix_its_heading() -> None:
    turns = np.arange(240) * math.tau / 240
    ends = (1.5 * np.column_stack([np.cos(turns), np.sin(turns)])).astype(np.float32)
    scans = [SampledScan(k, ends, np.zeros(2)) for k in range(5)]
    found = compare_scans(scans, [Pose2D(0.01 * k) for k in range(5)])
    assert not any(one.fixed_heading for one in found)
    assert all(one.fixed_near for one in found)
