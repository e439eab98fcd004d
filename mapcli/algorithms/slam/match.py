"""What a search for the best test position is asked, and what it answers (see `matching`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.measures import Similarity
from mapcli.model.pose import Pose2D

Search = Literal["window", "book", "none"]


@dataclass(frozen=True)
class MatchParameters:
    """How T is searched.

    Attributes:
        search: see `matching`.
        window_xy, window_theta_deg: half-widths of the window, to which the reach of the
            odometry's error is added.
        step_xy: metres between test positions, rounded to whole cells; None is one cell.
        step_theta_deg: degrees between test headings.
        similarity: how `book` compares; `window` always uses the likelihood field.
        prior: the most that leaving the odometry's pose costs, as a share of a perfect score.
        prior_knee: squared standard deviations that cost half of it.
        trusted: standard deviations within which the pose next to the odometry's is taken
            without a search, if the scan fits there as usual.
        indifferent: the pose next to the odometry's is taken when its agreement is at most this
            much less than the best one's.
        refine: go on from the best test position to the last millimetres.
        fewest: a scan of fewer points says nothing; `usual`: a scan of fewer says less than it
            seems to, so the prior weighs as if it had that many.
        lost_below: the share of the usual agreement below which odometry is suspected; then
        lost_xy, lost_xy_per_m, lost_theta_deg: a window of this half-width is searched, and
            believed when the agreement there is usual again, better by `lost_gain_at_once`, or a
            second time by `lost_gain` and at most `lost_leap` metres away, and the scan overlaps
            the map by `lost_overlap`.
        odd_below: the share of the usual agreement below which the map has nothing like the scan,
            which then says nothing.
    """

    search: Search = "window"
    window_xy: float = 0.1
    window_theta_deg: float = 2.0
    step_xy: float | None = None
    step_theta_deg: float = 0.5
    similarity: Similarity = "product"
    prior: float = 0.1
    prior_knee: float = 9.0
    trusted: float = 2.0
    indifferent: float = 0.03
    refine: bool = True
    fewest: int = 5
    usual: int = 40
    lost_below: float = 0.9
    lost_gain: float = 0.1
    lost_gain_at_once: float = 0.2
    lost_leap: float = 1.0
    lost_overlap: float = 0.4
    lost_xy: float = 0.5
    lost_xy_per_m: float = 2.2
    lost_theta_deg: float = 45.0
    odd_below: float = 0.6


@dataclass(frozen=True, slots=True)
class Match:
    """The best test position.

    Attributes:
        pose: world pose of the robot.
        score: agreement of the scan with the map where both know something, 0 to 1.
        known_points: points of the scan that fall there.
        found: whether the scan could say anything; otherwise the pose is the odometry's.
        information: shape (3, 3), how well the map alone fixes the pose, in the robot's frame:
            the inverse of a covariance of metres and radians; None where it was not asked.
        free_space_conflicts: points of the scan where the map knows that there is no wall.
        doubtful: another pose, far from the odometry's, agrees clearly better with the map.
    """

    pose: Pose2D
    score: float
    known_points: int
    found: bool
    information: NDArray[np.float64] | None = None
    free_space_conflicts: int = 0
    doubtful: bool = False


@dataclass(frozen=True, slots=True)
class MatchHistory:
    """What the scans before tell.

    Attributes:
        score: the agreement that is usual in this log.
        doubted: the last scan's match was doubtful.
    """

    score: float = 1.0
    doubted: bool = False
