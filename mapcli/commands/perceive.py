"""`mapcli perceive`: what a robot perceives at a pose of a map, or did at a moment of a log."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from mapcli import expect_perceptions
from mapcli.algorithms.similarity.confusion import ReadingNoise, noisy_trials
from mapcli.algorithms.similarity.expected_perception import RangeSensor, perception_at_intended
from mapcli.commands._log_options import LogInput, log_input_options, say_notes
from mapcli.commands._map_options import dialect_option
from mapcli.commands._options import (
    CELL,
    FILE,
    NOT_NEGATIVE,
    POSITIVE,
    Number,
    PoseType,
    common_options,
    no_clobber_option,
    numbers_in,
)
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say, warn
from mapcli.errors import DataError
from mapcli.formats.documents.perception_writer import SUFFIXES, Writable, dump_perception
from mapcli.formats.output import write_bytes
from mapcli.model.grid import GridMap
from mapcli.model.perception import (
    STEPS,
    TURNS_DEG,
    IntendedPose,
)
from mapcli.model.pose import FARTHEST_M, Pose2D
from mapcli.model.world import World

SENSOR = RangeSensor()


class Numbers(click.ParamType[Any]):
    """Numbers separated by commas."""

    name = "N,..."

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, tuple):
            return value
        numbers = numbers_in(value)
        if (
            not numbers
            or len(set(numbers)) < len(numbers)
            or not all(abs(number) <= FARTHEST_M for number in numbers)
        ):
            self.fail(f"{value!r} is not a list of numbers, each once.", param, ctx)
        return numbers


class Noise(Numbers):
    """Standard deviations: of distances, and of bearings in degrees."""

    name = "SD[,SD_DEG]"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        parts = value.split(",") if isinstance(value, str) else value
        try:
            found = tuple(float(part) for part in parts)
        except ValueError:
            found = ()
        if len(found) not in (1, 2) or not all(0 <= number <= FARTHEST_M for number in found):
            self.fail(f"{value!r} is not of the form {self.name}, 0 or more.", param, ctx)
        return (*found, 0.0)[:2]


def _text(numbers: tuple[float, ...]) -> str:
    return ",".join(f"{number:g}" for number in numbers)


@click.command(short_help="Write what a robot perceives at a pose, or at a moment of a log.")
@click.argument("source", metavar="MAP_OR_LOG", type=FILE)
@click.argument("out", metavar="OUT", type=FILE)
@click.option("--pose", type=PoseType("X,Y,THETA_DEG"), help="The intended pose in a map.")
@click.option("--cell", type=CELL, help="The middle of this cell instead, with --heading-deg.")
@click.option("--heading-deg", type=Number(-360, 360), default=0.0, show_default=True,
              help="The heading in --cell; 0 is right, 90 up.")  # fmt: skip
@click.option("--at", type=NOT_NEGATIVE, metavar="SECONDS", help="Of a log: cut out the scan at "
              "this time after its start.")  # fmt: skip
@click.option("--steps", type=Numbers(), default=_text(STEPS), show_default=True,
              help="How far the neighbouring candidates are, in cells (units without cells); 0 "
              "for none.")  # fmt: skip
@click.option("--turns-deg", type=Numbers(), default=_text(TURNS_DEG), show_default=True,
              help="Headings of the candidates against the intended one.")  # fmt: skip
@click.option("--alone", is_flag=True, help="Write one perception, the one at the pose itself, "
              "instead of a database.")  # fmt: skip
@click.option("--noise", type=Noise(), help="Of the sensor: the standard deviation of ranges and "
              "distances, in the map's unit, and of bearings, degrees.")  # fmt: skip
@click.option("--times", type=click.IntRange(1, 10_000), default=1, show_default=True,
              help="With --noise: so many sets of readings at each pose.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the noise.")
@click.option("--beams", type=click.IntRange(1, 100_000), default=SENSOR.beams, show_default=True,
              help="Of the sensor that looks at a grid map or polygons.")  # fmt: skip
@click.option("--fov-deg", type=Number(0, 360, min_open=True), default=SENSOR.fov_deg,
              show_default=True, help="Degrees that they cover, centred ahead.")  # fmt: skip
@click.option("--range-max", type=POSITIVE, default=SENSOR.range_max, show_default=True,
              help="How far it sees, in the map's unit.")  # fmt: skip
@dialect_option
@log_input_options
@no_clobber_option
@common_options
def command(
    source: str, out: str, pose: Pose2D | None, cell: tuple[int, int] | None,
    heading_deg: float, at: float | None, steps: tuple[float, ...], turns_deg: tuple[float, ...],
    alone: bool, noise: tuple[float, float] | None, times: int, seed: int, beams: int,
    fov_deg: float, range_max: float, dialect: Any, log_input: LogInput, no_clobber: bool,
    quiet: bool, verbose: bool,
) -> None:  # fmt: skip
    """Write what a robot expects to perceive at a pose of a map and at the candidate poses around
    it (the database of Activity 9.5), or what it did perceive at a moment of a log.

    In a grid map or among polygons, that is a scan: the ranges along the beams. In a points map,
    it is the distance and bearing of each point. OUT ends in .yaml or .json; - is YAML on standard
    output. `mapcli similarity-table` reads it.

    \b
    Examples:
      mapcli perceive fixtures/corner.txt --cell 4,6 --heading-deg 90 database.yaml
      mapcli perceive fixtures/landmarks-map.yaml --pose 0,1,-15 --alone measured.yaml
      mapcli perceive fixtures/landmarks-map.yaml --pose 0,0,0 --noise 0.1,5 --times 20 trials.yaml
      mapcli perceive fixtures/apartment.mcap --at 30 scan.yaml
    """
    chosen = [value for value in (pose, cell, at) if value is not None]
    if len(chosen) != 1:
        raise click.UsageError("Say --pose X,Y,THETA_DEG or --cell ROW,COL of a map, or --at "
                               "SECONDS of a log: one of them.")  # fmt: skip
    if out != "-" and Path(out).suffix.lower() not in SUFFIXES:
        raise click.UsageError(f"{out}: does not end in {', '.join(SUFFIXES)}.")
    if noise is None and times > 1:
        raise click.UsageError("--times needs --noise: without it they are all the same.")
    if noise is not None and (alone or at is not None):
        raise click.UsageError("--noise is for all candidate poses of a map; --steps 0 and "
                               "--turns-deg 0 leave the one.")  # fmt: skip
    if min(steps) < 0:
        raise click.UsageError("--steps are lengths, so they are not negative.")
    check_outputs([out], log_input.inputs([source]), "inputs", no_clobber=no_clobber)
    if at is not None:
        data, said = _from_log(source, at, log_input, out, quiet=quiet, verbose=verbose)
    else:
        place = IntendedPose(pose.theta, (pose.x, pose.y)) if pose else IntendedPose(
            math.radians(heading_deg), cell=cell)  # fmt: skip
        try:
            world = _world(source, dialect, quiet=quiet)
            sensor = RangeSensor(beams, fov_deg, range_max)
            database = expect_perceptions(world, place, steps, turns_deg, sensor)
        except DataError as error:
            error.file = error.file or source
            raise
        content: Writable = database
        said = f"{len(database.expectations)} poses, {database.of}"
        if noise is not None:
            reading_noise = ReadingNoise(noise[0], math.radians(noise[1]), seed)
            trials = noisy_trials(database, reading_noise, times)
            content, said = trials, f"{len(trials.trials)} sets of readings, {database.of}"
        elif alone:
            content = perception_at_intended(database, place, steps, turns_deg)
            said = f"1 pose, {database.of}"
        data = dump_perception(content, out)
    write_bytes(out, data, no_clobber=no_clobber)
    if not quiet:
        say(said)


def _world(source: str, dialect: Any, *, quiet: bool) -> World | GridMap:
    from mapcli import load_map, load_world

    loaded = load_world(source)
    if isinstance(loaded.world, World) or source == "-" or dialect == "nav2":
        world, warnings = loaded.world, loaded.warnings
    else:
        again = load_map(source, dialect=dialect)
        world, warnings = again.grid, again.warnings
    warn(source, warnings, quiet=quiet)
    return world


def _from_log(
    source: str, at: float, log_input: LogInput, out: str, *, quiet: bool, verbose: bool
) -> tuple[bytes, str]:
    """The scan at a time of a log, and what to say about it; errors name the log.

    Raises:
        DataError: there is no such scan.
    """
    from mapcli import extract_scan
    from mapcli.algorithms.scans.scan_extraction import scan_perception
    from mapcli.algorithms.slam.sweep_search import SweepSearch

    log = log_input.open([source])
    part = log_input.start_s, log_input.end_s, log_input.every
    try:
        found = extract_scan(log.records(), at, *part, settled=SweepSearch().settled)
        perception = scan_perception(found.scan, found.pose())
    except DataError as error:
        error.file = error.file or log.name
        raise
    say_notes(log, verbose=verbose, quiet=quiet)
    said = f"scan {found.number} at {found.seconds:.2f} s, {len(perception.beams)} beams"
    if found.odom is None:
        said += "; the log has no odometry there, so its pose is 0, 0, 0"
    return dump_perception(perception, out, found.odom), said
