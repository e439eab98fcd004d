"""The graph of reference [3] of the chapter: poses, and what is known of one seen from another."""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import Covariance, mahalanobis_distance, moved_covariance

DOUBTS = 10.0, 1.0
"""Standard deviations at which a loop's say has halved, from one optimisation to the next."""


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """Pose `to` as seen from pose `from_`.

    Attributes:
        covariance: of the measured pose, shape (3, 3), in its own frame.
        metres: how far the robot drove between them; 0 for a loop.
    """

    from_: int
    to: int
    measured: Pose2D
    covariance: Covariance
    metres: float = 0.0

    @property
    def is_loop(self) -> bool:
        return self.metres == 0

    def error(self, poses: list[Pose2D]) -> float:
        """Mahalanobis distance, in standard deviations, of what is measured from the poses."""
        off = self.measured.between(poses[self.from_].between(poses[self.to]))
        return mahalanobis_distance(off, self.covariance)


@dataclass(eq=False)
class GraphPath:
    """The shortest way through the graph from one pose to another (stateful: the uncertainty on
    it is gathered when it is asked for, which it seldom is).

    Attributes:
        metres: driven along it.
        pose: where it ends.
        before, edge: all but its last step, and that; None where it begins.
    """

    metres: float
    pose: Pose2D
    before: GraphPath | None = None
    edge: Edge | None = None
    is_backwards: bool = False
    _gathered: Covariance | None = None

    @property
    def covariance(self) -> Covariance:
        """Of the last pose as seen from the first, shape (3, 3), in the last one's frame."""
        steps: list[GraphPath] = []
        gathered, way = self._gathered, self
        while gathered is None:
            steps.append(way)
            if way.before is None:
                gathered = np.zeros((3, 3))
            else:
                way = way.before
                gathered = way._gathered
        for step in reversed(steps):
            gathered = step._gathered = step._after(gathered)
        return gathered

    def _after(self, gathered: Covariance) -> Covariance:
        """The uncertainty after the last step, from that before it."""
        if self.before is None or self.edge is None:
            return gathered
        seen = self.pose.between(self.before.pose)
        # An edge's uncertainty is known where it ends; when it is gone backwards, it is moved.
        own = self.edge.covariance
        step = moved_covariance(own, seen) if self.is_backwards else own
        return moved_covariance(gathered, seen) + step


class PoseGraph:
    """Poses and edges (stateful: `add` and `optimise` change it).

    Attributes:
        poses: as far as known now; the first stays where it is.
    """

    LOOP_METRES = 1.0
    """What a loop counts on a way through the graph."""

    def __init__(self, poses: list[Pose2D]) -> None:
        self.poses = list(poses)
        self._positions: NDArray[np.float64] | None = None
        self.edges: list[Edge] = []
        self._at: list[list[Edge]] = [[] for _ in poses]
        self._factors: dict[float, Any] = {}  # GTSAM's graphs, for each doubt, as far as built

    def add(self, edge: Edge) -> None:
        self.edges.append(edge)
        self._at[edge.from_].append(edge)
        self._at[edge.to].append(edge)

    def remove(self, edge: Edge) -> None:
        self.edges.remove(edge)
        self._factors.clear()
        self._at[edge.from_].remove(edge)
        self._at[edge.to].remove(edge)

    def positions(self) -> NDArray[np.float64]:
        """(x, y) of the poses, shape (n, 2)."""
        if self._positions is None:
            self._positions = np.array([(pose.x, pose.y) for pose in self.poses])
        return self._positions

    def shortest_paths(
        self, start: int, wanted: Iterable[int] | None = None
    ) -> dict[int, GraphPath]:
        """The shortest ways to the wanted poses and some others, or to all (Dijkstra)."""
        ways: dict[int, GraphPath] = {}
        missing = set(range(len(self.poses)) if wanted is None else wanted)
        order = count()  # ties are decided by what was found first
        waiting = [(0.0, next(order), start, GraphPath(0.0, self.poses[start]))]
        while missing and waiting:
            metres, _, node, way = heapq.heappop(waiting)
            if node in ways:
                continue
            ways[node] = way
            missing.discard(node)
            for edge in self._at[node]:
                backwards = edge.to == node
                other = edge.from_ if backwards else edge.to
                if other not in ways:
                    length = metres + (edge.metres or self.LOOP_METRES)
                    longer = GraphPath(length, self.poses[other], way, edge, backwards)
                    heapq.heappush(waiting, (length, next(order), other, longer))
        return ways

    def optimise(self, *, is_settled: bool = False) -> None:
        """Move the poses to where all edges together are satisfied best (Levenberg-Marquardt,
        by GTSAM); a loop that contradicts the others has less say (Cauchy).

        Contradiction is judged ever more strictly, as before the first step even right loops
        contradict the drift that they are there to undo (graduated non-convexity); strictly at
        once where the graph is settled, so that no edge contradicts it much.
        """
        import gtsam  # slow to import, and most short logs have no loops

        values = gtsam.Values()
        for number, pose in enumerate(self.poses):
            values.insert(number, gtsam.Pose2(pose.x, pose.y, pose.theta))
        for doubt in DOUBTS[-1:] if is_settled else DOUBTS:
            values = gtsam.LevenbergMarquardtOptimizer(self._built(doubt), values).optimize()
        found = [values.atPose2(number) for number in range(len(self.poses))]
        self.poses = [Pose2D(pose.x(), pose.y(), pose.theta()) for pose in found]
        self._positions = None

    def _built(self, doubt: float) -> Any:
        """The edges as GTSAM wants them, and that the first pose stays where it is; what was
        built before is added to."""
        import gtsam

        noise, first = gtsam.noiseModel, self.poses[0]
        if doubt not in self._factors:
            self._factors[doubt] = gtsam.NonlinearFactorGraph()
            here = gtsam.Pose2(first.x, first.y, first.theta)
            still = gtsam.PriorFactorPose2(0, here, noise.Constrained.All(3))
            self._factors[doubt].add(still)
        factors, robust = self._factors[doubt], noise.mEstimator.Cauchy.Create(doubt)
        for edge in self.edges[factors.size() - 1 :]:
            gaussian = noise.Gaussian.Covariance(edge.covariance)
            model = noise.Robust.Create(robust, gaussian) if edge.is_loop else gaussian
            m = edge.measured
            between = gtsam.Pose2(m.x, m.y, m.theta)
            factors.add(gtsam.BetweenFactorPose2(edge.from_, edge.to, between, model))
        return factors
