"""`mapcli slam-replay`: a robot log becomes a map and a pose trace (Algorithm 9.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import click

from mapcli import load_map
from mapcli.algorithms.scans.perception import PerceptionParameters
from mapcli.algorithms.similarity.measures import SIMILARITIES
from mapcli.algorithms.slam.local_map import LocalMapParameters
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.match import MatchParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.slam import Slam, SlamParameters
from mapcli.commands._knowledge_options import knowledge_options
from mapcli.commands._limit_option import limit_option
from mapcli.commands._log_options import LogInput, log_input_options, say_notes
from mapcli.commands._options import (
    FILE,
    NOT_NEGATIVE,
    POSITIVE,
    Command,
    Number,
    Numbers,
    PoseType,
    common_options,
    no_clobber_option,
)
from mapcli.commands._output import check_inputs
from mapcli.commands._replay import effective_parameters, replay_log
from mapcli.commands._replay_explain import MOST_EXPLAINED, Explainer
from mapcli.commands._replay_outputs import (
    ReplayOutputs,
    check_replay_outputs,
    default_folder,
    report,
    write_outputs,
)
from mapcli.commands._replay_perceptions import (
    check_perceptions,
    perception_contents,
    perception_files,
)
from mapcli.commands._say import say
from mapcli.errors import DataError
from mapcli.formats.input import DigestingReader
from mapcli.formats.maps.load import LoadedMap
from mapcli.model.knowledge import Knowledge
from mapcli.model.limit import Limit
from mapcli.model.pose import Pose2D
from mapcli.model.summary import LIMIT_FIELDS

BOOK_OPTIONS = "--similarity", "--book-steps", "--turns-deg"

MAP, MATCH, PERCEPTION = MapParameters(), MatchParameters(), PerceptionParameters()


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
@_option("--gather", PERCEPTION.gather_m, "Readings of range sensors with one beam are one scan "
         "over so many metres of way; 0: those of one place.", metavar="M",
         type=NOT_NEGATIVE)  # fmt: skip
@_option("--min-hits", MATCH.min_hits, "Hits that a scan needs, and as many where the map is "
         "known, to be matched; scans of fewer go by odometry.", metavar="N",
         type=click.IntRange(1))  # fmt: skip
@_option("--p-hit", MAP.p_hit, "Obstacle probability of an unknown cell after one beam ended in "
         "it; nearer to 0.5 for sensors that err.", metavar="P",
         type=Number(0.5, 1, min_open=True, max_open=True))  # fmt: skip
@_option("--p-miss", MAP.p_miss, "The same after one beam passed through.", metavar="P",
         type=Number(0, 0.5, min_open=True, max_open=True))  # fmt: skip
@_option("--search", MATCH.search, "Where to look for each scan's pose: in a window around the "
         "odometry's, at the book's fifteen poses, or nowhere (believe the odometry).",
         type=click.Choice(("window", "book", "none")))  # fmt: skip
@click.option("--similarity", type=click.Choice(SIMILARITIES), help="How --search book compares, "
              "always on the cells that two poses share; `window` uses the likelihood field.  "
              f"[default: {MATCH.similarity}]")  # fmt: skip
@click.option("--book-steps", type=Numbers("CELLS,...", 0.1, 100),
              help="How far from the odometry's position --search book "
              "looks, along the map's axes.  [default: 1]")  # fmt: skip
@click.option("--turns-deg", type=Numbers("DEG,...", -180, 180),
              help="At which headings --search book looks, from the odometry's.  "
              "[default: 0,-15,15]")  # fmt: skip
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
@_option("--loop-closing/--no-loop-closing", True, "Find out where the robot came back, and put "
         "right the whole way round; without, the map never forgets.")  # fmt: skip
@click.option("--known", metavar="MAP", type=FILE, help="A map to go on from, instead of an empty "
              "one; no loops are closed then.")  # fmt: skip
@click.option("--initial-pose", type=PoseType("X,Y,THETA_DEG"), help="Where the robot starts.  "
              "[default: 0,0,0; in a known map it is searched for]")  # fmt: skip
@click.option("--localize", is_flag=True, help="Find the poses in the known map, and leave it as "
              "it is.")  # fmt: skip
@click.option("--sessions", is_flag=True, help="Each LOG is a drive of its own through the same "
              "building: one map, and a trace of each in its frame.")  # fmt: skip
@click.option("--newest-last", is_flag=True, help="Of several drives, the last LOG is the newest, "
              "whatever the stamps say; where drives disagree the newest is right.")  # fmt: skip
@click.option("--static", is_flag=True, help="Keep of a map of several drives only what all that "
              "saw it agree on.")  # fmt: skip
@click.option("--save-state", "state", metavar="F", type=FILE, help="Write what is needed to add "
              "drives to this map later, as MCAP.")  # fmt: skip
@click.option("--continue", "continued", metavar="F", type=FILE, help="Add drives to the map of a "
              "state; --save-state may name the same file.")  # fmt: skip
@knowledge_options
@limit_option(LIMIT_FIELDS, "verdict!=good")
@click.option("--save-perception", "saved", metavar="N", type=click.IntRange(0), multiple=True,
              help="Write scan N (from 0) with its estimated pose into the folder, as "
              "perception-N.yaml for `mapcli similarity-table`. Repeatable.")  # fmt: skip
@click.option("--explain", metavar="DIR", type=FILE, help="With --search book: a page that leafs "
              "through the comparisons, each with its table, the matrices and their product, and "
              "the map before and after.")  # fmt: skip
@click.option("--explain-most", metavar="N", type=click.IntRange(1, 10_000),
              default=MOST_EXPLAINED, show_default=True,
              help="Comparisons that --explain shows, the first ones.")  # fmt: skip
@no_clobber_option
@common_options
def command(
    logs: tuple[str, ...], folder: str | None, png: str | None, map_: str | None,
    json: str | None, trace: str | None, mcap: str | None, log_input: LogInput,
    loop_closing: bool, known: str | None, initial_pose: Pose2D | None, localize: bool,
    knowledge: Knowledge, sessions: bool, newest_last: bool, static: bool, state: str | None,
    continued: str | None,
    limits: tuple[Limit, ...], saved: tuple[int, ...], explain: str | None, explain_most: int,
    no_clobber: bool, quiet: bool, verbose: bool, **model: Any,
) -> None:  # fmt: skip
    """Turn a robot log into a map and a pose trace (Algorithm 9.2).

    LOG is a log with laser scans and odometry: MCAP, a ROS 1 or ROS 2 bag (a file, or a folder), a
    CARMEN log, each plain or packed (gz, zst, bz2, xz, lz4), or - for standard input; or the CSV
    of a robot with a few range sensors, `t,x,y,theta,r1,...`, beside which a YAML says where they
    sit (docs/formats.md). Several LOGs are one recording in parts, in any order; recordings that
    are not one are refused. Every scan gets a pose or a reason.

    With --sessions each LOG is a drive: drives are found in each other and make one map, whatever
    the order and wherever each began. Those that share nothing are kept apart.

    \b
    Examples:
      mapcli slam-replay fixtures/apartment.mcap
      mapcli slam-replay robot.log.gz -o out --fail-if 'used_share<0.95'
      mapcli slam-replay robot.mcap --map map.yaml --trace poses.tum
      mapcli slam-replay sonars.mcap --sensor /range/left=0,0.1,90
      mapcli slam-replay fixtures/five-sensors.csv --search none
      mapcli slam-replay fixtures/corridor.mcap --search book --explain turns
      mapcli slam-replay --sessions monday.mcap tuesday.mcap -o building --save-state building.state
      mapcli slam-replay wednesday.mcap --continue building.state -o building
    """
    outputs = ReplayOutputs(png, map_, json, trace, mcap)
    if folder or not outputs.names():
        usual = asdict(ReplayOutputs.in_folder(folder or default_folder(logs[0])))
        named = {key: value for key, value in asdict(outputs).items() if value}
        outputs = ReplayOutputs(**{**usual, **named})
    if sessions or continued:
        # What a single drive does not need is not imported for it.
        from mapcli.commands._session_outputs import SessionOutputs
        from mapcli.commands._sessions import (
            DriveInput,
            SessionOptions,
            refuse_with_drives,
            replay_sessions,
        )

        alone = {
            "--known": known, "--initial-pose": initial_pose, "--trace": trace, "--mcap": mcap,
            "--save-perception": saved, "--explain": explain, "--no-loop-closing": not loop_closing,
            f"--search {model['search']}": model["search"] != "window",
        }  # fmt: skip
        refuse_with_drives(alone)
        replay_sessions(
            [[log] for log in logs] if sessions else [logs],
            SessionOptions(newest_last, static, continued, knowledge),
            SessionOutputs.of(folder or default_folder(logs[0]), png, map_, json, state),
            DriveInput(
                log_input, slam_parameters(loops=True, frozen=False, **model), limits, no_clobber,
                quiet, verbose,
            ),
        )  # fmt: skip
        return
    if newest_last or static:
        raise click.UsageError("--newest-last and --static need --sessions or --continue.")
    if localize and not known:
        raise click.UsageError("--localize needs --known, the map to find the poses in.")
    if explain and model["search"] != "book":
        raise click.UsageError("--explain shows what --search book compares.")
    explainer = Explainer(explain, explain_most) if explain else None
    check_inputs([*logs, *filter(None, [known])])
    files = perception_files(folder or default_folder(logs[0]), saved)
    read = DigestingReader()
    base = load_map(known, read=read) if known else None
    inputs = [*log_input.inputs(logs), *(map(str, base.files) if base else ())]
    others = [
        *files.values(),
        *([explainer.index] if explainer else []),
        *([state] if state else []),
    ]
    check_replay_outputs(outputs, inputs, others, no_clobber=no_clobber)
    parameters = slam_parameters(loops=loop_closing and not known, frozen=localize, **model)
    if (state or knowledge) and parameters.loops is None:
        name = "--save-state" if state else "What a person knows of a drive"
        raise click.UsageError(f"{name} needs loop closing.")
    slam = Slam(parameters, initial_pose, known_map(base, parameters) if base else None)
    log = log_input.open(logs)
    check_perceptions(files, log)
    replayed, run = replay_log(
        log, log_input, slam, files, *([explainer.watch] if explainer else []),
        knowledge=knowledge, quiet=quiet,
    )  # fmt: skip
    summary = replayed.summary
    told = effective_parameters(log_input, slam, initial_pose, read.digests, knowledge)
    head = {"inputs": log.digests(), "parameters": told}
    perceptions = perception_contents(
        files, run.kept, replayed.trace, parameters.perception, log.name
    )
    more = explainer.contents(log.name) if explainer else {}
    if state:
        from mapcli.commands._sessions import drive_name, state_of

        more = {state: state_of(run, drive_name(logs[0]), head, summary)}
    write_outputs(outputs, replayed, head, perceptions | more, no_clobber=no_clobber)
    if not (quiet or summary.matched):
        _explain_no_match(parameters.match, run.most_hits)
    for option in BOOK_OPTIONS if parameters.match.search != "book" and not quiet else ():
        if model[option.lstrip("-").replace("-", "_")]:
            say(f"Note: {option} is for --search book and changes nothing.")
    say_notes(log, verbose=verbose, quiet=quiet)
    if not quiet:
        report(summary, replayed.map, outputs)
        if explainer:
            explainer.report()
    if run.stopped_by is not None:
        raise run.stopped_by
    for limit in limits:
        limit.check(summary.values(), log.name)


def _explain_no_match(match: MatchParameters, most_hits: int) -> None:
    """Say why not one scan was matched, where that is known."""
    if match.search == "none":
        say("Note: no scan is matched, as --search none asks.")
    elif most_hits < match.min_hits:
        say(f"Note: no scan is matched: none has the {match.min_hits} hits that a match takes "
            f"(--min-hits), at most {most_hits}; the map is made by odometry.")  # fmt: skip
    else:
        say("Note: no scan is matched: what one saw was never seen by those before, or did not "
            "fit; the map is made by odometry.")  # fmt: skip


def slam_parameters(
    *,
    resolution: float,
    range_min: float | None,
    range_max: float | None,
    gather: float,
    min_hits: int,
    no_return: Any,
    p_hit: float,
    p_miss: float,
    search: Any,
    similarity: Any,
    book_steps: tuple[float, ...] | None,
    turns_deg: tuple[float, ...] | None,
    window_xy: float,
    window_theta_deg: float,
    step_xy: float | None,
    step_theta_deg: float,
    loops: bool,
    frozen: bool,
) -> SlamParameters:
    """The parameters of the algorithm from the options of the command line.

    Raises:
        click.UsageError: no range lies between range_min and range_max.
    """
    if range_min is not None and range_max is not None and range_max <= range_min:
        raise click.UsageError("--range-max is not more than --range-min.")
    parameters = SlamParameters(
        detect_odometry_faults=search == "window",
        local_map=LocalMapParameters(frozen=frozen),
        map=replace(MAP, resolution=resolution, p_hit=p_hit, p_miss=p_miss),
        perception=PerceptionParameters(range_min, range_max, no_return, gather),
        match=replace(
            MATCH,
            search=search,
            similarity=similarity or MATCH.similarity,
            book_steps=book_steps or MATCH.book_steps,
            turns_deg=turns_deg or MATCH.turns_deg,
            window_xy=window_xy,
            window_theta_deg=window_theta_deg,
            step_xy=step_xy,
            step_theta_deg=step_theta_deg,
            min_hits=min_hits,
        ),
    )
    if search == "book":
        return parameters.as_in_the_book()
    # Poses that are not searched for closely are not worth the loops.
    return parameters if loops and search == "window" else parameters.without_loops()


def known_map(base: LoadedMap, parameters: SlamParameters) -> OccupancyGrid:
    """A map of a file, to go on from.

    Raises:
        DataError: of a map that cannot be gone on from, see `OccupancyGrid.from_grid_map`.
    """
    try:
        return OccupancyGrid.from_grid_map(base.grid, parameters.map)
    except DataError as error:
        error.file = error.file or str(base.files[0])
        if base.grid.origin.theta:
            error.expected = "0, which `mapcli transform --bake-yaw` makes it"
        raise
