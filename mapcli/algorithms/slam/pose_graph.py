"""The pose graph (Grisetti et al. 2010, reference [3] of the chapter): poses, and measurements
between them; optimised by GTSAM, with Levenberg-Marquardt and Cauchy's robust kernel on loops."""

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

KERNEL_SCALES = 10.0, 1.0
"""Standard deviations at which the robust weight of a loop has halved (Cauchy's kernel), from one
optimisation to the next. Before the first one even right loops contradict the drift that they are
there to undo, so contradiction is judged ever more strictly (graduated non-convexity)."""

LOOP_METRES = 1.0
"""The length of a loop on a path through the graph: as if the robot had driven so far."""


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A measurement: pose `to` as seen from pose `from_`.

    Attributes:
        covariance: of the measured pose, in its own frame.
        metres: how far the robot drove between them; 0 for a loop.
        is_certain: a loop that is no outlier, whatever the others say.
    """

    from_: int
    to: int
    measured: Pose2D
    covariance: Covariance
    metres: float = 0.0
    is_certain: bool = False

    @property
    def is_loop(self) -> bool:
        return self.metres == 0

    def error(self, poses: list[Pose2D]) -> float:
        """Mahalanobis distance of what is measured from what the poses are."""
        off = self.measured.between(poses[self.from_].between(poses[self.to]))
        return mahalanobis_distance(off, self.covariance)


@dataclass(eq=False)
class GraphPath:
    """The shortest path through the graph from one pose to another (stateful: the covariance along
    it is added up when it is asked for, which it seldom is).

    Attributes:
        metres: driven along it.
        pose: where it ends.
        before, edge: all but its last step, and that step; None where it begins.
        is_backwards: the last step goes from the edge's `to` to its `from_`.
    """

    metres: float
    pose: Pose2D
    before: GraphPath | None = None
    edge: Edge | None = None
    is_backwards: bool = False
    _covariance: Covariance | None = None

    @property
    def covariance(self) -> Covariance:
        """Of the last pose as seen from the first, in the last one's frame."""
        steps: list[GraphPath] = []
        covariance, path = self._covariance, self
        while covariance is None:
            steps.append(path)
            if path.before is None:
                covariance = np.zeros((3, 3))
            else:
                path = path.before
                covariance = path._covariance
        for step in reversed(steps):
            covariance = step._covariance = step._after(covariance)
        return covariance

    def _after(self, covariance: Covariance) -> Covariance:
        """The covariance after the last step, from that before it."""
        if self.before is None or self.edge is None:
            return covariance
        seen = self.pose.between(self.before.pose)
        # An edge's covariance is known where it ends; when it is gone backwards, it is moved.
        own = self.edge.covariance
        step = moved_covariance(own, seen) if self.is_backwards else own
        return moved_covariance(covariance, seen) + step


