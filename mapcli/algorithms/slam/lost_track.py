"""A robot that is lost: scans that the map contradicts, one after the other.

What the map contradicts is not written into it, where it would make the next scans fit at a pose
that is wrong: the robot may be found again by the next scan, with walls that are as they were. But
when scan after scan fits nowhere, the robot is where it cannot be: it was carried, or it turned
while its wheels counted something else. Then the map begins ANEW, with a new PIECE, which hangs on
the one before by odometry alone, until loop closure joins them (`pieces`).
"""

from __future__ import annotations

import math

from mapcli.algorithms.slam.match import Match
from mapcli.algorithms.slam.motion_model import MotionModel, OdometryUncertainty
from mapcli.model.se2_uncertainty import CERTAIN, StandardDeviations

MOST_SCANS = 8
"""Scans that the map contradicts, one after the other, after which the robot is elsewhere: who
walks past the laser hides less of what it sees, or for less long."""

ANYWHERE = StandardDeviations(30.0, math.pi)
"""Of a robot that was carried: some rooms away, and no heading is less likely than another."""


class LostTrack:
    """What is known of the robot's pose without the map (stateful: `update` adds every scan).

    Attributes:
        lost_scans: since the first that the map contradicts; 0 where the map has told the pose
            since, or a scan was written into it.
        deviations: standard deviations of the pose, as they have added up since then.
    """

    def __init__(self, model: MotionModel) -> None:
        self._silent = model.uncertainty(None).deviations
        self.begin_anew()

    def begin_anew(self) -> None:
        """The map tells the pose, or a scan is written into it there."""
        self.lost_scans, self._deviations = 0, CERTAIN

    @property
    def is_elsewhere(self) -> bool:
        """Whether the robot must be where the map is not."""
        return self.lost_scans > MOST_SCANS

    @property
    def deviations(self) -> StandardDeviations:
        return ANYWHERE if self.is_elsewhere else self._deviations

    def update(self, match: Match, uncertainty: OdometryUncertainty) -> None:
        """The next scan: its match, and how far off the predicted pose may have been.

        Odometry that ends where the map contradicts it has probably failed: it counts as silent.
        """
        if match.found:
            self.begin_anew()
            return
        self._deviations = self._deviations.after(uncertainty.metres, uncertainty.deviations)
        self.lost_scans += self.lost_scans > 0 or match.is_contradicted
        if match.is_contradicted:
            self._deviations = self._deviations.after(0.0, self._silent)
