"""The options of `mapcli simulate` that say what the robot is like, and what troubles it."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any, get_args

import click

from mapcli.algorithms.simulation.drive import MotionLimits
from mapcli.algorithms.simulation.sensors import FAULT_KINDS, Fault, LaserModel, WheelModel
from mapcli.algorithms.simulation.simulate import ROBOT_RADIUS
from mapcli.commands._mount_types import SensorType
from mapcli.commands._options import POSE, POSITIVE, Command, Number, NumberList
from mapcli.errors import DataError
from mapcli.model.scan import Mount
from mapcli.model.sweep import BeamOrder

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


class CodesType(click.ParamType[Any]):
    """`M` or `M,M,...` on the command line, a tuple of numbers inside."""

    name = "M[,M...]"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, tuple):
            return value
        try:
            return tuple(float(word) for word in str(value).split(","))
        except ValueError:
            self.fail(f"{value!r} is not of the form {self.name}.", param, ctx)


_OPTIONS: tuple[tuple[str, Any, str, dict[str, Any]], ...] = (
    ("--speed", LIMITS.speed, "Metres per second, at most.", {}),
    ("--acceleration", LIMITS.acceleration, "Metres per second squared, at most.", {}),
    ("--turn-rate-deg", LIMITS.turn_rate_deg, "Degrees per second, at most.", {}),
    ("--turn-acceleration-deg", LIMITS.turn_acceleration_deg, "The same squared, at most.", {}),
    ("--corner-cut", LIMITS.corner_cut, "Metres that arcs cut off corners; 0 turns in place.", {}),
    ("--robot-radius", ROBOT_RADIUS, "Metres to keep from obstacles.", {"type": POSITIVE}),
    ("--odom-rate", WHEELS.rate, "Odometry readings and true poses per second.", {}),
    ("--odom-noise", ",".join(map(str, WHEELS.noise)),
     "Standard deviations: of the heading (rad) after a turn of 1 rad, after 1 m; "
     "of the way (m) after 1 m, after a turn of 1 rad.", {"type": NumberList("A1,A2,A3,A4")}),
    ("--odom-scale", WHEELS.scale, "Factor on the metres that the wheels count.", {}),
    ("--odom-turn-scale", WHEELS.turn_scale, "Factor on the turns that the wheels count.", {}),
    ("--odom-drift-deg", WHEELS.drift_deg, "Degrees per metre that they do not notice.", {}),
    ("--odom-delay", WHEELS.delay, "Seconds by which readings lag behind their stamps.", {}),
    ("--scan-rate", LASER.rate, "Scans per second.", {}),
    ("--beams", LASER.beams, "Beams of a scan.", {}),
    ("--fov-deg", LASER.fov_deg, "Degrees that they cover, centred ahead.", {}),
    ("--turn-time", LASER.turn_time,
     "Seconds of a full turn of the laser, in which it takes its beams one after another "
     "(time_increment of the scans); 0 takes all at once.", {}),
    ("--beam-order", LASER.order, "`backward`: the beam taken first is the last of a scan, as with "
     "lasers that turn clockwise.", {"type": click.Choice(get_args(BeamOrder))}),
    ("--range-min", LASER.range_min, "Metres; closer reads -inf.", {}),
    ("--range-max", LASER.range_max, "Metres; farther reads +inf.", {}),
    ("--range-noise", LASER.noise, "Standard deviation of a range, metres.", {}),
    ("--dropout", LASER.dropout, "Share of the beams that read NaN.", {}),
    ("--stray", LASER.stray, "Share of the beams that read anything within the range.", {}),
    ("--laser-pose", "0,0,0", "Where the laser sits on the robot.", {"type": POSE}),
    ("--people", 0, "How many people walk about, from somewhere on the robot's way.",
     {"type": click.IntRange(0, 1000)}),
    ("--glass", 0.0, "Share of the walls that are glass, which the laser sees only within 10 "
     "degrees of straight on.", {"type": Number(0, 1)}),
)  # fmt: skip
"""Flag, default, help, settings."""

_FAULTS = click.option(
    "--odom-fault", "faults", type=FaultType(), multiple=True,
    help="Odometry wrong from second T0 to T1 of the log; KIND is reverse-sign (metres count "
    "backwards), slip (wheels turn on, robot stands), slip-left or slip-right (that wheel turns "
    "half as much again as it rolls), freeze (robot moves, wheels count nothing), stale "
    "(readings stand still, then catch up) or turn (the right wheel loses its grip: the robot ends "
    "15 degrees clockwise of what is counted, Sect. 9.5). Repeatable.",
)  # fmt: skip

_NO_RETURN = click.option(
    "--no-return", type=CodesType(), default=(),
    help="What beams read that see nothing within --range-max: one of these.  [default: +inf]",
)  # fmt: skip

_REAR = click.option(
    "--rear-laser-pose", type=POSE,
    help="Where a second laser sits, like the first one, on the topic /scan_2.  [default: none]",
)  # fmt: skip


_SENSOR = click.option(
    "--sensor", "sensors", type=SensorType("NAME=X,Y,YAW_DEG"), multiple=True,
    help="A range sensor with one beam, where it sits on the robot, instead of the laser, whose "
    "rate, limits and noise it has; on the topic /range/NAME, or in the column NAME. Repeatable.",
)  # fmt: skip


_STAGGER = click.option(
    "--stagger", is_flag=True,
    help="The range sensors fire one after another, evenly within a period, as sonars do that "
    "would hear each other.",
)  # fmt: skip


def robot_options(command: Command) -> Command:
    """Drive, wheels, lasers, surroundings."""
    for option in (_REAR, _STAGGER, _SENSOR, _NO_RETURN, _FAULTS):
        command = option(command)
    for flag, default, text, settings in reversed(_OPTIONS):
        command = click.option(flag, default=default, show_default=True, help=text, **settings)(
            command
        )
    return command


def sensors_of(given: dict[str, Any], laser: LaserModel) -> dict[str, LaserModel]:
    """The range sensors, by name.

    Raises:
        click.UsageError: a name comes twice, a laser is asked for besides, or none are staggered.
    """
    sensors = {
        name: replace(laser, beams=1, fov_deg=1.0, mount=mount, turn_time=0.0)
        for name, mount in given["sensors"]
    }
    if len(sensors) < len(given["sensors"]):
        raise click.UsageError("--sensor gives two sensors the same name.")
    if given["stagger"] and not sensors:
        raise click.UsageError("--stagger is for range sensors; add --sensor.")
    if sensors and given["rear_laser_pose"]:
        raise click.UsageError("--sensor is for robots without a laser: no --rear-laser-pose.")
    return sensors


def robot_of(given: dict[str, Any]) -> tuple[MotionLimits, WheelModel, LaserModel]:
    """The models of drive, wheels and laser.

    Raises:
        DataError: a value outside its bounds.
    """
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
        delay=given["odom_delay"],
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
        stray=given["stray"],
        mount=Mount(given["laser_pose"]),
        turn_time=given["turn_time"],
        order=given["beam_order"],
        no_return=given["no_return"],
    )
    return limits, wheels, laser
