"""`mapcli evaluate`: how far a pose trace is from the truth, or from itself."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import click

from mapcli.algorithms.evaluation.trajectory_error import EvaluateParameters
from mapcli.commands._evaluate_report import report_lines, table_lines
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
    Evaluation,
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
@click.argument("names", metavar="TRACE... [REFERENCE]", type=FILE, nargs=-1, required=True)
@click.option("--self-check", metavar="LOG", type=FILE, multiple=True, help="Instead of a "
              "REFERENCE: align scans of places that the robot came back to, one against the "
              "other. Repeatable: of one TRACE, the parts of its recording; of several TRACEs in "
              "one frame, a LOG each in the same order, whose scans are aligned with each "
              "other's too.")  # fmt: skip
@click.option("--common-frame", is_flag=True, help="Align several TRACEs by one motion, since "
              "they share a frame, as of slam-replay --sessions.")  # fmt: skip
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
@click.option(
    "--json",
    "json_file",
    metavar="F",
    type=FILE,
    help="Everything as JSON, of several TRACEs a list; - is standard output.",
)
@click.option("--png", metavar="F", type=FILE, help="All paths, and the errors over time.")
@click.option("--csv", "csv_file", metavar="F", type=FILE,
              help="A line for each TRACE, with all fields of --fail-if.")  # fmt: skip
@limit_option(LIMIT_FIELDS, "ate_rmse>0.2", LISTED_FIELDS)
@log_input_options
@no_clobber_option
@common_options
def command(
    names: tuple[str, ...], self_check: tuple[str, ...], common_frame: bool, odometry: str | None,
    max_diff: float, interpolate: float | None, delta: tuple[float, str], topic: str | None,
    json_file: str | None, png: str | None, csv_file: str | None, limits: tuple[Limit, ...],
    log_input: LogInput, no_clobber: bool, quiet: bool, verbose: bool,
) -> None:  # fmt: skip
    """Say how far a pose trace is from the truth, or from itself.

    TRACE and REFERENCE are trace.json, .tum, .kitti, .g2o, .csv, lines of `t x y theta`, or a
    log with poses, such as the true ones of `mapcli simulate` and CARMEN. The best rigid
    alignment in the plane is taken; ATE is then the distance of poses at the same moment, RPE
    the difference of motions over --delta. A REFERENCE that ends in .relations (or
    .relations.gz) holds relations as of Kuemmerle et al. 2009. --self-check is for logs without
    any truth; the log options below are about its log, or that of --odometry. Several TRACEs
    against one REFERENCE make a table with a line for each.

    \b
    Examples:
      mapcli evaluate apartment-slam/trace.json fixtures/apartment.mcap --png errors.png
      mapcli evaluate trace.tum truth.tum --delta 5m --fail-if 'ate_rmse>0.2'
      mapcli evaluate trace.json intel.relations.gz --odometry intel.log.gz
      mapcli evaluate trace.json --self-check robot.mcap
      mapcli evaluate trace.json trace.tum truth.tum --csv table.csv --png errors.png
    """
    traces, reference = (names, None) if self_check else (names[:-1], names[-1])
    files = Files(traces, reference, self_check, odometry, common_frame)
    _check_usage(files, limits)
    outputs = [name for name in (json_file, png, csv_file) if name is not None]
    check_outputs(outputs, log_input.inputs(files.inputs()), "files", no_clobber=no_clobber)
    parameters = EvaluateParameters(max_diff, interpolate, *delta)
    run = EvaluateRun(files, log_input, parameters, topic, quiet=quiet, verbose=verbose)
    evaluations = run.evaluate()
    named = list(zip(files.labels(), evaluations, strict=True))
    if not quiet:
        if len(named) == 1:
            lines = report_lines(evaluations[0], files.traces[0], run.against, parameters)
        else:
            lines = table_lines(named, run.against, parameters, common_frame=common_frame)
        say_lines(lines, err="-" in outputs)
    with output_set(no_clobber=no_clobber) as results:
        if json_file is not None:
            results.write(json_file, _json(run, evaluations))
        if csv_file is not None:
            from mapcli.formats.documents.evaluation import evaluations_csv

            results.write(csv_file, evaluations_csv(named))
        if png is not None:
            results.write(png, _picture(named))
    for name, evaluation in named:
        for limit in limits:
            limit.check(evaluation.numbers(), name)


def _json(run: EvaluateRun, evaluations: Sequence[Evaluation]) -> bytes:
    """The document, of several traces a list of them."""
    from mapcli.formats.documents.evaluation import evaluation_document
    from mapcli.formats.documents.json_document import json_bytes

    parameters = run.effective_parameters()
    documents = [
        evaluation_document(evaluation, run.inputs_of(number), parameters)
        for number, evaluation in enumerate(evaluations)
    ]
    return json_bytes(documents if len(documents) > 1 else documents[0])


def _picture(evaluations: Sequence[tuple[str, Evaluation]]) -> bytes:
    if len(evaluations) == 1:
        from mapcli.pictures.evaluation import evaluation_picture

        return evaluation_picture(evaluations[0][1])
    from mapcli.pictures.several_evaluations import several_evaluations_picture

    return several_evaluations_picture(evaluations)


def _check_usage(files: Files, limits: Iterable[Limit]) -> None:
    """Refuse what does not go together.

    Raises:
        click.UsageError: naming it.
    """
    several = len(files.traces) > 1
    if not files.traces or (several and len(files.self_check) not in (0, len(files.traces))):
        raise click.UsageError(
            "Give either a REFERENCE or --self-check LOG; of several TRACEs, one LOG each."
        )
    if files.common_frame and files.kind != "trajectory":
        raise click.UsageError("--common-frame is for a REFERENCE that is a trajectory.")
    if files.odometry is not None and files.kind != "relations":
        raise click.UsageError("--odometry is for a REFERENCE that ends in .relations.")
    known = names_of_limits(files.kind)
    for limit in limits:
        if limit.field not in known:
            listed = ", ".join(known)
            raise click.UsageError(
                f"--fail-if: no {limit.field!r} against {files.kind}; there are {listed}."
            )
