"""People who walk about where a simulated robot drives."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.ray_casting import cast
from mapcli.model.pose import Pose2D

Floats = NDArray[np.float64]

WIDTH = 0.4
"""Metres: a laser sees people as discs so wide."""

ASIDE = 0.5
"""Metres from the laser to which people step aside."""

FROM_WALLS = 0.4
"""Metres from a wall at which people turn round."""

LEGS = 1.0, 6.0
"""Metres that people walk straight on, at least and at most, where there is room."""

SPEEDS = 0.6, 1.4
"""Metres per second."""

WAIT = 1.0
"""Seconds before people who face a wall turn."""


@dataclass(frozen=True, eq=False)
class Walk:
    """The way of somebody, straight and evenly from point to point.

    Attributes:
        times: shape (m,), seconds since the start of the log, ascending.
        points: shape (m, 2), metres.
    """

    times: Floats
    points: Floats

    def at(self, times: Floats) -> Floats:
        """Where the person is, shape (n, 2)."""
        return np.column_stack([np.interp(times, self.times, axis) for axis in self.points.T])

    def distances(self, origins: Floats, bearings: Floats, times: Floats) -> Floats:
        """Distance along each beam to the person, shape (n,), inf where it misses.

        Args:
            origins, times: of the beams, shape (n, 2) and (n,), or (1, 2) and (1,) for all.
            bearings: shape (n,), radians.
        """
        x, y = _aside(self.at(times) - origins).T
        along = x * np.cos(bearings) + y * np.sin(bearings)
        across = x * np.sin(bearings) - y * np.cos(bearings)
        half_chord = np.sqrt(np.maximum((WIDTH / 2) ** 2 - across**2, 0))
        return np.where((half_chord > 0) & (along > 0), along - half_chord, np.inf)


def _aside(offsets: Floats) -> Floats:
    """Offsets from the laser, of people who let the robot pass."""
    distances = np.linalg.norm(offsets, axis=1, keepdims=True)
    away = np.where(distances > 0, offsets / np.maximum(distances, 1e-9), (1.0, 0.0))
    return np.asarray(away * np.maximum(distances, ASIDE))


def walk_about(
    edges: Floats, start: tuple[float, float], seconds: float, rng: np.random.Generator
) -> Walk:
    """Somebody's walk from `start` for so many seconds: legs in any direction, none through walls.

    Args:
        edges: of everything solid, as of `edges_of`.
    """
    speed = rng.uniform(*SPEEDS)
    times, points = [0.0], [start]
    while times[-1] < seconds:
        heading, wanted = rng.uniform(-math.pi, math.pi), rng.uniform(*LEGS)
        x, y = points[-1]
        reach = wanted + FROM_WALLS
        ahead = cast(edges, Pose2D(x, y, heading), 0.0, math.tau, 1, reach)[0]
        way = min(float(ahead), reach) - FROM_WALLS
        if way >= LEGS[0]:
            times.append(times[-1] + way / speed)
            points.append((x + way * math.cos(heading), y + way * math.sin(heading)))
        else:
            times.append(times[-1] + WAIT)
            points.append((x, y))
    return Walk(np.array(times), np.array(points))
