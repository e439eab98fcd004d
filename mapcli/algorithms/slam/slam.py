"""Algorithm 9.2, simultaneous localization and mapping, one scan at a time: the front end.

The numbers in the comments of `Slam.step` are the lines of the book's algorithm; each line is a
module:

    2, 3   odometry moves the pose       `motion_model`, corrected by `odometry_calibration`, by
                                         `stale_odometry` where it comes late, and followed as
                                         hypotheses where it fails, `odometry_faults`
    4      the scan is analyzed          `scans.perception`, deskewed by `sweep_motion`
    5-9    the best test position        `scan_matcher` (correlative scan matching, relocalisation),
           around the odometry's pose    `book_matcher` (Sect. 9.5), `global_localization` (where
                                         nobody knows the robot's pose in a known map)
    10     the map is updated            `local_map`, of `occupancy_grid` with `likelihood_field`
                                         and `surfel_map`

What is done once the log has ended, loop closure above all, is `back_end`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from dataclasses import replace

from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.algorithms.scans.perception import NOTHING_SEEN, Perception, perceive
from mapcli.algorithms.slam.back_end import BackEndResult, finalise
from mapcli.algorithms.slam.book_matcher import BookSearch
from mapcli.algorithms.slam.global_localization import localize_globally
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.known_map_fit import EXPECTED, KnownMapFit
from mapcli.algorithms.slam.known_places import KnownPlaces
from mapcli.algorithms.slam.local_map import LocalMap
from mapcli.algorithms.slam.lost_track import LostTrack
from mapcli.algorithms.slam.map_refinement import map_from_keyframes
from mapcli.algorithms.slam.match import Match, MatchHistory
from mapcli.algorithms.slam.motion_model import DeadReckoning, OdometryUncertainty
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.odometry_faults import OdometryFaults
from mapcli.algorithms.slam.pose_refinement import ScanInMap
from mapcli.algorithms.slam.scan_matcher import match_scan
from mapcli.algorithms.slam.scan_points import points_of
from mapcli.algorithms.slam.short_distance import short_distance
from mapcli.algorithms.slam.slam_parameters import SlamParameters as SlamParameters
from mapcli.algorithms.slam.submaps import SUBMAP_M
from mapcli.algorithms.slam.sweep_motion import SweepMotionFilter
from mapcli.errors import DataError
from mapcli.model.pose import Pose2D
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import Mount, RangeScan, Record
from mapcli.model.trace import Status, TracedPose

FIRST_SCORE = 0.9
"""The running score before the first match."""

SCORE_WEIGHT = 0.05
"""The weight of the newest score in the running score, an exponential moving average."""

MOST_GLOBAL_SCANS = 10
"""Scans that are localised globally in a known map, at most."""


class Slam:
    """A run of Algorithm 9.2 (stateful: `map` and `pose` change with every scan).

    It begins with an empty map, or with a known one; there, without a start pose, the robot is
    localised globally.

    Attributes:
        local_map: m, the current map, and when it is updated.
        pose: c, the current position, in the map; the first scan is taken at the start pose.
        is_continued: there was a map before.
        odometry: dead reckoning and its uncertainty; faults: hypotheses about odometry that fails.
        sweep_motion: the robot's motion while a scan is taken beam by beam.
        lost: what is known of the pose where the map does not tell it.
        known_map_fit: how well the scans fit the map that there was.
        trajectory: all poses until now, and the keyframes, for the back end.
        book_search: how the last scan was compared, if that was as the book does.
    """

    def __init__(
        self,
        parameters: SlamParameters | None = None,
        start: Pose2D | None = None,
        known: OccupancyGrid | None = None,
    ) -> None:
        self.parameters = p = parameters or SlamParameters()
        self.local_map = LocalMap(known or OccupancyGrid(p.map), p.local_map)
        self.pose = start or Pose2D()
        self.is_continued = known is not None
        self._lasers: set[Mount] = set()  # those whose scans came by now
        self._is_localized, self._global_scans = known is None or start is not None, 0
        self.odometry = DeadReckoning(p.odometry, calibrate=p.calibrate_odometry)
        self.faults = OdometryFaults(map_remembers=p.local_map.max_length_m is None)
        is_written = known is not None and not p.local_map.frozen
        self.known_map_fit = KnownMapFit(deepcopy(known) if is_written else None)
        self._detects_faults = p.detect_odometry_faults and p.match.search == "window"
        self.sweep_motion = SweepMotionFilter()
        self.trajectory = TrackedTrajectory()
        self._seen: RangeScan | Perception = NOTHING_SEEN  # in the last scan
        self.book_search: BookSearch | None = None
        self.lost = LostTrack(p.odometry)
        self._short_distance = short_distance(p.match, self.map.parameters.resolution)
        self._history, self._has_begun = MatchHistory(FIRST_SCORE), False

    @property
    def map(self) -> OccupancyGrid:
        """m, the current map."""
        return self.local_map.grid

    @property
    def perception(self) -> Perception:
        """p, of the last scan; if nothing has asked for it yet, it is analyzed now."""
        if isinstance(self._seen, RangeScan):
            self._seen = self._perceive(self._seen)
        return self._seen

    def replay(self, records: Iterable[Record]) -> Iterator[TracedPose]:
        """Every scan of a log with the pose it was taken at, in time order."""
        for scan, odom in odometry_at_scans(records, self.parameters.perception.gather_m):
            yield self.step(scan, odom)

    def step(self, scan: RangeScan, odom: Pose2D | None) -> TracedPose:
        """One turn of the book's loop for a scan, with the odometry's pose at its stamp."""
        first, c = not self._has_begun, self.pose
        if first and isinstance(scan, RangeReading):
            self._close_no_loops()
        counted = self.odometry.motion(scan.stamp_ns, odom)  # 2: the robot has moved a little
        motion = self.faults.motion(scan.stamp_ns, counted)
        n = c.compose(motion or Pose2D())  # 3: new position based on odometry
        self._history = self._history.moved(motion)
        is_matched = self.is_continued or self.parameters.is_matched(scan)
        is_used = is_matched or self.local_map.is_due(n, scan.mount)
        p = self._perceive(scan) if is_used else NOTHING_SEEN  # 4: analyze sensor data
        is_moved = self._short_distance.is_moved(motion, scan.mount) or bool(p.readings)
        b = Match(n, 0.0, 0, found=False)
        if not self._is_localized:
            b = self._localize_globally(p)
        elif (
            is_moved and self._is_known_from(scan.mount) and is_matched
        ):  # 5-8: the best pose near n
            uncertainty = self.odometry.uncertainty(motion)
            uncertainty = replace(uncertainty, since_known=self.lost.deviations)
            p, b = self._match(scan, odom, p, n, uncertainty)
            if self._detects_faults:
                scan_in_map = ScanInMap(self.map, p, self.parameters.match)
                b = self.faults.select(c, uncertainty, b, scan_in_map, self._history)
            self._update_history(c, b)
            self.lost.update(b, uncertainty)
            if self.is_continued:
                self.known_map_fit.add(b, p, self.parameters.match)
        n = b.pose  # 9: replace new position by best position
        self.odometry.compare(c.between(n))
        in_map = is_moved and self._is_localized and self._update_map(n, p, scan.mount)  # 10
        self._record(scan, odom, p, motion, b, in_map=in_map)
        if in_map:
            self.lost.begin_anew()
        self._seen, self.book_search = p if is_used else scan, b.search
        self.pose, self._has_begun = n, True  # 11: current position is new position
        status: Status = "first" if first else "matched" if b.found else "odometry"
        score = b.score if b.found else None
        return TracedPose(scan.stamp_ns, n, odom, score, status)

    def _close_no_loops(self) -> None:
        """For the few beams of range sensors: what they see at a place looks like many others, and
        a scan fitted to the walls that it has shown itself is no better for it."""
        self.parameters = self.parameters.without_loops()
        self.local_map.parameters = self.parameters.local_map
        self._detects_faults = False

    def _perceive(self, scan: RangeScan) -> Perception:
        """The perception map of a scan, deskewed as is known before it is matched."""
        if scan.first_ns < scan.last_ns:
            scan = replace(scan, motion=self.sweep_motion.motion(scan))
        return perceive(scan, self.parameters.perception)

    def _match(
        self,
        scan: RangeScan,
        odom: Pose2D | None,
        perception: Perception,
        predicted: Pose2D,
        uncertainty: OdometryUncertainty,
    ) -> tuple[Perception, Match]:
        """The best test position around the predicted pose. It shows how the robot moved, by which
        the scan is deskewed and matched once more."""
        p = self.parameters.match
        b = match_scan(self.map, perception, predicted, uncertainty, p, self._history)
        if perception.sweep is None:
            return perception, b
        self.sweep_motion.update(scan, odom, self.pose.between(b.pose) if b.found else None)
        again = self.sweep_motion.deskewed(perception, scan)
        if again is not perception:
            b = match_scan(self.map, again, predicted, uncertainty, p, self._history)
        return again, b

    def _is_known_from(self, laser: Mount) -> bool:
        """Whether the map holds what a laser there sees: the first scan of one that looks back
        would be matched with the edges of what one that looks ahead has seen."""
        is_known = self.is_continued or laser in self._lasers
        self._lasers.add(laser)
        return is_known

    def _localize_globally(self, perception: Perception) -> Match:
        """The first pose in a known map.

        Raises:
            DataError: `MOST_GLOBAL_SCANS` scans are found nowhere.
        """
        match = localize_globally(self.map, perception, self.parameters.match)
        self._is_localized = match.found
        self._global_scans += len(perception.hits) >= self.parameters.match.min_hits
        if not match.found and self._global_scans == MOST_GLOBAL_SCANS:
            problem = f"{MOST_GLOBAL_SCANS} scans are found nowhere in the known map"
            raise DataError(problem, expected=EXPECTED)
        return match

    def check_known_map(self) -> None:
        """Refuse, when the log has ended, a known map that the robot was not found in.

        Raises:
            DataError: it was found nowhere, or was not there in a map that was to be left alone.
        """
        if not self._is_localized:
            problem = "is found nowhere in the known map"
            raise DataError(problem, expected=EXPECTED)
        p = self.parameters
        if p.local_map.frozen and p.match.search != "none":
            self.known_map_fit.check()

    def _update_map(self, pose: Pose2D, perception: Perception, laser: Mount) -> bool:
        """Line 10, unless the map contradicts the scan; where it goes on doing so, it begins anew.
        A map that never forgets is always written to: with walls of old laps it contradicts right
        poses too, when the robot comes back with an error."""
        if not self.lost.lost_scans or self.parameters.local_map.max_length_m is None:
            return self.local_map.update(pose, perception, laser)
        if not self.lost.is_elsewhere or not self.local_map.is_due(pose, laser):
            return False
        self.local_map.begin_anew(pose)
        self.faults.begin_anew()
        self._lasers = {laser}
        self._history = MatchHistory(FIRST_SCORE)
        return self.local_map.update(pose, perception, laser)

    def _update_history(self, before: Pose2D, match: Match) -> None:
        """The running score, and the calibration of odometry, after a match."""
        score = self._history.running_score
        if match.found:
            score += SCORE_WEIGHT * (match.score - score)
            if self.faults.active == "odometry":
                self.odometry.calibrate(before.between(match.pose), match.information)
        self._history = MatchHistory(score, match.alternative)

    def _record(
        self,
        scan: RangeScan,
        odom: Pose2D | None,
        perception: Perception,
        motion: Pose2D | None,
        match: Match,
        *,
        in_map: bool,
    ) -> None:
        """Keep what is needed when the log has ended."""
        if self.parameters.loops is None:
            return
        self.trajectory.correct_last_poses(self.faults.past_poses)
        points = points_of(perception, self.parameters.map.resolution)
        number = len(self.trajectory.poses)
        self.trajectory.add(match.pose, points.metres, motion)
        self.trajectory.sweeps.add(number, scan, odom, perception, points.numbers)
        if in_map:
            information = match.information if match.found else None
            odometry, alone = self.parameters.odometry, self.lost.deviations
            since = 1 + number - self.lost.lost_scans if self.lost.is_elsewhere else None
            self.trajectory.add_keyframe(perception, information, odometry, alone, since)

    @property
    def submap_count(self) -> int:
        """About how many submaps `finalise` will look at."""
        loops, keyframes = self.parameters.loops, self.trajectory.keyframes
        return 1 + int(keyframes[-1].metres / SUBMAP_M) if loops and keyframes else 0

    def finalise(
        self,
        progress: Callable[[int], None] = lambda step: None,
        places: KnownPlaces | None = None,
    ) -> BackEndResult | None:
        """Close the loops and refine all poses; None if there is nothing to improve.

        Args:
            progress: called with the number of each submap that was looked at.
            places: that a person knows.
        """
        p = self.parameters
        if p.loops is None or not self.trajectory.keyframes:
            return None
        return finalise(self.trajectory, p.map, p.loops, p.odometry, progress, places)

    def unrefined(self, scans: int) -> BackEndResult | None:
        """The first `scans` poses as they were tracked, and the map of their keyframes: what
        there is after an interruption. None without loop closure, where `map` is all of it."""
        p, keyframes = self.parameters, self.trajectory.keyframes
        if p.loops is None or not keyframes:
            return None
        poses = self.trajectory.poses[:scans]
        return BackEndResult(poses, map_from_keyframes(self.trajectory, poses, p.map))
