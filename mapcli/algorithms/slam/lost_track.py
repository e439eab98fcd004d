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
        scans: that the map contradicts, until now and in a row.
        deviations: standard deviations of the pose, as they have added up since the map told it,
            or a scan was written into the map there.
    """

    def __init__(self, model: MotionModel) -> None:
        self.scans, self.deviations = 0, CERTAIN
        self._silent = model.uncertainty(None).deviations

    @property
    def is_elsewhere(self) -> bool:
        """Whether the robot must be where the map is not."""
        return self.scans > MOST_SCANS

    def update(self, match: Match, uncertainty: OdometryUncertainty, step_s: float) -> None:
        """The next scan: its match, and how far off the predicted pose may have been.

        Odometry that ends where the map contradicts it has probably failed: it counts as silent.
        """
        self.scans = self.scans + 1 if match.is_contradicted else 0
        if match.found:
            self.deviations = CERTAIN
            return
        known = self.deviations.after(uncertainty.metres, uncertainty.deviations)
        if match.is_contradicted:
            xy, theta = known.after(0.0, self._silent)
            known = StandardDeviations(xy + CARRIED_SPEED * step_s, theta)
        self.deviations = known

    def begin_anew(self) -> None:
        """A scan was written into the map at the robot's pose, whatever that is."""
        self.scans, self.deviations = 0, CERTAIN
