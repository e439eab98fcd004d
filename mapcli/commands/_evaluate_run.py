"""What `mapcli evaluate` reads and compares."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from mapcli import evaluate, load_relations, load_trajectory
from mapcli.algorithms.evaluation.relations import odometry_of
from mapcli.algorithms.evaluation.trajectory_error import (
    EvaluateParameters,
    associate,
    common_alignment,
)
from mapcli.commands._evaluate_report import described
from mapcli.commands._log_options import LogInput, say_notes
from mapcli.commands._say import warn
from mapcli.errors import MapcliError
from mapcli.formats.documents.pose_trace import torn_files
from mapcli.formats.documents.relations import is_relations
from mapcli.formats.input import read_file, sha256_of
from mapcli.formats.logs.open_log import Log
from mapcli.model.counting import counted
from mapcli.model.evaluation import Evaluation, Kind
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Record
from mapcli.model.trajectory import Relations, Trajectory


@dataclass(frozen=True)
class Files:
    """What is compared: names as typed, None where not given.

    Attributes:
        self_check: of one trace the parts of its recording, of several a log each; or none.
        common_frame: align all traces by one motion.
    """

    traces: tuple[str, ...]
    reference: str | None
    self_check: tuple[str, ...]
    odometry: str | None
    common_frame: bool

    @property
    def kind(self) -> Kind:
        if self.self_check:
            return "self-check"
        return "relations" if is_relations(self.reference or "") else "trajectory"

    def inputs(self) -> list[str]:
        others = filter(None, (self.reference, *self.self_check, self.odometry))
        return [*self.traces, *others]

    def labels(self) -> list[str]:
        """Short names of the traces: of the files, unless two are called the same."""
        names = [Path(trace).name for trace in self.traces]
        return names if len(set(names)) == len(names) else list(self.traces)


class EvaluateRun:
    """One evaluation, of one trace or several (stateful: `digests` fills while files are read).

    Attributes:
        digests: file name -> SHA-256, for the head of the documents.
        against: what the traces are compared with, for people.
    """

    def __init__(
        self, files: Files, log_input: LogInput, parameters: EvaluateParameters,
        topic: str | None, *, quiet: bool, verbose: bool,
    ) -> None:  # fmt: skip
        self.files, self.log_input, self.parameters = files, log_input, parameters
        self.topic, self.quiet, self.verbose = topic, quiet, verbose
        self.digests: dict[str, str] = {}
        self.against = ""

    def evaluate(self) -> list[Evaluation]:
        """Load and compare, each trace.

        Raises:
            MapcliError: what the readers and the algorithms raise, with the trace's name.
        """
        labels = self.files.labels()
        traces = [self._trace(*names) for names in zip(self.files.traces, labels, strict=True)]
        if self.files.self_check:
            return self._self_checks(traces)
        with _about(self.files.traces[0]):
            reference = self._reference()
            odometry = None if self.files.odometry is None else self._odometry(self.files.odometry)
        alignment = None
        if self.files.common_frame and isinstance(reference, Trajectory):
            alignment = self._common_alignment(traces, reference)
        evaluations = []
        for name, trace in zip(self.files.traces, traces, strict=True):
            with _about(name):
                evaluations.append(
                    evaluate(
                        trace, reference, self.parameters, odometry=odometry, alignment=alignment
                    )
                )
        return evaluations

    def _trace(self, name: str, label: str) -> Trajectory:
        trace = self._load(name, None, label)
        torn = torn_files(Path(name))
        text = "beside it is not the one that it was written with"
        warn(name, [f"{file} {text}" for file in torn], quiet=self.quiet)
        return trace

    def _self_checks(self, traces: Sequence[Trajectory]) -> list[Evaluation]:
        """Each trace against its own scans and those of the others, which share its frame."""
        from mapcli.algorithms.evaluation.self_check import RecordedTrace, self_checks

        files, logs = self.files, self.files.self_check
        what = (
            "its own closed loops" if len(traces) == 1 else "places visited twice, by any of them"
        )
        self.against = f"{', '.join(logs)}: {what}"
        recordings = [logs] if len(traces) == 1 else [(log,) for log in logs]
        with _about(files.traces[0]):
            records = [self._records(parts) for parts in recordings]
            recorded = map(RecordedTrace, traces, records, files.traces)
            pairs = self_checks(list(recorded))
        evaluations = []
        for number, name in enumerate(files.traces):
            with _about(name):
                evaluations.append(pairs.evaluation(number))
        return evaluations

    def _common_alignment(self, traces: Sequence[Trajectory], reference: Trajectory) -> Pose2D:
        associations = []
        for name, trace in zip(self.files.traces, traces, strict=True):
            with _about(name):
                associations.append(associate(trace, reference, self.parameters))
        return common_alignment(traces, associations)

    def _reference(self) -> Trajectory | Relations:
        """What the traces are held against, loaded."""
        name = str(self.files.reference)
        if self.files.kind == "relations":
            relations = load_relations(name)
            self.digests[Path(name).name] = sha256_of(read_file(Path(name)))
            self.against = f"{name}: {counted(len(relations), 'relations')}"
            return relations
        truth = self._load(name, self.topic, Path(name).name)
        self.against = f"{name}: {described(truth)}"
        return truth

    def _odometry(self, name: str) -> Trajectory:
        with _about(name):
            return odometry_of(self._records([name]))

    def _records(self, names: Sequence[str]) -> Iterable[Record]:
        """The records of a log, which is opened at once."""
        log = self.log_input.open(names)
        self.digests |= log.digests()
        return self._telling(log)

    def _telling(self, log: Log) -> Iterator[Record]:
        yield from self.log_input.records(log)
        say_notes(log, verbose=self.verbose, quiet=self.quiet)

    def _load(self, name: str, topic: str | None, label: str) -> Trajectory:
        loaded = load_trajectory(name, topic)
        self.digests[label] = loaded.sha256
        warn(name, loaded.warnings, quiet=self.quiet)
        return loaded.trajectory

    def inputs_of(self, number: int) -> dict[str, str]:
        """The digests of the files that the evaluation of one trace depends on."""
        if self.files.common_frame or self.files.self_check:
            return self.digests
        labels = self.files.labels()
        others = set(labels) - {labels[number], Path(self.files.reference or "").name}
        return {name: digest for name, digest in self.digests.items() if name not in others}

    def effective_parameters(self) -> dict[str, Any]:
        """Everything that the result depends on besides the files."""
        if self.files.kind == "trajectory":
            common = {"common_frame": True} if self.files.common_frame else {}
            return {**asdict(self.parameters), "topic": self.topic, **common}
        if self.files.kind == "relations":
            return {"odometry": self.files.odometry is not None}
        from mapcli.algorithms.evaluation.self_check_parameters import SelfCheckParameters

        return {**self.log_input.parameters(), **asdict(SelfCheckParameters())}


@contextmanager
def _about(name: str) -> Iterator[None]:
    """Errors that name no file are about this one."""
    try:
        yield
    except MapcliError as error:
        error.file = error.file or name
        raise
