"""Closing the loop (Sect. 9.4): the robot comes back, and its map meets the map from before.

Submaps of the trajectory are the poses of a graph. Each new one is looked for in the maps of the
old ones that it may have come back to, as far as the uncertainty gathered along the graph allows. A
wrong loop is worse than none: a loop must fit well, must not fit elsewhere as well, and must
agree with another loop beside it, unless the graph knew already where it would be.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from mapcli.algorithms.slam.keyframes import Keyframe
from mapcli.algorithms.slam.occupancy_grid import MapParameters
from mapcli.algorithms.slam.pose_graph import Edge, GraphPath, PoseGraph
from mapcli.algorithms.slam.submap_matcher import SubmapMatch, SubmapMatcher, SubmapMatchParameters
from mapcli.algorithms.slam.submaps import Submap, covariance_between, split_into_submaps
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import (
    StandardDeviations,
    largest_position_variance,
    least_position_deviation,
)

NEWS, NEWS_SHARE = 1.0, 0.05
"""Standard deviations by which a loop contradicts a graph that has to move for it at once; the
share of loops that may wait otherwise, lest the time grows with the square of their number."""


@dataclass(frozen=True)
class LoopParameters:
    """When a place is taken for one from before.

    Attributes:
        submap_m: metres of trajectory that make one submap.
        apart_m: metres to be driven before a place can be an old one.
        near_m: metres between origins that see the same.
        deviations: the window's half-width in standard deviations of the graph.
        window_xy, window_deg: added to it; most_xy, most_deg: its limits.
        drift: how wrong all matches together may be besides, as a share of the way.
        candidates: old visits that are compared at most.
        score, overlap: what a match must reach.
        doubt: metres; a match that fits elsewhere this far off, in every direction, is no match.
        agree_xy, agree_deg, agree_share, agree_deg_per_m: how well two loops must agree.
    """

    submap_m: float = 5.0
    apart_m: float = 20.0
    near_m: float = 4.0
    deviations: float = 3.0
    window_xy: float = 0.3
    window_deg: float = 2.0
    most_xy: float = 8.0
    most_deg: float = 30.0
    drift: float = 0.005
    candidates: int = 4
    score: float = 0.5
    overlap: float = 0.4
    doubt: float = 0.5
    agree_xy: float = 0.15
    agree_deg: float = 1.0
    agree_share: float = 0.01
    agree_deg_per_m: float = 0.05
    submap: SubmapMatchParameters = field(default_factory=SubmapMatchParameters)


@dataclass(frozen=True, slots=True, eq=False)
class LoopClosureResult:
    """What became of the loops.

    Attributes:
        submaps: of the trajectory; origins: their origins' poses, moved.
        loops: between keyframes (numbers of keyframes); scores: of each.
    """

    submaps: list[Submap]
    origins: list[Pose2D]
    loops: list[Edge]
    scores: list[float]


class LoopCloser:
    """One run over a trajectory (stateful: the graph grows)."""

    def __init__(
        self, keyframes: list[Keyframe], map_: MapParameters, parameters: LoopParameters
    ) -> None:
        self.keyframes, self.parameters = keyframes, parameters
        self.submaps = split_into_submaps(keyframes, parameters.submap_m)
        self.matcher = SubmapMatcher(keyframes, map_, parameters.submap)
        self.graph = PoseGraph([keyframes[s.origin].pose for s in self.submaps])
        for k, (a, b) in enumerate(pairwise(s.origin for s in self.submaps)):
            self.graph.add(self._chained(k, a, b))
        self.metres = np.array([keyframes[s.origin].metres for s in self.submaps])
        self.pending: list[tuple[Edge, float]] = []
        self.closed: list[tuple[Edge, float]] = []
        self._untold = 0  # accepted since the graph was optimised
        self._loops_to: defaultdict[int, list[Edge]] = defaultdict(list)  # pending and closed

    def _chained(self, k: int, a: int, b: int) -> Edge:
        one, other = self.keyframes[a], self.keyframes[b]
        covariance = covariance_between(self.keyframes, a, b)
        metres = max(other.metres - one.metres, 1e-3)
        return Edge(k, k + 1, one.pose.between(other.pose), covariance, metres)

    def run(self, progress: Callable[[int], None] = lambda submap: None) -> LoopClosureResult:
        """Close all loops, in the order in which the robot came back."""
        for new in range(len(self.submaps)):
            for old, way in self.candidates(new).items():
                self.compare(old, new, way)
            self.learn(self.accept())
            progress(new)
        if self._untold:
            self.graph.optimise(is_settled=True)
        self.prune()
        loops = [edge for edge, _ in self.closed]
        return LoopClosureResult(self.submaps, self.graph.poses, loops, [s for _, s in self.closed])

    def learn(self, accepted: list[Edge]) -> None:
        """Optimise the graph, unless loops only tell what many before have told."""
        if not accepted:
            return
        self._untold += len(accepted)
        is_news = max(edge.error(self.graph.poses) for edge in accepted) >= NEWS
        if is_news or self._untold >= NEWS_SHARE * len(self.closed):
            self.graph.optimise(is_settled=not is_news)
            self._untold = 0

    def candidates(self, new: int) -> dict[int, GraphPath]:
        """Old submaps where the robot may be again: the nearest of each visit, unless a short
        way through the graph leads there, so that nothing would be learned."""
        p = self.parameters
        near = self._near(new)
        ways = self.graph.shortest_paths(new, near)
        nearest: list[int] = []
        for k, distance in near.items():
            if distance >= p.near_m + self._window(ways[k])[0]:
                continue
            if all(abs(self.metres[k] - self.metres[j]) > p.apart_m for j in nearest):
                nearest.append(k)
        far = [k for k in nearest if ways[k].metres >= p.apart_m]
        return {k: ways[k] for k in far[: p.candidates]}

    def _near(self, new: int) -> dict[int, float]:
        """Old submaps that may be candidates, with their distances, the nearest first."""
        p, here = self.parameters, self.graph.poses[new]
        old = int(np.searchsorted(self.metres, self.metres[new] - p.apart_m, side="right"))
        distances = np.hypot(*(self.graph.positions()[:old] - (here.x, here.y)).T)
        near = np.flatnonzero(distances < p.near_m + p.most_xy)
        near = near[np.argsort(distances[near], kind="stable")]
        return dict(zip(near.tolist(), distances[near].tolist(), strict=True))

    def _window(self, way: GraphPath) -> tuple[float, float]:
        """Half-widths of where a submap may be, metres and radians."""
        p, covariance = self.parameters, way.covariance
        variance = largest_position_variance(covariance)
        xy = p.deviations * math.sqrt(variance + (p.drift * way.metres) ** 2)
        turn = p.deviations * math.sqrt(float(covariance[2, 2]))
        return (
            min(p.window_xy + xy, p.most_xy),
            min(math.radians(p.window_deg) + turn, math.radians(p.most_deg)),
        )

    def compare(self, old: int, new: int, way: GraphPath) -> None:
        """Look for a submap in an old one's map; a good match waits for agreement."""
        p, poses = self.parameters, self.graph.poses
        window, predicted = self._window(way), poses[old].between(poses[new])
        a, b = self.submaps[old].origin, self.submaps[new].origin
        deviations = StandardDeviations(window[0] / p.deviations, window[1] / p.deviations)
        match = self.matcher.match(a, b, predicted, window, deviations)
        if match is not None and self._is_good(match):
            self.offer(Edge(old, new, match.pose, match.covariance), match.score)

    def _is_good(self, match: SubmapMatch) -> bool:
        p = self.parameters
        fits = match.score >= p.score and match.overlap >= p.overlap and not match.at_edge
        return fits and least_position_deviation(match.covariance) < p.doubt

    def offer(self, loop: Edge, score: float) -> None:
        """A loop that waits for another one that agrees with it."""
        self.pending.append((loop, score))
        self._loops_to[loop.to].append(loop)

    def accept(self) -> list[Edge]:
        """Take the waiting loops that agree with another one; which they were.

        Only the newest ones can tell anything that was not known before.
        """
        newest = max((edge.to for edge, _ in self.pending), default=0)
        agreed: set[Edge] = set()
        for loop in self._loops_to[newest]:
            for other in self._beside(newest):
                if self._agree(loop, other):
                    agreed |= {loop, other}
        taken = [one for one in self.pending if one[0] in agreed]
        for one in taken:
            self.graph.add(one[0])
        self.closed += taken
        self.pending = [one for one in self.pending if one[0] not in agreed]
        return [edge for edge, _ in taken]

    def _beside(self, submap: int) -> Iterator[Edge]:
        """Loops of the submaps just before."""
        p = self.parameters
        for k in range(submap - 1, -1, -1):
            if self.metres[submap] - self.metres[k] > p.apart_m + p.submap_m:
                break
            yield from self._loops_to[k]

    def _agree(self, one: Edge, other: Edge) -> bool:
        """Whether two loops beside each other say the same, going round over both of them."""
        p = self.parameters
        new = abs(self.metres[one.to] - self.metres[other.to])
        old = abs(self.metres[one.from_] - self.metres[other.from_])
        if old > 2 * p.apart_m:
            return False
        before = self._tracked(one.from_).between(self._tracked(other.from_))
        round_ = one.measured.inverse().compose(before).compose(other.measured)
        off = self._tracked(one.to).between(self._tracked(other.to)).between(round_)
        far = math.hypot(off.x, off.y) <= p.agree_xy + p.agree_share * (new + old)
        turn = math.radians(p.agree_deg + p.agree_deg_per_m * (new + old))
        return far and abs(off.theta) <= turn

    def _tracked(self, submap: int) -> Pose2D:
        return self.keyframes[self.submaps[submap].origin].pose

    def prune(self) -> None:
        """Let go of loops that the others contradict in the end."""
        wrong = [one for one in self.closed if one[0].error(self.graph.poses) > 5]
        for one in wrong:
            self.graph.remove(one[0])
            self.closed.remove(one)
        if wrong:
            self.graph.optimise()
