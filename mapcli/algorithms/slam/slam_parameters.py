"""The parameters of Algorithm 9.2 (`slam`), one group for each stage."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from mapcli.algorithms.scans.perception import PerceptionParameters
from mapcli.algorithms.slam.local_map import LocalMapParameters
from mapcli.algorithms.slam.loop_closure import LoopParameters
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.match import MatchParameters
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.model.range_reading import GatheredScan
from mapcli.model.scan import RangeScan


@dataclass(frozen=True)
class SlamParameters:
    """One group of parameters per stage.

    Attributes:
        odometry: how far off odometry may be.
        calibrate_odometry: estimate its systematic errors from the map.
        detect_odometry_faults: follow hypotheses of odometry that fails (only with the search
            `window`).
        loops: None closes none, and refines no pose when the log has ended.
    """

    map: MapParameters = field(default_factory=MapParameters)
    local_map: LocalMapParameters = field(default_factory=LocalMapParameters)
    perception: PerceptionParameters = field(default_factory=PerceptionParameters)
    odometry: MotionModel = field(default_factory=MotionModel)
    calibrate_odometry: bool = True
    match: MatchParameters = field(default_factory=MatchParameters)
    detect_odometry_faults: bool = True
    loops: LoopParameters | None = field(default_factory=LoopParameters)

    def as_in_the_book(self) -> SlamParameters:
        """For Algorithm 9.2 as it is printed: its fifteen test positions, and a map that never
        forgets and is updated in every turn of the loop."""
        plain, match = self.without_loops(), replace(self.match, search="book")
        local_map = replace(plain.local_map, update_m=0.0, update_deg=0.0)
        return replace(plain, local_map=local_map, match=match, detect_odometry_faults=False)

    def is_matched(self, scan: RangeScan) -> bool:
        """Whether a scan is to be compared with the map, or with other scans. Otherwise odometry
        alone tells its pose, and it need not be analyzed unless it is written into the map."""
        is_searched = self.match.search != "none" or self.loops is not None
        return is_searched or scan.first_ns < scan.last_ns or isinstance(scan, GatheredScan)

    def without_loops(self) -> SlamParameters:
        """A map that never forgets, and no loop closure."""
        local_map = replace(self.local_map, max_length_m=None)
        return replace(self, local_map=local_map, loops=None)
