"""A replay of a log's records through Algorithm 9.2, from the first record to the results."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mapcli.algorithms.scans.mount_check import MountCheck
from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.algorithms.slam.back_end import BackEndResult
from mapcli.algorithms.slam.contradictions import compare_scans
from mapcli.algorithms.slam.laser_calibration import LaserCalibration
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.odometry_check import odometry_reasons
from mapcli.algorithms.slam.persons_view import PersonsView
from mapcli.algorithms.slam.scan_sample import ScanSample
from mapcli.algorithms.slam.slam import Slam, SlamParameters
from mapcli.algorithms.slam.sweep_search import SweepSearch
from mapcli.algorithms.slam.verdict import map_reasons, verdict_of, wrong_lines
from mapcli.algorithms.slam.wheel_reasons import wheel_reasons
from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.knowledge import NOTHING_KNOWN, Knowledge
from mapcli.model.log import Damage
from mapcli.model.pose import Pose2D
from mapcli.model.range_reading import GatheredScan
from mapcli.model.reason import Reason
from mapcli.model.scan import NANOSECONDS, RangeScan, Record
from mapcli.model.seen_part import seen_part
from mapcli.model.summary import ReplaySummary
from mapcli.model.sweep_summary import SweepSummary, turn_time
from mapcli.model.trace import PoseTrace, TracedPose


@dataclass(frozen=True, eq=False)
class Replayed:
    """What a replay found out.

    Attributes:
        map: obstacle probabilities in the frame of the poses.
        trace: the pose of the robot in the map at every scan, and the loops closed.
        summary: what became of the scans.
    """

    map: GridMap
    trace: PoseTrace
    summary: ReplaySummary


def replay(
    records: Iterable[Record],
    parameters: SlamParameters | None = None,
    *,
    start: Pose2D | None = None,
    known: GridMap | None = None,
    damage: Damage | None = None,
    knowledge: Knowledge = NOTHING_KNOWN,
) -> Replayed:
    """Turn the records of a log into a map and the robot's trajectory (Algorithm 9.2).

    Args:
        records: odometry and scans in stamp order, of `mapcli.open_log(...).records()`.
        parameters: how; by default all stages, but no loop closure in a known map.
        start: pose of the robot in the map at the first scan. By default the map's origin; in a
            known map it is searched for.
        known: a map to go on from instead of an empty one.
        damage: `damage` of the log that the records are from, for the summary.
        knowledge: what a person knows of the drive.

    Raises:
        DataError: no scan among the records, a known map that cannot be gone on from, or a robot
            that is nowhere in it.
    """
    default = SlamParameters() if known is None else SlamParameters().without_loops()
    p = parameters or default
    grid = None if known is None else OccupancyGrid.from_grid_map(known, p.map)
    run = ReplayRun(Slam(p, start, grid))
    for _ in run.track(records):
        pass
    run.finalise(knowledge=knowledge)
    return run.result(damage)


class ReplayRun:
    """One replay (stateful), from which the results may be taken even when it is stopped early.

    Attributes:
        slam: the algorithm with its map.
        poses: as tracked so far.
        finalised: poses and map after loop closure and refinement; None if there was nothing to
            improve.
        interrupted: it was stopped early; stopped_by: the signal, if it was one.
        kept: the scans whose numbers are in `keep`.
        mount: whether the laser sits where the log says; calibration: where it sits, if the log
            does not say.
        sweeps: when the beams of a scan are taken, where the log does not tell.
        most_hits: beams of a scan that hit something, at most, where scans are matched.
    """

    def __init__(
        self,
        slam: Slam,
        keep: Container[int] = (),
        is_mount_unknown: Callable[[], bool] = lambda: False,
    ) -> None:
        self.slam = slam
        self.poses: list[TracedPose] = []
        self.finalised: BackEndResult | None = None
        self.interrupted = False
        self.stopped_by: KeyboardInterrupt | None = None
        self.kept: dict[int, RangeScan] = {}
        self.mount, self.calibration = MountCheck(), LaserCalibration(is_mount_unknown)
        self.sweeps = SweepSearch(slam.parameters)
        self._timed: RangeScan | None = None  # the first whose beams are not taken at once
        self.most_hits = 0
        self._keep, self._scans_read, self._scans_used = keep, 0, 0
        self._sample = ScanSample()
        self._not_so: list[str] = []

    def track(self, records: Iterable[Record]) -> Iterator[TracedPose]:
        """Every scan with its pose, as the log goes on."""
        way_m = self.slam.parameters.perception.gather_m
        scans = odometry_at_scans(self.sweeps.settled(self._counted(records)), way_m)
        for scan, odom in self.calibration.watched(self.mount.watched(scans)):
            if self._timed is None and scan.first_ns < scan.last_ns:
                self._timed = scan
            if len(self.poses) in self._keep:
                self.kept[len(self.poses)] = scan
            self._scans_used += len(scan.readings) if isinstance(scan, GatheredScan) else 1
            pose = self.slam.step(scan, odom)
            self._correct_last_poses(self.slam.faults.past_poses)
            self.poses.append(pose)
            if self.slam.parameters.match.search != "none":
                self.most_hits = max(self.most_hits, len(self.slam.perception.hits))
            if self._sample.is_next(self.poses[-1].pose):
                self._sample.take(self.slam.perception)
            yield self.poses[-1]

    def _correct_last_poses(self, poses: Sequence[Pose2D]) -> None:
        """The last scans were taken at these poses after all."""
        first = len(self.poses) - len(poses)
        for k, pose in enumerate(poses, first):
            self.poses[k] = replace(self.poses[k], pose=pose)

    def _counted(self, records: Iterable[Record]) -> Iterator[Record]:
        """The records; scans are counted."""
        for record in records:
            self._scans_read += isinstance(record, RangeScan)
            yield record

    def finalise(
        self,
        progress: Callable[[int], None] = lambda submap: None,
        knowledge: Knowledge = NOTHING_KNOWN,
    ) -> None:
        """Close loops and refine all poses; see `Slam.finalise`.

        Raises:
            DataError: the robot was not found in the known map, or a time that a person told is
                none of the drive.
        """
        self.slam.check_known_map()
        if knowledge:
            told = PersonsView.of(knowledge, [("", self.poses)])
            tracked = self.slam.trajectory
            self.slam.trajectory, self._not_so = told.followed(
                tracked, self.slam.parameters.odometry
            )
        self.finalised = self.slam.finalise(progress, told.places if knowledge else None)

    def stop(self) -> None:
        """After an interruption: take the poses as tracked, and the map that they make."""
        self.interrupted = True
        self.finalised = self.slam.unrefined(len(self.poses))

    def result(self, damage: Damage | None = None) -> Replayed:
        """Map, trace and summary.

        Args:
            damage: what was wrong with the log, as far as it was read.

        Raises:
            DataError: there was no scan.
        """
        if not self.poses:
            raise DataError("no scan in the part asked for")
        damage = damage or Damage()
        skipped = dict(damage.missed)
        if missed := self._scans_read - self._scans_used:
            skipped["scans not reached before the interruption"] = missed
        trace = self.trace()
        return Replayed(self._map(trace), trace, self._summary(trace, damage, skipped))

    def _map(self, trace: PoseTrace) -> GridMap:
        """The map, of a known one all that there was, else without what was glimpsed around it."""
        grid = self.slam.map if self.finalised is None else self.finalised.grid
        if self.slam.is_continued:
            return grid.to_grid_map()
        path = np.array([(traced.pose.x, traced.pose.y) for traced in trace.poses])
        return seen_part(grid.to_grid_map(), path)

    def trace(self) -> PoseTrace:
        """The poses until now, and the loops closed."""
        if self.finalised is None:
            return PoseTrace(tuple(self.poses))
        refined = zip(self.poses, self.finalised.poses, strict=True)
        poses = tuple(replace(traced, pose=pose) for traced, pose in refined)
        steps = tuple(a.pose.between(b.pose) for a, b in pairwise(self.poses))
        return PoseTrace(poses, self.finalised.loops, steps)

    def _summary(
        self, trace: PoseTrace, damage: Damage, skipped: Mapping[str, int]
    ) -> ReplaySummary:
        statuses = [pose.status for pose in self.poses]
        reasons = self._reasons(trace)
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
            odometry_faults=len(self.slam.faults.failures),
            odometry_catch_ups=self.slam.odometry.catch_ups,
            damage=dict(damage.counts),
            interrupted=self.interrupted,
            lost_share=damage.lost_share,
            verdict=verdict_of(reasons),
            reasons=reasons,
            sweep=self._sweep_summary(),
            loop_check=self.finalised.loop_check if self.finalised else None,
            unjoined=len(self.finalised.unjoined) if self.finalised else 0,
        )

    def _reasons(self, trace: PoseTrace) -> tuple[Reason, ...]:
        """What speaks against the map."""
        poses = [traced.pose for traced in trace.poses]
        sampled = [one for one in self._sample.scans if one.scan < len(poses)]
        duration_s = (self.poses[-1].stamp_ns - self.poses[0].stamp_ns) / NANOSECONDS
        # A laser that is mirrored or turned, and wheels that are, look the same.
        is_mounted_so = self.mount.finding() is None
        return (
            *(odometry_reasons(trace.poses, duration_s) if is_mounted_so else ()),
            *self.slam.known_map_fit.reasons(duration_s),
            *map_reasons(
                trace.poses,
                compare_scans(sampled, poses),
                self._remedy(),
                self.finalised.unjoined if self.finalised else (),
                self.finalised.begins if self.finalised else (),
                may_be_told=self.slam.parameters.loops is not None,
                is_searched=self.slam.parameters.match.search != "none",
            ),
            *wheel_reasons(trace.poses, self.slam.faults.failures),
            *wrong_lines(self._wrong_lines(), duration_s),
        )

    def _wrong_lines(self) -> list[str]:
        """What a person told that is not so."""
        return [*self._not_so, *(self.finalised.wrong_lines if self.finalised else ())]

    def _remedy(self) -> str:
        """The option to try where places passed twice do not meet."""
        p = self.slam.parameters
        if p.loops is not None or self.slam.is_continued:  # a known map closes no loops
            return ""
        return "--loop-closing" if p.match.search == "window" else "--search window"

    def _sweep_summary(self) -> SweepSummary | None:
        scan = self._timed
        if scan is None:
            return None
        order = self.sweeps.order if self.sweeps.was_needed else scan.timing.order
        crispness = self.finalised.crispness if self.finalised else None
        sweep_s = scan.timing.span(len(scan.ranges))
        found = self.sweeps.turn_s > 0
        return SweepSummary(turn_time(scan), sweep_s, order, crispness, is_found=found)
