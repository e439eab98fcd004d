"""What scan matching is asked (`MatchParameters`), and what it answers (`Match`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

from mapcli.algorithms.similarity.measures import Similarity
from mapcli.algorithms.similarity.shared_cells import Votes
from mapcli.model.perception import STEPS, TURNS_DEG
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import InformationMatrix

if TYPE_CHECKING:
    from mapcli.algorithms.slam.book_matcher import BookSearch

Search = Literal["window", "book", "none"]

MIN_POINTS = 5
"""A scan with fewer points, or fewer on known cells, says nothing about the pose, unless it is said
how few are enough."""

MIN_OVERLAP = 0.4
"""The share of a scan's points that fall on known cells, at least, where it is believed to belong
without odometry saying so."""


@dataclass(frozen=True)
class MatchParameters:
    """How T, the test positions of Algorithm 9.2, is searched.

    Attributes:
        search: see `scan_matcher`.
        window_xy, window_theta_deg: half-widths of the window, metres and degrees, to which a few
            standard deviations of odometry are added.
        step_xy: metres between test positions, rounded to whole cells; None is one cell.
        step_theta_deg: degrees between test headings.
        similarity: how `book` compares; `window` always uses the likelihood field.
        book_steps, turns_deg: the test positions of `book`: so many cells along the map's axes, and
            so many degrees from the odometry's heading.
        odometry_prior: the most that leaving the odometry's pose costs, as a share of a perfect
            score.
        relocalise: search far around when the scan fits the map worse than those before.
        min_hits: points that a scan must have, and as many on known cells, to be matched.
        refine: go on from the best test position to the last millimetres.
    """

    search: Search = "window"
    window_xy: float = 0.1
    window_theta_deg: float = 2.0
    step_xy: float | None = None
    step_theta_deg: float = 0.5
    similarity: Similarity = "agreement"
    book_steps: tuple[float, ...] = STEPS
    turns_deg: tuple[float, ...] = TURNS_DEG
    odometry_prior: float = 0.1
    relocalise: bool = True
    refine: bool = True
    min_hits: int = MIN_POINTS


class Alternative(NamedTuple):
    """Where a robot may be whose odometry has failed.

    Attributes:
        pose: in the map, as far as odometry has moved it by now.
        evidence: how much better the scans fit there, nats.
        votes: for it and for odometry, where scans are compared as `book` does.
    """

    pose: Pose2D
    evidence: float = 0.0
    votes: Votes = Votes(0, 0)


@dataclass(frozen=True, slots=True)
class Match:
    """The best test position.

    Attributes:
        pose: of the robot in the map.
        score: mean agreement of the scan with the map on the known points, 0 to 1.
        known_points: points of the scan on cells that the map knows something about.
        found: whether the scan could say anything; otherwise the pose is the odometry's.
        information: on the pose from the map alone, in the robot's frame; None where it was not
            asked.
        free_space_conflicts: points of the scan where the map knows free space.
        alternative: another pose, far from the odometry's, that fits better, but not so much better
            that odometry must have failed.
        is_contradicted: it was not found because the map contradicts it wherever it was searched.
        search: all that `book` compared.
    """

    pose: Pose2D
    score: float
    known_points: int
    found: bool
    information: InformationMatrix | None = None
    free_space_conflicts: int = 0
    alternative: Alternative | None = None
    is_contradicted: bool = False
    search: BookSearch | None = None


@dataclass(frozen=True, slots=True)
class MatchHistory:
    """What the matches of the scans before tell.

    Attributes:
        running_score: exponential moving average of their scores.
        alternative: where the robot may be instead.
    """

    running_score: float = 1.0
    alternative: Alternative | None = None

    def moved(self, motion: Pose2D | None) -> MatchHistory:
        """The same after the robot has moved; unknown motion ends the alternative."""
        if self.alternative is None:
            return self
        if motion is None:
            return MatchHistory(self.running_score)
        moved = self.alternative.pose.compose(motion)
        return MatchHistory(self.running_score, self.alternative._replace(pose=moved))
