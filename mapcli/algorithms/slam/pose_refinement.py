"""A scan in a map near a pose that is known already: refinement to the last millimetre, and how
well the scan agrees with the map there. Nothing is searched (see `scan_matcher`).

The refinement is Gauss-Newton on the distances of the points from the lines of the surfel map
(point-to-line ICP, see `surfel_map`), with the odometry's pose as a prior.
"""

from __future__ import annotations

import math
from dataclasses import replace

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.slam.agreement import agreement
from mapcli.algorithms.slam.correlative_search import SearchWindow
from mapcli.algorithms.slam.match import Match, MatchParameters
from mapcli.algorithms.slam.motion_model import OdometryUncertainty
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.algorithms.slam.scan_points import ScanPoints, points_of, window_box
from mapcli.algorithms.slam.surfel_map import BEARING_VARIANCE
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import InformationMatrix

FARTHEST_REFINEMENT = 24.0
"""Cells that the refinement may move a point: less than `occupancy_grid.MARGIN`. Beyond, it went
astray."""


CONVERGENCE_CELLS, CONVERGENCE_TURN = 4.0, math.radians(5)
"""The basin of convergence: how far from the right pose the refinement still finds it."""


class ScanInMap:
    """A scan and the map that it is compared with.

    Attributes:
        grid: the map, which grows where the scan would not fit into it.
        points: of the scan, in the robot's frame.
        turn_step: radians between test headings.
        independent: see `Perception`.
    """

    def __init__(
        self, grid: OccupancyGrid, perception: Perception, parameters: MatchParameters
    ) -> None:
        self.grid, self.cell = grid, grid.parameters.resolution
        self.points: ScanPoints = points_of(perception, self.cell)
        self.turn_step = math.radians(parameters.step_theta_deg)
        self.independent = perception.independent
        self._refines, self._min_points = parameters.refine, parameters.min_hits

    @property
    def size(self) -> int:
        """How many points the scan has, one for each cell."""
        return len(self.points.metres)

    @property
    def has_enough_points(self) -> bool:
        """Whether the scan has points enough to be matched."""
        return self.size >= self._min_points

    def cover(self, middle: Pose2D, window: SearchWindow) -> None:
        """Make the map hold every point at every pose of a window."""
        far = window.xy + self.cell
        if not self.grid.contains_circle(middle, self.points.radius + far):
            box = window_box(self.points.metres, middle, far, window.theta + self.turn_step)
            self.grid.extend_to(*box)

    def compare(self, pose: Pose2D, information: InformationMatrix | None = None) -> Match:
        """How well the scan agrees with the map at a pose, which is covered."""
        cells = self.grid.pose_to_cells(pose)
        score, known, conflicts = agreement(self.grid, self.points.cells, cells)
        return Match(pose, score, known, known >= self._min_points, information, conflicts)

    def refine(self, near: Pose2D, predicted: Pose2D, uncertainty: OdometryUncertainty) -> Match:
        """The match at the refined pose, or at `near` where the refinement is not to be trusted.

        Args:
            near: where to start, in the basin of convergence, covered.
            predicted: the pose by odometry, with its uncertainty: the prior. It weighs more where
                only a share of the points is evidence of its own.
        """
        if not self._refines:
            return self.compare(near)
        fit = self.grid.surfels.fit(
            self.points.metres,
            near,
            predicted,
            uncertainty.along_axes(math.sqrt(self.independent)),
            BEARING_VARIANCE,
        )
        moved = near.distance(fit.pose) + abs(near.between(fit.pose).theta) * self.points.radius
        if fit.matched >= self._min_points and moved < FARTHEST_REFINEMENT * self.cell:
            return self.compare(fit.pose, fit.information_in_own_frame())
        return self.compare(near)

    def match_near(self, predicted: Pose2D, uncertainty: OdometryUncertainty) -> Match:
        """The match next to a predicted pose, or that pose where the scan says nothing."""
        if not self.has_enough_points:
            return Match(predicted, 0.0, 0, found=False)
        self.cover(predicted, SearchWindow(FARTHEST_REFINEMENT * self.cell, CONVERGENCE_TURN))
        match = self.refine(predicted, predicted, uncertainty)
        return match if match.found else replace(match, pose=predicted)

    def free_space_conflicts(self, pose: Pose2D) -> int:
        """Points that fall where the map knows free space, at a pose as it is."""
        if not self.has_enough_points:
            return 0
        self.cover(pose, SearchWindow(0.0, 0.0))
        return self.compare(pose).free_space_conflicts
