"""`mapcli evaluate`: how far a pose trace is from the truth, or from itself."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from mapcli.algorithms.evaluation.trajectory_error import EvaluateParameters
from mapcli.commands._evaluate_report import report_lines
from mapcli.commands._evaluate_run import EvaluateRun, Files
from mapcli.commands._limit_option import limit_option
from mapcli.commands._log_options import LogInput, log_input_options
from mapcli.commands._options import (
    FILE,
    NOT_NEGATIVE,
    POSITIVE,
    common_options,
    no_clobber_option,
)
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say_lines
from mapcli.formats.output import output_set
from mapcli.model.evaluation import (
    ALL_MEASURES,
    COUNTS,
    LIMIT_FIELDS,
    STATISTICS,
    names_of_limits,
)
from mapcli.model.limit import Limit

DEFAULTS = EvaluateParameters()

LISTED_FIELDS = (
    f"{', '.join(COUNTS)}, and {'_, '.join(ALL_MEASURES)}_ followed by {', '.join(STATISTICS)} "
    f"(metres) or by rot_{STATISTICS[0]} and so on (degrees)"
)
"""For the help: one by one they are fifty."""


class DeltaType(click.ParamType[Any]):
    """`10f` or `2m` on the command line, a number and its unit inside."""

    name = "N[f|m]"

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return self.name

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"(\d+)f?|(\d*\.?\d+)m", str(value))
        number = float(match[1] or match[2]) if match else 0.0
        if match is None or not 0 < number < 1e9:
            self.fail(f"{value!r} is not of the form 10f (poses) or 2m (metres).", param, ctx)
        return number, "f" if match[1] else "m"


@click.command(short_help="Say how far a pose trace is from the truth, or from itself.")
@click.argument("trace", metavar="TRACE", type=FILE)
@click.argument("reference", metavar="[REFERENCE]", type=FILE, required=False)
@click.option("--self-check", metavar="LOG", type=FILE, help="Instead of a REFERENCE: align scans "
              "of places that the robot came back to, one against the other.")  # fmt: skip
@click.option("--odometry", metavar="LOG", type=FILE, help="With relations: carry poses on from "
              "scan to scan by the odometry of this log, instead of interpolating.")  # fmt: skip
@click.option("--max-diff", type=NOT_NEGATIVE, default=DEFAULTS.max_diff_s, show_default=True,
              metavar="S",
              help="Poses whose stamps differ by no more seconds are compared.")  # fmt: skip
@click.option("--interpolate", type=POSITIVE, metavar="S", help="Interpolate REFERENCE at the "
              "stamps of TRACE instead, between poses at most S seconds apart.")  # fmt: skip
@click.option("--delta", type=DeltaType(), default=f"{DEFAULTS.delta:g}{DEFAULTS.delta_unit}",
              show_default=True, help="RPE compares "
              "motions over N poses (f) or over N metres of the path (m).")  # fmt: skip
@click.option("--topic", metavar="TOPIC", help="Where the poses of an MCAP REFERENCE are, if "
              "there are several.")  # fmt: skip
@click.option("--json", "json_file", metavar="F", type=FILE,
              help="Everything as JSON; - is standard output.")  # fmt: skip
@click.option("--png", metavar="F", type=FILE, help="Both paths, and the errors over time.")
@limit_option(LIMIT_FIELDS, "ate_rmse>0.2", LISTED_FIELDS)
@log_input_options
@no_clobber_option
@common_options
def command(
    trace: str, reference: str | None, self_check: str | None, odometry: str | None,
    max_diff: float, interpolate: float | None, delta: tuple[float, str], topic: str | None,
    json_file: str | None, png: str | None, limits: tuple[Limit, ...], log_input: LogInput,
    no_clobber: bool, quiet: bool, verbose: bool,
) -> None:  # fmt: skip
    """Say how far a pose trace is from the truth, or from itself.

    TRACE and REFERENCE are trace.json, .tum, .kitti, .g2o, .csv, lines of `t x y theta`, or a
    log with poses, such as the true ones of `mapcli simulate` and CARMEN. The best rigid
    alignment in the plane is taken; ATE is then the distance of poses at the same moment, RPE
    the difference of motions over --delta. A REFERENCE that ends in .relations (or
    .relations.gz) holds relations as of Kuemmerle et al. 2009. --self-check is for logs without
    any truth; the log options below are about its log, or that of --odometry.

    \b
    Examples:
      mapcli evaluate apartment-slam/trace.json fixtures/apartment.mcap --png errors.png
      mapcli evaluate trace.tum truth.tum --delta 5m --fail-if 'ate_rmse>0.2'
      mapcli evaluate trace.json intel.relations.gz --odometry intel.log.gz
      mapcli evaluate trace.json --self-check robot.mcap
    """
    files = Files(trace, reference, self_check, odometry)
    _check_usage(files, limits)
    outputs = [name for name in (json_file, png) if name is not None]
    check_outputs(outputs, log_input.inputs(files.inputs()), "files", no_clobber=no_clobber)
    parameters = EvaluateParameters(max_diff, interpolate, *delta)
    run = EvaluateRun(files, log_input, parameters, topic, quiet=quiet, verbose=verbose)
    evaluation = run.evaluate()
    if not quiet:
        lines = report_lines(evaluation, files.trace, run.against, parameters)
        say_lines(lines, err="-" in outputs)
    with output_set(no_clobber=no_clobber) as results:
        if json_file is not None:
            from mapcli.formats.documents.evaluation import evaluation_document
            from mapcli.formats.documents.json_document import json_bytes

            content = evaluation_document(evaluation, run.digests, run.effective_parameters())
            results.write(json_file, json_bytes(content))
        if png is not None:
            from mapcli.pictures.evaluation import evaluation_picture

            results.write(png, evaluation_picture(evaluation))
    for limit in limits:
        limit.check(evaluation.numbers(), Path(files.trace).name)


def _check_usage(files: Files, limits: Iterable[Limit]) -> None:
    """Refuse what does not go together.

    Raises:
        click.UsageError: naming it.
    """
    if (files.reference is None) == (files.self_check is None):
        raise click.UsageError("Give either a REFERENCE or --self-check LOG.")
    if files.odometry is not None and files.kind != "relations":
        raise click.UsageError("--odometry is for a REFERENCE that ends in .relations.")
    known = names_of_limits(files.kind)
    for limit in limits:
        if limit.field not in known:
            listed = ", ".join(known)
            raise click.UsageError(
                f"--fail-if: no {limit.field!r} against {files.kind}; there are {listed}."
            )
