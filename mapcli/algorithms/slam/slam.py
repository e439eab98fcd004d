"""Algorithm 9.2: simultaneous localization and mapping, one scan at a time.

The numbers in the comments are the lines of the book's algorithm. What makes it work on real logs
sits in the modules it calls: `dead_reckoning` (2, 3), `perception` (4), `matching` (5-8) and
`current_map` (10). What is done once the log has ended, closing loops above all, is `closing`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.algorithms.scans.perception import Perception, PerceptionParameters, perceive
from mapcli.algorithms.slam.back_end import BackEndResult, finalise
from mapcli.algorithms.slam.global_localization import locate
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.local_map import LocalMap, LocalMapParameters
from mapcli.algorithms.slam.loop_closure import LoopParameters
from mapcli.algorithms.slam.map_refinement import RefineParameters
from mapcli.algorithms.slam.match import Match, MatchHistory, MatchParameters
from mapcli.algorithms.slam.motion_model import DeadReckoning, MotionModel
from mapcli.algorithms.slam.occupancy_grid import MapParameters, OccupancyGrid
from mapcli.algorithms.slam.odometry_calibration import CalibrationParameters
from mapcli.algorithms.slam.odometry_faults import FaultParameters, OdometryFaults
from mapcli.algorithms.slam.scan_matcher import ScanInMap, best_pose
from mapcli.algorithms.slam.scan_points import points_of
from mapcli.algorithms.slam.submaps import SUBMAP_M
from mapcli.errors import DataError
from mapcli.model.pose import Pose2D
from mapcli.model.scan import RangeScan, Record
from mapcli.model.trace import Status, TracedPose

SCORE_MEMORY = 0.05
"""The weight of the newest score in the running mean that tells what score is usual."""


MOST_TRIES = 10
"""Scans that are looked for in a whole known map."""


@dataclass(frozen=True)
class SlamParameters:
    """One group of parameters per stage; without `loops`, none are closed."""

    map: MapParameters = field(default_factory=MapParameters)
    current: LocalMapParameters = field(default_factory=LocalMapParameters)
    perception: PerceptionParameters = field(default_factory=PerceptionParameters)
    odometry: MotionModel = field(default_factory=MotionModel)
    calibration: CalibrationParameters = field(default_factory=CalibrationParameters)
    match: MatchParameters = field(default_factory=MatchParameters)
    faults: FaultParameters = field(default_factory=FaultParameters)
    loops: LoopParameters | None = field(default_factory=LoopParameters)
    refine: RefineParameters = field(default_factory=RefineParameters)


class Slam:
    """A run of Algorithm 9.2 (stateful: `map` and `pose` change with every scan).

    It begins with an empty map, or with a known one; there, without a start pose, the first scan
    is looked for in the whole map.

    Attributes:
        current: m, the current map, and when it is updated.
        pose: c, the current position; the first scan is taken at the start pose.
        odometry: what the wheels say; faults: whether they can be believed.
        trajectory: all poses until now.
    """

    def __init__(
        self,
        parameters: SlamParameters | None = None,
        start: Pose2D | None = None,
        known: OccupancyGrid | None = None,
    ) -> None:
        self.parameters = p = parameters or SlamParameters()
        self.current = LocalMap(known or OccupancyGrid(p.map), p.current)
        self.pose = start or Pose2D()
        self._is_continued = known is not None
        self._is_lost, self._tries = known is not None and start is None, 0
        self.odometry = DeadReckoning(p.odometry, p.calibration)
        self.faults = OdometryFaults(p.faults)
        # A map that remembers old laps is at odds with the right pose as well.
        self._tells_faults = p.match.search == "window" and p.current.most_m is not None
        self.trajectory = TrackedTrajectory()
        self._lately, self._has_begun = MatchHistory(0.9), False

    @property
    def map(self) -> OccupancyGrid:
        """m, the current map."""
        return self.current.grid

    def replay(self, records: Iterable[Record]) -> Iterator[TracedPose]:
        """Every scan of a log with the pose it was taken at, in time order."""
        for scan, odom in odometry_at_scans(records):
            yield self.step(scan, odom)

    def step(self, scan: RangeScan, odom: Pose2D | None) -> TracedPose:
        """One turn of the book's loop for a scan, with the odometry's pose at its stamp."""
        first, c = not self._has_begun, self.pose
        counted = self.odometry.motion(scan.stamp_ns, odom)  # 2: the robot has moved a little
        motion = self.faults.motion(scan.stamp_ns, counted)
        n = c.compose(motion or Pose2D())  # 3: new position based on odometry
        p = perceive(scan, self.parameters.perception)  # 4: analyze sensor data
        b = Match(n, 0.0, 0, found=False)
        if self._is_lost:
            b = self._locate(p)
        elif not first or self._is_continued:  # 5-8: the best test position around n
            uncertainty = self.odometry.uncertainty(motion)
            b = best_pose(self.map, p, n, uncertainty, self.parameters.match, self._lately)
            if self._tells_faults:
                near = ScanInMap(self.map, p, self.parameters.match)
                b = self.faults.weigh(c, uncertainty, b, near, self._lately.score)
            self._learn(c, b)
        n = b.pose  # 9: replace new position by best position
        in_map = not self._is_lost and self.current.update(n, p)  # 10: update map based on it
        self._record(p, n, b, in_map=in_map)
        self.pose, self._has_begun = n, True  # 11: current position is new position
        status: Status = "first" if first else "matched" if b.found else "odometry"
        return TracedPose(scan.stamp_ns, n, odom, b.score if b.found else None, status)

    def _locate(self, perception: Perception) -> Match:
        """The first position in a known map."""
        match = locate(self.map, perception, self.parameters.match)
        self._is_lost = not match.found
        self._tries += len(perception.hits) >= self.parameters.match.fewest
        if self._is_lost and self._tries == MOST_TRIES:
            raise DataError(
                f"{MOST_TRIES} scans are found nowhere in the known map",
                expected="--initial-pose, or another map",
            )
        return match

    def _learn(self, before: Pose2D, match: Match) -> None:
        """What the match tells about scores and wheels."""
        usual = self._lately.score
        if match.found:
            usual += SCORE_MEMORY * (match.score - usual)
            if self.faults.believed == "wheels":
                self.odometry.calibrate(before.between(match.pose), match.information)
        self._lately = MatchHistory(usual, match.doubtful)

    def _record(self, perception: Perception, pose: Pose2D, match: Match, *, in_map: bool) -> None:
        """Keep what is needed when the log has ended."""
        if self.parameters.loops is None:
            return
        self.trajectory.amend(self.faults.way)
        self.trajectory.add(pose, points_of(perception, self.parameters.map.resolution).metres)
        if in_map:
            self.trajectory.add_keyframe(perception, match.information, self.parameters.odometry)

    @property
    def submap_count(self) -> int:
        """About how many submaps `finalise` will look at."""
        loops, keyframes = self.parameters.loops, self.trajectory.keyframes
        return 1 + int(keyframes[-1].metres / SUBMAP_M) if loops and keyframes else 0

    def finalise(self, progress: Callable[[int], None] = lambda step: None) -> BackEndResult | None:
        """Close the loops and refine all poses; None if there is nothing to improve.

        `progress` is called with the number of each submap that was looked at.
        """
        p = self.parameters
        if p.loops is None or not self.trajectory.keyframes:
            return None
        return finalise(self.trajectory, p.map, p.loops, p.refine, progress)
