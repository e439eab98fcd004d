"""What `mapcli frontier` writes: trace, pictures, map and curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import click

from mapcli.algorithms.exploration.exploration_parameters import ExplorationParameters
from mapcli.commands._output import check_outputs
from mapcli.formats.output import output_set
from mapcli.model.exploration import Exploration, coverage_curve
from mapcli.model.grid import GridMap

Runs = Mapping[ExplorationParameters, Exploration]
"""One exploration for each strategy."""

SUFFIXES = {
    "--png": (".png",),
    "--gif": (".gif",),
    "--map": (".txt", ".yaml", ".yml", ".pgm", ".png"),
    "--curve": (".csv", ".png"),
}

BOOK_SIDE = 64
"""Maps up to this many rows and columns get the look of the book, as in `mapcli render`."""


@dataclass(frozen=True)
class ExploreOutputs:
    """The files that the user named; None for the others, `-` for standard output."""

    json: str | None
    png: str | None
    gif: str | None
    map: str | None
    curve: str | None

    def named(self) -> dict[str, str]:
        """Option -> file."""
        return {f"--{key}": name for key, name in asdict(self).items() if name is not None}

    def show_cells(self) -> bool:
        """Whether a file tells what each step has sensed."""
        return any((self.json, self.gif, self.curve))

    def uses_stdout(self) -> bool:
        return "-" in self.named().values()


def check_frontier_outputs(
    outputs: ExploreOutputs,
    strategies: Sequence[str],
    inputs: Sequence[str | None],
    *,
    plan: bool,
    no_clobber: bool,
) -> None:
    """Say early what is wrong with the files asked for.

    Raises:
        click.UsageError: a suffix of no known format, several results for one file, an animation
            of robots that do not move.
        OutputError: a file that cannot or must not be written, or is one of the inputs.
    """
    named = outputs.named()
    for option, suffixes in SUFFIXES.items():
        name = named.get(option, "-")
        if name != "-" and Path(name).suffix.lower() not in suffixes:
            raise click.UsageError(f"{option} {name}: does not end in {', '.join(suffixes)}.")
    if plan and (outputs.gif or outputs.curve):
        option = "--gif" if outputs.gif else "--curve"
        raise click.UsageError(f"{option} shows motion, and with --plan nobody moves.")
    files = [f for option, name in named.items() for f in files_of(option, name, strategies)]
    check_outputs(files, filter(None, inputs), "maps", no_clobber=no_clobber)


def files_of(option: str, name: str, strategies: Sequence[str]) -> list[str]:
    """The files of an option: one for each strategy, but one curve for all of them."""
    if option == "--curve":
        return [name]
    return [file_for(name, strategy, strategies) for strategy in strategies]


def file_for(name: str, strategy: str, strategies: Sequence[str]) -> str:
    """`trace.json`, or `trace-nearest.json` when there are several strategies."""
    if name == "-" or len(strategies) == 1:
        return name
    path = Path(name)
    return str(path.with_name(f"{path.stem}-{strategy}{path.suffix}"))


def write_outputs(
    outputs: ExploreOutputs, runs: Runs, inputs: Mapping[str, str], *, no_clobber: bool
) -> list[str]:
    """Write every file that was asked for; returns their names.

    Args:
        inputs: file name -> SHA-256, for the head of the trace.

    Raises:
        OutputError: a file cannot be written.
    """
    strategies = [parameters.strategy for parameters in runs]
    written = []
    with output_set(no_clobber=no_clobber) as results:
        for parameters, exploration in runs.items():
            for option, name in outputs.named().items():
                if option != "--curve":
                    file = file_for(name, parameters.strategy, strategies)
                    files = contents(option, file, exploration, parameters, inputs)
                    written += results.write_beside(file, files)
        if outputs.curve is not None:
            results.write(outputs.curve, curve_content(outputs.curve, runs))
            written.append(outputs.curve)
    return [name for name in written if name != "-"]


def contents(
    option: str,
    file: str,
    exploration: Exploration,
    parameters: ExplorationParameters,
    inputs: Mapping[str, str],
) -> dict[str, bytes]:
    """The files of one exploration for one option: name without its folder -> content."""
    name = file if file == "-" else Path(file).name
    small = max(exploration.after.stored.shape) <= BOOK_SIDE
    if option == "--json":
        from mapcli.formats.documents.exploration_trace import write_trace

        return {name: write_trace(exploration, inputs, asdict(parameters))}
    if option == "--png":
        from mapcli.pictures.exploration import exploration_picture

        return {name: exploration_picture(exploration, small=small, low=parameters.low)}
    if option == "--gif":
        from mapcli.pictures.exploration_gif import exploration_gif

        return {name: exploration_gif(exploration, small=small, low=parameters.low)}
    return map_files(file, exploration.after)


def map_files(file: str, grid: GridMap) -> dict[str, bytes]:
    """The map's files. An image keeps whole percents when there are other cells than 0 and 1."""
    from mapcli.commands._map_output import usual_options
    from mapcli.formats.maps.save import dump_map

    graded = grid.count(lambda cells: (cells > 0) & (cells < 1)) > 0
    return dump_map(grid, file, usual_options(file, "scale" if graded else "trinary"))


def curve_content(file: str, runs: Runs) -> bytes:
    """Coverage over distance of all runs."""
    curves = {str(run.strategy): coverage_curve(made) for run, made in runs.items()}
    if Path(file).suffix.lower() == ".png":
        from mapcli.pictures.coverage_plot import coverage_plot

        return coverage_plot(curves)
    from mapcli.formats.documents.coverage_curve import write_curve_csv

    return write_curve_csv(curves)