class PoseGraph:
    """Poses and edges (stateful: `add`, `remove` and `optimise` change it).

    Attributes:
        poses: in the map, as far as known now; the first stays where it is.
        edges: in the order in which they were added.
    """

    def __init__(self, poses: list[Pose2D]) -> None:
        self.poses = list(poses)
        self._positions: NDArray[np.float64] | None = None
        self.edges: list[Edge] = []
        self._edges_at: list[list[Edge]] = [[] for _ in poses]
        self._factors: dict[float, Any] = {}  # GTSAM's graph for each kernel scale, as far as built

    def add(self, edge: Edge) -> None:
        if edge.is_certain:
            self._factors.clear()  # tracking is doubted from now on
        self.edges.append(edge)
        self._edges_at[edge.from_].append(edge)
        self._edges_at[edge.to].append(edge)

    def with_loops(self, loops: set[Edge]) -> PoseGraph:
        """The same graph with some of its loops only, optimised."""
        graph = PoseGraph(self.poses)
        for edge in self.edges:
            if not edge.is_loop or edge in loops:
                graph.add(edge)
        graph.optimise()
        return graph

    def remove(self, edge: Edge) -> None:
        self.edges.remove(edge)
        self._factors.clear()
        self._edges_at[edge.from_].remove(edge)
        self._edges_at[edge.to].remove(edge)

    def move(self, numbers: Iterable[int], motion: Pose2D) -> None:
        """Move some poses together, by a motion in the map."""
        for number in numbers:
            self.poses[number] = motion.compose(self.poses[number])
        self._positions = None

    def positions(self) -> NDArray[np.float64]:
        """(x, y) of the poses, shape (n, 2)."""
        if self._positions is None:
            self._positions = np.array([(pose.x, pose.y) for pose in self.poses])
        return self._positions

    def shortest_paths(
        self, start: int, wanted: Iterable[int] | None = None
    ) -> dict[int, GraphPath]:
        """The shortest paths from `start` to the wanted poses and some others, or to all
        (Dijkstra); of paths of equal length, the one that was found first.

        `scipy.sparse.csgraph` takes six times as long on graphs that grow and stop early (intel:
        32 for 5 ms), and decides ties otherwise (46 of 1,389 paths), with other covariances.
        """
        paths: dict[int, GraphPath] = {}
        missing = set(range(len(self.poses)) if wanted is None else wanted)
        order = count()  # ties are decided by what was found first
        waiting = [(0.0, next(order), start, GraphPath(0.0, self.poses[start]))]
        while missing and waiting:
            metres, _, node, path = heapq.heappop(waiting)
            if node in paths:
                continue
            paths[node] = path
            missing.discard(node)
            for edge in self._edges_at[node]:
                backwards = edge.to == node
                other = edge.from_ if backwards else edge.to
                if other not in paths:
                    length = metres + (edge.metres or LOOP_METRES)
                    longer = GraphPath(length, self.poses[other], path, edge, backwards)
                    heapq.heappush(waiting, (length, next(order), other, longer))
        return paths

    def optimise(self, *, is_near_optimum: bool = False) -> None:
        """Move the poses to where all edges together are satisfied best (Levenberg-Marquardt, by
        GTSAM); a loop that contradicts the others has less weight, see `KERNEL_SCALES`.

        Args:
            is_near_optimum: no edge contradicts the poses much as they are, so contradiction is
                judged strictly at once.
        """
        import gtsam  # slow to import, and most short logs have no loops

        values = gtsam.Values()
        for number, pose in enumerate(self.poses):
            values.insert(number, gtsam.Pose2(pose.x, pose.y, pose.theta))
        for scale in KERNEL_SCALES[-1:] if is_near_optimum else KERNEL_SCALES:
            factors = self._factor_graph(scale)
            values = gtsam.LevenbergMarquardtOptimizer(factors, values).optimize()
        found = [values.atPose2(number) for number in range(len(self.poses))]
        self.poses = [Pose2D(pose.x(), pose.y(), pose.theta()) for pose in found]
        self._positions = None

    def _factor_graph(self, scale: float) -> Any:
        """GTSAM's graph: that the first pose stays where it is, and a factor for each edge; what
        was built before is added to.

        Where a loop is certain and tracking leads elsewhere, tracking was lost somewhere between:
        with a robust kernel its edges leave the whole error to one of them.
        """
        import gtsam

        noise, first = gtsam.noiseModel, self.poses[0]
        if scale not in self._factors:
            self._factors[scale] = gtsam.NonlinearFactorGraph()
            here = gtsam.Pose2(first.x, first.y, first.theta)
            still = gtsam.PriorFactorPose2(0, here, noise.Constrained.All(3))
            self._factors[scale].add(still)
        factors, robust = self._factors[scale], noise.mEstimator.Cauchy.Create(scale)
        is_torn = any(edge.is_certain for edge in self.edges)
        for edge in self.edges[factors.size() - 1 :]:
            gaussian = noise.Gaussian.Covariance(edge.covariance)
            is_doubted = is_torn if not edge.is_loop else not edge.is_certain
            model = noise.Robust.Create(robust, gaussian) if is_doubted else gaussian
            m = edge.measured
            between = gtsam.Pose2(m.x, m.y, m.theta)
            factors.add(gtsam.BetweenFactorPose2(edge.from_, edge.to, between, model))
        return factors
