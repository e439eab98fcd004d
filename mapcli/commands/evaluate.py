"""`mapcli evaluate`: how far a pose trace is from the truth, or from itself."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click

from mapcli.commands._log_options import LogInput, log_input_options, say_notes
from mapcli.commands._options import (
    FILE,
    NOT_NEGATIVE,
    POSITIVE,
    LimitType,
    common_options,
    no_clobber_option,
)
from mapcli.commands._output import check_outputs, write_bytes
from mapcli.errors import MapcliError
from mapcli.formats.logs import Log
from mapcli.model.evaluation import Evaluation, Kind, all_limit_fields, limit_fields
from mapcli.model.log import counted
from mapcli.model.scan import Odometry, Record
from mapcli.model.summary import Limit
from mapcli.model.trajectory import Trajectory


class DeltaType(click.ParamType[Any]):
    """`10f` or `2m` on the command line, a number and its unit inside."""

    name = "N[f|m]"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"(\d+)f?|(\d*\.?\d+)m", str(value))
        number = float(match[1] or match[2]) if match else 0.0
        if match is None or not 0 < number < 1e9:
            self.fail(f"{value!r} is not of the form 10f (poses) or 2m (metres).", param, ctx)
        return number, "f" if match[1] else "m"


@dataclass(frozen=True)
class Files:
    """What is compared: names as typed, None where not given."""

    trace: str
    reference: str | None
    self_check: str | None
    odometry: str | None

    @property
    def kind(self) -> Kind:
        from mapcli.formats.relations import is_relations

        if self.self_check is not None:
            return "self-check"
        return "relations" if is_relations(self.reference or "") else "trajectory"

    def inputs(self) -> list[str]:
        named = self.trace, self.reference, self.self_check, self.odometry
        return [name for name in named if name is not None]


@click.command(short_help="Say how far a pose trace is from the truth, or from itself.")
@click.argument("trace", metavar="TRACE", type=FILE)
@click.argument("reference", metavar="[REFERENCE]", type=FILE, required=False)
@click.option("--self-check", metavar="LOG", type=FILE, help="Instead of a REFERENCE: align scans "
              "of places that the robot came back to, one against the other.")  # fmt: skip
@click.option("--odometry", metavar="LOG", type=FILE, help="With relations: carry poses on from "
              "scan to scan by the odometry of this log, instead of interpolating.")  # fmt: skip
@click.option("--max-diff", type=NOT_NEGATIVE, default=0.01, show_default=True, metavar="S",
              help="Poses whose stamps differ by no more seconds are compared.")  # fmt: skip
@click.option("--interpolate", type=POSITIVE, metavar="S", help="Interpolate REFERENCE at the "
              "stamps of TRACE instead, between poses at most S seconds apart.")  # fmt: skip
@click.option("--delta", type=DeltaType(), default="1f", show_default=True, help="RPE compares "
              "motions over N poses (f) or over N metres of the path (m).")  # fmt: skip
@click.option("--topic", metavar="TOPIC", help="Where the poses of an MCAP REFERENCE are, if "
              "there are several.")  # fmt: skip
@click.option("--json", "json_file", metavar="F", type=FILE,
              help="Everything as JSON; - is standard output.")  # fmt: skip
@click.option("--png", metavar="F", type=FILE, help="Both paths, and the errors over time.")
@click.option("--fail-if", "limits", multiple=True,
              type=LimitType(all_limit_fields(), "ate_rmse>0.2"), help="Exit with 3 when this "
              "holds, e.g. ate_rmse>0.2. Repeatable.")  # fmt: skip
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

    TRACE and REFERENCE are trace.json, .tum, .kitti, .g2o, .csv, lines of `t x y theta`, or an
    MCAP file with poses, such as the true ones that `mapcli simulate` writes. The best rigid
    alignment in the plane is taken; ATE is then the distance of poses at the same moment, RPE
    the difference of motions over --delta. A REFERENCE that ends in .relations (or
    .relations.gz) holds relations as of Kuemmerle et al. 2009. --self-check is for logs without
    any truth; the log options below are about its log, or that of --odometry.

    --fail-if knows matched, total, matched_share, and ate_, rpe_, relations_ or self_check_
    followed by rmse, mean, median, std, min, max (metres) or rot_rmse and so on (degrees).

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
    check_outputs(outputs, files.inputs(), "files", no_clobber=no_clobber)
    from mapcli.algorithms.evaluate import EvaluateParameters

    parameters = EvaluateParameters(max_diff, interpolate, *delta)
    run = _Run(files, log_input, parameters, topic, quiet=quiet, verbose=verbose)
    evaluation = run.evaluate()
    if not quiet:
        from mapcli.commands._evaluate_report import report_lines

        lines = report_lines(evaluation, files.trace, run.against, parameters)
        click.echo("\n".join(lines), err="-" in outputs)
    if json_file is not None:
        from mapcli.formats.document import json_bytes
        from mapcli.formats.evaluation import evaluation_document

        content = evaluation_document(evaluation, run.digests, run.effective_parameters())
        write_bytes(json_file, json_bytes(content), no_clobber=no_clobber)
    if png is not None:
        from mapcli.formats.evaluation_picture import evaluation_picture

        write_bytes(png, evaluation_picture(evaluation), no_clobber=no_clobber)
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
    if files.inputs().count("-") > 1:
        raise click.UsageError("Only one input can be standard input.")
    known = limit_fields(files.kind)
    for limit in limits:
        if limit.field not in known:
            listed = ", ".join(known)
            raise click.UsageError(
                f"--fail-if: no {limit.field!r} against {files.kind}; there are {listed}."
            )


class _Run:
    """One evaluation (stateful: `digests` fills while files are read).

    Attributes:
        digests: file name -> SHA-256, for the head of the document.
        against: what the trace is compared with, for people.
    """

    def __init__(
        self, files: Files, log_input: LogInput, parameters: Any, topic: str | None, *,
        quiet: bool, verbose: bool,
    ) -> None:  # fmt: skip
        self.files, self.log_input, self.parameters = files, log_input, parameters
        self.topic, self.quiet, self.verbose = topic, quiet, verbose
        self.digests: dict[str, str] = {}
        self.against = ""

    def evaluate(self) -> Evaluation:
        """Load and compare.

        Raises:
            MapcliError: what the readers and the algorithms raise, with the trace's name.
        """
        trace = self._load(self.files.trace, None)
        try:
            if self.files.self_check is not None:
                return self._self_check(trace, self.files.self_check)
            if self.files.kind == "relations":
                return self._relations(trace, str(self.files.reference))
            return self._trajectory(trace, str(self.files.reference))
        except MapcliError as error:
            error.file = error.file or self.files.trace
            raise

    def _trajectory(self, trace: Trajectory, reference: str) -> Evaluation:
        from mapcli.algorithms.evaluate import compare

        truth = self._load(reference, self.topic)
        self.against = f"{reference}: {_described(truth)}"
        return compare(trace, truth, self.parameters)

    def _relations(self, trace: Trajectory, reference: str) -> Evaluation:
        from mapcli.algorithms.evaluate import compare_relations
        from mapcli.formats.relations import load_relations

        relations = load_relations(reference)
        self.digests[Path(reference).name] = hashlib.sha256(
            Path(reference).read_bytes()
        ).hexdigest()
        self.against = f"{reference}: {counted(len(relations), 'relations')}"
        odometry = None if self.files.odometry is None else self._odometry(self.files.odometry)
        return compare_relations(trace, relations, odometry)

    def _self_check(self, trace: Trajectory, name: str) -> Evaluation:
        from mapcli.algorithms.self_check import self_check

        self.against = f"{name}: its own closed loops"
        return self_check(trace, self._records(name))

    def _odometry(self, name: str) -> Trajectory:
        """All odometry of a log."""
        import numpy as np

        readings = [record for record in self._records(name) if isinstance(record, Odometry)]
        if not readings:
            raise MapcliError("has no odometry", file=name)
        poses = np.array([(r.pose.x, r.pose.y, r.pose.theta) for r in readings])
        return Trajectory(poses, np.array([r.stamp_ns for r in readings], dtype=np.int64))

    def _records(self, name: str) -> Iterable[Record]:
        """The records of a log, which is opened at once."""
        log = self.log_input.open([name])
        self.digests |= log.digests()
        return self._telling(log)

    def _telling(self, log: Log) -> Iterator[Record]:
        yield from self.log_input.records(log)
        if not self.quiet:
            say_notes(log, verbose=self.verbose)

    def _load(self, name: str, topic: str | None) -> Trajectory:
        from mapcli.formats.trajectories import load_trajectory

        loaded = load_trajectory(name, topic)
        self.digests[Path(name).name] = loaded.sha256
        for warning in () if self.quiet else loaded.warnings:
            click.echo(f"Warning: {name}: {warning}", err=True)
        return loaded.trajectory

    def effective_parameters(self) -> dict[str, Any]:
        """Everything that the result depends on besides the files."""
        if self.files.kind == "trajectory":
            return {**asdict(self.parameters), "topic": self.topic}
        if self.files.kind == "relations":
            return {"odometry": self.files.odometry is not None}
        from mapcli.algorithms.self_check import SelfCheckParameters

        return {**self.log_input.parameters(), **asdict(SelfCheckParameters())}


def _described(trajectory: Trajectory) -> str:
    from mapcli.commands._evaluate_report import described

    return described(trajectory)
