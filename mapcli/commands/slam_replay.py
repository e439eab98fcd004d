"""`mapcli slam-replay`: a robot log becomes a map and a pose trace (Algorithm 9.2)."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, replace
from typing import Any

import click

from mapcli.algorithms.matching import MatchParameters
from mapcli.algorithms.occupancy import MapParameters, units_of
from mapcli.algorithms.perception import PerceptionParameters
from mapcli.algorithms.slam import Slam, SlamParameters
from mapcli.commands._log_options import LogInput, log_input_options, say_notes
from mapcli.commands._options import (
    FILE,
    NOT_NEGATIVE,
    POSITIVE,
    Command,
    Number,
    common_options,
    no_clobber_option,
)
from mapcli.commands._output import progress
from mapcli.commands._replay_outputs import (
    ReplayOutputs,
    check_replay_outputs,
    default_folder,
    report,
    write_outputs,
)
from mapcli.errors import DataError
from mapcli.formats.logs import Log
from mapcli.model.scan import RangeScan, Record
from mapcli.model.summary import Limit, ReplaySummary
from mapcli.model.trace import PoseTrace, TracedPose

MAP, MATCH, PERCEPTION = MapParameters(), MatchParameters(), PerceptionParameters()


class LimitType(click.ParamType[Any]):
    """`used_share<0.95` on the command line, a `Limit` inside."""

    name = "EXPR"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, Limit):
            return value
        try:
            return Limit.parse(value)
        except DataError as error:
            self.fail(f"{error}.", param, ctx)


def _option(flag: str, default: Any, text: str, **settings: Any) -> Callable[[Command], Command]:
    return click.option(flag, default=default, show_default=True, help=text, **settings)


@click.command()
@click.argument("logs", metavar="LOG...", type=FILE, nargs=-1, required=True)
@click.option("-o", "folder", metavar="DIR", type=FILE, help="Folder for map.png, map.yaml + "
              "map.pgm and trace.json.  [default: the log's name with -slam]")  # fmt: skip
@click.option("--png", metavar="F", type=FILE, help="The map with the path, as a picture.")
@click.option("--map", "map_", metavar="F", type=FILE,
              help="The map: .yaml (with .pgm), .pgm, .png, .txt.")  # fmt: skip
@click.option("--json", metavar="F", type=FILE,
              help="The pose trace as JSON; - is standard output, here as everywhere.")  # fmt: skip
@click.option("--trace", metavar="F", type=FILE, help="The pose trace: .tum, .kitti, .g2o, .csv.")
@click.option("--mcap", metavar="F", type=FILE, help="Map and poses as ROS 2 messages.")
@log_input_options
@_option("--resolution", MAP.resolution, "Metres per cell.", type=Number(0.001, 100))
@click.option("--range-min", type=POSITIVE, help="Leave out readings closer than this, metres.  "
              "[default: the sensor's]")  # fmt: skip
@click.option("--range-max", type=POSITIVE, help="Take readings farther than this, metres, for no "
              "return.  [default: the sensor's]")  # fmt: skip
@_option("--no-return", PERCEPTION.no_return, "What beams without return passed: `clear` makes it "
         "open up to the maximum range, `ignore` leaves it as it was.",
         type=click.Choice(("clear", "ignore")))  # fmt: skip
@click.option("--p-hit", type=Number(0.5, 1, min_open=True, max_open=True), metavar="P",
              help="Obstacle probability of an unknown cell after one beam ended in it; nearer to "
              "0.5 for sensors that err.  [default: 0.993]")  # fmt: skip
@click.option("--p-miss", type=Number(0, 0.5, min_open=True, max_open=True), metavar="P",
              help="The same after one beam passed through.  [default: 0.19]")  # fmt: skip
@_option("--search", MATCH.search, "Where to look for each scan's pose: in a window around the "
         "odometry's, at the book's fifteen poses, or nowhere (believe the odometry).",
         type=click.Choice(("window", "book", "none")))  # fmt: skip
@_option("--window-xy", MATCH.window_xy, "Least half-width of the window, metres; it grows with "
         "the odometry's likely error.", type=NOT_NEGATIVE)  # fmt: skip
@_option("--window-theta-deg", MATCH.window_theta_deg, "The same for the heading, degrees.",
         type=NOT_NEGATIVE)  # fmt: skip
@click.option("--step-xy", type=POSITIVE, help="Metres between test positions.  [default: a cell]")
@_option(
    "--step-theta-deg",
    MATCH.step_theta_deg,
    "Degrees between test headings.",
    type=Number(0.01, 90),
)
@click.option("--no-loop-closing", is_flag=True, help="Accepted for scripts: this version does "
              "not close loops, so large ones may not meet.")  # fmt: skip
@click.option("--fail-if", "limits", type=LimitType(), multiple=True,
              help="Exit with 3 when this holds for the summary, e.g. used_share<0.95. "
              "Repeatable.")  # fmt: skip
@no_clobber_option
@common_options
def command(
    logs: tuple[str, ...], folder: str | None, png: str | None, map_: str | None,
    json: str | None, trace: str | None, mcap: str | None, log_input: LogInput,
    no_loop_closing: bool, limits: tuple[Limit, ...], no_clobber: bool, quiet: bool,
    verbose: bool, **model: Any,
) -> None:  # fmt: skip
    """Turn a robot log into a map and a pose trace (Algorithm 9.2).

    LOG is an MCAP file with laser scans and odometry, a CARMEN log (plain or gzip), a folder with
    MCAP files, or - for standard input; several LOGs are one recording in parts. Every scan gets
    a pose or a reason.

    \b
    Examples:
      mapcli slam-replay fixtures/apartment.mcap
      mapcli slam-replay robot.log.gz -o out --fail-if 'used_share<0.95'
      mapcli slam-replay robot.mcap --map map.yaml --trace poses.tum
    """
    outputs = ReplayOutputs(png, map_, json, trace, mcap)
    if folder or not outputs.names():
        usual = asdict(ReplayOutputs.in_folder(folder or default_folder(logs[0])))
        named = {key: value for key, value in asdict(outputs).items() if value}
        outputs = ReplayOutputs(**{**usual, **named})
    check_replay_outputs(outputs, logs, no_clobber=no_clobber)
    parameters = slam_parameters(**model)
    replay = Replay(log_input.open(logs), log_input, parameters)
    replay.run(quiet=quiet)
    summary, grid = replay.summary(), replay.slam.map.to_grid_map()
    head = {"inputs": replay.log.digests(), "parameters": replay.effective_parameters()}
    write_outputs(outputs, grid, replay.trace(), head, summary, no_clobber=no_clobber)
    if not quiet:
        say_notes(replay.log, verbose=verbose)
        report(summary, grid, outputs)
    if replay.interrupted:
        raise KeyboardInterrupt
    for limit in limits:
        limit.check(summary.numbers(), replay.log.name)


def slam_parameters(
    *,
    resolution: float,
    range_min: float | None,
    range_max: float | None,
    no_return: Any,
    p_hit: float | None,
    p_miss: float | None,
    search: Any,
    window_xy: float,
    window_theta_deg: float,
    step_xy: float | None,
    step_theta_deg: float,
) -> SlamParameters:
    """The parameters of the algorithm from the options of the command line.

    Raises:
        click.UsageError: no range lies between range_min and range_max.
    """
    if range_min is not None and range_max is not None and range_max <= range_min:
        raise click.UsageError("--range-max is not more than --range-min.")
    return SlamParameters(
        map=replace(
            MAP,
            resolution=resolution,
            hit=MAP.hit if p_hit is None else units_of(p_hit),
            miss=MAP.miss if p_miss is None else -units_of(p_miss),
        ),
        perception=PerceptionParameters(range_min, range_max, no_return),
        match=replace(
            MATCH,
            search=search,
            window_xy=window_xy,
            window_theta_deg=window_theta_deg,
            step_xy=step_xy,
            step_theta_deg=step_theta_deg,
        ),
    )


class Replay:
    """One run over a log (stateful), from which the results are taken even when it is stopped.

    Attributes:
        log: what is replayed; slam: the algorithm with its map.
        poses: what is known so far.
        interrupted: the user stopped it with Ctrl-C.
    """

    def __init__(self, log: Log, log_input: LogInput, parameters: SlamParameters) -> None:
        self.log, self.log_input, self.parameters = log, log_input, parameters
        self.slam = Slam(parameters)
        self.poses: list[TracedPose] = []
        self.interrupted = False
        self._asked = 0
        self._started = time.perf_counter()

    def run(self, *, quiet: bool) -> None:
        """Replay the log to its end, or to Ctrl-C.

        Raises:
            DataError: not one scan in the part asked for, or none before Ctrl-C.
        """
        gc.freeze()  # the compiler's many objects will not become garbage; do not look again
        records = self._counting(self.log_input.records(self.log))
        steps = self.slam.replay(records)
        try:
            for pose in progress(steps, self.log.name, self.log.scan_count, quiet=quiet):
                self.poses.append(pose)
        except KeyboardInterrupt:
            self.interrupted = True
            if not self.poses:
                raise
        except DataError as error:
            error.file = error.file or self.log.name
            raise
        if not self.poses:
            raise DataError("no scan in the part asked for", file=self.log.name)

    def _counting(self, records: Iterable[Record]) -> Iterator[Record]:
        for record in records:
            self._asked += isinstance(record, RangeScan)
            yield record

    def trace(self) -> PoseTrace:
        return PoseTrace(tuple(self.poses))

    def summary(self) -> ReplaySummary:
        """What became of the scans."""
        trace = self.trace()
        damage = dict(self.log.damage.counts)
        skipped = {what: n for what, n in damage.items() if self._costs_scans(what)}
        if self._asked > len(self.poses):
            skipped["scans not reached before the interruption"] = self._asked - len(self.poses)
        statuses = [pose.status for pose in self.poses]
        return ReplaySummary(
            scans=len(self.poses) + sum(skipped.values()),
            used=len(self.poses),
            matched=statuses.count("matched"),
            odometry=statuses.count("odometry"),
            skipped=skipped,
            distance_m=trace.distance(),
            duration_s=(self.poses[-1].stamp_ns - self.poses[0].stamp_ns) * 1e-9,
            loops=len(trace.loops),
            mean_score=trace.mean_score(),
            odometry_jumps=self.slam.odometry_jumps,
            damage=damage,
            interrupted=self.interrupted,
            seconds=time.perf_counter() - self._started,
        )

    def _costs_scans(self, what: str) -> bool:
        """Whether a kind of damage means that a scan could not be used."""
        topic = self.log.scan_topic
        return what.startswith(
            ("scans ", f"messages on {topic} ", f"lines without a valid {topic} ")
        )

    def effective_parameters(self) -> dict[str, Any]:
        """Everything that the result depends on."""
        return {**self.log_input.parameters(), **asdict(self.parameters)}
