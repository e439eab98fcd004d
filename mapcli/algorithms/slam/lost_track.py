"""A robot that is lost: scans that the map contradicts, one after the other.

What the map contradicts is not written into it, where it would make the next scans fit at a pose
that is wrong: the robot may be found again by the next scan, with walls that are as they were. But
when scan after scan fits nowhere, the robot is where it cannot be: it was carried, or it turned
while its wheels counted something else. Then the map begins ANEW, with a new PIECE, which hangs on
the one before by odometry alone, until loop closure joins them (`pieces`).
"""

from __future__ import annotations

from mapcli.algorithms.slam.match import Match
from mapcli.algorithms.slam.motion_model import MotionModel, OdometryUncertainty
from mapcli.model.se2_uncertainty import CERTAIN, StandardDeviations

MOST_SCANS = 8
"""Scans that the map contradicts, one after the other, after which the robot is elsewhere: who
walks past the laser hides less of what it sees, or for less long."""

CARRIED_SPEED = 1.0
"""Metres per second: how fast a robot that is lost may be moved by other than its wheels."""


class LostTrack:
    """What is known of the robot's pose without the map (stateful: `update` adds every scan).

    Attributes:
        scans: that the map contradicts, since it told the pose last.
        deviations: standard deviations of the pose, as they have added up since the map told it,
            or a scan was written into the map there.
    """

    def __init__(self, model: MotionModel) -> None:
        self._silent = model.uncertainty(None).deviations
        self.begin_anew()

    def begin_anew(self) -> None:
        """The map tells the pose, or a scan is written into it there."""
        self.scans, self.deviations, self._lost_s = 0, CERTAIN, 0.0

    @property
    def is_elsewhere(self) -> bool:
        """Whether the robot must be where the map is not."""
        return self.scans > MOST_SCANS

    @property
    def anywhere(self) -> StandardDeviations:
        """`deviations` of a robot that may have been carried while it was lost."""
        xy, theta = self.deviations
        return StandardDeviations(xy + CARRIED_SPEED * self._lost_s, theta)

    def update(self, match: Match, uncertainty: OdometryUncertainty, step_s: float) -> None:
        """The next scan: its match, and how far off the predicted pose may have been.

        Odometry that ends where the map contradicts it has probably failed: it counts as silent.
        """
        if match.found:
            self.begin_anew()
            return
        self.deviations = self.deviations.after(uncertainty.metres, uncertainty.deviations)
        if match.is_contradicted:
            self.scans += 1
            self._lost_s += step_s
            self.deviations = self.deviations.after(0.0, self._silent)
