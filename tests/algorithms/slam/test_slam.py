"""Algorithm 9.2 in a room whose every distance is known."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from mapcli.algorithms.scans.perception import Perception, PerceptionParameters, perceive
from mapcli.algorithms.scans.ray_casting import cast, edges_of
from mapcli.algorithms.slam import occupancy_grid as occupancy
from mapcli.algorithms.slam.local_map import LocalMapParameters
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.match import MatchParameters, Search
from mapcli.algorithms.slam.motion_model import HIGHEST_SPEED
from mapcli.algorithms.slam.slam import Slam, SlamParameters
from mapcli.model.pose import Pose2D, wrap_angle
from mapcli.model.scan import Mount, Odometry, RangeScan, Record
from mapcli.model.trace import TracedPose
from mapcli.model.world import World

ROOM = edges_of(
    World.of(
        [
            [[-3.03, -1.52], [4.04, -1.52], [4.04, 5.01], [-3.03, 5.01]],
            [[-0.33, 1.33], [0.36, 1.33], [0.36, 2.04], [-0.33, 2.04]],
        ]
    )
)
"""A rectangle of 7.07 m by 6.53 m with one pillar; the robot is inside and sees the edges."""

BEAMS = 180
PERIOD_NS = 100_000_000
AHEAD = Mount()


def scan_at(
    pose: Pose2D, index: int, edges: np.ndarray = ROOM, reach: float = 12.0, mount: Mount = AHEAD
) -> RangeScan:
    laser = pose.compose(mount.pose)
    step = math.tau / BEAMS
    ranges = cast(edges, laser, -math.pi, step, BEAMS, reach).astype(np.float32)
    return RangeScan(index * PERIOD_NS, -math.pi, step, ranges, 0.0, reach, mount)


def blind(index: int, value: float = math.inf) -> RangeScan:
    return replace(scan_at(Pose2D(), index), ranges=np.full(BEAMS, value, np.float32))


def round_trip(steps: int, length: float = 0.25) -> list[Pose2D]:
    """A drive that begins at the origin and winds around the pillar."""
    poses, pose = [], Pose2D()
    for k in range(steps):
        poses.append(pose)
        pose = pose.compose(Pose2D(length, 0.0, length * (0.6 + 0.3 * math.sin(0.3 * k))))
    return poses


def odometry_of(poses: list[Pose2D], errors: list[Pose2D] | None = None) -> list[Pose2D]:
    """What odometry would count: each motion followed by its error."""
    odom = [poses[0]]
    for k in range(1, len(poses)):
        motion = poses[k - 1].between(poses[k])
        odom.append(odom[-1].compose(motion).compose(errors[k] if errors else Pose2D()))
    return odom


def log_of(
    poses: list[Pose2D], odom: list[Pose2D], see: Callable[[Pose2D, int], RangeScan] = scan_at
) -> list[Record]:
    records: list[Record] = []
    for k, (pose, counted) in enumerate(zip(poses, odom, strict=True)):
        records += [Odometry(k * PERIOD_NS, counted), see(pose, k)]
    return records


def errors_up_to(xy: float, degrees: float, count: int, seed: int = 0) -> list[Pose2D]:
    rng = np.random.default_rng(seed)
    turn = math.radians(degrees)
    return [
        Pose2D(length * math.cos(a), length * math.sin(a), t)
        for length, a, t in zip(
            rng.uniform(0, xy, count),
            rng.uniform(-math.pi, math.pi, count),
            rng.uniform(-turn, turn, count),
            strict=True,
        )
    ]


def searching(search: Search, **match) -> SlamParameters:
    return SlamParameters(match=MatchParameters(search=search, **match))


def replay(records: list[Record], parameters: SlamParameters | None = None) -> list[TracedPose]:
    return list(Slam(parameters).replay(records))


def assert_near(
    found: list[TracedPose], true: list[Pose2D], xy: float = 0.02, degrees: float = 0.5
) -> None:
    assert len(found) == len(true)
    for k, (traced, pose) in enumerate(zip(found, true, strict=True)):
        off = abs(math.degrees(wrap_angle(traced.pose.theta - pose.theta)))
        away = traced.pose.distance(pose)
        assert away <= xy, f"scan {k} ({traced.status}): {away:.3f} m away"
        assert off <= degrees, f"scan {k} ({traced.status}): {off:.2f} degrees off"


def statuses(found: list[TracedPose]) -> list[str]:
    return [traced.status for traced in found]


POSES = round_trip(60)

# --- the three searches


@pytest.mark.parametrize("seed", range(3))
def test_wrong_odometry_is_put_right(seed: int) -> None:
    odom = odometry_of(POSES, errors_up_to(0.1, 5.0, len(POSES), seed))
    assert max(a.distance(b) for a, b in zip(odom, POSES, strict=True)) > 0.3
    found = replay(log_of(POSES, odom))
    assert_near(found, POSES)
    assert statuses(found) == ["first"] + ["matched"] * (len(POSES) - 1)
    assert [traced.odom for traced in found] == odom
    assert [traced.stamp_ns for traced in found] == [k * PERIOD_NS for k in range(len(POSES))]
    assert found[0].score is None
    scores = [traced.score for traced in found[1:] if traced.score is not None]
    assert len(scores) == len(POSES) - 1
    assert all(0.5 < score <= 1 for score in scores)


def test_the_map_is_the_room() -> None:
    slam = Slam()
    list(slam.replay(log_of(POSES, odometry_of(POSES, errors_up_to(0.1, 5.0, len(POSES))))))
    grid = slam.map.to_grid_map()
    share = np.linspace(0, 1, 200)[1:-1, None]
    walls = np.concatenate([a + share * (b - a) for a, b in ROOM])
    # A wall's cell, or one beside it, is occupied all along it, and nothing is elsewhere.
    occupied = grid.world_of_cells(*np.nonzero(grid.cells > 0.65))
    gaps = np.hypot(*(occupied[:, None] - walls[None]).transpose(2, 0, 1))
    assert (gaps.min(axis=0) < 0.07).mean() > 0.95
    assert gaps.min(axis=1).max() < 0.12
    # And the room itself is known to be free.
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-2.8, 3.9, 0.1), np.arange(-1.3, 4.9, 0.1)))
    open_floor = np.hypot(x - 0.015, y - 1.685) > 0.7
    rows, columns = grid.cells_of_world(np.column_stack([x, y])[open_floor]).T
    assert (grid.cells[rows, columns] <= 0.196).mean() > 0.95


def test_none_analyzes_what_is_written_and_what_is_asked_for(monkeypatch) -> None:
    """Every second scan is a tenth of a metre from the one before, too near to be written."""
    seen: list[int] = []

    def noting(scan: RangeScan, parameters: PerceptionParameters) -> Perception:
        seen.append(scan.stamp_ns // PERIOD_NS)
        return perceive(scan, parameters)

    monkeypatch.setattr("mapcli.algorithms.slam.slam.perceive", noting)
    poses = [Pose2D(0.4 * (k // 2) + 0.1 * (k % 2)) for k in range(8)]
    slam = Slam(searching("none").without_loops())
    for _ in slam.replay(log_of(poses, poses)):
        pass
    assert seen == [0, 2, 4, 6]
    assert len(slam.perception.hits) == BEAMS
    assert seen == [0, 2, 4, 6, 7]


def test_none_takes_the_odometry_as_it_is() -> None:
    odom = odometry_of(POSES, errors_up_to(0.1, 5.0, len(POSES)))
    found = replay(log_of(POSES, odom), searching("none"))
    assert_near(found, odom, xy=1e-9, degrees=1e-9)
    assert statuses(found) == ["first"] + ["odometry"] * (len(POSES) - 1)
    assert {traced.score for traced in found} == {None}


@pytest.mark.parametrize("turn", [0, -15, 15])
@pytest.mark.parametrize("step", [(0, 0), (0, 1), (0, -1), (-1, 0), (1, 0)])
def test_book_picks_the_true_one_of_the_fifteen(step: tuple[int, int], turn: int) -> None:
    # The robot stands, and its odometry claims that it has moved by a cell and turned.
    here = Pose2D(0.03, 0.02, 0.4)
    cell = 0.2
    claimed = Pose2D(
        here.x - step[0] * cell, here.y - step[1] * cell, here.theta - math.radians(turn)
    )
    slam = Slam(replace(searching("book"), map=MapParameters(resolution=cell)), start=here)
    found = list(slam.replay(log_of([here, here], [here, claimed])))
    assert_near(found, [here, here], xy=1e-9, degrees=1e-9)
    stands = (step, turn) == ((0, 0), 0)  # then there is nothing to compare again
    assert statuses(found) == ["first", "odometry" if stands else "matched"]


def test_book_keeps_small_errors_from_growing() -> None:
    poses = round_trip(40, 0.1)
    drift = [Pose2D(0.02, 0.01, 0.0)] * len(poses)
    odom = odometry_of(poses, drift)
    assert odom[-1].distance(poses[-1]) > 0.3
    found = replay(log_of(poses, odom), searching("book"))
    assert_near(found, poses, xy=0.15, degrees=8.0)


# --- odometry that fails


def test_without_odometry_a_slow_drive_is_followed() -> None:
    poses = [Pose2D(0.05 * k, 0.02 * k, math.radians(2.0 * k)) for k in range(40)]
    found = replay([scan_at(pose, k) for k, pose in enumerate(poses)])
    assert_near(found, poses)
    assert statuses(found) == ["first"] + ["matched"] * 39
    assert {traced.odom for traced in found} == {None}


def test_a_jump_of_the_odometry_is_not_believed() -> None:
    odom = odometry_of(POSES)
    jump = Pose2D(40.0, 30.0, 2.0)
    odom[30:] = [jump.compose(pose) for pose in odom[30:]]
    slam = Slam()
    found = list(slam.replay(log_of(POSES, odom)))
    assert_near(found, POSES)
    assert slam.odometry.jumps == 1


def test_only_leaps_are_jumps() -> None:
    far = 1.0 + HIGHEST_SPEED * PERIOD_NS * 1e-9
    for metres, jumps in ((far - 0.01, 0), (far + 0.01, 1)):
        slam = Slam(searching("none"))
        odom = [Pose2D(), Pose2D(0.0, metres, 0.0)]
        found = list(slam.replay(log_of([Pose2D()] * 2, odom)))
        assert slam.odometry.jumps == jumps
        assert found[1].pose == (Pose2D() if jumps else odom[1])


@pytest.mark.parametrize("length", [0.05, 0.25])
def test_odometry_that_counts_backwards_for_seconds(length: float) -> None:
    poses = round_trip(70, length)
    motions = [a.between(b) for a, b in pairwise(poses)]
    motions[20:50] = [Pose2D(-m.x, -m.y, m.theta) for m in motions[20:50]]
    odom = [Pose2D()]
    for motion in motions:
        odom.append(odom[-1].compose(motion))
    assert_near(replay(log_of(poses, odom)), poses, xy=0.05, degrees=1.0)


def test_odometry_that_falls_silent_for_seconds() -> None:
    poses = round_trip(70, 0.1)
    records = [
        record
        for record in log_of(poses, odometry_of(poses))
        if isinstance(record, RangeScan) or not 2 < record.stamp_ns * 1e-9 < 5
    ]
    found = replay(records)
    assert_near(found, poses, xy=0.05, degrees=1.0)
    assert None in {traced.odom for traced in found[20:50]}


# --- scans of few points


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_a_scan_without_returns_goes_by_odometry(value: float) -> None:
    records = log_of(POSES, odometry_of(POSES))
    for k in (20, 21):
        records[2 * k + 1] = blind(k, value)
    as_counted = SlamParameters(calibrate_odometry=False)
    found = replay(records, as_counted)
    assert_near(found, POSES)
    expected = ["first"] + ["matched"] * (len(POSES) - 1)
    expected[20:22] = ["odometry", "odometry"]
    assert statuses(found) == expected
    assert found[20].score is None
    moved = found[19].pose.compose(POSES[19].between(POSES[20]))
    assert_near(found[20:21], [moved], xy=1e-9, degrees=1e-9)  # nothing but the odometry


def test_a_log_that_begins_blind() -> None:
    poses = round_trip(10)
    records = log_of(poses, odometry_of(poses))
    for k in range(3):
        records[2 * k + 1] = blind(k)
    for search in ("window", "book", "none"):
        found = replay(records, searching(search))
        assert statuses(found)[:3] == ["first", "odometry", "odometry"]
        assert found[3].pose.distance(poses[3]) < 1e-9  # the map begins here


@pytest.mark.parametrize("returns", [0, 3])
def test_a_log_that_begins_blind_and_without_odometry(returns: int) -> None:
    # The robot stands where it is until it sees; such a scan must not pass for the map.
    poses = [Pose2D(0.05 * k) for k in range(20)]
    records = [scan_at(pose, k) for k, pose in enumerate([poses[0], *poses])]
    records[0].ranges[returns:] = math.inf
    found = replay(records)
    assert statuses(found)[2:] == ["matched"] * 19
    assert_near(found, [poses[0], *poses], xy=0.05, degrees=1.5)


@pytest.mark.parametrize("period", [2, 3])
def test_every_other_scan_blind(period: int) -> None:
    poses = round_trip(60, 0.2)
    records = log_of(poses, odometry_of(poses, errors_up_to(0.02, 1.0, len(poses))))
    for k in range(1, len(poses), period):
        records[2 * k + 1] = blind(k)
    found = replay(records)
    assert_near(found, poses, xy=0.05, degrees=2.0)
    assert statuses(found).count("odometry") == len(range(1, len(poses), period))


def test_only_blind_scans() -> None:
    records = [blind(k) for k in range(5)]
    for search in ("window", "book", "none"):
        slam = Slam(searching(search))
        found = list(slam.replay(records))
        assert statuses(found) == ["first"] + ["odometry"] * 4
        assert {traced.pose for traced in found} == {Pose2D()}
        assert not slam.map.to_grid_map().known.any()


def test_beams_without_return_can_clear() -> None:
    clear = SlamParameters(perception=PerceptionParameters(no_return="clear"))
    slam = Slam(clear)
    slam.step(replace(blind(0), range_max=3.0), None)
    grid = slam.map.to_grid_map()
    assert grid.known.sum() > 2000  # of a disc of 28 m2, where near beams lie close enough
    assert np.nanmax(grid.cells) < 0.5


def test_no_records_no_poses() -> None:
    assert replay([]) == []
    assert replay([Odometry(0, Pose2D())]) == []


# --- how it runs


def test_a_laser_mounted_anywhere_sees_the_same_room() -> None:
    mount = Mount(Pose2D(0.3, -0.2, 2.0), flipped=True)

    def see(pose: Pose2D, index: int) -> RangeScan:
        scan = scan_at(pose, index, mount=mount)
        # Upside down the beams come in the other order; the first was at -pi, as was the last + 1.
        return replace(scan, ranges=np.roll(scan.ranges[::-1], 1))

    odom = odometry_of(POSES, errors_up_to(0.1, 5.0, len(POSES)))
    assert_near(replay(log_of(POSES, odom, see)), POSES)


def test_the_start_is_where_one_says() -> None:
    start = Pose2D(-1.0, 0.5, 2.5)
    poses = [start.compose(pose) for pose in round_trip(15, 0.1)]
    odom = [Pose2D(7, 8, 1).compose(pose) for pose in odometry_of(round_trip(15, 0.1))]
    found = list(Slam(start=start).replay(log_of(poses, odom)))
    assert found[0].pose == start
    assert_near(found, poses)


@pytest.mark.parametrize(
    ("moved", "updated"),
    [
        (Pose2D(), False),
        (Pose2D(0.25, 0.0, 0.0), False),
        (Pose2D(0.0, -0.35, 0.0), True),
        (Pose2D(0.0, 0.0, 0.25), False),
        (Pose2D(0.0, 0.0, 0.35), True),
        (Pose2D(0.0, 0.0, -0.35), True),
    ],
)
def test_the_map_is_updated_where_the_robot_has_moved(moved: Pose2D, updated: bool) -> None:
    slam = Slam(SlamParameters(local_map=LocalMapParameters(update_m=0.3, update_deg=17.0)))
    here = Pose2D(0.02, 0.01, 3.1)
    there = here.compose(moved)
    slam.step(scan_at(here, 0), here)
    before = slam.map.to_grid_map()
    for k in range(1, 4):
        slam.step(scan_at(there, k), there)
    after = slam.map.to_grid_map()
    assert np.array_equal(before.cells, after.cells, equal_nan=True) != updated


def test_step_by_step_is_the_same_as_a_replay() -> None:
    poses = POSES[:15]
    odom = odometry_of(poses, errors_up_to(0.1, 5.0, len(poses)))
    slam = Slam()
    stepped = [
        slam.step(scan_at(p, k), o) for k, (p, o) in enumerate(zip(poses, odom, strict=True))
    ]
    assert stepped == replay(log_of(poses, odom))
    assert slam.pose == stepped[-1].pose


@pytest.mark.parametrize("search", ["window", "book"])
def test_two_runs_agree_to_the_last_bit(search: Search) -> None:
    poses = POSES[:30]
    records = log_of(poses, odometry_of(poses, errors_up_to(0.1, 5.0, len(poses))))
    first, second = Slam(searching(search)), Slam(searching(search))
    assert list(first.replay(records)) == list(second.replay(records))
    assert first.map.log_odds.tobytes() == second.map.log_odds.tobytes()
    assert first.map.pyramid.tobytes() == second.map.pyramid.tobytes()


def test_records_stay_as_they_were() -> None:
    poses = POSES[:10]
    records = log_of(poses, odometry_of(poses))
    scans = [record for record in records if isinstance(record, RangeScan)]
    for scan in scans:
        scan.ranges[::7] = [math.nan, math.inf, -math.inf, 0.0, 99.0, 1.0] * 4 + [2.0, 3.0]
        scan.ranges.setflags(write=False)
    before = [scan.ranges.tobytes() for scan in scans]
    clear = SlamParameters(perception=PerceptionParameters(no_return="clear"))
    replay(records, clear)
    assert [scan.ranges.tobytes() for scan in scans] == before


def corridor() -> tuple[np.ndarray, list[Pose2D]]:
    """A corridor of 30 m with doorposts, and a drive along it."""
    outline = [[-1.53, -1.02], [29.04, -1.02], [29.04, 1.23], [-1.53, 1.23]]
    posts = [
        [[x, 1.03], [x + 0.31, 1.03], [x + 0.31, 1.33], [x, 1.33]] for x in np.arange(0.7, 28, 1.9)
    ]
    return edges_of(World.of([outline, *posts])), [Pose2D(0.4 * k) for k in range(65)]


def test_a_map_that_grows_many_times_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    edges, poses = corridor()
    odom = odometry_of(poses, errors_up_to(0.1, 5.0, len(poses), seed=1))
    records = log_of(poses, odom, lambda pose, k: scan_at(pose, k, edges, 4.0))
    start = Pose2D(0.02, 0.01)  # not on the corner of a cell, where the last bit decides
    at_once = Slam(start=start)
    at_once.map.extend_to(np.array([-20.0, -20.0]), np.array([45.0, 20.0]))
    shape = at_once.map.log_odds.shape
    expected = list(at_once.replay(records))
    assert at_once.map.log_odds.shape == shape
    assert_near(expected, [start.compose(pose) for pose in poses], xy=0.05, degrees=1.0)

    monkeypatch.setattr(occupancy, "BLOCK", 8)
    growing = Slam(start=start)
    shapes, found = set(), []
    for traced in growing.replay(records):
        found.append(traced)
        shapes.add(growing.map.log_odds.shape)
    assert len(shapes) > 5
    assert_near(found, [traced.pose for traced in expected], xy=1e-6, degrees=1e-6)
    a, b = growing.map.to_grid_map(), at_once.map.to_grid_map()
    assert np.array_equal(a.cells, b.cells, equal_nan=True)
