"""The options with which every command that reads a log reads it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import wraps
from typing import Any, TypeVar

import click

from mapcli.commands._mount_types import LaserPoseType, SensorType
from mapcli.commands._options import FILE, NOT_NEGATIVE, NumberList
from mapcli.commands._say import say, warn
from mapcli.formats.logs.csv.sensors_file import existing_sensors_file
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.model.log import ALL_TOPICS, LogOptions
from mapcli.model.scan import Mount, Record

Command = TypeVar("Command", bound=Callable[..., Any])

DEFAULTS = LogOptions()


@dataclass(frozen=True)
class LogInput:
    """What part of a log is read, and how.

    Attributes:
        options: topics, mount, clock and strictness.
        start_s, end_s, every: see `model.selection.select`.
    """

    options: LogOptions = DEFAULTS
    start_s: float | None = None
    end_s: float | None = None
    every: int = 1

    def open(self, paths: Sequence[str]) -> Log:
        """Open the recording. Raises what `open_log` raises."""
        return open_log(paths, self.options)

    def inputs(self, paths: Sequence[str]) -> list[str]:
        """The files that are read for a recording, which no output may replace."""
        beside = [self.options.sensors_file or existing_sensors_file(path) for path in paths]
        return [*paths, *filter(None, dict.fromkeys(beside))]

    def records(self, log: Log) -> Iterator[Record]:
        """The records asked for; `log.damage` accounts for the scans among them."""
        return log.records(self.start_s, self.end_s, self.every)

    def parameters(self) -> dict[str, Any]:
        """The effective parameters, for the head of a document."""
        options = asdict(self.options)
        for name in ("strict", "one_recording"):
            options.pop(name)  # changes whether there is a result, never the result
        return {**options, "start_s": self.start_s, "end_s": self.end_s, "every": self.every}


OPTIONS = (
    click.option(
        "--scan-topic",
        "scan_topics",
        metavar="TOPIC",
        multiple=True,
        help="Where the scans are, if there are several. Repeatable, for several lasers that "
        f"make one map; `{ALL_TOPICS}` takes every topic of scans.",
    ),
    click.option(
        "--odom-topic",
        metavar="TOPIC",
        help="Where the odometry is; may be /tf, "
        "whatever its frames are called, or a topic of poses.",
    ),
    click.option(
        "--laser-pose",
        type=LaserPoseType(),
        help="Where the laser sits on the robot, in metres and degrees, instead of what the log "
        "says; `flip` if it hangs upside down.",
    ),
    click.option(
        "--cloud-height",
        type=NumberList("LO,HI"),
        default=DEFAULTS.cloud_height,
        show_default=True,
        help="Of a point cloud (PointCloud2, read where there are no scans), the points so high "
        "above its sensor, metres; of each bearing, the nearest counts.",
    ),
    click.option(
        "--sensor",
        "sensors",
        type=SensorType("TOPIC=X,Y,YAW_DEG"),
        multiple=True,
        help="Where a range sensor with one beam (sensor_msgs/Range) sits on the robot, in metres "
        "and degrees, instead of what the log says. Repeatable.",
    ),
    click.option(
        "--sensors",
        "sensors_file",
        metavar="F",
        type=FILE,
        help="YAML that says where the sensors of a CSV log sit, and in what units.  [default: "
        "the log's name with .yaml]",
    ),
    click.option(
        "--time-source",
        type=click.Choice(("auto", "header", "log")),
        default=DEFAULTS.time_source,
        show_default=True,
        help="Use the stamps in the messages, or the times of their recording; auto: the stamps, "
        "unless they evidently do not tell the time.",
    ),
    click.option(
        "--range-unit",
        type=click.Choice(("m", "cm", "mm")),
        default=DEFAULTS.range_unit,
        show_default=True,
        help="The unit of the scans' readings.",
    ),
    click.option(
        "--angle-unit",
        type=click.Choice(("rad", "deg")),
        default=DEFAULTS.angle_unit,
        show_default=True,
        help="The unit of the scans' angles.",
    ),
    click.option(
        "--turn-time",
        type=NOT_NEGATIVE,
        metavar="S",
        help="Seconds of a full turn of a laser that spins: its beams are taken one after "
        "another; 0: all at once.  [default: as the log's time_increment says, or its scans show]",
    ),
    click.option(
        "--scan-stamp",
        type=click.Choice(("first", "middle", "last")),
        default=DEFAULTS.scan_stamp,
        show_default=True,
        help="Which beam the stamp of a scan is of, where they are taken one after another.",
    ),
    click.option(
        "--beam-order",
        type=click.Choice(("forward", "backward")),
        help="Whether the first beam of the array is taken first, or the last one.  "
        "[default: found out]",
    ),
    click.option("--start", type=NOT_NEGATIVE, metavar="S", help="Leave out the first S seconds."),
    click.option(
        "--end", type=NOT_NEGATIVE, metavar="S", help="Stop S seconds after the log's start."
    ),
    click.option(
        "--every",
        type=click.IntRange(1),
        default=LogInput.every,
        show_default=True,
        metavar="N",
        help="Use every N-th scan.",
    ),
    click.option(
        "--strict", is_flag=True, help="Refuse a damaged log instead of using what can be read."
    ),
    click.option(
        "--one-recording",
        is_flag=True,
        help="Read as one recording what seems to be several: overlapping times, gaps of hours, "
        "odometry that starts again.",
    ),
)


def log_input_options(command: Command) -> Command:
    """Add the options; the command receives them as one argument, `log_input: LogInput`."""

    @wraps(command)
    def with_input(
        *args: Any,
        scan_topics: tuple[str, ...],
        odom_topic: str | None,
        laser_pose: Mount | None,
        cloud_height: tuple[float, float],
        sensors: tuple[tuple[str, Mount], ...],
        sensors_file: str | None,
        time_source: Any,
        turn_time: float | None,
        scan_stamp: Any,
        beam_order: Any,
        start: float | None,
        end: float | None,
        every: int,
        range_unit: Any,
        angle_unit: Any,
        strict: bool,
        one_recording: bool,
        **rest: Any,
    ) -> Any:
        if start is not None and end is not None and end < start:
            raise click.UsageError("--end is before --start.")
        if cloud_height[0] >= cloud_height[1]:
            raise click.UsageError("--cloud-height LO,HI: HI is not above LO.")
        options = LogOptions(
            scan_topics=scan_topics,
            odom_topic=odom_topic,
            laser_pose=laser_pose,
            cloud_height=cloud_height,
            sensors=sensors,
            sensors_file=sensors_file,
            time_source=time_source,
            strict=strict,
            one_recording=one_recording,
            range_unit=range_unit,
            angle_unit=angle_unit,
            scan_stamp=scan_stamp,
            turn_time=turn_time,
            beam_order=beam_order,
        )
        return command(*args, log_input=LogInput(options, start, end, every), **rest)

    for option in reversed(OPTIONS):
        with_input = option(with_input)
    return with_input  # type: ignore[return-value]


def say_notes(log: Log, *, verbose: bool = False, quiet: bool = False) -> None:
    """Tell on stderr how a log was understood and, with -q too, what was wrong with it."""
    if verbose and not quiet:
        say(f"Scans from {', '.join(log.scan_topics) or None}, odometry from {log.odom_topic}.")
    for text in () if quiet else log.notes:
        say(f"Note: {text}")
    for found in log.breaks if log.options.one_recording and not quiet else ():
        say(f"Note: read as one recording, though {found.what}")
    warn(log.name, log.damage.lines())
