"""`mapcli simulate`: drive a simulated robot through a world and write its log."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import click

from mapcli import simulate
from mapcli.algorithms.simulation.drive import MotionLimits
from mapcli.algorithms.simulation.simulate import START_NS, Simulation
from mapcli.commands._mowing import mow_lawn, mow_options
from mapcli.commands._options import FILE, UNIX_TIME, common_options, no_clobber_option
from mapcli.commands._output import check_outputs, progress
from mapcli.commands._robot_options import robot_of, robot_options, sensors_of
from mapcli.commands._say import say, warn
from mapcli.errors import DataError
from mapcli.formats.logs.csv.writer import beside, is_csv, save_csv_log
from mapcli.model.grid import GridMap
from mapcli.model.scan import NANOSECONDS, Mount
from mapcli.model.waypoint import Waypoint
from mapcli.model.world import World


@click.command()
@click.argument("world", metavar="WORLD", type=FILE)
@click.argument("out", metavar="[OUT.mcap|OUT.csv]", type=FILE, required=False)
@click.option(
    "--path", metavar="FILE", type=FILE, help="Waypoints to drive along, or a pose trace."
)
@click.option(
    "--tour",
    metavar="N",
    type=click.IntRange(1, 1000),
    help="Find a way through WORLD, a grid map, to N places and back, instead of --path.",
)
@click.option(
    "--seed",
    default=0,
    show_default=True,
    type=click.IntRange(0),
    help="Of noise, tour, people and glass; 0 is a seed like any other.",
)
@click.option(
    "--start-time",
    metavar="UNIX_S",
    default=START_NS / NANOSECONDS,
    show_default=True,
    type=UNIX_TIME,
    help="When the drive begins.",
)
@robot_options
@mow_options
@no_clobber_option
@common_options
def command(
    world: str, out: str | None, path: str | None, mow: bool, quiet: bool, verbose: bool,
    **given: Any,
) -> None:  # fmt: skip
    """Drive a simulated robot through WORLD and write its log: odometry with noise (/odom), laser
    scans (/scan) and the true poses (/ground_truth).

    WORLD is YAML with `polygons:`, solid obstacles as lists of [x, y] in metres, or a grid map
    whose cells of 0.5 and more are solid; beams pass through its unknown cells. FILE has one
    waypoint a line, `X Y [back] [speed=M/S] [pause=S]`, the first is the start; `back` drives
    there in reverse. A pose trace (.json, .tum, .kitti, .g2o, .csv) will do as well. With --tour
    the robot finds its own way and keeps --robot-radius from all that is not known to be open. The
    same input, options and seed give the same bytes.

    With --sensor the robot has range sensors with one beam each instead of the laser, like a ring
    of sonars. OUT.csv gets their readings with the odometry of the same moment, and OUT.yaml where
    they sit; true poses are in OUT.mcap only.

    With --mow, WORLD is a lawn: one polygon, and a point if the charging station is not where the
    first lane begins. The mower steers by its odometry, and by landmarks that it recognises when
    its floor sensor comes upon them; the report says how far from the station it ends, how
    consistently, and how large landmarks must be. OUT.mcap may be left out; it gets odometry and
    true poses of the first run (with landmarks if there are any). Obstacles, the laser and faults
    play no part then, nor the limits of acceleration.

    \b
    Examples:
      mapcli simulate fixtures/corridor.yaml --path fixtures/corridor-path.txt corridor.mcap
      mapcli simulate fixtures/apartment.yaml --path fixtures/apartment-path.txt \\
          --seed 7 --odom-fault reverse-sign@12-17 --range-max 8 apartment.mcap
      mapcli simulate map.yaml --tour 8 --people 6 --glass 0.1 --turn-time 0.1 busy.mcap
      mapcli simulate map.yaml --tour 8 --odom-delay 0.2 --odom-fault stale@20-22 \\
          --odom-fault slip-left@40-45 --no-return 51.14,51.15 wheels.mcap
      mapcli simulate map.yaml --tour 8 --fov-deg 180 --laser-pose 0.2,0,0 \\
          --rear-laser-pose -0.2,0,180 --start-time 1700000000 cart.mcap
      mapcli simulate fixtures/corridor.yaml --path fixtures/corridor-path.txt --range-max 1 \\
          --sensor front=0.06,0,0 --sensor left=0,0.05,90 --sensor right=0,-0.05,-90 small.csv
      mapcli simulate fixtures/lawn.yaml --mow --landmarks 16 --png mowers.png
    """
    from mapcli import load_waypoints, load_world

    _check_usage(world, out, path, mow, given)
    try:
        limits, wheels, laser = robot_of(given)
        sensors = sensors_of(given, laser)
    except DataError as error:
        raise click.UsageError(f"{error}.") from error
    if mow:
        mow_lawn(world, out, wheels, given, quiet=quiet)
        return
    assert out is not None
    inputs = [world, *([path] if path else [])]
    if is_csv(out) and not sensors:
        raise click.UsageError(f"{out}: a CSV log has range sensors; add --sensor.")
    outputs = [out, beside(out)] if is_csv(out) else [out]
    check_outputs(outputs, inputs, "inputs", no_clobber=given["no_clobber"])
    loaded = load_world(world)
    warn(world, loaded.warnings, quiet=quiet)
    with _names(path or world):
        ways = load_waypoints(path) if path else _tour(loaded.world, limits, given)
        simulation = simulate(
            loaded.world, ways, limits=limits, wheels=wheels, laser=laser,
            robot_radius=given["robot_radius"], seed=given["seed"],
        )  # fmt: skip
        rear = given["rear_laser_pose"]
        simulation = replace(
            simulation, people=given["people"], glass=given["glass"],
            rear=replace(laser, mount=Mount(rear)) if rear else None,
            start_ns=round(given["start_time"] * NANOSECONDS), sensors=sensors,
            staggered=given["stagger"],
        )  # fmt: skip
    _write(simulation, out, given["no_clobber"], quiet)
    if not quiet:
        _report(simulation, verbose)


def _check_usage(
    world: str, out: str | None, path: str | None, mow: bool, given: dict[str, Any]
) -> None:
    if mow and (path or given["tour"] or given["faults"]):
        raise click.UsageError(
            "--mow drives its own way: leave out --path, --tour and --odom-fault."
        )
    if path and given["tour"]:
        raise click.UsageError("--path and --tour are two ways: leave out one.")
    if not mow and (not (path or given["tour"]) or out is None):
        missing = "argument 'OUT.mcap'" if path or given["tour"] else "option '--path'"
        raise click.UsageError(f"Missing {missing} (or add --mow to mow a lawn).")
    if not mow and (given["landmarks"] or given["png"] or given["json"]):
        raise click.UsageError("--landmarks, --png and --json are for --mow.")


def _tour(world: World | GridMap, limits: MotionLimits, given: dict[str, Any]) -> list[Waypoint]:
    from mapcli import plan_tour

    if isinstance(world, World):
        raise DataError("is no grid map", expected="one for --tour; mapcli rasterize makes it")
    return plan_tour(world, given["tour"], given["robot_radius"], limits, given["seed"])


@contextmanager
def _names(file: str) -> Iterator[None]:
    """Say which file an algorithm's complaint is about."""
    try:
        yield
    except DataError as error:
        error.file = error.file or file
        raise


def _write(simulation: Simulation, out: str, no_clobber: bool, quiet: bool) -> None:
    from mapcli import save_log
    from mapcli.formats.logs.topics import LogNames

    records = progress(simulation.records(), "Driving", simulation.record_count, quiet=quiet)
    if is_csv(out):
        sensors = {name: sensor.blank(name) for name, sensor in simulation.sensors.items()}
        save_csv_log(records, sensors, out, no_clobber=no_clobber)
        return
    save_log(records, out, LogNames(topic_per_mount=True), no_clobber=no_clobber)


def _report(simulation: Simulation, verbose: bool) -> None:
    for number, time in enumerate(simulation.arrivals() if verbose else (), start=1):
        pose = simulation.true_pose(time)
        say(f"{time:8.2f} s  waypoint {number:3}  ({pose.x:.2f}, {pose.y:.2f})")
    seen = "readings of range sensors" if simulation.sensors else "scans"
    say(
        f"{simulation.drive.distance:.1f} m in {simulation.duration:.1f} s, "
        f"{simulation.scan_count:,} {seen}, {simulation.reading_count:,} odometry readings",
    )
