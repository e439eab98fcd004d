"""What the laser of a simulated robot can see: walls, panes of glass, people who walk about."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.ray_casting import cast, edges_near, edges_of
from mapcli.algorithms.simulation.people import Walk
from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap
from mapcli.model.pose import Pose2D
from mapcli.model.world import World

Floats = NDArray[np.float64]

Fan = tuple[float, float, int]
"""Bearing of the first beam and from one to the next, in the laser's frame; number of beams."""

GLASS_SQUARENESS = math.cos(math.radians(10))
"""Glass is a mirror: an echo comes back only from beams that hit it nearly straight on."""

PANE = 2.0
"""Metres that a pane of glass in a grid map is wide."""


def _no_edges() -> Floats:
    return np.empty((0, 2, 2))


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that a beam may hit.

    Attributes:
        walls: edges of what is solid, shape (k, 2, 2), as of `edges_of`.
        glass: the same of panes, which only beams that hit them straight on see; the others pass.
        people: their walks.
    """

    walls: Floats
    glass: Floats = field(default_factory=_no_edges)
    people: tuple[Walk, ...] = ()

    def distances(self, lasers: Sequence[Pose2D], times: Floats, fan: Fan, reach: float) -> Floats:
        """Distance along each beam to the first thing that it meets, inf where nothing is in reach.

        Args:
            lasers: where the laser is when each beam is taken, or one pose for all of them.
            times: of the poses, seconds since the start of the log.
            reach: metres.
        """
        ranges = _cast(self.walls, lasers, fan, reach, 0.0)
        if len(self.glass):
            panes = _cast(self.glass, lasers, fan, reach, GLASS_SQUARENESS)
            ranges = np.minimum(ranges, panes)
        origins, bearings = _beams(lasers, fan)
        for walk in self.people:
            ranges = np.minimum(ranges, walk.distances(origins, bearings, times))
        return np.where(ranges <= reach, ranges, np.inf)


def _beams(lasers: Sequence[Pose2D], fan: Fan) -> tuple[Floats, Floats]:
    """Where each beam begins (one place if it is that of all) and its bearing in the world."""
    origins = np.array([(laser.x, laser.y) for laser in lasers])
    headings = np.array([laser.theta for laser in lasers])
    return origins, headings + fan[0] + fan[1] * np.arange(fan[2])


def _cast(
    edges: Floats, lasers: Sequence[Pose2D], fan: Fan, reach: float, squareness: float
) -> Floats:
    if len(lasers) == 1:
        return cast(edges, lasers[0], *fan, reach, squareness)
    from mapcli.algorithms.simulation._kernels.sweep import sweep

    origins, bearings = _beams(lasers, fan)
    ranges = np.full(len(bearings), reach)
    sweep(
        edges_near(edges, origins.min(axis=0) - reach, origins.max(axis=0) + reach),
        origins, bearings, squareness, ranges,
    )  # fmt: skip
    return np.where(ranges < reach, ranges, np.inf)


def glazed(world: World | GridMap, share: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """The edges of a world of which a share is glass: those of walls, those of panes.

    What is solid is glass by whole polygons, and in a grid map by squares as wide as a pane.
    """
    if isinstance(world, World):
        drawn = rng.random(len(world.polygons)) < share
        parts = ([p for p, is_glass in zip(world.polygons, drawn, strict=True) if is_glass == kind]
                 for kind in (False, True))  # fmt: skip
        walls, panes = (edges_of(World(tuple(part))) for part in parts)
        return walls, panes
    side = max(round(PANE / world.resolution), 1)
    rows, columns = np.arange(world.rows) // side, np.arange(world.columns) // side
    glass = (rng.random((rows[-1] + 1, columns[-1] + 1)) < share)[np.ix_(rows, columns)]
    solid = world.cells >= OCCUPIED_THRESHOLD
    walls, panes = (
        edges_of(world.replaced((solid & kind).astype(np.float32))) for kind in (~glass, glass)
    )
    return walls, panes
