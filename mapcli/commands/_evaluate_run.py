"""What `mapcli evaluate` reads and compares."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from mapcli import evaluate, load_relations, load_trajectory
from mapcli.algorithms.evaluation.evaluate import Reference
from mapcli.algorithms.evaluation.relations import odometry_of
from mapcli.algorithms.evaluation.trajectory_error import EvaluateParameters
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
from mapcli.model.scan import Record
from mapcli.model.trajectory import Trajectory


@dataclass(frozen=True)
class Files:
    """What is compared: names as typed, None where not given."""

    trace: str
    reference: str | None
    self_check: str | None
    odometry: str | None

    @property
    def kind(self) -> Kind:
        if self.self_check is not None:
            return "self-check"
        return "relations" if is_relations(self.reference or "") else "trajectory"

    def inputs(self) -> list[str]:
        named = self.trace, self.reference, self.self_check, self.odometry
        return [name for name in named if name is not None]


class EvaluateRun:
    """One evaluation (stateful: `digests` fills while files are read).

    Attributes:
        digests: file name -> SHA-256, for the head of the document.
        against: what the trace is compared with, for people.
    """

    def __init__(
        self, files: Files, log_input: LogInput, parameters: EvaluateParameters,
        topic: str | None, *, quiet: bool, verbose: bool,
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
        torn = torn_files(Path(self.files.trace))
        text = "beside it is not the one that it was written with"
        warn(self.files.trace, [f"{name} {text}" for name in torn], quiet=self.quiet)
        try:
            reference = self._reference()
            odometry = None if self.files.odometry is None else self._odometry(self.files.odometry)
            return evaluate(trace, reference, self.parameters, odometry=odometry)
        except MapcliError as error:
            error.file = error.file or self.files.trace
            raise

    def _reference(self) -> Reference:
        """What the trace is held against, loaded."""
        if self.files.self_check is not None:
            self.against = f"{self.files.self_check}: its own closed loops"
            return self._records(self.files.self_check)
        name = str(self.files.reference)
        if self.files.kind == "relations":
            relations = load_relations(name)
            self.digests[Path(name).name] = sha256_of(read_file(Path(name)))
            self.against = f"{name}: {counted(len(relations), 'relations')}"
            return relations
        truth = self._load(name, self.topic)
        self.against = f"{name}: {described(truth)}"
        return truth

    def _odometry(self, name: str) -> Trajectory:
        try:
            return odometry_of(self._records(name))
        except MapcliError as error:
            error.file = error.file or name
            raise

    def _records(self, name: str) -> Iterable[Record]:
        """The records of a log, which is opened at once."""
        log = self.log_input.open([name])
        self.digests |= log.digests()
        return self._telling(log)

    def _telling(self, log: Log) -> Iterator[Record]:
        yield from self.log_input.records(log)
        say_notes(log, verbose=self.verbose, quiet=self.quiet)

    def _load(self, name: str, topic: str | None) -> Trajectory:
        loaded = load_trajectory(name, topic)
        self.digests[Path(name).name] = loaded.sha256
        warn(name, loaded.warnings, quiet=self.quiet)
        return loaded.trajectory

    def effective_parameters(self) -> dict[str, Any]:
        """Everything that the result depends on besides the files."""
        if self.files.kind == "trajectory":
            return {**asdict(self.parameters), "topic": self.topic}
        if self.files.kind == "relations":
            return {"odometry": self.files.odometry is not None}
        from mapcli.algorithms.evaluation.self_check import SelfCheckParameters

        return {**self.log_input.parameters(), **asdict(SelfCheckParameters())}
