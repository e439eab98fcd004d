"""Simulated logs: records, odometry with noise and faults, the laser, collisions."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import FIXTURES
from mcap.reader import make_reader

from mapcli import GridMap, LaserModel, Pose2D, Simulation, WheelModel, World, plan_drive
from mapcli import simulate as simulated
from mapcli.algorithms.scans.ray_casting import edges_of
from mapcli.algorithms.simulation.drive import Drive
from mapcli.algorithms.simulation.scene import Scene
from mapcli.algorithms.simulation.sensors import Fault
from mapcli.algorithms.simulation.simulate import POSE_STEP, START_NS, check_clearance
from mapcli.errors import DataError
from mapcli.model.scan import Mount, Odometry, RangeScan, TruePose
from mapcli.model.waypoint import Waypoint

ROOM = World.of(
    [
        [[-1, -1], [6, -1], [6, 0], [-1, 0]],
        [[-1, 4], [6, 4], [6, 5], [-1, 5]],
        [[-1, 0], [0, 0], [0, 4], [-1, 4]],
        [[5, 0], [6, 0], [6, 4], [5, 4]],
    ]
)


EXACT_WHEELS = WheelModel(noise=(0, 0, 0, 0))


EXACT_LASER = LaserModel(rate=2, beams=8, noise=0)


@pytest.fixture(scope="module")
def drive() -> Drive:
    path = [Waypoint(1, 1), Waypoint(3, 1), Waypoint(3, 3), Waypoint(3, 1.5, back=True)]
    return plan_drive(path)


def poses_of(simulation: Simulation, kind: type) -> list[Pose2D]:
    return [record.pose for record in simulation.records() if isinstance(record, kind)]


def flat(poses: list[Pose2D]) -> np.ndarray:
    return np.array([(pose.x, pose.y, pose.theta) for pose in poses])


def test_records_come_in_order_of_stamps(drive: Drive) -> None:
    simulation = Simulation(ROOM, drive, laser=LaserModel(rate=7, beams=4))
    records = list(simulation.records())
    stamps = [record.stamp_ns for record in records]
    assert stamps == sorted(stamps)
    assert stamps[0] == START_NS
    assert [type(record) for record in records[:3]] == [TruePose, Odometry, RangeScan]
    assert len(records) == simulation.record_count
    scans = [record.stamp_ns for record in records if isinstance(record, RangeScan)]
    assert scans[1] - START_NS == round(1e9 / 7)
    assert stamps[-1] >= START_NS + simulation.duration * 1e9


def test_one_verb_plans_checks_and_senses() -> None:
    waypoints = [Waypoint(1, 2), Waypoint(3, 2)]
    simulation = simulated(ROOM, waypoints, wheels=EXACT_WHEELS, laser=EXACT_LASER, seed=3)
    same = Simulation(ROOM, plan_drive(waypoints), EXACT_WHEELS, EXACT_LASER, 3)
    assert poses_of(simulation, Odometry) == poses_of(same, Odometry)
    with pytest.raises(DataError, match="expected at least its radius, 5 m"):
        simulated(ROOM, waypoints, robot_radius=5)


def test_exact_wheels_tell_the_truth(drive: Drive) -> None:
    simulation = Simulation(ROOM, drive, EXACT_WHEELS, EXACT_LASER)
    true = poses_of(simulation, TruePose)
    odometry = [true[0].compose(pose) for pose in poses_of(simulation, Odometry)]
    assert flat(odometry) == pytest.approx(flat(true), abs=2 * POSE_STEP)
    assert (true[-1].x, true[-1].y) == pytest.approx((3, 1.5), abs=POSE_STEP)


def test_the_seed_is_all_there_is(drive: Drive) -> None:
    def odometry(seed: int) -> np.ndarray:
        return flat(poses_of(Simulation(ROOM, drive, laser=EXACT_LASER, seed=seed), Odometry))

    assert np.array_equal(odometry(0), odometry(0))
    assert not np.array_equal(odometry(0), odometry(1))


def test_the_laser_does_not_change_the_wheels(drive: Drive) -> None:
    lasers = LaserModel(rate=1, beams=4), LaserModel(rate=3, beams=7, noise=0.2)
    one, two = (poses_of(Simulation(ROOM, drive, laser=laser), Odometry) for laser in lasers)
    assert one == two


def test_noise_grows_with_the_root_of_the_distance() -> None:
    model = WheelModel(noise=(0.1, 0.2, 0.3, 0.4))
    moved, turned = Pose2D(0.04), Pose2D(theta=-0.09)
    for motion, x_sigma, theta_sigma in ((moved, 0.06, 0.04), (turned, 0.12, 0.03)):
        rng = np.random.default_rng(0)
        errors = flat([model.measured(motion, rng) for _ in range(4000)]) - flat([motion])
        assert errors.std(axis=0) == pytest.approx([x_sigma, 0, theta_sigma], rel=0.05)
        assert errors.mean(axis=0) == pytest.approx([0, 0, 0], abs=0.006)


def test_systematic_errors() -> None:
    model = replace(EXACT_WHEELS, scale=1.1, turn_scale=0.9, drift_deg=10)
    measured = model.measured(Pose2D(0.3, 0.4, 0.5), np.random.default_rng(0))
    expected = (0.33, 0.44, 0.45 - math.radians(5))
    assert (measured.x, measured.y, measured.theta) == pytest.approx(expected)


def wheels_and_truth(fault: Fault) -> tuple[Simulation, np.ndarray, np.ndarray]:
    """x of the odometry and of the truth, at 20 Hz, of two metres straight on in 5 s."""
    straight = plan_drive([Waypoint(1, 2), Waypoint(3, 2)])
    simulation = Simulation(ROOM, straight, replace(EXACT_WHEELS, faults=(fault,)), EXACT_LASER)
    odometry, truth = (flat(poses_of(simulation, kind))[:, 0] for kind in (Odometry, TruePose))
    return simulation, odometry, truth - 1


def test_reversed_sign() -> None:
    simulation, odometry, truth = wheels_and_truth(Fault("reverse-sign", 2, 3))
    assert simulation.duration == pytest.approx(5)
    assert odometry[40] == pytest.approx(truth[40], abs=1e-5)  # 2 s
    assert truth[60] - truth[40] == pytest.approx(0.5, abs=1e-5)
    assert odometry[60] - odometry[40] == pytest.approx(-0.5, abs=1e-5)
    assert odometry[-1] == pytest.approx(1.0, abs=1e-5)


def test_frozen_wheels() -> None:
    _, odometry, truth = wheels_and_truth(Fault("freeze", 2, 3))
    assert odometry[40] == odometry[60]
    assert odometry[-1] == pytest.approx(truth[-1] - 0.5, abs=1e-5)


def test_slipping_wheels() -> None:
    simulation, odometry, truth = wheels_and_truth(Fault("slip", 2, 3))
    assert simulation.duration == pytest.approx(6)
    assert simulation.arrivals() == pytest.approx([0, 6])
    assert truth[40] == truth[60]
    assert odometry[60] - odometry[40] == pytest.approx(0.5, abs=1e-5)
    assert truth[-1] == pytest.approx(2.0, abs=1e-5)


def test_a_wheel_that_loses_its_grip_for_a_moment() -> None:
    """Sect. 9.5: the robot comes as far as is counted, but ends 15 degrees clockwise of it."""
    straight = plan_drive([Waypoint(1, 2), Waypoint(4, 2)])
    wheels = replace(EXACT_WHEELS, faults=(Fault("turn", 2, 3),))
    simulation = Simulation(ROOM, straight, wheels, EXACT_LASER)
    counted, truth = (poses_of(simulation, kind) for kind in (Odometry, TruePose))
    turn = np.degrees([b.theta - a.theta for a, b in zip(truth, counted, strict=True)])
    assert turn[40] == pytest.approx(0, abs=0.01)
    assert turn[60:] == pytest.approx(15, abs=0.01)
    assert counted[60].x == pytest.approx(truth[60].x - 1, abs=0.01)


def test_stray_readings_are_anywhere_within_the_range() -> None:
    straight = plan_drive([Waypoint(1, 2), Waypoint(3, 2)])
    laser = LaserModel(rate=2, beams=400, noise=0, stray=0.25, range_min=0.2, range_max=8)
    scans = []
    for one in (laser, replace(laser, stray=0.0)):
        records = Simulation(ROOM, straight, EXACT_WHEELS, one).records()
        scans.append(next(r.ranges for r in records if isinstance(r, RangeScan)))
    strayed = scans[0][scans[0] != scans[1]]
    assert 0.2 < len(strayed) / 400 < 0.3
    assert 0.2 <= strayed.min() < 1
    assert 6 < strayed.max() <= 8


def test_stale_odometry_catches_up_at_once() -> None:
    _, odometry, truth = wheels_and_truth(Fault("stale", 2, 3))
    assert set(odometry[40:60]) == {odometry[39]}
    assert odometry[39] == pytest.approx(truth[39], abs=1e-5)
    assert odometry[60:] == pytest.approx(truth[60:], abs=1e-5)


def test_late_odometry_tells_where_the_robot_was() -> None:
    straight = plan_drive([Waypoint(1, 2), Waypoint(3, 2)])
    wheels = replace(EXACT_WHEELS, delay=0.5)
    simulation = Simulation(ROOM, straight, wheels, EXACT_LASER)
    odometry, truth = (flat(poses_of(simulation, kind))[:, 0] for kind in (Odometry, TruePose))
    assert odometry[:10].tolist() == [0] * 10
    assert odometry[10:] == pytest.approx(truth[:-10] - 1, abs=1e-5)


@pytest.mark.parametrize(
    ("kind", "moved", "counted"),
    [  # 0.3 m from wheel to wheel, the slipping one counts half as much again
        ("slip-left", Pose2D(0.6), (0.75, 0, -1.0)),
        ("slip-right", Pose2D(0.6), (0.75, 0, 1.0)),
        ("slip-left", Pose2D(theta=0.4), (-0.015, 0, 0.5)),
        ("slip-right", Pose2D(theta=0.4), (0.015, 0, 0.5)),
    ],
)
def test_one_wheel_slips(kind: Any, moved: Pose2D, counted: tuple[float, ...]) -> None:
    wheels = WheelModel(faults=(Fault(kind, 2, 3),))
    assert flat([wheels.counted(moved, 2.5)])[0] == pytest.approx(counted)
    assert wheels.counted(moved, 3.5) == moved


def test_a_fault_after_the_end_is_refused(drive: Drive) -> None:
    wheels = WheelModel(faults=(Fault("slip", 99, 100),))
    with pytest.raises(DataError, match="slip begins at 99 s; expected a time before the end"):
        Simulation(ROOM, drive, wheels)


def test_ranges_by_hand() -> None:
    model = LaserModel(beams=4, noise=0, range_min=1.5, range_max=3.5)
    scan = scan_from(model, Pose2D(1, 3))
    # Behind 1 m (too close), to the right 3 m, ahead 4 m (too far), to the left 1 m.
    assert scan.ranges.tolist() == [-math.inf, 3.0, math.inf, -math.inf]
    assert scan.stamp_ns == START_NS + 2_500_000_000
    assert np.degrees(scan.bearings()) == pytest.approx([-180, -90, 0, 90])
    assert (scan.range_min, scan.range_max) == (1.5, 3.5)


def scan_from(model: LaserModel, robot: Pose2D) -> RangeScan:
    """The scan of a robot that stands in ROOM, 2.5 s after the start."""
    rng = np.random.default_rng(0)
    return model.scan(Scene(edges_of(ROOM)), lambda _: robot, 2.5, START_NS, rng)


@pytest.mark.parametrize(
    ("order", "ranges"),
    [("forward", [1.0, 3.0, 3.75, 1.0]), ("backward", [1.375, 3.0, 3.875, 1.0])],
)
def test_beams_are_taken_one_after_another(order: Any, ranges: list[float]) -> None:
    """A robot at (1, 3) drives ahead with 1 m/s; its beams, to behind, right, ahead and left, are
    taken in the order of the array 0, 1/8, 2/8, 3/8 s after the first, or in the other one."""
    model = LaserModel(rate=2, beams=4, noise=0, turn_time=0.5, order=order)
    drives = lambda time: Pose2D(1 + time - 2.5, 3)  # noqa: E731
    rng = np.random.default_rng(0)
    scan = model.scan(Scene(edges_of(ROOM)), drives, 2.5, START_NS, rng)
    assert scan.ranges.tolist() == ranges
    assert scan.timing.increment == 0.125
    assert scan.stamp_ns == START_NS + 2_500_000_000


def test_what_reads_where_nothing_returns() -> None:
    model = LaserModel(beams=400, noise=0, range_max=1.2, no_return=(51.5, 51.25))
    scan = scan_from(model, Pose2D(1, 3))
    exact = scan_from(replace(model, no_return=()), Pose2D(1, 3))
    nothing = np.isposinf(exact.ranges)
    assert np.array_equal(scan.ranges[~nothing], exact.ranges[~nothing])
    readings, counts = np.unique(scan.ranges[nothing], return_counts=True)
    assert readings.tolist() == [51.25, 51.5]
    assert counts / counts.sum() == pytest.approx([0.5, 0.5], abs=0.1)
    assert scan.range_max == 1.2


def test_a_rear_laser_scans_between_the_scans_of_the_first(drive: Drive) -> None:
    mount = Mount(Pose2D(-0.2, 0, math.pi))
    simulation = Simulation(ROOM, drive, laser=EXACT_LASER, rear=replace(EXACT_LASER, mount=mount))
    records = list(simulation.records())
    assert len(records) == simulation.record_count
    front, rear = (
        [r for r in records if isinstance(r, RangeScan) and (r.mount == mount) is behind]
        for behind in (False, True)
    )
    assert [scan.stamp_ns - START_NS for scan in rear[:2]] == [250_000_000, 750_000_000]
    assert len(front) + len(rear) == simulation.scan_count
    # At the start, (1, 1) facing right: the wall behind is 1 m from the first and 0.8 from this.
    assert front[0].ranges[0] == pytest.approx(1.0, abs=0.001)
    assert rear[0].ranges[4] == pytest.approx(0.8 + 0.5 * 0.25**2 / 2, abs=0.001)
    with pytest.raises(DataError, match="both lasers sit at the same place"):
        replace(simulation, rear=EXACT_LASER)


def test_the_log_begins_when_it_should(drive: Drive) -> None:
    simulation = Simulation(ROOM, drive, laser=EXACT_LASER, start_ns=12 * 10**9)
    stamps = [record.stamp_ns for record in simulation.records()]
    assert stamps[0] == 12 * 10**9
    late = Simulation(ROOM, drive, laser=EXACT_LASER)
    assert [r.stamp_ns - START_NS for r in late.records()] == [s - stamps[0] for s in stamps]


def test_people_and_glass_leave_the_wheels_as_they_are(drive: Drive) -> None:
    alone = Simulation(ROOM, drive, laser=EXACT_LASER)
    busy = replace(alone, people=3, glass=0.5)
    assert poses_of(alone, Odometry) == poses_of(busy, Odometry)
    with pytest.raises(DataError, match="people is -1"):
        replace(alone, people=-1)
    with pytest.raises(DataError, match=r"glass is 1\.5; expected a share"):
        replace(alone, glass=1.5)


def test_half_a_turn_has_beams_at_both_ends() -> None:
    scan = scan_from(LaserModel(beams=181, fov_deg=180), Pose2D(1, 1))
    assert np.degrees(scan.bearings()[[0, 90, 180]]) == pytest.approx([-90, 0, 90])


def test_points_lie_on_the_walls_wherever_the_laser_sits() -> None:
    mount = Mount(Pose2D(0.2, -0.1, 0.5))
    robot = Pose2D(2, 2, 1.0)
    scan = scan_from(LaserModel(noise=0, mount=mount), robot)
    x, y = robot.apply(scan.points()).T
    gap = np.min([np.abs(x), np.abs(x - 5), np.abs(y), np.abs(y - 4)], axis=0)
    assert gap.max() < 0.001
    assert len(gap) == 360


def test_range_noise_and_dropout() -> None:
    model = LaserModel(beams=2000, noise=0.05, dropout=0.25)
    noisy = scan_from(model, Pose2D(2, 2))
    exact = scan_from(replace(model, noise=0, dropout=0), Pose2D(2, 2))
    errors = noisy.ranges - exact.ranges
    assert np.isnan(errors).mean() == pytest.approx(0.25, abs=0.03)
    assert np.nanstd(errors) == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: LaserModel(turn_time=0.2), "turn_time is 0.2; expected seconds, up to"),
        (lambda: LaserModel(no_return=(math.nan,)), "no_return is (nan,)"),
        (lambda: WheelModel(delay=-1), "delay is -1; expected seconds, 0 or more"),
        (lambda: LaserModel(rate=0), "rate is 0; expected more than 0"),
        (lambda: LaserModel(beams=0), "beams is 0"),
        (lambda: LaserModel(beams=10**18), "beams is 1000000000000000000; expected at most"),
        (lambda: LaserModel(fov_deg=361), "fov_deg is 361; expected degrees, up to 360"),
        (lambda: LaserModel(range_max=math.inf), "range_max is inf"),
        (lambda: LaserModel(range_min=13), "range_min is 13; expected less than range_max"),
        (lambda: LaserModel(noise=-1), "noise is -1"),
        (lambda: LaserModel(dropout=1), "dropout is 1; expected a share"),
        (lambda: WheelModel(rate=-1), "rate is -1"),
        (lambda: WheelModel(scale=0), "scale is 0"),
        (lambda: WheelModel(drift_deg=math.nan), "drift_deg is nan"),
        (lambda: WheelModel(noise=(0, 0, -1, 0)), "noise (0, 0, -1, 0); expected four"),
        (
            lambda: WheelModel(faults=(Fault("slip", 3, 5), Fault("freeze", 2, 4))),
            "faults overlap at 3 s",
        ),
        (lambda: Fault("slip", 3, 3), "fault from 3 to 3 s; expected an end after its begin"),
        (lambda: Fault("sleep", 1, 2), "fault 'sleep'; expected reverse-sign or slip or freeze"),
    ],
)
def test_sensors_are_checked(make: Callable[[], object], message: str) -> None:
    with pytest.raises(DataError) as error:
        make()
    assert message in str(error.value)


def test_a_drive_that_keeps_clear(drive: Drive) -> None:
    check_clearance(ROOM, drive, 0.9)
    with pytest.raises(DataError, match=r"waypoint 2, the robot is 1\.00 m from .* 1\.01 m"):
        check_clearance(ROOM, drive, 1.01)


def test_a_drive_through_a_wall_names_the_waypoint() -> None:
    through = plan_drive([Waypoint(1, 1), Waypoint(3, 1), Waypoint(3, 5.5)])
    with pytest.raises(DataError, match="on the way to waypoint 3, the robot is"):
        check_clearance(ROOM, through)


def test_a_collision_after_a_long_way() -> None:
    """Within a radius of the wall, at x = 6; 300 km are checked within seconds."""
    start = time.process_time()
    drive = plan_drive([Waypoint(3e5, 1), Waypoint(1, 1)])
    with pytest.raises(
        DataError, match=r"at \(6\.(0[89]|1[0-5]), 1\.00\), on the way to waypoint 2"
    ):
        check_clearance(ROOM, drive)
    assert time.process_time() - start < 10


def test_a_start_in_an_obstacle() -> None:
    grid = GridMap(np.array([[0, 0, 0], [0, 1, 1], [0, 1, 1]], dtype=np.float32), 5.0)
    with pytest.raises(DataError, match=r"waypoint 1 \(10, 5\) lies in an obstacle"):
        check_clearance(grid, plan_drive([Waypoint(10, 5), Waypoint(10, 6)]))


def test_the_apartment_fixture_is_as_promised() -> None:
    file = FIXTURES / "apartment.mcap"
    assert file.stat().st_size <= 600_000
    with file.open("rb") as stream:
        statistics = make_reader(stream).get_summary().statistics
    seconds = (statistics.message_end_time - statistics.message_start_time) / 1e9
    assert 60 <= seconds <= 120
