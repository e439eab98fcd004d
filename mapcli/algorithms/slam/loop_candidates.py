"""Candidates for a loop: old submaps where the robot may be again, and how wide to search there.

How far off the pose graph may have a submap is the covariance along the shortest path through the
graph. The marginal covariance of the optimum (`gtsam.Marginals`) takes all edges into account, but
gives other deviations (0.6 to 12 times as large on the logs of the benchmarks), and takes 3 ms
for each new submap instead of 0.2.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam.correlative_search import SearchWindow
from mapcli.algorithms.slam.pose_graph import GraphPath, PoseGraph
from mapcli.model.se2_uncertainty import largest_position_variance

APART_M = 20.0
"""Metres to be driven before a place can be an old one; also, what two visits are apart at least.
Nearer, submaps see the same walls anyway, and the local map has kept them together."""

NEAR_M = 4.0
"""Metres between origins of submaps that see the same walls."""

MOST_CANDIDATES = 4
"""Old visits that are compared with a submap at most; the time for loops goes with it."""

WINDOW_SIGMAS = 3.0
"""Standard deviations of the graph that a window reaches to either side."""

CORRELATED_DRIFT = 0.005
"""Metres of error for each metre along the path, beside the covariance: errors of matches in the
same corridor are correlated, and add up faster than independent ones."""


LEAST_WINDOW = SearchWindow(0.3, math.radians(2.0))
"""What a window has beside the deviations: origins are known to the centimetre at best."""

WIDEST_TURN = math.radians(30.0)
"""Of a window; the heading is never lost so far."""


def find_candidates(
    graph: PoseGraph, metres: NDArray[np.float64], new: int, widest_xy: float
) -> dict[int, GraphPath]:
    """Old submaps where the robot may be again, and the paths from the new one to them: of each
    visit the nearest, unless a short path leads there, so that a loop would add nothing.

    Args:
        graph: a pose for each submap.
        metres: driven until each submap's origin, shape (submaps,).
        new: the submap.
        widest_xy: metres, of a window.
    """
    near = near_submaps(graph, metres, new, NEAR_M + widest_xy)
    paths = graph.shortest_paths(new, near)
    nearest: list[int] = []
    for k, distance in near.items():
        if distance >= NEAR_M + search_window(paths[k], widest_xy).xy:
            continue
        if all(abs(metres[k] - metres[j]) > APART_M for j in nearest):
            nearest.append(k)
    far = [k for k in nearest if paths[k].metres >= APART_M]
    return {k: paths[k] for k in far[:MOST_CANDIDATES]}


def near_submaps(
    graph: PoseGraph, metres: NDArray[np.float64], new: int, radius: float
) -> dict[int, float]:
    """Old submaps whose origins are nearer to the new one's than a radius, with the distances,
    metres, the nearest first."""
    here = graph.poses[new]
    old = int(np.searchsorted(metres, metres[new] - APART_M, side="right"))
    distances = np.hypot(*(graph.positions()[:old] - (here.x, here.y)).T)
    near = np.flatnonzero(distances < radius)
    near = near[np.argsort(distances[near], kind="stable")]
    return dict(zip(near.tolist(), distances[near].tolist(), strict=True))


def search_window(path: GraphPath, widest_xy: float) -> SearchWindow:
    """Where a submap may be, as seen from the other end of a path: the deviations along it, in
    the most uncertain direction."""
    variance = largest_position_variance(path.covariance)
    xy = WINDOW_SIGMAS * math.sqrt(variance + (CORRELATED_DRIFT * path.metres) ** 2)
    turn = WINDOW_SIGMAS * math.sqrt(float(path.covariance[2, 2]))
    return SearchWindow(
        min(LEAST_WINDOW.xy + xy, widest_xy), min(LEAST_WINDOW.theta + turn, WIDEST_TURN)
    )
