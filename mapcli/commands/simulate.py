"""`mapcli simulate`: drive a simulated robot through a world and write its log."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import click

from mapcli import simulate
from mapcli.algorithms.simulation.drive import MotionLimits
from mapcli.algorithms.simulation.sensors import FAULT_KINDS, Fault, LaserModel, WheelModel
from mapcli.algorithms.simulation.simulate import ROBOT_RADIUS, Simulation
from mapcli.commands._mowing import mow_lawn, mow_options
from mapcli.commands._options import (
    FILE,
    POSE,
    POSITIVE,
    Command,
    NumberList,
    common_options,
    no_clobber_option,
)
from mapcli.commands._output import check_outputs, progress
from mapcli.commands._say import say, warn
from mapcli.errors import DataError
from mapcli.model.scan import Mount

LIMITS, WHEELS, LASER = MotionLimits(), WheelModel(), LaserModel()


class FaultType(click.ParamType[Any]):
    """`KIND@T0-T1` on the command line, a `Fault` inside."""

    name = "KIND@T0-T1"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, Fault):
            return value
        match = re.fullmatch(r"(.+)@([\d.]+)-([\d.]+)", value)
        try:
            kind, begin, end = match.groups() if match else ("", "", "")
            return Fault(kind, float(begin), float(end))  # type: ignore[arg-type]
        except ValueError:
            kinds = ", ".join(FAULT_KINDS)
            self.fail(f"{value!r} is not of the form {self.name}, KIND one of {kinds}.", param, ctx)
        except DataError as error:
            self.fail(f"{value!r}: {error}.", param, ctx)


def _option(flag: str, default: Any, text: str, **settings: Any) -> Callable[[Command], Command]:
    return click.option(flag, default=default, show_default=True, help=text, **settings)


@click.command()
@click.argument("world", metavar="WORLD", type=FILE)
@click.argument("out", metavar="[OUT.mcap]", type=FILE, required=False)
@click.option("--path", metavar="FILE", type=FILE, help="Waypoints to drive along.")
@_option("--seed", 0, "Of the noise; 0 is a seed like any other.", type=click.IntRange(0))
@_option("--speed", LIMITS.speed, "Metres per second, at most.")
@_option("--acceleration", LIMITS.acceleration, "Metres per second squared, at most.")
@_option("--turn-rate-deg", LIMITS.turn_rate_deg, "Degrees per second, at most.")
@_option("--turn-acceleration-deg", LIMITS.turn_acceleration_deg, "The same squared, at most.")
@_option("--corner-cut", LIMITS.corner_cut, "Metres that arcs cut off corners; 0 turns in place.")
@_option("--robot-radius", ROBOT_RADIUS, "Metres to keep from obstacles.", type=POSITIVE)
@_option("--odom-rate", WHEELS.rate, "Odometry readings and true poses per second.")
@_option(
    "--odom-noise",
    ",".join(map(str, WHEELS.noise)),
    "Standard deviations: of the heading (rad) after a turn of 1 rad, after 1 m; "
    "of the way (m) after 1 m, after a turn of 1 rad.",
    type=NumberList("A1,A2,A3,A4"),
)
@_option("--odom-scale", WHEELS.scale, "Factor on the metres that the wheels count.")
@_option("--odom-turn-scale", WHEELS.turn_scale, "Factor on the turns that the wheels count.")
@_option("--odom-drift-deg", WHEELS.drift_deg, "Degrees per metre that they do not notice.")
@click.option(
    "--odom-fault",
    "faults",
    type=FaultType(),
    multiple=True,
    help="Wheels wrong from second T0 to T1 of the log; KIND is reverse-sign (metres count "
    "backwards), slip (wheels turn on, robot stands) or freeze (robot moves, wheels count "
    "nothing). Repeatable.",
)
@_option("--scan-rate", LASER.rate, "Scans per second.")
@_option("--beams", LASER.beams, "Beams of a scan.")
@_option("--fov-deg", LASER.fov_deg, "Degrees that they cover, centred ahead.")
@_option("--range-min", LASER.range_min, "Metres; closer reads -inf.")
@_option("--range-max", LASER.range_max, "Metres; farther reads +inf.")
@_option("--range-noise", LASER.noise, "Standard deviation of a range, metres.")
@_option("--dropout", LASER.dropout, "Share of the beams that read NaN.")
@_option("--laser-pose", "0,0,0", "Where the laser sits on the robot.", type=POSE)
@mow_options
@no_clobber_option
@common_options
def command(
    world: str, out: str | None, path: str | None, mow: bool, robot_radius: float, quiet: bool,
    verbose: bool, **given: Any,
) -> None:  # fmt: skip
    """Drive a simulated robot through WORLD and write its log: odometry with noise (/odom), laser
    scans (/scan) and the true poses (/ground_truth).

    WORLD is YAML with `polygons:`, solid obstacles as lists of [x, y] in metres, or a grid map
    whose cells of 0.5 and more are solid; beams pass through its unknown cells. FILE has one
    waypoint a line, `X Y [back] [speed=M/S] [pause=S]`, the first is the start; `back` drives
    there in reverse. The same input, options and seed give the same bytes.

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
      mapcli simulate fixtures/lawn.yaml --mow --landmarks 16 --png mowers.png
    """
    from mapcli import load_waypoints, load_world

    _check_usage(world, out, path, mow, given)
    try:
        limits, wheels, laser = _models(given)
    except DataError as error:
        raise click.UsageError(f"{error}.") from error
    if mow:
        mow_lawn(world, out, wheels, given, quiet=quiet)
        return
    assert path is not None
    assert out is not None
    check_outputs([out], [world, path], "inputs", no_clobber=given["no_clobber"])
    loaded = load_world(world)
    warn(world, loaded.warnings, quiet=quiet)
    with _names(path):
        simulation = simulate(
            loaded.world, load_waypoints(path), limits=limits, wheels=wheels, laser=laser,
            robot_radius=robot_radius, seed=given["seed"],
        )  # fmt: skip
    _write(simulation, out, given["no_clobber"], quiet)
    if not quiet:
        _report(simulation, verbose)


def _check_usage(
    world: str, out: str | None, path: str | None, mow: bool, given: dict[str, Any]
) -> None:
    if mow and (path or given["faults"]):
        raise click.UsageError("--mow drives its own way: leave out --path and --odom-fault.")
    if not mow and (path is None or out is None):
        missing = "argument 'OUT.mcap'" if path else "option '--path'"
        raise click.UsageError(f"Missing {missing} (or add --mow to mow a lawn).")
    if not mow and (given["landmarks"] or given["png"] or given["json"]):
        raise click.UsageError("--landmarks, --png and --json are for --mow.")
    if world == path == "-":
        raise click.UsageError("WORLD and --path cannot both be standard input.")


def _models(given: dict[str, Any]) -> tuple[MotionLimits, WheelModel, LaserModel]:
    limits = MotionLimits(
        speed=given["speed"],
        acceleration=given["acceleration"],
        turn_rate_deg=given["turn_rate_deg"],
        turn_acceleration_deg=given["turn_acceleration_deg"],
        corner_cut=given["corner_cut"],
    )
    wheels = WheelModel(
        rate=given["odom_rate"],
        noise=given["odom_noise"],
        scale=given["odom_scale"],
        turn_scale=given["odom_turn_scale"],
        drift_deg=given["odom_drift_deg"],
        faults=given["faults"],
    )
    laser = LaserModel(
        rate=given["scan_rate"],
        beams=given["beams"],
        fov_deg=given["fov_deg"],
        range_min=given["range_min"],
        range_max=given["range_max"],
        noise=given["range_noise"],
        dropout=given["dropout"],
        mount=Mount(given["laser_pose"]),
    )
    return limits, wheels, laser


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

    records = progress(simulation.records(), "Driving", simulation.record_count, quiet=quiet)
    save_log(records, out, no_clobber=no_clobber)


def _report(simulation: Simulation, verbose: bool) -> None:
    for number, time in enumerate(simulation.arrivals() if verbose else (), start=1):
        pose = simulation.true_pose(time)
        say(f"{time:8.2f} s  waypoint {number:3}  ({pose.x:.2f}, {pose.y:.2f})")
    say(
        f"{simulation.drive.distance:.1f} m in {simulation.duration:.1f} s, "
        f"{simulation.scan_count:,} scans, {simulation.reading_count:,} odometry readings",
    )
