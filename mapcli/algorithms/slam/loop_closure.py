"""Loop closure (Sect. 9.4): the robot comes back, and its map meets the map from before.

A wrong loop is worse than none. Without a loop the map keeps the drift: it is bent, and still a
map of the place, piece by piece. With a wrong loop the optimiser bends the whole trajectory until
two different places lie on top of each other, and no later measurement brings them apart. So a
loop is ACCEPTED only when

1. it was to be expected: the old submap is within the window that the graph's uncertainty allows
   (`loop_candidates`);
2. it fits: the new submap's points agree with the old one's map, in the middle of the window and
   nowhere else as well (`LoopCloser.is_reliable`);
3. another loop next to it says the same (`LoopCloser.accept`): pairwise consistency;

and it is dropped again when all loops together contradict it (`LoopCloser.prune`; until then it
has a robust kernel in the graph, `pose_graph`), or the beams do (`loop_check`).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mapcli.algorithms.slam.correlative_search import SearchWindow
from mapcli.algorithms.slam.keyframes import Keyframe
from mapcli.algorithms.slam.known_places import KnownPlaces, PlacesOfSubmaps
from mapcli.algorithms.slam.loop_candidates import (
    APART_M,
    WINDOW_SIGMAS,
    find_candidates,
    search_window,
)
from mapcli.algorithms.slam.loop_consistency import TrackedOrigins, are_consistent
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.pieces import Pieces
from mapcli.algorithms.slam.pose_graph import Edge, GraphPath, PoseGraph
from mapcli.algorithms.slam.submap_matcher import SubmapMatch, SubmapMatcher
from mapcli.algorithms.slam.submaps import (
    SUBMAP_M,
    Submap,
    covariance_between,
    split_into_submaps,
)
from mapcli.algorithms.slam.wide_search import Found, WideSearch
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import least_position_deviation

LEAST_SCORE, LEAST_OVERLAP = 0.5, 0.4
"""Of a match: agreement of the points that the map knows something about, and their share."""

AMBIGUOUS_M = 0.5
"""Metres; a match that fits as well this far off in EVERY direction is none. In one direction it
may: a corridor fixes the pose across it."""

OPTIMISE_GATE = 1.0
"""Mahalanobis distance of a new loop's residual at which the graph is optimised at once, from the
loosest robust kernel on."""

PENDING_SHARE = 0.05
"""The share of the loops that may wait as pending factors otherwise, lest the time grows with the
square of their number."""

PRUNE_GATE = 5.0
"""Mahalanobis distance of its residual beyond which a loop is an outlier after optimisation."""


CLEARLY = 0.08
"""By which the score of a match must be better than that at any other place, when it may be
anywhere: rooms that are alike differ by up to 0.04, by noise; places that look alike in a coarse
map only by 0.12 and more."""

CLOSE_WINDOW = SearchWindow(1.0, math.radians(4.0))
"""Around what was found in a coarse map: some of its cells, and of its headings."""


@dataclass(frozen=True)
class LoopParameters:
    """When a place is taken for one from before.

    Attributes:
        widest_xy: metres: how far off the pose may be when the robot comes back; half the width
            of the widest search.
    """

    widest_xy: float = 8.0


class ScoredLoop(NamedTuple):
    """A loop between two submaps, and the score of its match, 0 to 1."""

    edge: Edge
    score: float


@dataclass(frozen=True, slots=True, eq=False)
class LoopClosureResult:
    """What became of the loops.

    Attributes:
        submaps: of the trajectory.
        origins: the poses of their origins, loops closed.
        loops: that were accepted, between submaps (their numbers); scores: of each.
        unjoined: the first submaps of pieces that no loop has joined with the first piece.
    """

    submaps: list[Submap]
    origins: list[Pose2D]
    loops: list[Edge]
    scores: list[float]
    unjoined: list[int]


class LoopCloser:
    """One run over a trajectory (stateful: the graph grows).

    Attributes:
        submaps: of the trajectory; metres: driven until each one's origin; tracked: these,
            and the poses and pieces of the origins, as tracked.
        graph: a pose for each submap; edges along the trajectory, and loops.
        unconfirmed: loops that wait for another one that is consistent with them.
        accepted: loops in the graph.
        said: loops that a person told, with what was typed; not_found: what was, and is not so.
    """

    def __init__(
        self,
        keyframes: list[Keyframe],
        map_: MapParameters,
        parameters: LoopParameters,
        places: KnownPlaces | None = None,
    ) -> None:
        self.keyframes, self.parameters = keyframes, parameters
        self.submaps = split_into_submaps(keyframes)
        self.matcher = SubmapMatcher(keyframes, map_)
        poses = [keyframes[s.origin].pose for s in self.submaps]
        self.graph = PoseGraph(poses)
        for k, (a, b) in enumerate(pairwise(s.origin for s in self.submaps)):
            self.graph.add(self._tracked_edge(k, a, b))
        self.metres = np.array([keyframes[s.origin].metres for s in self.submaps])
        self.pieces = Pieces(keyframes, self.submaps)
        self.tracked = TrackedOrigins(poses, self.metres, self.pieces.of)
        self.unconfirmed: list[ScoredLoop] = []
        self.accepted: list[ScoredLoop] = []
        origins = [one.origin for one in self.submaps]
        self._wide_search = WideSearch(self.graph, self.matcher, origins, map_)
        self._places = PlacesOfSubmaps(places or KnownPlaces(), keyframes, self.submaps)
        self.said: dict[Edge, str] = {}
        self.not_found: list[str] = []
        self._pending_factors = 0  # accepted since the graph was optimised
        self._loops_to: defaultdict[int, list[Edge]] = defaultdict(list)  # of both lists

    def _tracked_edge(self, k: int, a: int, b: int) -> Edge:
        """From submap k to the next one, with origins a and b, as tracked."""
        one, other = self.keyframes[a], self.keyframes[b]
        covariance = covariance_between(self.keyframes, a, b)
        metres = max(other.metres - one.metres, 1e-3)
        return Edge(k, k + 1, one.pose.between(other.pose), covariance, metres)

    def run(self, progress: Callable[[int], None] = lambda submap: None) -> LoopClosureResult:
        """Close all loops, in the order in which the robot came back."""
        for new in range(len(self.submaps)):
            for old, path in self.candidates(new).items():
                if self.pieces.are_joined(old, new):
                    self.compare(old, new, path)
            self.compare_widely(new)
            self.update_graph([*self.accept_known(new), *self.accept()])
            progress(new)
        if self._pending_factors:
            self.graph.optimise(is_near_optimum=True)
        self.prune()
        return self.result()

    def result(self) -> LoopClosureResult:
        """What the loops that are accepted by now make."""
        loops, scores = [one.edge for one in self.accepted], [one.score for one in self.accepted]
        unjoined = self.pieces.unjoined()
        return LoopClosureResult(self.submaps, self.graph.poses, loops, scores, unjoined)

    def wrong_lines(self) -> list[str]:
        """What a person told that is not so: the place was not found, or contradicts the rest."""
        kept = {one.edge for one in self.accepted}
        return [*self.not_found, *(line for edge, line in self.said.items() if edge not in kept)]

    def candidates(self, new: int) -> dict[int, GraphPath]:
        """Old submaps where the robot may be again, and the paths there."""
        return find_candidates(self.graph, self.metres, new, self.parameters.widest_xy)

    def compare(self, old: int, new: int, path: GraphPath) -> None:
        """Look for a submap in an old one's map, where the graph has it."""
        window = search_window(path, self.parameters.widest_xy)
        predicted = self.graph.poses[old].between(self.graph.poses[new])
        loop = self._match(old, new, predicted, window)
        if loop is not None:
            self.propose(loop)

    def compare_widely(self, new: int) -> None:
        """Look for a submap among those of pieces that its own is not joined with."""
        for group in self.pieces.others(new):
            others = self.pieces.members(group, new)
            if self._wide_search.is_due(new, others, self.pieces.of[new]):
                self._propose_clear(new, self._wide_search.find(new, others))

    def accept_known(self, new: int) -> list[Edge]:
        """Loops that a person told, if they are there: they need no other one that agrees."""
        taken = []
        for one in self._places.sought(new):
            found = [self._match(one.old, new, pose, one.window) for pose in one.poses]
            loop = max(filter(None, found), key=lambda loop: loop.score, default=None)
            if loop is None:
                self.not_found.append(one.line)
                continue
            loop = loop._replace(edge=replace(loop.edge, is_certain=True))
            self.said[loop.edge] = one.line
            self._take(loop)
            taken.append(loop.edge)
        return taken

    def _take(self, loop: ScoredLoop) -> None:
        """A loop comes into the graph."""
        self._join(loop.edge)
        self.graph.add(loop.edge)
        self.accepted.append(loop)

    def _propose_clear(self, new: int, places: list[list[Found]]) -> None:
        """A submap that fits clearly best at one of these places becomes a loop that waits for
        another one; one that fits at two of them as well may be at either."""
        loops = []
        for place in places:
            found = (self._match(one.old, new, one.pose, CLOSE_WINDOW) for one in place)
            loops += sorted(filter(None, found), key=lambda loop: -loop.score)[:1]
        loops.sort(key=lambda loop: -loop.score)
        if loops and all(loops[0].score - one.score >= CLEARLY for one in loops[1:]):
            self.propose(loops[0])

    def _match(
        self, old: int, new: int, predicted: Pose2D, window: SearchWindow
    ) -> ScoredLoop | None:
        """Look for a submap in an old one's map; None if there is no reliable match, or a person
        knows better."""
        if self._places.are_apart(old, new):
            return None
        a, b = self.submaps[old].origin, self.submaps[new].origin
        match = self.matcher.match(a, b, predicted, window, window.deviations(WINDOW_SIGMAS))
        if match is None or not self.is_reliable(match):
            return None
        return ScoredLoop(Edge(old, new, match.pose, match.covariance), match.score)

    def is_reliable(self, match: SubmapMatch) -> bool:
        """Whether a match fits well, on enough ground, and not elsewhere as well."""
        fits = match.score >= LEAST_SCORE and match.overlap >= LEAST_OVERLAP and not match.at_edge
        return fits and least_position_deviation(match.covariance) < AMBIGUOUS_M

    def propose(self, loop: ScoredLoop) -> None:
        """A loop that waits for another one that is consistent with it."""
        self.unconfirmed.append(loop)
        self._loops_to[loop.edge.to].append(loop.edge)

    def accept(self) -> list[Edge]:
        """HERE A LOOP IS ACCEPTED: when another loop, of a submap shortly before, is consistent
        with it. Both go into the graph; returns which they were.

        Two wrong matches seldom are wrong by the same motion, while right ones always agree: this
        is the pairwise consistency of Olson (2009, recognizing places by local matches) and
        Mangelson et al. (2018, pairwise consistent measurement sets). A set as large as possible
        need not be searched: one neighbour that agrees is enough, as loops to the same old place
        come one after the other.

        Only loops of the newest submap can confirm anything that was not confirmed before.
        """
        newest = max((loop.edge.to for loop in self.unconfirmed), default=0)
        confirmed: set[Edge] = set()
        for loop in self._loops_to[newest]:
            for other in self._loops_before(newest):
                if self.are_consistent(loop, other):
                    confirmed |= {loop, other}
        taken = [one for one in self.unconfirmed if one.edge in confirmed]
        for one in taken:
            self._take(one)
        self.unconfirmed = [one for one in self.unconfirmed if one.edge not in confirmed]
        return [one.edge for one in taken]

    def _join(self, loop: Edge) -> None:
        """A loop between two pieces moves one of them to where it says, with all that hangs on it:
        from elsewhere the optimiser would take the loop for an outlier."""
        old, new = loop.from_, loop.to
        if self.pieces.are_joined(old, new):
            return
        poses, moved = self.graph.poses, self.pieces.with_all_that_hangs_on(new)
        motion = poses[old].compose(loop.measured).compose(poses[new].inverse())
        if 0 in moved:  # the map's first pose stays where it is
            moved, motion = self.pieces.with_all_that_hangs_on(old), motion.inverse()
        self.graph.move(moved, motion)
        self.pieces.join(old, new)

    def _loops_before(self, submap: int) -> Iterator[Edge]:
        """Loops of the submaps just before one."""
        for k in range(submap - 1, -1, -1):
            if self.metres[submap] - self.metres[k] > APART_M + SUBMAP_M:
                break
            yield from self._loops_to[k]

    def are_consistent(self, one: Edge, other: Edge) -> bool:
        """Whether two loops say the same."""
        return are_consistent(one, other, self.tracked)

    def update_graph(self, accepted: list[Edge]) -> None:
        """Optimise the graph, unless loops only say what many before have said."""
        if not accepted:
            return
        self._pending_factors += len(accepted)
        contradicts = max(edge.error(self.graph.poses) for edge in accepted) >= OPTIMISE_GATE
        if contradicts or self._pending_factors >= PENDING_SHARE * len(self.accepted):
            self.graph.optimise(is_near_optimum=not contradicts)
            self._pending_factors = 0

    def keep(self, loops: list[ScoredLoop], graph: PoseGraph) -> None:
        """Drop all loops but these, of a graph with them."""
        self.accepted, self.graph = loops, graph
        self.pieces = Pieces(self.keyframes, self.submaps)
        for one in loops:
            self.pieces.join(one.edge.from_, one.edge.to)

    def prune(self) -> None:
        """Outlier rejection after optimisation: drop loops whose residual exceeds `PRUNE_GATE`."""
        poses, gate = self.graph.poses, PRUNE_GATE
        wrong = [
            one for one in self.accepted
            if not one.edge.is_certain and one.edge.error(poses) > gate
        ]  # fmt: skip
        for one in wrong:
            self.graph.remove(one.edge)
            self.accepted.remove(one)
        if wrong:
            self.graph.optimise()
