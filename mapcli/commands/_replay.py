"""A run of `mapcli slam-replay`, from the log to the results."""

from __future__ import annotations

import time
from collections.abc import Container, Iterable, Iterator
from dataclasses import asdict, replace
from itertools import pairwise
from typing import Any

from mapcli.algorithms.slam.back_end import BackEndResult
from mapcli.algorithms.slam.slam import Slam
from mapcli.commands._log_options import LogInput
from mapcli.commands._output import progress, progress_of_steps
from mapcli.errors import DataError
from mapcli.formats.logs.open_log import Log
from mapcli.model.grid import GridMap
from mapcli.model.scan import RangeScan, Record
from mapcli.model.summary import ReplaySummary
from mapcli.model.trace import PoseTrace, TracedPose


class Replay:
    """One run over a log (stateful), from which the results are taken even when it is stopped.

    Attributes:
        log: what is replayed; slam: the algorithm with its map.
        poses: what is known so far.
        finalised: poses and map after the loops were closed; None if there was nothing to close.
        interrupted: the user stopped it with Ctrl-C.
        kept: the scans that are to be saved, by number.
    """

    def __init__(
        self, log: Log, log_input: LogInput, slam: Slam, keep: Container[int] = ()
    ) -> None:
        self.log, self.log_input, self.slam = log, log_input, slam
        self.poses: list[TracedPose] = []
        self.finalised: BackEndResult | None = None
        self.interrupted = False
        self.kept: dict[int, RangeScan] = {}
        self._keep, self._asked = keep, 0
        self._started = time.perf_counter()

    def run(self, *, quiet: bool) -> None:
        """Replay the log to its end, or to Ctrl-C.

        Raises:
            DataError: not one scan in the part asked for, or none before Ctrl-C.
        """
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
        with progress_of_steps("closing loops", self.slam.submap_count, quiet=quiet) as report:
            self.finalised = self.slam.finalise(report)

    def _counting(self, records: Iterable[Record]) -> Iterator[Record]:
        for record in records:
            if isinstance(record, RangeScan):
                if self._asked in self._keep:
                    self.kept[self._asked] = record
                self._asked += 1
            yield record

    def trace(self) -> PoseTrace:
        """The poses, and the loops closed."""
        if self.finalised is None:
            return PoseTrace(tuple(self.poses))
        improved = zip(self.poses, self.finalised.poses, strict=True)
        poses = tuple(replace(traced, pose=pose) for traced, pose in improved)
        steps = tuple(a.pose.between(b.pose) for a, b in pairwise(self.poses))
        return PoseTrace(poses, self.finalised.loops, steps)

    def grid(self) -> GridMap:
        """The map."""
        grid = self.slam.map if self.finalised is None else self.finalised.grid
        return grid.to_grid_map()

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
            odometry_jumps=self.slam.odometry.jumps,
            odometry_faults=self.slam.faults.scans,
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
        return {**self.log_input.parameters(), **asdict(self.slam.parameters)}
