"""`mapcli frontier`: explore a map with Algorithm 9.1."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from typing import Any

import click

from mapcli import explore
from mapcli import plan as plan_goals
from mapcli.algorithms.exploration.exploration_parameters import (
    LARGEST_SEED,
    STRATEGIES,
    ExplorationParameters,
)
from mapcli.algorithms.exploration.explore import KnownMapError
from mapcli.algorithms.exploration.runner import is_large
from mapcli.commands._frontier_inputs import Mission, load_mission, warn_about_known
from mapcli.commands._frontier_outputs import (
    ExploreOutputs,
    Runs,
    check_frontier_outputs,
    write_outputs,
)
from mapcli.commands._frontier_report import (
    comparison_lines,
    map_text,
    plan_lines,
    step_lines,
    summary_lines,
)
from mapcli.commands._limit_option import limit_option
from mapcli.commands._map_options import dialect_option
from mapcli.commands._options import (
    CELL,
    FILE,
    NOT_NEGATIVE,
    POINT,
    Number,
    common_options,
    no_clobber_option,
)
from mapcli.commands._say import say, say_lines
from mapcli.errors import DataError
from mapcli.model.exploration import LIMIT_FIELDS, Exploration
from mapcli.model.grid import GridMap
from mapcli.model.limit import Limit

USUAL = ExplorationParameters()


@click.command(short_help="Explore a map with Algorithm 9.1.")
@click.argument("world", metavar="WORLD", type=FILE)
@click.option("--robot", "cells", type=CELL, multiple=True, help="A robot's cell. Repeatable.")
@click.option("--robot-xy", "points", type=POINT, multiple=True,
              help="A robot's place in metres. Repeatable.")  # fmt: skip
@click.option("--known", metavar="MAP", type=FILE, help="What is known at the start.  "
              "[default: what the robots sense where they stand]")  # fmt: skip
@click.option("--strategy", "strategies", type=click.Choice(STRATEGIES), multiple=True,
              default=(USUAL.strategy,), show_default=True, help="The next goal: the nearest "
              "frontier cell; the highest p = a / d; the most cells expected to be seen per path "
              "length; any one. Ties: the shorter path, then the smaller row, then the smaller "
              "column. Repeat it to compare.")  # fmt: skip
@click.option("--seed", metavar="N", type=click.IntRange(0, LARGEST_SEED - 1), default=USUAL.seed,
              show_default=True, help="Of --strategy random.")  # fmt: skip
@click.option("--low", type=Number(0, 1, min_open=True), default=USUAL.low, show_default=True,
              help="A known cell is open when its probability is below this.")  # fmt: skip
@click.option("--sensor-range", metavar="CELLS", type=click.IntRange(1),
              default=USUAL.sensor_range, show_default=True, help="1: the eight neighbours; "
              "more: what can be seen without looking through obstacles.")  # fmt: skip
@click.option("--connectivity", type=click.Choice(("4", "8")), default=str(USUAL.connectivity),
              show_default=True, help="Neighbours to move to; 8 cuts no corners.")  # fmt: skip
@click.option("--robot-radius", metavar="M", type=NOT_NEGATIVE, default=USUAL.robot_radius,
              show_default=True, help="Keep clear of known obstacles.")  # fmt: skip
@click.option("--max-steps", metavar="N", type=click.IntRange(0),
              help="End after so many steps, of all robots together.")  # fmt: skip
@click.option("--max-distance", metavar="M", type=NOT_NEGATIVE,
              help="End before all robots together have gone farther.")  # fmt: skip
@click.option("--coverage", metavar="SHARE", type=Number(0, 1, min_open=True),
              help="End when this share of what can be explored is known.")  # fmt: skip
@click.option("--return-home", is_flag=True, help="Go back to the start at the end.")
@click.option("--plan", is_flag=True, help="Say what the frontier is and where the robots would "
              "go next; nobody moves.")  # fmt: skip
@click.option("--steps", is_flag=True, help="Print the order in which the robots explore, a line "
              "a step.")  # fmt: skip
@click.option("--json", metavar="F", type=FILE, help="The trace of all steps; - is standard "
              "output, here as everywhere.")  # fmt: skip
@click.option("--png", metavar="F", type=FILE, help="The map as explored, with the paths.")
@click.option("--gif", metavar="F", type=FILE, help="The same as it grows, one frame a step.")
@click.option("--map", "map_", metavar="F", type=FILE,
              help="The map as explored: .txt, .yaml (with its image), .pgm, .png.")  # fmt: skip
@click.option("--curve", metavar="F", type=FILE, help="Coverage over distance: .csv, .png.")
@limit_option(LIMIT_FIELDS, "coverage<0.95")
@dialect_option
@no_clobber_option
@common_options
def command(
    world: str, known: str | None, cells: tuple[Any, ...], points: tuple[Any, ...],
    strategies: tuple[Any, ...], connectivity: str, plan: bool, steps: bool,
    json: str | None, png: str | None, gif: str | None, map_: str | None, curve: str | None,
    limits: tuple[Limit, ...], dialect: Any, no_clobber: bool, quiet: bool, verbose: bool,
    **parameters: Any,
) -> None:  # fmt: skip
    """Explore WORLD, a map that stands in for the environment, with Algorithm 9.1.

    The robots go to frontier cells (open cells beside unknown ones), sense, and mark their map,
    until no frontier is left that they can reach. Without an output it prints a summary. With
    several strategies, each writes its own files: `trace.json` becomes `trace-nearest.json`.

    \b
    Examples:
      mapcli frontier fixtures/fig9_9.txt --known fixtures/fig9_4.txt --robot 5,9 --png fig9_9.png
      mapcli frontier depot.yaml --robot-xy 0,0 --sensor-range 100 --json trace.json --gif run.gif
      mapcli frontier fig9_9.txt --robot 7,4 --strategy nearest --strategy priority --curve -
      mapcli frontier fixtures/fig9_9.txt --known fixtures/fig9_4.txt --robot 5,9 --steps
      mapcli frontier -q map.yaml --robot-xy 0,0 --fail-if 'coverage<0.95'
    """
    outputs = ExploreOutputs(json, png, gif, map_, curve)
    chosen = tuple(dict.fromkeys(strategies))
    check_frontier_outputs(outputs, chosen, (world, known), plan=plan, no_clobber=no_clobber)
    mission = load_mission(world, known, cells, points, dialect, quiet=quiet)
    usual = ExplorationParameters(connectivity=8 if connectivity == "8" else 4, **parameters)
    if not quiet:
        warn_about_known(mission, usual.low)
    runs = {}
    for strategy in chosen:
        run = replace(usual, strategy=strategy)
        keep_cells = steps or outputs.show_cells()
        runs[run] = explored(mission, run, plan=plan, keep_cells=keep_cells, quiet=quiet)
    written = write_outputs(outputs, runs, mission.inputs, no_clobber=no_clobber)
    if not quiet:
        _say(mission, runs, outputs, plan=plan, steps=steps)
    for name in written if verbose else ():
        say(f"written: {name}")
    for run, made in runs.items():
        name = mission.source if len(runs) == 1 else f"{mission.source} ({run.strategy})"
        for limit in limits:
            limit.check(asdict(made.summary), name)


def explored(
    mission: Mission,
    parameters: ExplorationParameters,
    *,
    plan: bool,
    keep_cells: bool,
    quiet: bool,
) -> Exploration:
    """Explore, or plan, with a progress bar on a terminal; errors name the map at fault.

    Raises:
        DataError: the robots cannot start.
    """
    try:
        if plan:
            return plan_goals(mission.world, mission.robots, parameters, mission.known)
        with coverage_bar(mission.world, parameters, quiet=quiet) as progress:
            return explore(
                mission.world,
                mission.robots,
                parameters,
                mission.known,
                keep_cells=keep_cells,
                progress=progress,
            )
    except DataError as error:
        at_fault = mission.known_source if isinstance(error, KnownMapError) else mission.source
        error.file = at_fault
        raise


@contextmanager
def coverage_bar(
    world: GridMap, parameters: ExplorationParameters, *, quiet: bool
) -> Iterator[Callable[[float], None]]:
    """A bar on stderr that is given the coverage now and then, for what may take a while."""
    if quiet or not sys.stderr.isatty() or not is_large(world, parameters):
        yield lambda coverage: None
        return
    label = f"Exploring ({parameters.strategy})"
    with click.progressbar(length=1000, label=label, file=sys.stderr, show_eta=False) as bar:
        yield lambda coverage: bar.update(int(1000 * coverage) - bar.pos)


def terminal_width() -> int:
    import shutil

    return shutil.get_terminal_size().columns


def _say(mission: Mission, runs: Runs, outputs: ExploreOutputs, *, plan: bool, steps: bool) -> None:
    """Summary, plan or comparison; on a terminal that gets nothing else, the map as text."""
    to_stderr = outputs.uses_stdout()
    for parameters, exploration in runs.items():
        if plan:
            lines = [f"strategy: {parameters.strategy}", *plan_lines(exploration)]
        else:
            lines = [*step_lines(exploration), ""] if steps else []
            lines += summary_lines(exploration, parameters, mission.world)
        if not outputs.named() and sys.stdout is not None and sys.stdout.isatty():
            lines += ["", *map_text(exploration, parameters.low, terminal_width())]
        say_lines([*lines, ""] if len(runs) > 1 else lines, err=to_stderr)
    if len(runs) > 1 and not plan:
        say_lines(comparison_lines(runs, mission.world, mission.known), err=to_stderr)
